"""Standard items of a file as places to come to, judged as an upload of them is."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from robot_link.mavlink.wire import grace
from robot_link.service.item_place import (
    ABSOLUTE,
    RELATIVE,
    ItemRefusal,
    changed_speed,
    item_depth_m,
    item_place,
)
from server.plan_file.place import Placement
from server.plan_file.proposal import Findings, LatitudeLongitude, NorthEast, ReadChoices
from server.plan_file.stop import (
    FASTEST_M_S,
    Stop,
    asked_depth,
    reachable,
    taken_depth,
)

_VERTICAL: Final = (2.0, 3.0)
"""SPEED_TYPE of climbs and descents."""
_HOLDS = "a hold of {value:g} s is left out: a robot does not wait at a waypoint"
_STOPS = "does not go on by itself; here the robot goes on"


@dataclass(frozen=True, slots=True)
class FileItem:
    """One item of a mission, as a file has it; NaN where the file has no number."""

    place: str
    """What to call it, such as ``item 4``."""
    command: int
    frame: int
    parameters: tuple[float, float, float, float]
    x: float
    """Latitude, deg; in a local frame north, m."""
    y: float
    """Longitude, deg; in a local frame east, m."""
    z: float | None
    """Altitude, m, as the frame means it; None where the file says none."""
    is_continued: bool = True

    @property
    def place_deg(self) -> LatitudeLongitude | None:
        """Where it is on the globe, if it says so."""
        is_place = self.frame != grace.MAV_FRAME_LOCAL_NED and math.isfinite(self.x + self.y)
        return (self.x, self.y) if is_place else None

    @property
    def words(self) -> str:
        """What it asks for."""
        known = grace.enums["MAV_CMD"].get(self.command)
        if known is None:
            return f"command {self.command}"
        name = known.name.removeprefix("MAV_CMD_").removeprefix("NAV_")
        return f"command {self.command} ({name.lower().replace('_', ' ')})"


class ItemJudge:
    """Turns the items of one file into places to come to, and notes what it does not take."""

    def __init__(self, placement: Placement, choices: ReadChoices, findings: Findings) -> None:
        self.stops: list[Stop] = []
        self.returns = False
        self._placement = placement
        self._choices = choices
        self._findings = findings
        self._speeds: dict[str, float | None] = {"swim": None, "glide": None}
        self._told: dict[str, list[str]] = defaultdict(list)
        self._without_depth: list[tuple[str, Stop]] = []

    def judge(self, items: Sequence[FileItem]) -> None:
        """Take items in their order."""
        for item in items:
            try:
                self._take(item)
            except ItemRefusal as refusal:
                self._findings.refuse(item.place, _value(item), str(refusal))
                if "mean sea level" in str(refusal):
                    self._ask_altitude()
        depth = asked_depth(
            self._findings, [place for place, _ in self._without_depth], self._choices
        )
        for _, stop in self._without_depth:
            stop.depth_m = depth
        for note, places in self._told.items():
            self._findings.notes.append(f"{', '.join(places)}: {note}.")

    def _take(self, item: FileItem) -> None:
        match item.command:
            case grace.MAV_CMD_NAV_WAYPOINT:
                self._refuse_behind_return(item)
                self._come(item)
            case grace.MAV_CMD_DO_CHANGE_SPEED:
                self._change_speed(item)
            case grace.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                self.returns = True
                self._told["the robot returns to the first waypoint, not to a home"].append(
                    item.place
                )
            case grace.MAV_CMD_NAV_LAND if self._choices.land_surfaces:
                self._refuse_behind_return(item)
                self._land(item)
            case _:
                if item.command == grace.MAV_CMD_NAV_LAND:
                    self._findings.ask("land_surfaces", "A landing means coming up at its place")
                self._findings.refuse(
                    item.place, item.words, "cannot be flown by a robot that glides"
                )
                return
        if not item.is_continued:
            self._told[_STOPS].append(item.place)

    def _refuse_behind_return(self, item: FileItem) -> None:
        if self.returns:
            reason = f"{item.words} comes after a return, which ends a design"
            raise ItemRefusal(grace.MAV_MISSION_INVALID_SEQUENCE, reason)

    def _come(self, item: FileItem) -> None:
        place = self._reached(item)
        if place is None:
            return
        if item.z is None:
            stop = Stop(place)
            self._without_depth.append((item.place, stop))
        else:
            unmoved = item_place(item.frame, item.x, item.y, self._placement.water)
            depth = self._depth(item, item.z, unmoved)
            if depth is None:
                return
            stop = Stop(place, depth)
        motion = stop.comes_as("glide")
        stop.speed_m_s = self._speeds[motion]
        hold = item.parameters[0]
        if math.isfinite(hold) and hold > 0.0:
            self._told[_HOLDS.format(value=hold)].append(item.place)
        self.stops.append(stop)

    def _reached(self, item: FileItem) -> NorthEast | None:
        at = item_place(item.frame, item.x, item.y, self._placement.water)
        is_local = item.frame == grace.MAV_FRAME_LOCAL_NED
        place = at if is_local else self._placement.shifted(at)
        return place if reachable(self._placement, self._findings, item.place, place) else None

    def _depth(self, item: FileItem, z: float, place: NorthEast) -> float | None:
        value = f"{z:g} m"
        if self._choices.turns_sign and item.frame in RELATIVE | ABSOLUTE:
            return taken_depth(self._findings, item.place, value, z)
        depth = item_depth_m(item.frame, z, place, self._placement.water)
        if item.frame in ABSOLUTE and self._placement.water.surface_altitude_m:
            self._ask_altitude()
        return taken_depth(self._findings, item.place, value, depth)

    def _ask_altitude(self) -> None:
        self._findings.ask(
            "surface_altitude_m", "How high does this water stand above mean sea level?", "m"
        )

    def _change_speed(self, item: FileItem) -> None:
        motion = "glide" if item.parameters[0] in _VERTICAL else "swim"
        speed = changed_speed(item.parameters[1], self._speeds[motion])
        if speed is not None and speed > FASTEST_M_S:
            reason = f"{speed:g} m/s is faster than the {FASTEST_M_S:g} m/s of a design"
            raise ItemRefusal(grace.MAV_MISSION_INVALID_PARAM2, reason)
        self._speeds[motion] = speed
        if motion == "swim":
            self._told["the speed is for swimming; glides keep the robot's own"].append(item.place)

    def _land(self, item: FileItem) -> None:
        has_place = item.place_deg not in (None, (0.0, 0.0))
        place = self._reached(item) if has_place else None
        if place is not None:
            self.stops.append(Stop(place, surfaces=True))
        elif self.stops and not has_place:
            self.stops[-1].surfaces = True
        elif not has_place:
            self._findings.refuse(item.place, item.words, "it has no place, nor any before it")


def _value(item: FileItem) -> str:
    match item.command:
        case grace.MAV_CMD_NAV_WAYPOINT:
            return "" if item.z is None else f"{item.z:g} m"
        case grace.MAV_CMD_DO_CHANGE_SPEED:
            return f"{item.parameters[1]:g} m/s"
        case _:
            return item.words
