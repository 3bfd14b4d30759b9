"""A suggestion as it is kept: the data of its event, which a restarted station reads again."""

from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any

from pydantic import TypeAdapter

from server.schedule.replan.present import Present
from server.schedule.replan.problem import Judged
from server.schedule.replan.view import Surfacing

SUGGESTED = "plan.suggested"
"""Kind of the event: a search came to a verdict, whichever."""


@dataclass(frozen=True, slots=True)
class Told:
    """What a search came to, and what from."""

    verdict: str
    """``replace`` or ``keep``."""
    text: str
    basis: str
    measure: str
    instead_of: str
    flown: str
    """Plan that the robot flew then."""
    leg: int
    """Leg of that at which another would begin."""
    surfacing: Surfacing
    begins_ne_m: tuple[float, float]
    gain: float | None
    keep: Judged
    new: Judged | None
    samples: int
    plan: str | None
    judged_at: datetime
    fix_at: datetime | None = None
    fix_std_m: float | None = None
    newest_sample_at: datetime | None = None
    until: datetime | None = None

    def document(self) -> dict[str, Any]:
        """Return it as JSON."""
        return _ADAPTER.dump_python(self, mode="json")


_ADAPTER = TypeAdapter(Told)


def told_of(document: dict[str, Any]) -> Told:
    """Return what was kept."""
    return _ADAPTER.validate_python(document)


def inputs_of(present: Present, problem_seed: int, search_s: float) -> dict[str, Any]:
    """Return what the search was given beside the samples, for the plan's document."""
    return {
        "instead_of": present.plan.id,
        "surfacing": present.surfacing,
        "begins_ne_m": list(present.begins_ne_m),
        "present": [asdict(leg) for leg in present.rest],
        "seed": problem_seed,
        "search_s": search_s,
    }
