"""The way back into the domain for a robot that drifted out of it while it waited."""

import math
from dataclasses import replace

from autonomy.planner import primitive
from autonomy.planner.config import PlannerConfig
from autonomy.planner.edge import legs_duration_s, legs_energy, planned_points
from autonomy.planner.outcome import sentence
from autonomy.planner.plan import Candidate, Leg, PlanResult

_INSET_SHARE = 0.05
"""The way ends this share of the domain's width inside, so that drift does not undo it at once."""


def approach(config: PlannerConfig, start_xy: tuple[float, float]) -> Leg | None:
    """Return the swim at the surface to the nearest place well inside the domain.

    Args:
        config: Settings whose domain is meant.
        start_xy: North and east of the robot at the surface, m, in the site's frame.

    Returns:
        One swim, or None for a robot that is inside already or whose position is unknown.
    """
    x, y = start_xy
    domain = config.domain
    if domain.contains(x, y, 0.0) or not (math.isfinite(x) and math.isfinite(y)):
        return None
    end = (
        _nearest(x, domain.x_min_m, domain.x_max_m),
        _nearest(y, domain.y_min_m, domain.y_max_m),
        0.0,
    )
    return primitive.swim(config, (x, y, 0.0), end)


def approach_energy(config: PlannerConfig, first: Leg | None) -> float:
    """Return the energy units of the way back, none without one."""
    return 0.0 if first is None else legs_energy(config, (first,))


def preceded(result: PlanResult, first: Leg, config: PlannerConfig, budget: float) -> PlanResult:
    """Return the result with ``first`` flown before every trajectory of it.

    Args:
        result: Of a search that begins where ``first`` ends.
        first: The way there.
        config: Settings of the search.
        budget: Energy units of the round, the way included.
    """
    if result.best is None:
        return result
    best = _preceded(result.best, first, config)
    distance_m = math.dist(first.start_ned, first.end_ned)
    return replace(
        result,
        message=f"It begins with a swim of {distance_m:.2g} m back into the domain. "
        + sentence(config, budget, result, best),
        best=best,
        runners_up=tuple(_preceded(other, first, config) for other in result.runners_up),
    )


def _preceded(candidate: Candidate, first: Leg, config: PlannerConfig) -> Candidate:
    legs = (first, *candidate.legs)
    points = planned_points(config, legs)
    return replace(
        candidate,
        legs=legs,
        points=points,
        energy=candidate.energy + approach_energy(config, first),
        duration_s=legs_duration_s(config, legs),
        worst_std_m=float(points[:, 4].max()),
    )


def _nearest(value: float, low: float, high: float) -> float:
    inset = _INSET_SHARE * (high - low)
    return min(max(value, low + inset), high - inset)
