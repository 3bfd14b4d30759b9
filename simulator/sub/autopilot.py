"""What the submarine does by itself: modes, arming, its mission, and what it says in sentences."""

import math
from collections.abc import Sequence
from typing import Final

from autonomy.frames import ned_from_wgs84
from autonomy.site import Site
from onboard.link.mission_server import MissionVerdict
from robot_link.mavlink.flight_mode import SUB_MODES
from robot_link.mavlink.wire import grace
from robot_link.service.standard_item import StandardItem
from simulator.sub.plant import IDLE, Demand, SubPlant

MODES: Final = {name: number for number, name in SUB_MODES.items()}
SUPPORTED: Final = ("MANUAL", "STABILIZE", "ALT_HOLD", "AUTO", "GUIDED", "POSHOLD", "SURFACE")
_RELATIVE: Final = (
    grace.MAV_FRAME_GLOBAL_RELATIVE_ALT,
    grace.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
)
_FLOWN: Final = (grace.MAV_CMD_NAV_WAYPOINT, grace.MAV_CMD_NAV_LOITER_TIME)
_KNOWN: Final = (*_FLOWN, grace.MAV_CMD_DO_CHANGE_SPEED, grace.MAV_CMD_NAV_RETURN_TO_LAUNCH)
_SURFACE_M: Final = 0.15
_REACHED_DOWN_M: Final = 0.4
_PILOT_TIMEOUT_S: Final = 3.0
"""As of ArduSub's FS_PILOT_TIMEOUT: a stick that is older is in the middle."""
_NEEDS_ARMING: Final = ("AUTO", "GUIDED", "POSHOLD")


class SubAutopilot:
    """Decides a demand at each step. Belongs to one event loop."""

    def __init__(self, site: Site, plant: SubPlant) -> None:
        self._site = site
        self._plant = plant
        self.mode = MODES["MANUAL"]
        self.is_armed = False
        self.items: tuple[StandardItem, ...] = ()
        """The mission; item 0 is its home."""
        self.item = 0
        self.speed_m_s = 0.6
        self.radius_m = 2.0
        self.is_leaking = False
        self.surfaces_on_leak = False
        self.words: list[tuple[int, str]] = []
        """Severity and text of what waits to be said."""
        self._held: tuple[float, float, float] = (plant.north_m, plant.east_m, 0.0)
        self._stick = IDLE
        self._steered_s = -math.inf

    @property
    def mode_name(self) -> str:
        """Name of the mode."""
        return SUB_MODES[self.mode]

    @property
    def home(self) -> StandardItem:
        """Return the item 0 of every mission: where the vehicle is at home."""
        return StandardItem(
            grace.MAV_CMD_NAV_WAYPOINT,
            grace.MAV_FRAME_GLOBAL,
            round(self._site.origin_latitude_deg * 1e7),
            round(self._site.origin_longitude_deg * 1e7),
            0.0,
        )

    def arm(self, is_armed: bool) -> bool:
        """Arm or disarm; tell whether that was possible."""
        if is_armed and self._plant.charge < 0.05:
            self.say(grace.MAV_SEVERITY_CRITICAL, "Arm: battery below minimum arming voltage")
            return False
        if is_armed != self.is_armed:
            self.say(grace.MAV_SEVERITY_INFO, "Arming motors" if is_armed else "Disarming motors")
        self.is_armed = is_armed
        return True

    def enter(self, mode: int) -> bool:
        """Change the mode; tell whether that was possible."""
        name = SUB_MODES.get(mode, "")
        if name not in SUPPORTED:
            self.say(grace.MAV_SEVERITY_WARNING, f"Mode change to {name or mode} failed")
            return False
        if name in _NEEDS_ARMING and not self.is_armed:
            self.say(grace.MAV_SEVERITY_WARNING, f"Mode change to {name} failed: not armed")
            return False
        if name == "AUTO" and len(self.items) < 2:
            self.say(grace.MAV_SEVERITY_WARNING, "Mode change to AUTO failed: no mission")
            return False
        if name == "AUTO" and self.item == 0:
            self.item = 1
        self.mode = mode
        self._held = (self._plant.north_m, self._plant.east_m, self._plant.depth_m)
        self._stick = IDLE
        return True

    def go_to(self, north_m: float, east_m: float, depth_m: float) -> None:
        """Take a place to go to in GUIDED."""
        self._held = (north_m, east_m, max(0.0, depth_m))

    def steer(self, demand: Demand) -> None:
        """Take what the pilot's sticks say."""
        self._stick = demand
        self._steered_s = self._plant.time_s

    def take(self, items: Sequence[StandardItem]) -> MissionVerdict:
        """Put a mission on board, or refuse it with the first item that it cannot fly."""
        for number, item in enumerate(items[1:], start=1):
            if item.command not in _KNOWN:
                reason = f"item {number}: command {item.command} is not supported"
                return MissionVerdict(grace.MAV_MISSION_UNSUPPORTED, reason)
            if item.command not in _FLOWN:
                continue
            if item.frame not in _RELATIVE:
                reason = f"item {number}: frame {item.frame} is not supported"
                return MissionVerdict(grace.MAV_MISSION_UNSUPPORTED_FRAME, reason)
            if item.z > 0.0:
                reason = f"item {number}: altitude {item.z:g} m is above the surface"
                return MissionVerdict(grace.MAV_MISSION_INVALID_PARAM7, reason)
            deepest_m = self._site.water.depth_max_m
            if -item.z > deepest_m:
                reason = f"item {number}: {-item.z:g} m is deeper than {deepest_m:g} m"
                return MissionVerdict(grace.MAV_MISSION_INVALID_PARAM7, reason)
        self.items = (self.home, *items[1:])
        self.item = 1 if len(self.items) > 1 else 0
        return MissionVerdict()

    def leak(self) -> None:
        """Find water inside."""
        self.is_leaking = True
        self.say(grace.MAV_SEVERITY_CRITICAL, "Leak Detected")
        if self.surfaces_on_leak and self.is_armed:
            self.enter(MODES["SURFACE"])

    def say(self, severity: int, text: str) -> None:
        """Say a sentence soon."""
        self.words.append((severity, text))

    def demand(self) -> Demand:
        """Return what the motors are to do now."""
        if not self.is_armed:
            return IDLE
        if self._plant.time_s - self._steered_s > _PILOT_TIMEOUT_S:
            self._stick = IDLE
        match self.mode_name:
            case "SURFACE":
                is_up = self._plant.depth_m <= _SURFACE_M
                return Demand(down=-0.2 if is_up else -0.8)
            case "ALT_HOLD":
                return self._steered(self._down_to(self._held[2] - 5.0 * self._stick.down))
            case "POSHOLD" | "GUIDED":
                return self._towards(*self._held)
            case "AUTO":
                return self._mission()
            case _:
                return self._stick

    def _steered(self, down: float) -> Demand:
        stick = self._stick
        return Demand(stick.forward, stick.right, down, stick.turn)

    def _down_to(self, depth_m: float) -> float:
        return min(max(1.5 * (depth_m - self._plant.depth_m), -1.0), 1.0)

    def _towards(self, north_m: float, east_m: float, depth_m: float) -> Demand:
        plant = self._plant
        north, east = north_m - plant.north_m, east_m - plant.east_m
        away_m = math.hypot(north, east)
        off_rad = math.remainder(math.atan2(east, north) - plant.heading_rad, 2.0 * math.pi)
        is_near = away_m < 0.5
        turn = 0.0 if is_near else min(max(1.5 * off_rad, -1.0), 1.0)
        speed = min(self.speed_m_s / 0.9, 0.4 * away_m) * max(0.0, math.cos(off_rad))
        return Demand(forward=speed, down=self._down_to(depth_m), turn=turn)

    def _mission(self) -> Demand:
        while self.item < len(self.items):
            item = self.items[self.item]
            if item.command == grace.MAV_CMD_DO_CHANGE_SPEED:
                self.speed_m_s = min(max(item.parameters[1], 0.1), 0.9)
            elif item.command in _FLOWN:
                north_m, east_m = place_of(item, self._site)
                off_m = math.hypot(north_m - self._plant.north_m, east_m - self._plant.east_m)
                is_deep = abs(-item.z - self._plant.depth_m) <= _REACHED_DOWN_M
                if off_m > self.radius_m or not is_deep:
                    return self._towards(north_m, east_m, -item.z)
                self.say(grace.MAV_SEVERITY_INFO, f"Reached waypoint #{self.item}")
            else:
                break
            self.item += 1
        self.item = 0
        self.say(grace.MAV_SEVERITY_INFO, "Mission complete")
        self.enter(MODES["SURFACE"])
        return self.demand()


def place_of(item: StandardItem, site: Site) -> tuple[float, float]:
    """Return north and east of an item in a site's frame, m."""
    ned = ned_from_wgs84(
        item.x / 1e7, item.y / 1e7, site.origin_latitude_deg, site.origin_longitude_deg
    )
    return float(ned[0]), float(ned[1])
