"""What speaks against flying a plan: every violated limit, in words."""

import math
from collections.abc import Iterator

from autonomy.estimation.position import drifted_variance
from autonomy.planner.check.leg_check import badly_made, disconnected, not_finite
from autonomy.planner.check.violation import (
    PLACE_TOLERANCE_M,
    SHARE_TOLERANCE,
    Violation,
    leg_title,
)
from autonomy.planner.check.water_check import out_of_bounds
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import drift, primitive
from autonomy.planner.leg.edge import (
    departures,
    doubts,
    first_doubt_m,
    legs_duration_s,
    surfacings,
)
from autonomy.planner.plan import Leg, PrimitiveKind
from autonomy.site import Site


def violations(legs: tuple[Leg, ...], config: PlannerConfig, site: Site) -> tuple[Violation, ...]:
    """List everything that forbids to fly these legs.

    In a current the legs say where the robot believes to be; the water's limits hold for where it
    really is.

    Args:
        legs: The plan.
        config: Limits of energy, time, uncertainty, domain and primitives. The first swims may
            come from outside the domain, or from within a margin, into it.
        site: The water, which no plan may leave.

    Returns:
        Every violation found, empty for a plan that may be flown. If a number is not finite, only
        such numbers are listed, since nothing else can be judged.
    """
    if not legs:
        return (Violation("legs", "The plan has no legs."),)
    broken = tuple(not_finite(legs))
    if broken:
        return broken
    found = [*disconnected(legs, config), *badly_made(legs, config)]
    found += out_of_bounds(legs, config, site)
    found += _overspent(legs, config)
    if not found:
        found += _lost(legs, config)
    return tuple(found)


def outdated(
    legs: tuple[Leg, ...],
    config: PlannerConfig,
    position_ne_m: tuple[float, float],
    age_s: float,
    site: Site,
) -> tuple[Violation, ...]:
    """List why a plan that was made some time ago no longer fits the robot.

    Args:
        legs: The plan.
        config: Settings that it was made with, which say how long it stays true.
        position_ne_m: Where the robot is now.
        age_s: Time since the plan was made.
        site: The water that the robot is in.
    """
    limits = config.mission
    found: list[Violation] = []
    away_m = math.dist(legs[0].start_ned[:2], position_ne_m) if legs else 0.0
    if away_m > limits.draft_distance_m:
        found.append(
            Violation(
                "mission.draft_distance_m",
                f"The robot is {_not_less(away_m)} m from where the plan begins; "
                f"the limit is {limits.draft_distance_m:g} m.",
            )
        )
    elif away_m > PLACE_TOLERANCE_M and not _is_way_free(legs, config, position_ne_m, site):
        found.append(
            Violation(
                "mission.draft_distance_m",
                f"The robot is {_not_less(away_m)} m from where the plan begins, and the way "
                "there is not free.",
            )
        )
    if age_s > limits.draft_age_s:
        found.append(
            Violation(
                "mission.draft_age_s",
                f"The plan was made {age_s / 60.0:.0f} min ago; "
                f"the limit is {limits.draft_age_s / 60.0:g} min.",
            )
        )
    return tuple(found)


def _is_way_free(
    legs: tuple[Leg, ...], config: PlannerConfig, position_ne_m: tuple[float, float], site: Site
) -> bool:
    """Tell whether a swim to the plan's start breaks no limit that the plan does not break."""
    here = (*position_ne_m, legs[0].start_ned[2])
    way = primitive.swim(config, here, legs[0].start_ned)
    broken = len(list(out_of_bounds((way, *legs), config, site)))
    return broken <= len(list(out_of_bounds(legs, config, site)))


def _overspent(legs: tuple[Leg, ...], config: PlannerConfig) -> Iterator[Violation]:
    """Check energy against the round's budget, by the planner's own account."""
    energy = 0.0
    begins_s = _begins_s(legs, config)
    for number, (leg, begin_s) in enumerate(zip(legs, begins_s, strict=True)):
        due = primitive.energy_of(config, leg, begin_s)
        energy += due
        if abs(due - leg.energy) > SHARE_TOLERANCE * due + 0.001:
            yield Violation(
                f"legs.{number}.energy",
                f"{leg_title(number, leg)} takes {due:.2f} energy units, not {leg.energy:.2f}.",
            )
    energy += departures(legs) * config.surfacing_energy
    if energy > config.round_budget * (1.0 + 1e-3):
        yield Violation(
            "round_budget",
            f"The plan takes {energy:.4g} energy units; a round may use {config.round_budget:.4g}.",
        )
    duration_s = legs_duration_s(config, legs)
    if 0.0 < config.time_budget_s * (1.0 + 1e-3) < duration_s:
        yield Violation(
            "time_budget_s",
            f"The plan takes {duration_s:.0f} s; a round may take {config.time_budget_s:.0f} s.",
        )
    sent = surfacings(legs) * config.mission.surfacing_bytes
    if 0 < config.satellite_bytes < sent:
        yield Violation(
            "satellite_bytes",
            f"The plan's surfacings send {sent} bytes by satellite; a round may send "
            f"{config.satellite_bytes}.",
        )


def _begins_s(legs: tuple[Leg, ...], config: PlannerConfig) -> list[float]:
    """Return when legs begin, s after the plan; 0 where no leg's price depends on it."""
    if all(leg.kind is not PrimitiveKind.KEEP for leg in legs):
        return [0.0] * len(legs)
    return [course.begin.time_s for course in drift.courses(config, legs)]


def _lost(legs: tuple[Leg, ...], config: PlannerConfig) -> Iterator[Violation]:
    """Check the position's uncertainty, from one surfacing to the next.

    The planner looks at the uncertainty at its own sampling times, and takes every dive for the
    first. What it grows by within one interval is allowed on top, and so is what is forgotten of
    the current until a later dive begins, so that no plan of its own is refused.
    """
    interval, position = config.primitives.point_interval_s, config.position_filter
    allowed = config.max_uncertainty_m
    dives = list(_dives(legs))
    found = doubts(config, (legs[dive] for dive in dives))
    for dive, (times_s, std_m) in zip(dives, found, strict=True):
        worst = int(std_m.argmax())
        blind_s, worst_m = float(times_s[worst]), float(std_m[worst])
        growth = drifted_variance(position, blind_s + interval) - drifted_variance(
            position, blind_s
        )
        limit_m = math.sqrt(allowed**2 + growth)
        if worst_m > limit_m and first_doubt_m(config, legs[dive]) > limit_m:
            yield Violation(
                "max_uncertainty_m",
                f"The position becomes uncertain by {worst_m:.2g} m, "
                f"{blind_s:.0f} s after leg {dive.start + 1} begins; "
                f"the limit is {allowed:g} m.",
            )


def _dives(legs: tuple[Leg, ...]) -> Iterator[slice]:
    """Return the numbers of the legs of each dive, from one surfacing to the next."""
    begin = 0
    for number, leg in enumerate(legs):
        if leg.end_ned[2] <= PLACE_TOLERANCE_M:
            yield slice(begin, number + 1)
            begin = number + 1


def _not_less(distance_m: float) -> str:
    """Return a distance rounded up, so that one beyond a limit is not written as the limit."""
    step = 0.01 if distance_m < 1.0 else 0.1
    return f"{math.ceil(distance_m / step - 1e-6) * step:.4g}"
