"""Writes a design as a file of another program, and says what that cannot express; pure."""

import csv
import io
import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final
from xml.sax.saxutils import escape

from autonomy.design.document import Design, Lawnmower, Manner, Mooring, StationKeep, Waypoint
from autonomy.site import Site
from robot_link.mavlink.wire import grace
from server.base.text import shown
from server.plan_file import own_part
from server.plan_file.item import FileItem
from server.plan_file.leg import WrittenLeg, on_globe, written_legs
from server.plan_file.loss import Format, Loss, losses_of
from server.plan_file.proposal import LatitudeLongitude, NorthEast
from server.plan_file.shape import WAYPOINTS
from server.plan_file.wpl import HEAD
from server.water import kml_text

MEDIA_TYPES: Final[dict[Format, str]] = {
    "qgc_plan": "application/json",
    "wpl": "text/plain; charset=utf-8",
    "kml": kml_text.MEDIA_TYPE,
    "geojson": "application/geo+json",
    "csv": "text/csv; charset=utf-8",
}
_ENDINGS: Final[dict[Format, str]] = {
    "qgc_plan": "plan",
    "wpl": "waypoints",
    "kml": "kml",
    "geojson": "geojson",
    "csv": "csv",
}
_DECIMALS = 9
"""Of degrees: 0.1 mm."""
_GEOJSON_DECIMALS = 7
_WPL_DECIMALS = 8
_METRE_DECIMALS = 6
_SUBMARINE: Final = grace.MAV_TYPE_SUBMARINE
_RELATIVE: Final = grace.MAV_FRAME_GLOBAL_RELATIVE_ALT
_GROUND_SPEED, _DESCENT_SPEED, _USUAL_SPEED = 1.0, 3.0, -2.0
_SWIM_SPEED_M_S = 0.2
"""QGroundControl needs a number; of a design that says none."""


@dataclass(frozen=True, slots=True)
class WrittenPlan:
    """A file to save."""

    content: bytes
    media_type: str
    file_name: str
    losses: tuple[Loss, ...]


class NothingToWriteError(ValueError):
    """A design without waypoints makes no file."""


def write_plan_file(
    format: Format,
    design: Design,
    way: Sequence[Waypoint],
    usual: Manner,
    site: Site,
    name: str,
) -> WrittenPlan:
    """Write a design.

    Args:
        format: Which file.
        design: The design.
        way: Its waypoints, laid out (``autonomy.design.way.waypoints_of``).
        usual: Its manner, with nothing left to the robot.
        site: The water in whose frame they are.
        name: What the design is called.

    Raises:
        NothingToWriteError: If it has no waypoint.
    """
    if not way:
        raise NothingToWriteError("The design has no waypoint: there is nothing to write.")
    if isinstance(design.content, StationKeep):
        usual = usual.model_copy(update={"motion": "swim"})
    legs = written_legs(way, usual, site)
    losses = losses_of(format, design, legs, way)
    title = shown(name).strip() or "design"
    match format:
        case "qgc_plan":
            text = _qgc_plan(design, legs, site, title)
        case "wpl":
            text = _wpl(design, legs, site)
        case "kml":
            text = _kml(design, legs, site, title, losses)
        case "geojson":
            text = _geojson(design, legs, site, title, losses)
        case "csv":
            text = _csv(legs, title, losses)
    stem = re.sub(r"[^\w.-]+", "_", title, flags=re.ASCII).strip("._") or "design"
    return WrittenPlan(text.encode(), MEDIA_TYPES[format], f"{stem}.{_ENDINGS[format]}", losses)


def _items(
    design: Design, legs: Sequence[WrittenLeg], swim_speed_m_s: float | None, decimals: int
) -> list[FileItem]:
    """Return the items of a mission: a change of speed where it changes, and the waypoints.

    Args:
        design: The design.
        legs: Its waypoints.
        swim_speed_m_s: What the file says elsewhere of the speed of swimming.
        decimals: Of degrees.
    """
    content = design.content
    hold_s = content.duration_s if isinstance(content, Mooring | StationKeep) else 0.0
    speeds: dict[str, float | None] = {"swim": swim_speed_m_s, "glide": None}
    items: list[FileItem] = []
    for leg in legs:
        if leg.speed_m_s != speeds[leg.motion]:
            speeds[leg.motion] = leg.speed_m_s
            kind = _GROUND_SPEED if leg.motion == "swim" else _DESCENT_SPEED
            speed = _USUAL_SPEED if leg.speed_m_s is None else leg.speed_m_s
            items.append(
                FileItem(
                    "",
                    grace.MAV_CMD_DO_CHANGE_SPEED,
                    grace.MAV_FRAME_MISSION,
                    (kind, speed, -1.0, 0.0),
                    0.0,
                    0.0,
                    0.0,
                )
            )
        latitude, longitude = (round(value, decimals) for value in leg.place_deg)
        items.append(
            FileItem(
                "",
                grace.MAV_CMD_NAV_WAYPOINT,
                _RELATIVE,
                (hold_s, 0.0, 0.0, math.nan),
                latitude,
                longitude,
                round(-leg.depth_m, _METRE_DECIMALS) + 0.0,
            )
        )
    return items


def _qgc_plan(design: Design, legs: Sequence[WrittenLeg], site: Site, title: str) -> str:
    speed = design.manner.swim_speed_m_s
    items = _items(design, legs, speed, _DECIMALS)
    document = {
        "fileType": "Plan",
        "version": 1,
        "groundStation": "Grace Ground Station",
        "mission": {
            "version": 2,
            "firmwareType": grace.MAV_AUTOPILOT_GENERIC,
            "vehicleType": _SUBMARINE,
            "globalPlanAltitudeMode": 1,
            "cruiseSpeed": _SWIM_SPEED_M_S if speed is None else speed,
            "hoverSpeed": _SWIM_SPEED_M_S if speed is None else speed,
            "plannedHomePosition": [site.origin_latitude_deg, site.origin_longitude_deg, 0],
            "items": [_simple_item(number, item) for number, item in enumerate(items, start=1)],
        },
        "geoFence": {"version": 2, "circles": [], "polygons": _fences(site)},
        "rallyPoints": {"version": 2, "points": []},
        own_part.KEY: own_part.own_part(design, site, title, items),
    }
    return json.dumps(document, indent=4, ensure_ascii=False) + "\n"


def _simple_item(number: int, item: FileItem) -> dict[str, Any]:
    numbers = (*item.parameters, item.x, item.y, item.z)
    written: dict[str, Any] = {
        "type": "SimpleItem",
        "command": item.command,
        "frame": item.frame,
        "params": [None if value is None or math.isnan(value) else value for value in numbers],
        "autoContinue": True,
        "doJumpId": number,
    }
    if item.frame == _RELATIVE:
        written |= {"AltitudeMode": 1, "Altitude": item.z, "AMSLAltAboveTerrain": None}
    return written


def _fences(site: Site) -> list[dict[str, Any]]:
    box = site.water
    corners: Sequence[NorthEast] = (
        (box.x_min_m, box.y_min_m),
        (box.x_max_m, box.y_min_m),
        (box.x_max_m, box.y_max_m),
        (box.x_min_m, box.y_max_m),
    )
    if site.shoreline is not None:
        corners = site.shoreline.corners_m
    fences = [(True, site.name, corners)]
    fences += [(False, area.name, area.corners_m) for area in (*site.islands, *site.keep_outs)]
    return [
        {
            "version": 1,
            "inclusion": is_inside,
            "name": name,
            "polygon": [
                [round(a, _DECIMALS), round(b, _DECIMALS)] for a, b in on_globe(ring, site)
            ],
        }
        for is_inside, name, ring in fences
    ]


def _wpl(design: Design, legs: Sequence[WrittenLeg], site: Site) -> str:
    """Return lines without comments: QGroundControl takes a file with one for corrupted."""
    home = FileItem(
        "",
        grace.MAV_CMD_NAV_WAYPOINT,
        grace.MAV_FRAME_GLOBAL,
        (0.0, 0.0, 0.0, 0.0),
        site.origin_latitude_deg,
        site.origin_longitude_deg,
        0.0,
    )
    items = [home, *_items(design, legs, None, _WPL_DECIMALS)]
    lines = [HEAD]
    for number, item in enumerate(items):
        parameters = (0.0 if math.isnan(value) else value for value in item.parameters)
        words = (
            str(number),
            str(int(number == 0)),
            str(item.frame),
            str(item.command),
            *(f"{value:.8g}" for value in parameters),
            f"{item.x:.{_WPL_DECIMALS}f}",
            f"{item.y:.{_WPL_DECIMALS}f}",
            f"{item.z:.{_METRE_DECIMALS}f}",
            "1",
        )
        lines.append("\t".join(words))
    return "\n".join(lines) + "\n"


def _kml(
    design: Design,
    legs: Sequence[WrittenLeg],
    site: Site,
    title: str,
    losses: Sequence[Loss],
) -> str:
    line = kml_text.coordinates(_line(legs), _DECIMALS, _METRE_DECIMALS)
    area = ""
    ring = _area_ring(design, site)
    if ring:
        places = kml_text.coordinates(((b, a, 0.0) for a, b in ring), _DECIMALS, 0)
        area = kml_text.area(f"{title}: area", "survey", places)
    about = escape(_comment(losses))
    return (
        f"{kml_text.BEGIN}<name>{escape(title)}</name><description>{about}</description>"
        f"{kml_text.line(title, line, _words(legs))}{area}{kml_text.END}"
    )


def _line(legs: Sequence[WrittenLeg]) -> list[tuple[float, float, float]]:
    """Return longitude, latitude and height of a line; one waypoint stands there twice."""
    places = [(leg.place_deg[1], leg.place_deg[0], -leg.depth_m + 0.0) for leg in legs]
    return places * 2 if len(places) == 1 else places


def _words(legs: Sequence[WrittenLeg]) -> dict[str, str]:
    return {WAYPOINTS: "1"} if len(legs) == 1 else {}


def _area_ring(design: Design, site: Site) -> list[LatitudeLongitude]:
    """Return the closed, anticlockwise outline of a pattern over an area; empty without one."""
    content = design.content
    if not isinstance(content, Lawnmower):
        return []
    corners = [corner.ne_m for corner in content.area]
    pairs = zip(corners, [*corners[1:], corners[0]], strict=True)
    turns_right = sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)
    ring = on_globe(corners if turns_right < 0.0 else corners[::-1], site)
    return [*ring, ring[0]]


def _geojson(
    design: Design,
    legs: Sequence[WrittenLeg],
    site: Site,
    title: str,
    losses: Sequence[Loss],
) -> str:
    def place(longitude: float, latitude: float) -> list[float]:
        return [round(longitude, _GEOJSON_DECIMALS), round(latitude, _GEOJSON_DECIMALS)]

    line = [[*place(x, y), round(z, _METRE_DECIMALS)] for x, y, z in _line(legs)]
    about = {"name": title, "comment": _comment(losses), **_words(legs)}
    features: list[dict[str, Any]] = [_feature("LineString", line, about)]
    ring = _area_ring(design, site)
    if ring:
        words = {"name": f"{title}: area", "role": "survey"}
        features.append(_feature("Polygon", [[place(b, a) for a, b in ring]], words))
    document = {"type": "FeatureCollection", "features": features}
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"


def _feature(kind: str, coordinates: Any, words: dict[str, str]) -> dict[str, Any]:  # noqa: ANN401
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "geometry": geometry, "properties": words}


def _csv(legs: Sequence[WrittenLeg], title: str, losses: Sequence[Loss]) -> str:
    text = io.StringIO()
    text.write(f"# {title}\n")
    for loss in losses:
        text.write(f"# not in this file: {loss.text}\n")
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(
        (
            "latitude_deg",
            "longitude_deg",
            "motion",
            "shallow_m",
            "deep_m",
            "glide_angle_deg",
            "speed_m_s",
            "surfaces",
            "name",
        )
    )
    for leg in legs:
        is_glide = leg.motion == "glide"
        rows.writerow(
            (
                f"{leg.place_deg[0]:.{_DECIMALS}f}",
                f"{leg.place_deg[1]:.{_DECIMALS}f}",
                leg.motion,
                f"{leg.shallow_m:.{_METRE_DECIMALS}f}" if is_glide else "",
                f"{leg.depth_m:.{_METRE_DECIMALS}f}" if is_glide else "",
                f"{math.degrees(leg.glide_angle_rad):.6f}" if is_glide else "",
                "" if leg.speed_m_s is None else f"{leg.speed_m_s:.6g}",
                {True: "yes", False: "no", None: ""}[leg.surfaces],
                leg.name,
            )
        )
    return text.getvalue()


def _comment(losses: Sequence[Loss]) -> str:
    if not losses:
        return ""
    return "Not in this file: " + "; ".join(loss.text for loss in losses) + "."
