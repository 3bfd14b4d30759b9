"""Where a robot really is that flies its legs in a current.

A robot under water does not feel the current: its legs say where it believes to be. At the surface
it knows its position, so its belief jumps to the truth there, and a swim along the surface is
steered over ground. A robot that reckons with a current itself finds from the jumps of its plan
which one each dive counts on.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from autonomy.current.table import FlowTable, flow_at, is_uniform, largest_speed_m_s, uniform_flow
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import primitive
from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind

ROUNDS = 2
"""How often the way along which a leg is carried is worked out from how far it is carried."""
_LEVEL = (PrimitiveKind.SWIM, PrimitiveKind.KEEP)
MIDPOINTS = (0.25, 0.75)
"""Shares of a leg at which the current is looked up; their mean is that of the leg."""


@dataclass(frozen=True, slots=True)
class Carried:
    """How far the water has carried a robot from where it believes to be, and when that is."""

    north_m: float
    east_m: float
    time_s: float
    """Since the plan began."""


@dataclass(frozen=True, slots=True)
class Course:
    """A leg in a current."""

    begin: Carried
    """When the leg begins."""
    current_ne_m_s: tuple[float, float]
    """Mean current along it."""


def knows_place(leg: Leg) -> bool:
    """Tell whether the robot sees its position all along a leg: one along the surface."""
    return leg.kind in _LEVEL and leg.start_ned[2] <= 0.0


def fresh(config: PlannerConfig, begin_s: float) -> Carried:
    """Return that a robot knows its place, when it leaves the surface after a surfacing."""
    return Carried(0.0, 0.0, begin_s + config.mission.turn_time_s)


def courses(config: PlannerConfig, legs: Iterable[Leg], begin_s: float = 0.0) -> tuple[Course, ...]:
    """Return the courses of legs one after the other.

    Args:
        config: The current, and how long a surfacing takes.
        legs: What the robot believes to fly.
        begin_s: When the first surfacing begins, s since the plan began.
    """
    found: list[Course] = []
    here = fresh(config, begin_s)
    for leg in legs:
        course = course_of(config, leg, here)
        found.append(course)
        here = later(config, leg, course)
    return tuple(found)


def course_of(config: PlannerConfig, leg: Leg, begin: Carried) -> Course:
    """Return the course of a leg that begins so."""
    table = config.current.table
    if is_uniform(table):
        return Course(begin, uniform_flow(table))
    x, y, z = leg.start_ned
    current = flow_at(table, x + begin.north_m, y + begin.east_m, z, begin.time_s)
    for _ in range(ROUNDS):
        current = _along(table, leg, begin, current)
    return Course(begin, current)


def _along(
    table: FlowTable, leg: Leg, begin: Carried, current: tuple[float, float]
) -> tuple[float, float]:
    """Return the mean current along the way on which a current carries a leg."""
    north = east = 0.0
    for share in MIDPOINTS:
        x, y, z = primitive.position_at(leg, share)
        passed_s = share * leg.duration_s
        u, v = flow_at(
            table,
            x + begin.north_m + passed_s * current[0],
            y + begin.east_m + passed_s * current[1],
            z,
            begin.time_s + passed_s,
        )
        north += u / len(MIDPOINTS)
        east += v / len(MIDPOINTS)
    return north, east


def later(config: PlannerConfig, leg: Leg, course: Course) -> Carried:
    """Return how far the robot was carried when a leg has ended."""
    begin, (north, east) = course.begin, course.current_ne_m_s
    end_s = begin.time_s + leg.duration_s
    if leg.end_ned[2] <= 0.0:
        return fresh(config, end_s)
    return Carried(
        begin.north_m + north * leg.duration_s, begin.east_m + east * leg.duration_s, end_s
    )


def after(config: PlannerConfig, leg: Leg, course: Course) -> tuple[PositionNed, Carried]:
    """Return where the robot believes to be after a leg, and how far it was carried from there."""
    then = later(config, leg, course)
    if leg.end_ned[2] <= 0.0:
        return position_at(leg, course, 1.0), then
    return leg.end_ned, then


def position_at(leg: Leg, course: Course, fraction: float) -> PositionNed:
    """Return where the robot really is after this part (0..1) of a leg's duration."""
    place = primitive.position_at(leg, fraction)
    if knows_place(leg):
        return place
    begin, (north, east) = course.begin, course.current_ne_m_s
    passed_s = fraction * leg.duration_s
    return (
        place[0] + begin.north_m + north * passed_s,
        place[1] + begin.east_m + east * passed_s,
        place[2],
    )


def speed_m_s(config: PlannerConfig) -> float:
    """Return the greatest speed of the current."""
    current = config.current
    if current.source != "none" and current.flow is not None:
        return largest_speed_m_s(current.flow)
    return math.hypot(*current.steady_ne_m_s)


def has_current(config: PlannerConfig) -> bool:
    """Tell whether plans allow for a current."""
    return speed_m_s(config) != 0.0
