"""The chance constraint of plans: how likely a robot may leave the water, and margins that grow.

A dry run's flights tell how likely a plan leads out of the water or into a keep-out. Where that is
more than the settings allow, the planner searches again with a margin that is larger by as much as
the flights fell short.
"""

from autonomy.planner.config import PlannerConfig
from autonomy.site import Box, Site
from robot_link.dry_run import Safety
from server.plan.view import DryRunView

MOST_SEARCHES = 4
"""Searches for one plan, the first included."""
_GROWS_M = 1.1
"""A margin grows by so many times what the flights fell short: another plan scatters otherwise."""
_LEAST_SHARE = 0.2
"""Part of the domain's shorter side that is left of it."""
NO_LIMIT = 1.0


def chance_of(found: DryRunView | None) -> float | None:
    """Return the chance to leave the water or enter a keep-out; None where nobody knows."""
    if found is None or found.safety is None:
        return None
    safety = found.safety
    return Safety(safety.flights, safety.out, (), safety.short_m).chance


def too_likely(found: DryRunView | None, config: PlannerConfig) -> str:
    """Return a sentence where a plan may leave the water more likely than it may, else ""."""
    limit = config.adaptive.greatest_chance
    if limit >= NO_LIMIT:
        return ""
    chance = chance_of(found)
    if found is None or found.safety is None or chance is None:
        return (
            f"How likely it leaves the water or enters a keep-out is not known, for it was not "
            f"rehearsed; at most {100.0 * limit:.2g} % are allowed."
        )
    if chance <= limit:
        return ""
    safety = found.safety
    text = (
        f"It leaves the water or enters a keep-out with a chance of {100.0 * chance:.2g} % "
        f"({safety.out} of {safety.flights} flights); at most {100.0 * limit:.2g} % are allowed."
    )
    if not safety.legs:
        return f"{text} Rehearse it once more: so few flights cannot tell that little."
    worst = max(safety.legs, key=lambda one: one.flights)
    deed = f"leave {worst.where}" if worst.where == "the water" else f'enter "{worst.where}"'
    return (
        f"{text} Leg {worst.leg + 1} breaks it: {worst.flights} flights {deed} there, by "
        f"{worst.beyond_m:.2g} m. It lacks {safety.short_m:.2g} m of margin."
    )


def short_m(found: DryRunView | None) -> float:
    """Return by how much the flights of a dry run fell short of the margin, m."""
    return 0.0 if found is None or found.safety is None else found.safety.short_m


def with_margin(config: PlannerConfig, site: Site, added_m: float) -> PlannerConfig:
    """Return settings to search with so that plans keep farther from shore, walls and keep-outs.

    Args:
        config: The plan's own.
        site: Its water.
        added_m: How much farther, m.
    """
    if added_m <= 0.0:
        return config
    margin_m = config.margin_m + added_m
    domain = _inside(config.domain, site.water, margin_m)
    return config.model_copy(update={"margin_m": margin_m, "domain": domain})


def grown_m(added_m: float, found: DryRunView | None) -> float:
    """Return the margin to add after a dry run that fell short with ``added_m`` of it."""
    return added_m + _GROWS_M * short_m(found)


def _inside(domain: Box, water: Box, margin_m: float) -> Box:
    """Return a domain without what is nearer to the water's walls than a margin."""
    x_min, x_max = _kept(
        (domain.x_min_m, domain.x_max_m), (water.x_min_m + margin_m, water.x_max_m - margin_m)
    )
    y_min, y_max = _kept(
        (domain.y_min_m, domain.y_max_m), (water.y_min_m + margin_m, water.y_max_m - margin_m)
    )
    sides = {"x_min_m": x_min, "x_max_m": x_max, "y_min_m": y_min, "y_max_m": y_max}
    return domain.model_copy(update=sides)


def _kept(side: tuple[float, float], free: tuple[float, float]) -> tuple[float, float]:
    """Return the part of a side that is free, but a least part about its middle."""
    low, high = max(side[0], free[0]), min(side[1], free[1])
    middle, least = 0.5 * (side[0] + side[1]), 0.5 * _LEAST_SHARE * (side[1] - side[0])
    return min(low, middle - least), max(high, middle + least)
