"""What speaks against flying a plan: every violated limit, in words."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from autonomy.planner import primitive
from autonomy.planner.config import PlannerConfig
from autonomy.planner.edge import POINT_STD, POINT_TIME, planned_points, surfacings
from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind
from autonomy.site import Box, Site

_SAME_PLACE_M = 0.005
_DOMAIN_MARGIN_M = 0.005
_TOLERANCE = 0.01
_ANGLE_TOLERANCE_RAD = math.radians(0.5)


@dataclass(frozen=True, slots=True)
class Violation:
    """One limit that a plan breaks."""

    field: str
    """What breaks it, such as ``legs.2.end_ned`` or ``round_budget``."""
    message: str
    """One sentence with the limit and by how much it is broken."""


def violations(legs: tuple[Leg, ...], config: PlannerConfig, site: Site) -> tuple[Violation, ...]:
    """List everything that forbids to fly these legs.

    Args:
        legs: The plan.
        config: Limits of energy, uncertainty, domain and primitives. A first swim may come from
            outside the domain into it.
        site: The water, which no plan may leave.

    Returns:
        Every violation found, empty for a plan that may be flown. If a number is not finite, only
        such numbers are listed, since nothing else can be judged.
    """
    if not legs:
        return (Violation("legs", "The plan has no legs."),)
    broken = tuple(_not_finite(legs))
    if broken:
        return broken
    found = [*_disconnected(legs), *_badly_made(legs, config)]
    for number, leg in enumerate(legs):
        found += _outside(number, leg, config.domain, site)
    found += _overspent(legs, config)
    if not found:
        found += _lost(legs, config)
    return tuple(found)


def outdated(
    legs: tuple[Leg, ...], config: PlannerConfig, position_ne_m: tuple[float, float], age_s: float
) -> tuple[Violation, ...]:
    """List why a plan that was made some time ago no longer fits the robot.

    Args:
        legs: The plan.
        config: Settings that it was made with, which say how long it stays true.
        position_ne_m: Where the robot is now.
        age_s: Time since the plan was made.
    """
    limits = config.mission
    found: list[Violation] = []
    away_m = math.dist(legs[0].start_ned[:2], position_ne_m) if legs else 0.0
    if away_m > limits.draft_distance_m:
        found.append(
            Violation(
                "mission.draft_distance_m",
                f"The robot is {away_m:.3g} m from where the plan begins; "
                f"the limit is {limits.draft_distance_m:g} m.",
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


def _not_finite(legs: tuple[Leg, ...]) -> Iterator[Violation]:
    for number, leg in enumerate(legs):
        named = {
            "start_ned": leg.start_ned,
            "end_ned": leg.end_ned,
            "speed_m_s": (leg.speed_m_s,),
            "duration_s": (leg.duration_s,),
            "energy": (leg.energy,),
            "heading_rad": (leg.heading_rad,),
            "radius_m": (leg.radius_m,),
            "turn_rad": (leg.turn_rad,),
        }
        for name, values in named.items():
            if not all(math.isfinite(value) for value in values):
                yield Violation(
                    f"legs.{number}.{name}",
                    f"{_title(number, leg)} has a {name} that is not a finite number.",
                )


def _disconnected(legs: tuple[Leg, ...]) -> Iterator[Violation]:
    """Check that the plan begins and ends at the surface, in one piece."""
    if legs[0].start_ned[2] > _SAME_PLACE_M:
        yield Violation(
            "legs.0.start_ned",
            f"The plan begins {legs[0].start_ned[2]:.2f} m under water, not at the surface.",
        )
    for number in range(1, len(legs)):
        gap = math.dist(legs[number - 1].end_ned, legs[number].start_ned)
        if gap > _SAME_PLACE_M:
            yield Violation(
                f"legs.{number}.start_ned",
                f"{_title(number, legs[number])} begins {gap:.2f} m from where leg {number} ends.",
            )
    if legs[-1].end_ned[2] > _SAME_PLACE_M:
        yield Violation(
            f"legs.{len(legs) - 1}.end_ned",
            f"The plan ends {legs[-1].end_ned[2]:.2f} m under water, not at the surface.",
        )


def _badly_made(legs: tuple[Leg, ...], config: PlannerConfig) -> Iterator[Violation]:
    """Check each leg against what its kind of primitive is."""
    for number, leg in enumerate(legs):
        if leg.speed_m_s <= 0.0 or leg.duration_s <= 0.0:
            yield Violation(
                f"legs.{number}.speed_m_s",
                f"{_title(number, leg)} needs a speed and a duration above 0.",
            )
            continue
        way = _way(leg)
        if abs(way - leg.speed_m_s * leg.duration_s) > _TOLERANCE * way + _SAME_PLACE_M:
            yield Violation(
                f"legs.{number}.duration_s",
                f"{_title(number, leg)} covers {way:.2f} m, which takes "
                f"{way / leg.speed_m_s:.1f} s at {leg.speed_m_s:.3g} m/s, not "
                f"{leg.duration_s:.1f} s.",
            )
        reason = _misshapen(leg, config)
        if reason:
            yield Violation(f"legs.{number}.end_ned", f"{_title(number, leg)} {reason}.")


def _way(leg: Leg) -> float:
    """Return the distance that a leg's speed refers to."""
    (x0, y0, z0), (x1, y1, z1) = leg.start_ned, leg.end_ned
    return math.hypot(x1 - x0, y1 - y0) if leg.kind is PrimitiveKind.SWIM else abs(z1 - z0)


def _misshapen(leg: Leg, config: PlannerConfig) -> str:
    """Return what is wrong with a leg's geometry, "" if nothing."""
    limits = config.primitives
    (x0, y0, z0), (x1, y1, z1) = leg.start_ned, leg.end_ned
    horizontal, change = math.hypot(x1 - x0, y1 - y0), abs(z1 - z0)
    if leg.kind is PrimitiveKind.SWIM:
        return f"changes depth by {change:.2f} m" if change > _SAME_PLACE_M else ""
    if leg.kind is PrimitiveKind.DIVE:
        return f"moves {horizontal:.2f} m sideways" if horizontal > _SAME_PLACE_M else ""
    if leg.kind is PrimitiveKind.SPIRAL:
        if leg.radius_m <= 0.0 or leg.turn_rad == 0.0:
            return "needs a radius and a turn other than 0"
        x, y, _ = primitive.position_at(leg, 1.0)
        off = math.hypot(x - x1, y - y1)
        # Milliradians and millimetres of the wire move the end of a long spiral a little.
        wire = _SAME_PLACE_M + 1e-3 * leg.radius_m * (1.0 + abs(leg.turn_rad))
        return f"turns to a point {off:.2f} m from its end" if off > wire else ""
    angle = math.atan2(change, horizontal)
    low, high = limits.glide_angle_min_rad, limits.glide_angle_max_rad
    if low - _ANGLE_TOLERANCE_RAD <= angle <= high + _ANGLE_TOLERANCE_RAD:
        return ""
    return (
        f"has a glide angle of {math.degrees(angle):.1f} deg; the robot glides at "
        f"{math.degrees(low):.0f} to {math.degrees(high):.0f} deg"
    )


def _outside(number: int, leg: Leg, domain: Box, site: Site) -> Iterator[Violation]:
    """Check a leg against walls, floor and domain; what leaves the water is not listed twice."""
    low, high = primitive.bounds(leg)
    beyond = _beyond(low, high, site.water, site.kind)
    comes_in = number == 0 and leg.kind is PrimitiveKind.SWIM and domain.contains(*leg.end_ned)
    if not beyond and not comes_in:
        beyond = _beyond(low, high, domain, "survey domain")
    for text in beyond:
        yield Violation(f"legs.{number}.end_ned", f"{_title(number, leg)} goes {text}.")


def _beyond(low: PositionNed, high: PositionNed, box: Box, name: str) -> list[str]:
    """Say by how much a leg's bounds leave a box, and through which side."""
    sides = (
        (box.x_min_m - low[0], f"south edge of the {name}, x {box.x_min_m:g} m"),
        (high[0] - box.x_max_m, f"north edge of the {name}, x {box.x_max_m:g} m"),
        (box.y_min_m - low[1], f"west edge of the {name}, y {box.y_min_m:g} m"),
        (high[1] - box.y_max_m, f"east edge of the {name}, y {box.y_max_m:g} m"),
        (high[2] - box.depth_max_m, f"{name} floor {box.depth_max_m:g} m"),
        (-low[2], "surface"),
    )
    return [f"{past:.2f} m beyond the {side}" for past, side in sides if past > _DOMAIN_MARGIN_M]


def _overspent(legs: tuple[Leg, ...], config: PlannerConfig) -> Iterator[Violation]:
    """Check energy against the round's budget, by the planner's own account."""
    energy = 0.0
    for number, leg in enumerate(legs):
        due = primitive.energy(leg.kind, leg.duration_s, config.energy)
        energy += due
        if abs(due - leg.energy) > _TOLERANCE * due + 0.001:
            yield Violation(
                f"legs.{number}.energy",
                f"{_title(number, leg)} takes {due:.2f} energy units, not {leg.energy:.2f}.",
            )
    energy += surfacings(legs) * config.surfacing_energy
    if energy > config.round_budget * (1.0 + 1e-3):
        yield Violation(
            "round_budget",
            f"The plan takes {energy:.4g} energy units; a round may use {config.round_budget:.4g}.",
        )


def _lost(legs: tuple[Leg, ...], config: PlannerConfig) -> Iterator[Violation]:
    """Check the position's uncertainty, from one surfacing to the next.

    The planner looks at the uncertainty at its own sampling times; what it grows by within one
    interval is allowed on top, so that no plan of its own is refused.
    """
    interval = config.primitives.point_interval_s
    growth = config.position_filter.drift_m_sqrt_s**2 * interval
    limit = math.sqrt(config.max_uncertainty_m**2 + growth)
    begin = 0
    for number, leg in enumerate(legs):
        if leg.end_ned[2] > _SAME_PLACE_M:
            continue
        points = planned_points(config, legs[begin : number + 1])
        worst = points[points[:, POINT_STD].argmax()]
        if worst[POINT_STD] > limit:
            yield Violation(
                "max_uncertainty_m",
                f"The position becomes uncertain by {worst[POINT_STD]:.2g} m, "
                f"{worst[POINT_TIME]:.0f} s after leg {begin + 1} begins; "
                f"the limit is {config.max_uncertainty_m:g} m.",
            )
        begin = number + 1


def _title(number: int, leg: Leg) -> str:
    return f"Leg {number + 1} ({leg.kind})"
