"""Reads a plan file of any format into a proposal; pure.

Formats are told by what a file holds; its name only helps where that tells nothing.
"""

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

from autonomy.design.document import Design, Way
from autonomy.site import Site
from server.plan_file import shape, table
from server.plan_file.item import ItemJudge
from server.plan_file.place import Placement, middle_of
from server.plan_file.proposal import Findings, LatitudeLongitude, PlanFileProposal, ReadChoices
from server.plan_file.qgc_plan import QgcPlanFile
from server.plan_file.stop import (
    SurveyManner,
    design_of,
    lawnmower_of,
    offer_move,
    offer_sign,
    way_length_m,
)
from server.plan_file.wpl import add_home, read_wpl
from server.water.foreign_file import json_document, kmz_document, text_of
from server.water.proposal import Reading, ReadingError
from server.water.shape_file import geojson_shapes, kml_shapes

BYTES_MAX = 10 << 20
ENDINGS = (".plan", ".waypoints", ".txt", ".kml", ".kmz", ".geojson", ".json", ".csv")


@dataclass(frozen=True, slots=True)
class _Plan:
    """A file that was read, before it is placed in a water."""

    format: str
    middle_deg: LatitudeLongitude | None
    draw: Callable[[Placement], Design]
    surveys: Callable[[], dict[int, SurveyManner]] = dict


def read_plan_file(name: str, content: bytes, site: Site, choices: ReadChoices) -> PlanFileProposal:
    """Read a plan file into what a design could be made of; nothing of it is dropped silently.

    Args:
        name: The file's name.
        content: What it holds, at most 10 MB.
        site: The water of the robot for which it is read.
        choices: How the operator answered the questions of an earlier proposal.

    Raises:
        ReadingError: If the file is refused as a whole, with line, item or feature.
    """
    if not content:
        raise ReadingError(("", "the file is empty"))
    if len(content) > BYTES_MAX:
        size = f"{len(content) / 2**20:.1f} MB are more than the {BYTES_MAX >> 20} taken"
        raise ReadingError(("", size))
    findings = Findings()
    plan = _opened(name, content, site, choices, findings)
    placement = Placement(site, choices, plan.middle_deg)
    document = plan.draw(placement)
    if choices.area is not None:
        document = _over(choices.area, plan.surveys(), choices, findings) or document
    _look_around(document, placement, choices, findings)
    return PlanFileProposal(
        format=plan.format,
        document=document,
        distance_m=way_length_m(document),
        notes=tuple(findings.notes),
        refused=tuple(findings.refused),
        needs=tuple(findings.needs.values()),
        areas=tuple(findings.areas),
        marks=tuple(findings.marks),
    )


def _opened(
    name: str, content: bytes, site: Site, choices: ReadChoices, findings: Findings
) -> _Plan:
    start = content[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()
    ending = PurePath(name).suffix.lower()
    if content.startswith(b"PK"):
        document = kmz_document(io.BytesIO(content), BYTES_MAX)
        return _shapes_plan(kml_shapes(document, "KMZ", leaves_active=True), choices, findings)
    if start.startswith(b"QGC"):
        return _wpl_plan(text_of(content), choices, findings)
    if start.startswith(b"<") or ending == ".kml":
        return _shapes_plan(kml_shapes(content, "KML", leaves_active=True), choices, findings)
    if start.startswith((b"{", b"[")) or ending in (".plan", ".geojson", ".json"):
        return _json_plan(json_document(content), site, choices, findings)
    if ending in (".waypoints", ".txt"):
        raise ReadingError(("line 1", "must be 'QGC WPL 110'"))
    if ending == ".csv":
        return _table_plan(text_of(content), choices, findings)
    known = ", ".join(ENDINGS)
    raise ReadingError(("", f"neither its content nor its name tells what it is; known: {known}"))


def _json_plan(
    document: Any,  # noqa: ANN401 - any JSON
    site: Site,
    choices: ReadChoices,
    findings: Findings,
) -> _Plan:
    if not isinstance(document, dict):
        raise ReadingError(("", "the file is JSON, but neither a plan nor GeoJSON"))
    if "fileType" not in document and "type" in document:
        return _shapes_plan(geojson_shapes(document), choices, findings)
    plan = QgcPlanFile(document, findings)
    return _Plan(
        "QGroundControl plan",
        plan.middle_deg(),
        lambda placement: plan.design(placement, choices, site),
        lambda: plan.surveys,
    )


def _wpl_plan(text: str, choices: ReadChoices, findings: Findings) -> _Plan:
    file = read_wpl(text)
    findings.notes += file.notes
    places = [item.place_deg for item in file.items if item.place_deg is not None]

    def draw(placement: Placement) -> Design:
        add_home(file.home, placement, findings)
        judge = ItemJudge(placement, choices, findings)
        judge.judge(file.items)
        return design_of(judge.stops, returns=judge.returns)

    return _Plan("QGC WPL 110", middle_of(places), draw)


def _shapes_plan(reading: Reading, choices: ReadChoices, findings: Findings) -> _Plan:
    findings.notes += reading.warnings

    def draw(placement: Placement) -> Design:
        is_kml = reading.format != "GeoJSON"
        judge = shape.ShapeJudge(placement, choices, findings, is_kml=is_kml)
        judge.judge(reading.shapes)
        return design_of(judge.stops)

    return _Plan(reading.format, shape.middle_of_shapes(reading.shapes), draw)


def _table_plan(text: str, choices: ReadChoices, findings: Findings) -> _Plan:
    rows = table.read_table(text, findings)

    def draw(placement: Placement) -> Design:
        return design_of(table.stops_of(rows, placement, choices, findings))

    return _Plan("CSV", table.middle_of_rows(rows), draw)


def _over(
    number: int, surveys: dict[int, SurveyManner], choices: ReadChoices, findings: Findings
) -> Design | None:
    if number > len(findings.areas):
        reason = f"the file has {len(findings.areas)} areas"
        findings.refuse(f"area {number}", "", reason)
        return None
    manner = surveys.get(number, SurveyManner())
    return lawnmower_of(findings.areas[number - 1], manner, choices, findings)


def _look_around(
    document: Design, placement: Placement, choices: ReadChoices, findings: Findings
) -> None:
    """Say what is missing or far away, and ask what is open."""
    content = document.content
    stops = content.waypoints if isinstance(content, Way) else ()
    if isinstance(content, Way) and not stops:
        if not (findings.refused or findings.areas or findings.marks):
            raise ReadingError(("", "the file holds no waypoint, no area and no place"))
        findings.notes.append("The file brings no waypoint to fly to.")
    elsewhere = [stop.ne_m for stop in stops]
    elsewhere += [corner for area in findings.areas for corner in area.corners_m]
    if placement.is_moved:
        findings.notes.append("Everything is moved into the middle of the water's domain.")
        offer_move(findings)
    elif elsewhere and not any(map(placement.is_near, elsewhere)):
        findings.notes.append(f"Everything lies {placement.away(elsewhere[0])}.")
        offer_move(findings)
    if findings.areas:
        count = len(findings.areas)
        some = f"one of the {count} areas" if count > 1 else "the area"
        findings.ask("area", f"Cover {some} by a lawnmower")
    if choices.turns_sign:
        offer_sign(findings)
    if findings.refused:
        count = len(findings.refused)
        parts = "1 part is refused" if count == 1 else f"{count} parts are refused"
        findings.ask(
            "imports_rest",
            f"{parts}: leave them out and import the rest",
            is_needed=not choices.imports_rest,
        )
