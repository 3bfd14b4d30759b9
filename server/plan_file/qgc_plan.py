"""QGroundControl's ``.plan``: items and surveys as waypoints or an area, fences, rally points.

Source: the plan file format of QGroundControl, version 1, and its writers.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from autonomy.design.document import Design
from autonomy.frames import wgs84_from_ned
from autonomy.site import Site
from robot_link.mavlink.wire import grace
from server.plan_file import own_part
from server.plan_file.field import (
    Document,
    list_at,
    number_of,
    object_at,
    pair_of,
    pairs_of,
    whole_of,
)
from server.plan_file.item import FileItem, ItemJudge
from server.plan_file.place import Placement, add_area, add_mark, middle_of
from server.plan_file.proposal import AreaRole, Findings, LatitudeLongitude, ReadArea, ReadChoices
from server.plan_file.stop import (
    FASTEST_M_S,
    SurveyManner,
    design_of,
    lawnmower_of,
    offer_sign,
)
from server.water.proposal import ReadingError

ITEMS_MAX = 10_000
CIRCLE_CORNERS: Final = 64
ABOVE_TERRAIN: Final = 3
"""AltitudeMode of an altitude that QGroundControl works out from one above the ground."""
_SURVEY_VERSIONS = (2, 3, 4, 5, 6)
_KEYS = {"fileType", "version", "groundStation", "mission", "geoFence", "rallyPoints"}


@dataclass(slots=True)
class Survey:
    """A survey of an area by another program."""

    place: str
    ring: list[LatitudeLongitude]
    manner: SurveyManner
    transects: list[FileItem]
    height_m: float
    area: ReadArea | None = None


@dataclass(slots=True)
class QgcMission:
    """The parts of a file, before they are placed in a water."""

    items: list[FileItem] = field(default_factory=list)
    """Without those of surveys."""
    surveys: list[Survey] = field(default_factory=list)
    order: list[FileItem | Survey] = field(default_factory=list)
    complex_refused: list[tuple[str, str]] = field(default_factory=list)


class QgcPlanFile:
    """One ``.plan``, read and checked; ``design`` brings it into a water.

    Raises:
        ReadingError: If it is no plan of this version.
    """

    def __init__(self, document: Document, findings: Findings) -> None:
        _check_head(document)
        self._document = document
        self._findings = findings
        self._mission = object_at(document, "mission")
        if self._mission and self._mission.get("version") != 2:
            version = self._mission.get("version")
            raise ReadingError(("mission.version", f"{version!r:.20} is not taken, 2 is"))
        self._parts = self._read_items()
        others = sorted(set(document) - _KEYS - {own_part.KEY})
        if others:
            findings.notes.append(f"Left out, not known: {', '.join(others)[:200]}.")
        self.surveys: dict[int, SurveyManner] = {}
        """How each survey covers its area, by the area's number."""

    def middle_deg(self) -> LatitudeLongitude | None:
        """Return the middle of what is flown, or else of the fences."""
        places = [item.place_deg for item in self._parts.items if item.place_deg]
        places += [corner for survey in self._parts.surveys for corner in survey.ring]
        if not places:
            polygons = list_at(object_at(self._document, "geoFence"), "polygons", "geoFence.")
            for polygon in polygons:
                ring = pairs_of(polygon.get("polygon")) if isinstance(polygon, dict) else None
                places += ring or []
        return middle_of(places)

    def design(self, placement: Placement, choices: ReadChoices, site: Site) -> Design:
        """Return the design, and note down areas, marks and what is not taken."""
        findings, parts = self._findings, self._parts
        for place, value in parts.complex_refused:
            findings.refuse(place, value, "cannot be flown by a robot that glides")
        for survey in parts.surveys:
            survey.area = add_area(findings, placement, survey.place, "survey", survey.ring)
            if survey.area is not None:
                self.surveys[survey.area.number] = survey.manner
        self._add_fences(placement)
        self._add_marks(placement)
        kept = self._kept(placement, choices, site)
        return kept or self._drawn(placement, choices)

    def _kept(self, placement: Placement, choices: ReadChoices, site: Site) -> Design | None:
        """Return the design that the file keeps of ours, if it still goes with its items."""
        if not own_part.is_of_file(self._document):
            return None
        part = self._document[own_part.KEY]
        origin = pair_of(part.get("origin")) if isinstance(part, dict) else None
        is_here = origin == (site.origin_latitude_deg, site.origin_longitude_deg)

        def brought(place: LatitudeLongitude) -> tuple[float, float]:
            return placement.place(*place)

        is_moving = placement.is_moved or not is_here
        found = own_part.kept_design(part, self._parts.items, site, brought if is_moving else None)
        if isinstance(found, Design):
            if not choices.turns_sign and choices.area is None:
                return found
            found = "gives way to what was chosen"
        self._findings.notes.append(
            f"What Grace Ground Station kept in the file {found}; it is left out."
        )
        return None

    def _drawn(self, placement: Placement, choices: ReadChoices) -> Design:
        findings, parts = self._findings, self._parts
        flown = [
            item
            for each in parts.order
            for item in (
                [each]
                if isinstance(each, FileItem)
                else each.transects
                if choices.takes_transects
                else []
            )
        ]
        judge = ItemJudge(placement, choices, findings)
        judge.judge(flown)
        speed = self._cruise_speed()
        areas = [survey for survey in parts.surveys if survey.area is not None]
        points = sum(len(survey.transects) for survey in parts.surveys)
        if points > 0:
            findings.ask("takes_transects", f"Take the {points} points of the survey's transects")
        if areas and not judge.stops and not choices.takes_transects:
            return self._covered(areas, choices, placement)
        if areas and judge.stops and not choices.takes_transects:
            findings.notes.append(
                "The file has waypoints and a survey: the waypoints are taken, the area beside."
            )
        return design_of(judge.stops, returns=judge.returns, swim_speed_m_s=speed)

    def _covered(
        self, surveys: Sequence[Survey], choices: ReadChoices, placement: Placement
    ) -> Design:
        first = surveys[0]
        if len(surveys) > 1:
            self._findings.notes.append(
                f"The file has {len(surveys)} surveys: the first is taken, the areas are beside."
            )
        if math.isfinite(first.height_m) and first.height_m > 0.0:
            if choices.turns_sign:
                choices = choices.model_copy(update={"default_depth_m": first.height_m})
            else:
                offer_sign(self._findings)
                self._findings.notes.append(
                    f"{first.place}: {first.height_m:g} m above the water are no depth;"
                    " the design's own is taken."
                )
        elif first.height_m < 0.0 and choices.default_depth_m is None:
            choices = choices.model_copy(update={"default_depth_m": -first.height_m})
        area = first.area
        design = area and lawnmower_of(area, first.manner, choices, self._findings)
        return design or design_of(())

    def _cruise_speed(self) -> float | None:
        speed = number_of(self._mission.get("cruiseSpeed"))
        if 0.0 < speed <= FASTEST_M_S:
            return speed
        if speed > FASTEST_M_S:
            self._findings.notes.append(
                f"The cruise speed of {speed:g} m/s is left out: the robot's own holds."
            )
        return None

    def _read_items(self) -> QgcMission:
        raw = list_at(self._mission, "items", "mission.")
        if len(raw) > ITEMS_MAX:
            reason = f"{len(raw):,} items are more than the {ITEMS_MAX:,} taken"
            raise ReadingError(("mission.items", reason))
        parts = QgcMission()
        for number, item in enumerate(raw, start=1):
            place = f"item {number}"
            kind = item.get("type") if isinstance(item, dict) else None
            if kind == "SimpleItem":
                found = simple_item(place, item)
                parts.items.append(found)
                parts.order.append(found)
            elif kind == "ComplexItem" and item.get("complexItemType") == "survey":
                survey = self._survey(place, item)
                parts.surveys.append(survey)
                parts.order.append(survey)
            elif kind == "ComplexItem":
                parts.complex_refused.append((place, f"{item.get('complexItemType')!s:.40}"))
            else:
                raise ReadingError((place, "is neither a simple nor a complex item"))
        return parts

    def _survey(self, place: str, item: Document) -> Survey:
        ring = pairs_of(item.get("polygon"))
        if ring is None:
            raise ReadingError((f"{place}, polygon", "is no list of latitudes and longitudes"))
        if item.get("version") not in _SURVEY_VERSIONS:
            self._findings.notes.append(
                f"{place}: version {item.get('version')!r:.20} of a survey is not known;"
                " its polygon is taken as it stands."
            )
        style = object_at(item, "TransectStyleComplexItem", f"{place}, ")
        camera = object_at(style, "CameraCalc", f"{place}, ")
        spacing, angle = (
            number_of(camera.get("AdjustedFootprintSide")),
            number_of(item.get("angle")),
        )
        height = number_of(camera.get("DistanceToSurface"))
        manner = SurveyManner(
            spacing if 0.0 < spacing <= 1e6 else None,
            math.radians(math.remainder(angle, 360.0)) if math.isfinite(angle) else 0.0,
            style.get("Refly90Degrees") is True,
        )
        is_relative = camera.get("DistanceToSurfaceRelative", True) is not False
        relative = grace.MAV_FRAME_GLOBAL_RELATIVE_ALT if is_relative else grace.MAV_FRAME_GLOBAL
        frame = (
            grace.MAV_FRAME_GLOBAL_TERRAIN_ALT if style.get("FollowTerrain") is True else relative
        )
        points = pairs_of(style.get("VisualTransectPoints")) or []
        transects = [
            FileItem(
                f"{place}, point {number}",
                grace.MAV_CMD_NAV_WAYPOINT,
                frame,
                (0.0, 0.0, 0.0, math.nan),
                *point,
                None if math.isnan(height) else height,
            )
            for number, point in enumerate(points, start=1)
        ]
        return Survey(place, ring, manner, transects, height if is_relative else math.nan)

    def _add_fences(self, placement: Placement) -> None:
        fence = object_at(self._document, "geoFence")
        polygons = list_at(fence, "polygons", "geoFence.")
        circles = list_at(fence, "circles", "geoFence.")
        if (polygons or circles) and fence.get("version") != 2:
            version = f"version {fence.get('version')!r:.20}"
            self._findings.refuse("geoFence", version, "is not taken, 2 is")
            return
        for number, polygon in enumerate(polygons, start=1):
            ring = pairs_of(polygon.get("polygon")) if isinstance(polygon, dict) else None
            place = f"geoFence.polygons {number}"
            if ring is None:
                self._findings.refuse(place, "", "is no list of latitudes and longitudes")
                continue
            add_area(self._findings, placement, place, _fence_role(polygon), ring, _name(polygon))
        for number, each in enumerate(circles, start=1):
            self._add_circle(placement, f"geoFence.circles {number}", each)
        if fence.get("breachReturn") is not None:
            at = pair_of(fence["breachReturn"])
            if at is not None:
                add_mark(
                    self._findings, placement, "geoFence.breachReturn", "place", at, "Breach return"
                )

    def _add_circle(self, placement: Placement, place: str, each: object) -> None:
        circle = each.get("circle") if isinstance(each, dict) else None
        centre = pair_of(circle.get("center")) if isinstance(circle, dict) else None
        radius = number_of(circle.get("radius")) if isinstance(circle, dict) else math.nan
        if not isinstance(each, dict) or centre is None or not 0.0 < radius <= 1e6:
            self._findings.refuse(place, f"radius {radius:g}", "is no circle")
            return
        angles = [2.0 * math.pi * k / CIRCLE_CORNERS for k in range(CIRCLE_CORNERS)]
        rim = [(radius * math.cos(angle), radius * math.sin(angle)) for angle in angles]
        ring = [(at[0], at[1]) for at in wgs84_from_ned(rim, *centre).tolist()]
        note = f"a circle of {radius:.2f} m about {centre[0]:.7f}, {centre[1]:.7f}"
        add_area(self._findings, placement, place, _fence_role(each), ring, _name(each), note)

    def _add_marks(self, placement: Placement) -> None:
        home = self._mission.get("plannedHomePosition")
        at = pair_of(home)
        if at == (0.0, 0.0):
            self._findings.notes.append("The planned home position is not set.")
        elif at is not None:
            add_mark(self._findings, placement, "plannedHomePosition", "home", at, "Planned home")
        elif home is not None:
            self._findings.refuse("plannedHomePosition", f"{home!s:.40}", "is no place")
        rally = object_at(self._document, "rallyPoints")
        points = list_at(rally, "points", "rallyPoints.")
        if points and rally.get("version") not in (1, 2):
            version = f"version {rally.get('version')!r:.20}"
            self._findings.refuse("rallyPoints", version, "is not taken, 1 and 2 are")
            return
        for number, point in enumerate(points, start=1):
            place, name = f"rallyPoints {number}", f"Rally point {number}"
            where = pair_of(point)
            if where is None:
                self._findings.refuse(place, f"{point!s:.40}", "is no place")
            else:
                add_mark(self._findings, placement, place, "rally", where, name)


def _check_head(document: Document) -> None:
    kind = document.get("fileType")
    if kind != "Plan":
        raise ReadingError(("fileType", f"{kind!r:.40} is no plan of QGroundControl"))
    if document.get("version") != 1:
        raise ReadingError(("version", f"{document.get('version')!r:.20} is not taken, 1 is"))


def simple_item(place: str, item: Document) -> FileItem:
    """Return a simple item of a plan.

    Raises:
        ReadingError: If it is none.
    """
    command, frame = whole_of(item.get("command")), whole_of(item.get("frame"))
    if command is None or frame is None:
        raise ReadingError((place, "needs the numbers of its command and its frame"))
    raw: Any = item.get("params")
    if not isinstance(raw, list) or len(raw) != 7:
        raise ReadingError((f"{place}, params", "must be a list of seven numbers or nulls"))
    params = [number_of(value) for value in raw]
    altitude = params[6]
    if whole_of(item.get("AltitudeMode")) == ABOVE_TERRAIN:
        frame, altitude = grace.MAV_FRAME_GLOBAL_TERRAIN_ALT, number_of(item.get("Altitude"))
    return FileItem(
        place,
        command,
        frame,
        (params[0], params[1], params[2], params[3]),
        params[4],
        params[5],
        None if math.isnan(altitude) else altitude,
        item.get("autoContinue") is not False,
    )


def _fence_role(fence: Document) -> AreaRole:
    return "keep_out" if fence.get("inclusion") is False else "outline"


def _name(fence: Document) -> str:
    name = fence.get("name")
    return name[:60] if isinstance(name, str) else ""
