"""Where a leg leads when the robot is not exactly where the plan wanted it."""

import math

from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind

_STEERABLE = (PrimitiveKind.GLIDE, PrimitiveKind.SWIM)


def is_surface(depth_m: float) -> bool:
    """Tell whether a planned depth means the surface."""
    return depth_m < 1e-3


def dive_ends(legs: tuple[Leg, ...]) -> tuple[int, ...]:
    """Return, for each leg, the index of the leg that next ends at the surface (or the last)."""
    ends = [len(legs) - 1] * len(legs)
    for i in range(len(legs) - 1, -1, -1):
        if is_surface(legs[i].end_ned[2]):
            ends[i] = i
        elif i + 1 < len(legs):
            ends[i] = ends[i + 1]
    return tuple(ends)


def anchored_end(legs: tuple[Leg, ...], north_m: float, east_m: float) -> PositionNed:
    """Return where the first of these legs should end when it begins at another place.

    The error of the start is taken back evenly over the time of the legs that can steer, so the
    last leg ends where it was planned and no leg alone has to bend.

    Args:
        legs: The leg to fly and those after it until the next surfacing.
        north_m: Northing at which the first leg really begins.
        east_m: Easting at which the first leg really begins.
    """
    leg = legs[0]
    steerable_s = sum(other.duration_s for other in legs if other.kind in _STEERABLE)
    kept = 1.0
    if leg.kind in _STEERABLE and steerable_s > 0.0:
        kept -= leg.duration_s / steerable_s
    elif len(legs) == 1:
        kept = 0.0
    return (
        leg.end_ned[0] + kept * (north_m - leg.start_ned[0]),
        leg.end_ned[1] + kept * (east_m - leg.start_ned[1]),
        leg.end_ned[2],
    )


def adrift_s(legs: tuple[Leg, ...]) -> float:
    """Return for how long the water carries a robot before the first of these legs that steers."""
    adrift = 0.0
    for leg in legs:
        if leg.kind in _STEERABLE:
            break
        adrift += leg.duration_s
    return adrift


def wrap(angle_rad: float) -> float:
    """Return the same direction in -pi..pi."""
    return math.remainder(angle_rad, 2.0 * math.pi)
