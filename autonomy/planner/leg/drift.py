"""Where a robot really is that flies its legs in a steady current.

A robot under water does not feel the current: its legs say where it believes to be. At the surface
it knows its position, so its belief jumps to the truth there, and a swim along the surface is
steered over ground.
"""

import math
from collections.abc import Iterable

from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import primitive
from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind


def knows_place(leg: Leg) -> bool:
    """Tell whether the robot sees its position all along a leg: a swim along the surface."""
    return leg.kind is PrimitiveKind.SWIM and leg.start_ned[2] <= 0.0


def blind_s(legs: Iterable[Leg]) -> tuple[float, ...]:
    """Return for how long the robot has not seen its position when each leg begins, s."""
    times: list[float] = []
    under_s = 0.0
    for leg in legs:
        times.append(under_s)
        under_s = later(leg, under_s)
    return tuple(times)


def later(leg: Leg, under_s: float) -> float:
    """Return for how long the robot has not seen its position when a leg has ended, s."""
    return 0.0 if leg.end_ned[2] <= 0.0 else under_s + leg.duration_s


def position_at(config: PlannerConfig, leg: Leg, under_s: float, fraction: float) -> PositionNed:
    """Return where the robot really is after this part (0..1) of a leg's duration.

    Args:
        config: The current.
        leg: What the robot believes to fly.
        under_s: For how long it has not seen its position when the leg begins.
        fraction: Part of the leg.
    """
    place = primitive.position_at(leg, fraction)
    if knows_place(leg):
        return place
    return carried(config, place, under_s + fraction * leg.duration_s)


def carried(config: PlannerConfig, place: PositionNed, under_s: float) -> PositionNed:
    """Return where a robot is that believes to be at a place and has not seen for some time."""
    current = config.current
    return (
        place[0] + current.north_m_s * under_s,
        place[1] + current.east_m_s * under_s,
        place[2],
    )


def speed_m_s(config: PlannerConfig) -> float:
    """Return the speed of the current."""
    return math.hypot(config.current.north_m_s, config.current.east_m_s)


def has_current(config: PlannerConfig) -> bool:
    """Tell whether plans allow for a current."""
    return config.current.north_m_s != 0.0 or config.current.east_m_s != 0.0
