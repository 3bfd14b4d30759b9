"""Searches with margins that grow until a plan leaves the water as rarely as its settings allow."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any

from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import Candidate
from db.query.mission.plans import PlanRecord
from server.plan.chance import MOST_SEARCHES, chance_of, grown_m, short_m, too_likely
from server.plan.view import DryRunView


@dataclass(frozen=True, slots=True)
class Tried:
    """A trajectory that was found, kept and flown ahead."""

    best: Candidate
    found: Mapping[str, Any]
    """What is known of the search."""
    kept: PlanRecord
    dry_run: DryRunView | None
    """None where none was wanted, and it is a draft already."""


async def safest(
    first: Tried, config: PlannerConfig, search: Callable[[float], Awaitable[Tried | None]]
) -> tuple[Tried, Tried]:
    """Search again with more margin while a plan is too likely to leave the water.

    Args:
        first: What was found with the margin of the settings.
        config: The settings.
        search: Searches with so many metres more; None if that found nothing.

    Returns:
        The safest, and the last one that was kept.
    """
    tried, added_m = [first], 0.0
    while len(tried) < MOST_SEARCHES:
        last = tried[-1].dry_run
        if short_m(last) == 0.0 or not too_likely(last, config):
            break
        added_m = grown_m(added_m, last)
        again = await search(added_m)
        if again is None:
            break
        tried.append(again)
    return min(tried, key=_chance), tried[-1]


def _chance(one: Tried) -> float:
    chance = chance_of(one.dry_run)
    return 1.0 if chance is None else chance
