"""What speaks against the legs themselves: broken numbers, gaps, and shapes that nothing flies."""

import math
from collections.abc import Iterator

from autonomy.planner.check.violation import (
    PLACE_TOLERANCE_M,
    SHARE_TOLERANCE,
    Violation,
    leg_title,
)
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import drift, primitive
from autonomy.planner.plan import Leg, PrimitiveKind

_DURATION_STEP_S = 0.1
_AIM_SHARE = 0.02
_ANGLE_TOLERANCE_RAD = math.radians(0.5)


def not_finite(legs: tuple[Leg, ...]) -> Iterator[Violation]:
    """List the numbers of the legs that are not finite."""
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
                    f"{leg_title(number, leg)} has a {name} that is not a finite number.",
                )


def disconnected(legs: tuple[Leg, ...], config: PlannerConfig) -> Iterator[Violation]:
    """Check that the plan begins and ends at the surface, in one piece.

    Where the robot surfaces, the next leg begins where it really is then.
    """
    if legs[0].start_ned[2] > PLACE_TOLERANCE_M:
        yield Violation(
            "legs.0.start_ned",
            f"The plan begins {legs[0].start_ned[2]:.2f} m under water, not at the surface.",
        )
    courses, has_current = drift.courses(config, legs), drift.has_current(config)
    # durations travel in tenths of a second
    slack_m = PLACE_TOLERANCE_M + _DURATION_STEP_S * drift.speed_m_s(config) * len(legs)
    for number in range(1, len(legs)):
        before, leg = legs[number - 1], legs[number]
        end = before.end_ned
        if end[2] <= 0.0:
            end = drift.position_at(before, courses[number - 1], 1.0)
        gap = math.dist(end, leg.start_ned)
        # where the current changes from place to place, a leg is aimed off by it to a small part
        if gap > slack_m + _AIM_SHARE * math.dist(end, before.end_ned):
            where = "ends" if end == before.end_ned else "leads in the current"
            yield Violation(
                f"legs.{number}.start_ned",
                f"{leg_title(number, leg)} begins {gap:.2f} m from where leg {number} {where}.",
            )
        elif has_current and end != before.end_ned and leg.kind is PrimitiveKind.SPIRAL:
            yield Violation(
                f"legs.{number}.kind",
                f"{leg_title(number, leg)} cannot begin a dive in a current: the robot is not told "
                "where its circle lies.",
            )
    if legs[-1].end_ned[2] > PLACE_TOLERANCE_M:
        yield Violation(
            f"legs.{len(legs) - 1}.end_ned",
            f"The plan ends {legs[-1].end_ned[2]:.2f} m under water, not at the surface.",
        )


def badly_made(legs: tuple[Leg, ...], config: PlannerConfig) -> Iterator[Violation]:
    """Check each leg against what its kind of primitive is."""
    courses = drift.courses(config, legs)
    for number, (leg, course) in enumerate(zip(legs, courses, strict=True)):
        if leg.speed_m_s <= 0.0 or leg.duration_s <= 0.0:
            yield Violation(
                f"legs.{number}.speed_m_s",
                f"{leg_title(number, leg)} needs a speed and a duration above 0.",
            )
            continue
        if leg.kind is PrimitiveKind.KEEP:
            yield from _not_kept(number, leg, config, course.begin.time_s)
            continue
        way = _way(leg)
        if abs(way - leg.speed_m_s * leg.duration_s) > SHARE_TOLERANCE * way + PLACE_TOLERANCE_M:
            yield Violation(
                f"legs.{number}.duration_s",
                f"{leg_title(number, leg)} covers {way:.2f} m, which takes "
                f"{way / leg.speed_m_s:.1f} s at {leg.speed_m_s:.3g} m/s, not "
                f"{leg.duration_s:.1f} s.",
            )
        reason = _misshapen(leg, config, course.begin.time_s)
        if reason:
            yield Violation(f"legs.{number}.end_ned", f"{leg_title(number, leg)} {reason}.")


def _not_kept(number: int, leg: Leg, config: PlannerConfig, begin_s: float) -> Iterator[Violation]:
    """Check a stay at the surface: where it is, how near, and in which current."""
    title, least_m = leg_title(number, leg), config.primitives.keep_radius_min_m
    if max(leg.start_ned[2], leg.end_ned[2]) > PLACE_TOLERANCE_M:
        text = f"{title} keeps a place {leg.end_ned[2]:.2f} m under water, not at the surface."
        yield Violation(f"legs.{number}.end_ned", text)
    if math.dist(leg.start_ned[:2], leg.end_ned[:2]) > leg.radius_m + PLACE_TOLERANCE_M:
        away_m = math.dist(leg.start_ned[:2], leg.end_ned[:2])
        text = f"{title} begins {away_m:.2f} m from the place that it keeps within {leg.radius_m:g}"
        yield Violation(f"legs.{number}.start_ned", f"{text} m.")
    if leg.radius_m < least_m - PLACE_TOLERANCE_M:
        text = f"{title} keeps within {leg.radius_m:g} m; the robot can hold {least_m:g} m."
        yield Violation(f"legs.{number}.radius_m", text)
    motion = config.primitives.model_copy(update={"swim_speed_m_s": leg.speed_m_s})
    swimming = config.model_copy(update={"primitives": motion})
    fault = primitive.keeping_fault(swimming, leg.end_ned, leg.duration_s, begin_s)
    if fault:
        yield Violation(f"legs.{number}.end_ned", f"{title}: {fault}.")


def _way(leg: Leg) -> float:
    """Return the distance that a leg's speed refers to."""
    (x0, y0, z0), (x1, y1, z1) = leg.start_ned, leg.end_ned
    return math.hypot(x1 - x0, y1 - y0) if leg.kind is PrimitiveKind.SWIM else abs(z1 - z0)


def _misshapen(leg: Leg, config: PlannerConfig, begin_s: float) -> str:
    """Return what is wrong with a leg's geometry, "" if nothing."""
    limits = config.primitives
    (x0, y0, z0), (x1, y1, z1) = leg.start_ned, leg.end_ned
    horizontal, change = math.hypot(x1 - x0, y1 - y0), abs(z1 - z0)
    if leg.kind is PrimitiveKind.SWIM:
        if change > PLACE_TOLERANCE_M:
            return f"changes depth by {change:.2f} m"
        return _too_slow(leg, config, begin_s)
    if leg.kind is PrimitiveKind.DIVE:
        return f"moves {horizontal:.2f} m sideways" if horizontal > PLACE_TOLERANCE_M else ""
    if leg.kind is PrimitiveKind.SPIRAL:
        if leg.radius_m <= 0.0 or leg.turn_rad == 0.0:
            return "needs a radius and a turn other than 0"
        x, y, _ = primitive.position_at(leg, 1.0)
        off = math.hypot(x - x1, y - y1)
        # Milliradians and millimetres of the wire move the end of a long spiral a little.
        wire = PLACE_TOLERANCE_M + 1e-3 * leg.radius_m * (1.0 + abs(leg.turn_rad))
        return f"turns to a point {off:.2f} m from its end" if off > wire else ""
    angle = math.atan2(change, horizontal)
    low, high = limits.glide_angle_min_rad, limits.glide_angle_max_rad
    if low - _ANGLE_TOLERANCE_RAD <= angle <= high + _ANGLE_TOLERANCE_RAD:
        return ""
    return (
        f"has a glide angle of {math.degrees(angle):.1f} deg; the robot glides at "
        f"{math.degrees(low):.0f} to {math.degrees(high):.0f} deg"
    )


def _too_slow(leg: Leg, config: PlannerConfig, begin_s: float) -> str:
    """Return that a swim along the surface cannot get on so fast in the current, "" if it can."""
    if not (drift.knows_place(leg) and drift.has_current(config)):
        return ""
    swims = config.primitives.swim_speed_m_s
    current = primitive.surface_current(config, leg.start_ned, begin_s)
    north = leg.speed_m_s * math.cos(leg.heading_rad) - current[0]
    east = leg.speed_m_s * math.sin(leg.heading_rad) - current[1]
    through = math.hypot(north, east)
    if through <= swims * (1.0 + SHARE_TOLERANCE):
        return ""
    return (
        f"needs {through:.3g} m/s through the water to get on against the current; "
        f"the robot swims at {swims:.3g} m/s"
    )
