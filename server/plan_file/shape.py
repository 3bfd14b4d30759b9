"""Lines, areas and marks of KML and GeoJSON as the parts of a design."""

import math
from collections.abc import Sequence

from server.plan_file.field import number_of
from server.plan_file.place import Placement, add_area, add_mark, middle_of
from server.plan_file.proposal import AreaRole, Findings, LatitudeLongitude, ReadChoices
from server.plan_file.stop import Stop, asked_depth, reachable, taken_depth
from server.water.proposal import Shape

WAYPOINTS = "waypoints"
"""Word of a line that stands for a single waypoint: the formats want two points of a line."""
_CLAMPED = ("", "clampToGround")
_ABOVE_FLOOR = ("relativeToSeaFloor", "clampToSeaFloor")


def middle_of_shapes(shapes: Sequence[Shape]) -> LatitudeLongitude | None:
    """Return the middle of the lines, or else of all shapes."""
    lines = [shape for shape in shapes if shape.geometry == "line"] or shapes
    return middle_of([at for shape in lines for ring in shape.rings for at in ring])


class ShapeJudge:
    """Turns the shapes of one file into places to come to, areas and marks.

    Args:
        placement: Where the file lies in the water.
        choices: What the operator said.
        findings: Takes areas, marks and what is not taken.
        is_kml: Whether heights hold only where ``altitudeMode`` says so.
    """

    def __init__(
        self, placement: Placement, choices: ReadChoices, findings: Findings, *, is_kml: bool
    ) -> None:
        self.stops: list[Stop] = []
        self._placement = placement
        self._choices = choices
        self._findings = findings
        self._is_kml = is_kml
        self._without_depth: list[tuple[str, Stop]] = []

    def judge(self, shapes: Sequence[Shape]) -> None:
        """Take shapes in their order."""
        lines = [shape for shape in shapes if shape.geometry == "line"]
        if len(lines) > 1:
            self._findings.notes.append(
                f"{len(lines)} lines are flown one after the other, in the file's order."
            )
        for shape in shapes:
            match shape.geometry:
                case "line":
                    self._fly(shape)
                case "polygon":
                    self._add_areas(shape)
                case "point":
                    place = f"feature {shape.number}"
                    name = shape.name or f"Place {shape.number}"
                    at = shape.rings[0][0]
                    add_mark(self._findings, self._placement, place, "place", at, name)
        places = [place for place, _ in self._without_depth]
        depth = asked_depth(self._findings, places, self._choices)
        for _, stop in self._without_depth:
            stop.depth_m = depth

    def _add_areas(self, shape: Shape) -> None:
        place = f"feature {shape.number}"
        if not shape.are_closed and not self._is_kml:
            reason = "its ring does not close: the last corner must be the first (RFC 7946)"
            self._findings.refuse(place, f"polygon of {len(shape.rings[0])} corners", reason)
            return
        said = str(shape.words.get("role") or "").lower().replace("-", "_")
        role: AreaRole = "outline"
        if said in ("keep_out", "survey"):
            role = said
        add_area(self._findings, self._placement, place, role, shape.rings[0], shape.name)
        for number, hole in enumerate(shape.rings[1:], start=1):
            name = f"Hole {number} of {shape.name}" if shape.name else f"Hole {number}"
            of = f"{place}, hole {number}"
            add_area(self._findings, self._placement, of, "keep_out", hole, name)

    def _fly(self, shape: Shape) -> None:
        said = shape.words.get("depth_m")
        heights: Sequence[float | None] = shape.heights_m
        if self._is_kml and shape.altitude_mode in _CLAMPED:
            if any(heights):
                self._findings.notes.append(
                    f"feature {shape.number}: its heights are left out: KML clamps them to the"
                    " ground."
                )
            heights = [None] * len(heights)
        vertices = list(zip(shape.rings[0], heights, strict=True))
        if str(shape.words.get(WAYPOINTS)) == "1":
            del vertices[1:]
        for number, (at, height) in enumerate(vertices, start=1):
            place = f"feature {shape.number}, point {number}"
            if at == (0.0, 0.0):
                reason = "latitude 0, longitude 0 stands for no place"
                self._findings.refuse(place, "0, 0", reason)
                continue
            where = self._placement.place(*at)
            if not reachable(self._placement, self._findings, place, where):
                continue
            stop = Stop(where)
            if said is None and height is None:
                self._without_depth.append((place, stop))
            else:
                stop.depth_m = self._depth(place, shape.altitude_mode, at, said, height)
                if stop.depth_m is None:
                    continue
            self.stops.append(stop)

    def _depth(
        self, place: str, mode: str, at: LatitudeLongitude, said: object, height: float | None
    ) -> float | None:
        sign = -1.0 if self._choices.turns_sign else 1.0
        if said is not None:
            self._findings.says_depths = True
            depth = number_of(said) if not isinstance(said, str) else _number(said)
            return taken_depth(self._findings, place, f"depth_m {said!s:.20}", sign * depth)
        value = f"{height:g} m"
        if mode in _ABOVE_FLOOR:
            if self._placement.water.floor_m is None:
                reason = "above the floor cannot be planned, the floor is unknown"
                self._findings.refuse(place, value, reason)
                return None
            floor = self._placement.water.floor_m(*self._placement.unshifted(at))
            return taken_depth(self._findings, place, value, floor - (height or 0.0))
        return taken_depth(self._findings, place, value, -sign * (height or 0.0))


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
