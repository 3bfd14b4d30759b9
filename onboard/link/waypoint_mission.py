"""Standard mission items as this project's legs, and back; pure.

A waypoint at the depth of the one before it is swum to, one at another depth is glided to; a
waypoint straight above or below is a dive. Where the slope is too flat for a glide, the flattest
one is followed by a swim; where it is too steep, a dive comes before the steepest one. The ends of
the legs are the waypoints themselves, and what was added is told. What a gliding robot cannot fly
is refused by the number of the item: loiters, jumps, take-offs, places above the water or too deep.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from autonomy.frames import wgs84_from_ned
from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind
from robot_link.mavlink.wire import grace
from robot_link.mission import Mission, MissionSettings
from robot_link.service.item_place import (
    GLOBAL,
    ItemRefusal,
    ItemWater,
    below_surface,
    changed_speed,
    item_position,
)
from robot_link.service.standard_item import StandardItem

_DEGREES = 1e-7
_LOCAL_M = 1e-4
_SAME_M = 0.01
_SLOPE_DEG = 0.1
"""So much a slope may exceed the robot's window: less than any robot holds its angle."""


class WaypointRefusal(ValueError):  # noqa: N818 - an answer, as others of this name
    """An item cannot be flown; the message names it."""

    def __init__(self, number: int, result: int, reason: str) -> None:
        """Name the item, the MAV_MISSION_RESULT and the reason."""
        super().__init__(f"item {number}: {reason}")
        self.result = result


_SETTINGS = MissionSettings(2.0, 20.0, 60.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class WaypointRules:
    """How a robot flies waypoints that name no speed, and what it can fly."""

    origin_latitude_deg: float
    """Origin of the site's frame."""
    origin_longitude_deg: float
    """Origin of the site's frame."""
    swim_speed_m_s: float = 0.2
    """Speed over ground at constant depth."""
    vertical_speed_m_s: float = 0.1
    """Vertical speed of a glide or dive."""
    flattest_glide_deg: float = 10.0
    """Least slope of a glide, from the horizontal."""
    steepest_glide_deg: float = 60.0
    """Greatest slope of a glide; a vertical way is a dive."""
    depth_max_m: float = 50.0
    """Greatest depth."""
    settings: MissionSettings = _SETTINGS
    """What holds for every such mission; its timeout is added to that of the duration."""
    timeout_factor: float = 3.0
    """The mission ends after so many times its planned duration."""


_TOO_FLAT, _TOO_STEEP = "too flat for one glide, a swim is added", "too steep, a dive is added"


def _unheard(_note: str) -> None:
    """Do not want to know."""


def mission_of_waypoints(
    items: Sequence[StandardItem],
    start: PositionNed,
    rules: WaypointRules,
    tell: Callable[[str], None] = _unheard,
) -> Mission:
    """Build the mission that standard items describe.

    Args:
        items: The items in order.
        start: Where the robot is; the first leg begins there, at the surface.
        rules: How waypoints are flown.
        tell: Called with a sentence on waypoints that are reached in another way than by one leg.

    Raises:
        WaypointRefusal: If an item cannot be flown, or none is a waypoint.
    """
    here: PositionNed = (start[0], start[1], 0.0)
    speed_m_s = rules.swim_speed_m_s
    legs: list[Leg] = []
    added: dict[str, list[int]] = {_TOO_FLAT: [], _TOO_STEEP: []}
    for number, item in enumerate(items):
        match item.command:
            case grace.MAV_CMD_NAV_WAYPOINT:
                there = _place(number, item, rules)
                if _distance(here, there) > _SAME_M:
                    way, note = _way(here, there, speed_m_s, rules)
                    legs += way
                    if note:
                        added[note].append(number)
                    here = there
            case grace.MAV_CMD_DO_CHANGE_SPEED:
                speed_m_s = _speed(number, item, speed_m_s, rules)
            case grace.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                legs += _up(here, rules)
                here = (here[0], here[1], 0.0)
                home: PositionNed = (start[0], start[1], 0.0)
                if _distance(here, home) > _SAME_M:
                    legs += _way(here, home, speed_m_s, rules)[0]
                    here = home
            case _:
                reason = f"command {item.command} cannot be flown by a glider"
                raise WaypointRefusal(number, grace.MAV_MISSION_UNSUPPORTED, reason)
    legs += _up(here, rules)
    for note, numbers in added.items():
        if numbers:
            plural = "s" if len(numbers) > 1 else ""
            tell(f"item{plural} {', '.join(map(str, numbers))}: {note}")
    if not legs:
        raise WaypointRefusal(0, grace.MAV_MISSION_INVALID, "the mission leads nowhere")
    duration_s = sum(leg.duration_s for leg in legs)
    patience_s = math.ceil(rules.timeout_factor * duration_s) + rules.settings.timeout_s
    settings = replace(rules.settings, timeout_s=patience_s, start_x_m=start[0], start_y_m=start[1])
    try:
        return Mission.from_legs(settings, tuple(legs))
    except ValueError as error:
        raise WaypointRefusal(0, grace.MAV_MISSION_INVALID, str(error)) from error


def waypoints_of_mission(mission: Mission, rules: WaypointRules) -> tuple[StandardItem, ...]:
    """Return the ends of a mission's legs as waypoints, for whoever reads it back."""
    return tuple(_waypoint(leg.end_ned, rules) for leg in mission.legs)


def _waypoint(place: PositionNed, rules: WaypointRules) -> StandardItem:
    origin = (rules.origin_latitude_deg, rules.origin_longitude_deg)
    latitude, longitude = wgs84_from_ned(place[:2], *origin).tolist()
    return StandardItem(
        command=grace.MAV_CMD_NAV_WAYPOINT,
        frame=grace.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        x=round(latitude / _DEGREES),
        y=round(longitude / _DEGREES),
        z=-place[2],
    )


def _place(number: int, item: StandardItem, rules: WaypointRules) -> PositionNed:
    unit = _DEGREES if item.frame in GLOBAL else _LOCAL_M
    water = ItemWater(rules.origin_latitude_deg, rules.origin_longitude_deg)
    try:
        place = item_position(item.frame, item.x * unit, item.y * unit, item.z, water)
        if place[2] > rules.depth_max_m:
            reason = f"{place[2]:.1f} m is deeper than {rules.depth_max_m:g} m"
            raise WaypointRefusal(number, grace.MAV_MISSION_INVALID_PARAM7, reason)
        return (*place[:2], below_surface(place[2]))
    except ItemRefusal as refusal:
        raise WaypointRefusal(number, refusal.result, str(refusal)) from refusal


def _speed(number: int, item: StandardItem, speed_m_s: float, rules: WaypointRules) -> float:
    try:
        asked = changed_speed(item.parameters[1], speed_m_s)
    except ItemRefusal as refusal:
        raise WaypointRefusal(number, refusal.result, str(refusal)) from refusal
    return rules.swim_speed_m_s if asked is None else asked


def _way(
    here: PositionNed, there: PositionNed, speed_m_s: float, rules: WaypointRules
) -> tuple[list[Leg], str]:
    """Return the legs that lead from one waypoint to the next, and what had to be added."""
    heading = math.atan2(there[1] - here[1], there[0] - here[0])
    along = math.dist(here[:2], there[:2])
    down = abs(there[2] - here[2])
    if down <= _SAME_M:
        return [_swim(here, there, speed_m_s, heading)], ""
    vertical = rules.vertical_speed_m_s
    if along <= _SAME_M:
        return [_vertical(PrimitiveKind.DIVE, here, there, vertical, heading)], ""
    slope_deg = math.degrees(math.atan2(down, along))
    if slope_deg < rules.flattest_glide_deg - _SLOPE_DEG:
        part = down / math.tan(math.radians(rules.flattest_glide_deg)) / along
        north, east = (a + part * (b - a) for a, b in zip(here[:2], there[:2], strict=True))
        between: PositionNed = (north, east, there[2])
        glide = _vertical(PrimitiveKind.GLIDE, here, between, vertical, heading)
        return [glide, _swim(between, there, speed_m_s, heading)], _TOO_FLAT
    if slope_deg > rules.steepest_glide_deg + _SLOPE_DEG:
        glided = along * math.tan(math.radians(rules.steepest_glide_deg))
        between = (here[0], here[1], there[2] - math.copysign(glided, there[2] - here[2]))
        dive = _vertical(PrimitiveKind.DIVE, here, between, vertical, heading)
        glide = _vertical(PrimitiveKind.GLIDE, between, there, vertical, heading)
        return [dive, glide], _TOO_STEEP
    return [_vertical(PrimitiveKind.GLIDE, here, there, vertical, heading)], ""


def _swim(here: PositionNed, there: PositionNed, speed_m_s: float, heading_rad: float) -> Leg:
    duration_s = math.dist(here[:2], there[:2]) / speed_m_s
    return _built(PrimitiveKind.SWIM, here, there, speed_m_s, duration_s, heading_rad)


def _vertical(
    kind: PrimitiveKind, here: PositionNed, there: PositionNed, speed_m_s: float, heading_rad: float
) -> Leg:
    """Return a leg whose speed is its vertical one."""
    duration_s = abs(there[2] - here[2]) / speed_m_s
    return _built(kind, here, there, speed_m_s, duration_s, heading_rad)


def _up(here: PositionNed, rules: WaypointRules) -> list[Leg]:
    if here[2] <= _SAME_M:
        return []
    surface: PositionNed = (here[0], here[1], 0.0)
    vertical = rules.vertical_speed_m_s
    return [_built(PrimitiveKind.DIVE, here, surface, vertical, here[2] / vertical, 0.0)]


def _built(
    kind: PrimitiveKind,
    here: PositionNed,
    there: PositionNed,
    speed_m_s: float,
    duration_s: float,
    heading_rad: float,
) -> Leg:
    return Leg(kind, here, there, speed_m_s, duration_s, 0.0, heading_rad)


def _distance(here: PositionNed, there: PositionNed) -> float:
    return math.dist(here, there)
