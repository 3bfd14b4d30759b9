"""Where a standard mission item leads and how fast: one judgement for links and for files.

Altitudes of items are positive up, depths positive down from the surface, where home lies.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from autonomy.frames import ned_from_wgs84
from robot_link.mavlink.wire import grace

PositionNed = tuple[float, float, float]
RELATIVE: Final = frozenset(
    (grace.MAV_FRAME_GLOBAL_RELATIVE_ALT, grace.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
)
ABSOLUTE: Final = frozenset((grace.MAV_FRAME_GLOBAL, grace.MAV_FRAME_GLOBAL_INT))
TERRAIN: Final = frozenset(
    (grace.MAV_FRAME_GLOBAL_TERRAIN_ALT, grace.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT)
)
GLOBAL: Final = RELATIVE | ABSOLUTE | TERRAIN
ABOVE_M: Final = 0.5
"""A waypoint at the surface may be so much above it: whoever sets it knows the level no better."""
_NO_CHANGE: Final = -1.0
_DEFAULT_SPEED: Final = -2.0


class ItemRefusal(ValueError):  # noqa: N818 - an answer, as others of this name
    """An item cannot be flown; the message is the reason, the caller knows its number."""

    def __init__(self, result: int, reason: str, value: float | None = None) -> None:
        """Take the MAV_MISSION_RESULT, the reason and the number at fault, if it is one."""
        super().__init__(reason)
        self.result = result
        self.value = value


@dataclass(frozen=True, slots=True)
class ItemWater:
    """What of a water decides where an item is."""

    origin_latitude_deg: float
    """Origin of the water's frame."""
    origin_longitude_deg: float
    """Origin of the water's frame."""
    surface_altitude_m: float | None = 0.0
    """How high the surface stands above mean sea level; None where nobody knows."""
    floor_m: Callable[[float, float], float] | None = None
    """Depth of the floor at north, east; None where it is not charted."""


def item_position(frame: int, x: float, y: float, z: float, water: ItemWater) -> PositionNed:
    """Return where an item is; its depth may be negative.

    Args:
        frame: MAV_FRAME.
        x: Latitude, deg; in the local frame north, m.
        y: Longitude, deg; in the local frame east, m.
        z: Altitude as the frame means it, m.
        water: Where the robot is.

    Raises:
        ItemRefusal: If the item says no place, or one that nobody can tell in this water.
    """
    if not math.isfinite(z):
        raise ItemRefusal(grace.MAV_MISSION_INVALID_PARAM7, "it has no altitude")
    north, east = item_place(frame, x, y, water)
    return north, east, item_depth_m(frame, z, (north, east), water)


def item_place(frame: int, x: float, y: float, water: ItemWater) -> tuple[float, float]:
    """Return north and east of an item, m; arguments as of ``item_position``.

    Raises:
        ItemRefusal: If the item says no place.
    """
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ItemRefusal(grace.MAV_MISSION_INVALID_PARAM5_X, "it has no place")
    if frame == grace.MAV_FRAME_LOCAL_NED:
        return x, y
    if frame not in GLOBAL:
        reason = f"frame {frame} is not known"
        raise ItemRefusal(grace.MAV_MISSION_UNSUPPORTED_FRAME, reason, frame)
    if abs(x) > 90.0:
        reason = f"no such place: latitude {x:g} deg"
        raise ItemRefusal(grace.MAV_MISSION_INVALID_PARAM5_X, reason, x)
    if abs(y) > 180.0:
        reason = f"no such place: longitude {y:g} deg"
        raise ItemRefusal(grace.MAV_MISSION_INVALID_PARAM6_Y, reason, y)
    if x == 0.0 and y == 0.0:
        reason = "latitude 0, longitude 0 stands for no place"
        raise ItemRefusal(grace.MAV_MISSION_INVALID_PARAM5_X, reason, 0.0)
    origin = (water.origin_latitude_deg, water.origin_longitude_deg)
    north, east = ned_from_wgs84(x, y, *origin).tolist()
    return north, east


def item_depth_m(frame: int, z: float, place: tuple[float, float], water: ItemWater) -> float:
    """Return the depth that an item's altitude means; negative above the water.

    Raises:
        ItemRefusal: If what the altitude counts from is not known in this water.
    """
    if frame == grace.MAV_FRAME_LOCAL_NED:
        return z
    if frame in RELATIVE:
        return -z
    if frame in ABSOLUTE:
        if water.surface_altitude_m is None:
            reason = f"{z:g} m is above mean sea level, and nobody said how high this water stands"
            raise ItemRefusal(grace.MAV_MISSION_INVALID_PARAM7, reason, z)
        return water.surface_altitude_m - z
    if water.floor_m is None:
        reason = f"frame {frame}: {z:g} m above the floor cannot be planned, the floor is unknown"
        raise ItemRefusal(grace.MAV_MISSION_UNSUPPORTED_FRAME, reason, z)
    return water.floor_m(*place) - z


def below_surface(depth_m: float) -> float:
    """Return a depth; what is hardly above the water is at its surface.

    Raises:
        ItemRefusal: If it is above the water.
    """
    if depth_m < -ABOVE_M:
        reason = f"it is {-depth_m:.1f} m above the water"
        raise ItemRefusal(grace.MAV_MISSION_INVALID_PARAM7, reason, -depth_m)
    return max(0.0, depth_m)


def changed_speed(asked_m_s: float, present_m_s: float | None) -> float | None:
    """Return the speed after an item that changes it; None is the vehicle's own.

    Raises:
        ItemRefusal: If what is asked for is no speed.
    """
    if asked_m_s == _NO_CHANGE:
        return present_m_s
    if asked_m_s == _DEFAULT_SPEED:
        return None
    if not (math.isfinite(asked_m_s) and asked_m_s > 0.0):
        reason = f"{asked_m_s:g} m/s is no speed"
        raise ItemRefusal(grace.MAV_MISSION_INVALID_PARAM2, reason, asked_m_s)
    return asked_m_s
