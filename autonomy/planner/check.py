"""What speaks against flying a plan: every violated limit, in words."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from autonomy.arrays import FloatArray
from autonomy.planner import drift, primitive
from autonomy.planner.clearance import clearance_m, floor_contact, true_way
from autonomy.planner.config import PlannerConfig
from autonomy.planner.edge import (
    POINT_STD,
    POINT_TIME,
    departures,
    legs_duration_s,
    planned_points,
    surfacings,
)
from autonomy.planner.plan import Leg, PrimitiveKind
from autonomy.site import Area, Box, Site

_SAME_PLACE_M = 0.005
_DOMAIN_MARGIN_M = 0.005
_TOLERANCE = 0.01
_DURATION_STEP_S = 0.1
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
    broken = tuple(_not_finite(legs))
    if broken:
        return broken
    found = [*_disconnected(legs, config), *_badly_made(legs, config)]
    arrival = _arrival(legs, config)
    for number, (leg, under_s) in enumerate(zip(legs, drift.blind_s(legs), strict=True)):
        way = true_way(config, leg, under_s)
        found += _outside(number, leg, way, config.domain, site, comes_in=number < arrival)
        found += _aground(number, leg, way, config, site, comes_in=number < arrival)
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


def _disconnected(legs: tuple[Leg, ...], config: PlannerConfig) -> Iterator[Violation]:
    """Check that the plan begins and ends at the surface, in one piece.

    Where the robot surfaces, the next leg begins where it really is then.
    """
    if legs[0].start_ned[2] > _SAME_PLACE_M:
        yield Violation(
            "legs.0.start_ned",
            f"The plan begins {legs[0].start_ned[2]:.2f} m under water, not at the surface.",
        )
    under_s = drift.blind_s(legs)
    # durations travel in tenths of a second
    slack_m = _SAME_PLACE_M + _DURATION_STEP_S * drift.speed_m_s(config) * len(legs)
    for number in range(1, len(legs)):
        before, leg = legs[number - 1], legs[number]
        end = before.end_ned
        if end[2] <= 0.0:
            end = drift.position_at(config, before, under_s[number - 1], 1.0)
        gap = math.dist(end, leg.start_ned)
        if gap > slack_m:
            where = "ends" if end == before.end_ned else "leads in the current"
            yield Violation(
                f"legs.{number}.start_ned",
                f"{_title(number, leg)} begins {gap:.2f} m from where leg {number} {where}.",
            )
        elif (
            drift.has_current(config) and end != before.end_ned and leg.kind is PrimitiveKind.SPIRAL
        ):
            yield Violation(
                f"legs.{number}.kind",
                f"{_title(number, leg)} cannot begin a dive in a current: the robot is not told "
                "where its circle lies.",
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
        if change > _SAME_PLACE_M:
            return f"changes depth by {change:.2f} m"
        return _too_slow(leg, config)
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


def _too_slow(leg: Leg, config: PlannerConfig) -> str:
    """Return that a swim along the surface cannot get on so fast in the current, "" if it can."""
    if not (drift.knows_place(leg) and drift.has_current(config)):
        return ""
    swims = config.primitives.swim_speed_m_s
    north = leg.speed_m_s * math.cos(leg.heading_rad) - config.current.north_m_s
    east = leg.speed_m_s * math.sin(leg.heading_rad) - config.current.east_m_s
    through = math.hypot(north, east)
    if through <= swims * (1.0 + _TOLERANCE):
        return ""
    return (
        f"needs {through:.3g} m/s through the water to get on against the current; "
        f"the robot swims at {swims:.3g} m/s"
    )


def _arrival(legs: tuple[Leg, ...], config: PlannerConfig) -> int:
    """Return how many swims along the surface bring the robot into the domain, 0 if none."""
    for number, leg in enumerate(legs):
        if not drift.knows_place(leg):
            return 0
        if config.domain.contains(*leg.end_ned):
            return number + 1
    return 0


def _outside(
    number: int, leg: Leg, way: FloatArray, domain: Box, site: Site, *, comes_in: bool
) -> Iterator[Violation]:
    """Check a leg against walls, floor and domain; what leaves the water is not listed twice."""
    low, high = way.min(axis=0).tolist(), way.max(axis=0).tolist()
    beyond = _beyond(low, high, site.water, site.kind)
    if not beyond and not comes_in:
        beyond = _beyond(low, high, domain, "survey domain")
    if not beyond:
        believed = _beyond(*primitive.bounds(leg), site.water, site.kind)
        beyond = [f"{text}, in the robot's belief" for text in believed]
    for text in beyond:
        yield Violation(f"legs.{number}.end_ned", f"{_title(number, leg)} goes {text}.")


def _aground(
    number: int, leg: Leg, way: FloatArray, config: PlannerConfig, site: Site, *, comes_in: bool
) -> Iterator[Violation]:
    """Check a leg against keep-outs, shoreline and floor, with their margins."""
    borders = [(area, f'the keep-out "{area.name}"', 1.0) for area in config.keep_outs]
    if site.shoreline is not None:
        borders.append((site.shoreline, f'the shoreline "{site.shoreline.name}"', -1.0))
    for area, name, side in borders:
        text = _too_near(area, name, side, way, config.margin_m, comes_in=comes_in)
        if text:
            yield Violation(f"legs.{number}.end_ned", f"{_title(number, leg)} {text}.")
    contact = floor_contact(site, way)
    is_below_all = way[:, 2].max() > site.water.depth_max_m + _DOMAIN_MARGIN_M
    if comes_in or is_below_all or contact.clearance_m >= config.floor_margin_m - _DOMAIN_MARGIN_M:
        return
    place = f"{contact.north_m:.4g} m north, {contact.east_m:.4g} m east"
    if contact.floor_m <= 0.0:
        text = f"is on land at {place}"
    elif contact.clearance_m < 0.0:
        text = (
            f"goes {-contact.clearance_m:.2f} m under the floor, "
            f"which is {contact.floor_m:.3g} m deep at {place}"
        )
    else:
        text = (
            f"comes within {contact.clearance_m:.2f} m of the floor, {contact.floor_m:.3g} m deep "
            f"at {place}; the margin is {config.floor_margin_m:g} m"
        )
    yield Violation(f"legs.{number}.end_ned", f"{_title(number, leg)} {text}.")


def _too_near(
    area: Area, name: str, side: float, way: FloatArray, margin_m: float, *, comes_in: bool
) -> str:
    """Return how a way breaks the margin to an area, "" if it does not.

    Args:
        area: The area.
        name: What to call it.
        side: 1 if the robot must stay outside of it, -1 if inside.
        way: Corners of the way, shape ``(m, 3)``.
        margin_m: Least distance from its outline.
        comes_in: Whether the way leads back into the water that may be used: then it may begin
            within the margin, or on the wrong side of a shoreline.
    """
    distances = side * area.distance_m(way[:, 0], way[:, 1])
    if comes_in:
        if side < 0.0 and distances[0] <= 0.0:
            return ""
        margin_m = min(margin_m, float(distances[0]))
    clearance = clearance_m(area, way)
    if clearance <= 0.0 or distances.min() <= -_DOMAIN_MARGIN_M:
        return f"enters {name}" if side > 0.0 else f"goes beyond {name}"
    if clearance < margin_m - _DOMAIN_MARGIN_M:
        return f"comes within {clearance:.2f} m of {name}; the margin is {margin_m:g} m"
    return ""


def _beyond(low: Sequence[float], high: Sequence[float], box: Box, name: str) -> list[str]:
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
