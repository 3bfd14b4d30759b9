"""Designs moved as a whole, and designs made of the legs of a plan."""

import math
from collections.abc import Sequence
from typing import Any

from autonomy.design.document import (
    RELATIVE_ROWS,
    WAYPOINTS_MAX,
    Design,
    Manner,
    Spot,
    StationKeep,
    SurfacingRules,
    Way,
    Waypoint,
)
from autonomy.planner.plan import Leg, PrimitiveKind

_AT_SURFACE_M = 1e-3


def shifted(design: Design, north_m: float, east_m: float) -> Design:
    """Return a design with every place moved by so much.

    Raises:
        ValidationError: If a place leaves what a design may hold.
    """
    if north_m == 0.0 and east_m == 0.0:
        return design
    return Design.model_validate(_moved(design.model_dump(mode="json"), north_m, east_m))


def _moved(value: Any, north_m: float, east_m: float) -> Any:  # noqa: ANN401 - JSON
    if isinstance(value, list):
        return [_moved(one, north_m, east_m) for one in value]
    if not isinstance(value, dict):
        return value
    inner = {
        key: one if key == RELATIVE_ROWS else _moved(one, north_m, east_m)
        for key, one in value.items()
    }
    if {"north_m", "east_m"} <= inner.keys():
        inner["north_m"] += north_m
        inner["east_m"] += east_m
    return inner


def design_of_legs(legs: Sequence[Leg]) -> Design:
    """Return waypoints that lead along a plan's legs: one at each surfacing.

    What a design cannot say, such as a spiral on the way, becomes the glide between the places
    where the robot comes up. A single stay at the surface becomes one again; of others the place
    alone is left.

    Raises:
        ValueError: If there are no legs, or more surfacings than waypoints are allowed.
    """
    if not legs:
        raise ValueError("the plan has no legs")
    if len(legs) == 1 and legs[0].kind is PrimitiveKind.KEEP:
        return _stay(legs[0])
    legs = [leg for leg in legs if leg.kind is not PrimitiveKind.KEEP]
    if not legs:
        raise ValueError("the plan only stays at several places")
    first = legs[0].start_ned
    waypoints = [Waypoint(north_m=first[0], east_m=first[1])]
    dive: list[Leg] = []
    for leg in legs:
        dive.append(leg)
        if leg.end_ned[2] <= _AT_SURFACE_M:
            waypoints.append(_waypoint(dive))
            dive = []
    if len(waypoints) > WAYPOINTS_MAX:
        raise ValueError(
            f"the plan comes up {len(waypoints) - 1} times; a design has at most {WAYPOINTS_MAX}"
            " waypoints"
        )
    return Design(
        content=Way(waypoints=tuple(waypoints)), manner=Manner(), surfacing=SurfacingRules()
    )


def _waypoint(dive: Sequence[Leg]) -> Waypoint:
    """Return the place where a dive comes up, and how the robot comes there."""
    end, deep_m = dive[-1].end_ned, max(leg.end_ned[2] for leg in dive)
    if deep_m <= _AT_SURFACE_M:
        speed_m_s = dive[-1].speed_m_s
        return Waypoint(north_m=end[0], east_m=end[1], motion="swim", speed_m_s=speed_m_s)
    glides = [leg for leg in dive if leg.kind is PrimitiveKind.GLIDE]
    across_m = sum(math.dist(leg.start_ned[:2], leg.end_ned[:2]) for leg in glides)
    down_m = sum(abs(leg.end_ned[2] - leg.start_ned[2]) for leg in glides)
    return Waypoint(
        north_m=end[0],
        east_m=end[1],
        motion="glide",
        deep_m=deep_m,
        glide_angle_rad=math.atan2(down_m, across_m) if across_m > 0.0 else None,
        speed_m_s=[leg for leg in dive if leg.kind is not PrimitiveKind.SWIM][-1].speed_m_s,
    )


def _stay(leg: Leg) -> Design:
    place = Spot(north_m=leg.end_ned[0], east_m=leg.end_ned[1])
    stay = StationKeep(place=place, radius_m=leg.radius_m, duration_s=leg.duration_s)
    return Design(content=stay, manner=Manner(swim_speed_m_s=leg.speed_m_s))
