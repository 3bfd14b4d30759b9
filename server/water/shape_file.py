"""Outlines, keep-outs and places from GeoJSON (RFC 7946), KML, KMZ and GPX.

Everything comes out in WGS84 degrees. What runs or loads something else is refused: a file of a
map has no business with either.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from server.water.foreign_file import (
    XmlDocument,
    file_bytes,
    json_document,
    kmz_document,
    tag,
    xml_document,
)
from server.water.proposal import LatitudeLongitude, Reading, ReadingError, Shape

FEATURES_MAX = 5_000
_ACTIVE = ("<script", "javascript:", "<iframe", "onload=", "onerror=")
_LOADS = ("NetworkLink", "NetworkLinkControl", "Script")
_PICTURES = ("GroundOverlay", "ScreenOverlay", "PhotoOverlay")
_CLOSED_SHARE = 0.05
"""A track whose ends are nearer than this share of its length is an outline."""
_LONGEST_TURN_DEG = 180.0
_PLACE_KINDS = ("dock", "beacon", "receiver", "landmark")
_Vertex = tuple[float, float, float | None]
"""Longitude or easting, latitude or northing, height where the file says one."""
Project = Callable[[Sequence[tuple[float, float]]], list[LatitudeLongitude]]


def read_geojson(path: Path, project: Project | None) -> Reading:
    """Read GeoJSON.

    Args:
        path: The file.
        project: Turns pairs (x, y) of another reference system into latitude and longitude; None
            for WGS84 as the standard has it.

    Raises:
        ReadingError: With the feature at fault.
    """
    return geojson_shapes(json_document(file_bytes(path)), project)


def geojson_shapes(document: Any, project: Project | None = None) -> Reading:  # noqa: ANN401 - any JSON
    """Return the shapes of a GeoJSON document; arguments and errors as of ``read_geojson``."""
    if not isinstance(document, dict):
        raise ReadingError(("", "the file is JSON, but no GeoJSON object"))
    named = _named_crs(document)
    if (
        named
        and project is None
        and not named.upper().endswith(("CRS84", "EPSG::4326", "EPSG:4326"))
    ):
        raise ReadingError(
            (
                "crs",
                f"the file names the reference system {named}, but GeoJSON is in WGS 84 degrees"
                " (RFC 7946); give it as crs to have it converted",
            )
        )
    shapes = [
        shape
        for number, feature in enumerate(_features(document), start=1)
        for shape in _geojson_shapes(number, feature, project)
    ]
    return Reading("GeoJSON", shapes=shapes)


def _named_crs(document: Mapping[str, Any]) -> str:
    crs = document.get("crs")
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    return name if isinstance(name, str) else ""


def _features(document: dict[str, Any]) -> Iterator[dict[str, Any]]:
    kind = document.get("type")
    features: Any = [document]
    if kind == "FeatureCollection":
        features = document.get("features")
    elif kind != "Feature":
        features = [{"type": "Feature", "geometry": document, "properties": {}}]
    if not isinstance(features, list):
        raise ReadingError(("features", "must be a list"))
    if len(features) > FEATURES_MAX:
        raise ReadingError(("features", f"{len(features)} are more than the {FEATURES_MAX} taken"))
    for number, feature in enumerate(features, start=1):
        if not isinstance(feature, dict) or feature.get("type") != "Feature":
            raise ReadingError((f"feature {number}", "is no GeoJSON feature"))
        yield feature


def _geojson_shapes(
    number: int, feature: dict[str, Any], project: Project | None
) -> Iterator[Shape]:
    properties = feature.get("properties")
    words: dict[str, Any] = properties if isinstance(properties, dict) else {}
    name = str(words.get("name") or words.get("title") or feature.get("id") or "")
    for text in (name, *map(str, words.values())):
        _refuse_active(f"feature {number}", text)
    geometry = feature.get("geometry")
    if geometry is None:
        return
    for kind, coordinates in _geometries(number, geometry):
        try:
            rings = [[_vertex(place) for place in ring] for ring in coordinates]
        except (TypeError, ValueError, IndexError, KeyError) as error:
            raise ReadingError(
                (f"feature {number}", "its coordinates are no lists of two numbers")
            ) from error
        shape = _shape(number, name, kind, rings, project)
        _take_words(shape, words)
        yield shape


def _vertex(place: Any) -> _Vertex:  # noqa: ANN401 - any JSON
    return float(place[0]), float(place[1]), float(place[2]) if len(place) > 2 else None


def _geometries(number: int, geometry: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401 - any JSON
    """Return kind and rings of each simple geometry of one."""
    kind = geometry.get("type") if isinstance(geometry, dict) else None
    coordinates = geometry.get("coordinates") if isinstance(geometry, dict) else None
    match kind:
        case "Polygon":
            yield "polygon", coordinates
        case "MultiPolygon" if isinstance(coordinates, list):
            yield from (("polygon", each) for each in coordinates)
        case "LineString":
            yield "line", [coordinates]
        case "MultiLineString" if isinstance(coordinates, list):
            yield from (("line", [each]) for each in coordinates)
        case "Point":
            yield "point", [[coordinates]]
        case "MultiPoint" if isinstance(coordinates, list):
            yield from (("point", [[each]]) for each in coordinates)
        case "GeometryCollection" if isinstance(geometry.get("geometries"), list):
            for each in geometry["geometries"]:
                yield from _geometries(number, each)
        case _:
            raise ReadingError((f"feature {number}", f"{kind!r} is no geometry of GeoJSON"))


def _geographic(
    number: int, vertices: list[_Vertex], project: Project | None
) -> list[LatitudeLongitude]:
    ring = [(x, y) for x, y, _ in vertices]
    if project is not None:
        return project(ring)
    for x, y in ring:
        if not (abs(x) <= 180.0 and abs(y) <= 90.0):  # also of what is no number
            raise ReadingError(
                (
                    f"feature {number}",
                    f"{x:g}, {y:g} are no longitude and latitude: the file must"
                    " be in WGS 84 degrees, or its reference system given as crs",
                )
            )
    return [(y, x) for x, y in ring]


def _shape(
    number: int,
    name: str,
    kind: str,
    vertices: list[list[_Vertex]],
    project: Project | None = None,
) -> Shape:
    """Return a feature whose rings are closed, but do not repeat their first corner."""
    place = f"feature {number}"
    if not vertices or not vertices[0]:
        raise ReadingError((place, "has no coordinates"))
    rings = [_geographic(number, ring, project) for ring in vertices]
    heights = [[z for _, _, z in ring] for ring in vertices]
    are_closed = all(ring[0] == ring[-1] for ring in rings)
    if kind == "polygon":
        rings = [ring[:-1] if len(ring) > 1 and ring[0] == ring[-1] else ring for ring in rings]
        for ring in rings:
            distinct = [at for i, at in enumerate(ring) if at != ring[i - 1]]
            if len(set(distinct)) < 3:
                raise ReadingError((place, "a polygon needs three corners"))
            ring[:] = distinct
    for ring in rings:
        turns = [abs(a[1] - b[1]) for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]
        if max(turns) > _LONGEST_TURN_DEG:
            raise ReadingError((place, "crosses the antimeridian (longitude 180); cut it there"))
    shape = Shape(number, name[:60], _simple(kind), rings)
    shape.are_closed, shape.heights_m = are_closed, [] if kind == "polygon" else heights[0]
    return shape


def _simple(kind: str) -> Any:  # noqa: ANN401 - a literal that the callers write
    return kind


def _take_words(shape: Shape, words: Mapping[str, Any]) -> None:
    """Take what a feature's properties say of its role, its kind of place and its depth."""
    said = str(words.get("role") or words.get("kind") or words.get("type") or "").lower()
    said = said.strip().replace("-", "_").replace(" ", "_")
    if said in ("outline", "island", "keep_out", "ignored") and shape.geometry == "polygon":
        shape.role = said
    if said in _PLACE_KINDS:
        shape.place_kind = said
    shape.words = words
    depth = words.get("depth_m")
    if isinstance(depth, int | float) and math.isfinite(depth) and 0.0 <= depth <= 12_000.0:
        shape.depth_m = float(depth)


def read_kml(path: Path) -> Reading:
    """Read KML.

    Raises:
        ReadingError: With the placemark at fault.
    """
    return kml_shapes(file_bytes(path), "KML")


def read_kmz(path: Path) -> Reading:
    """Read KMZ: a ZIP archive with a KML document.

    Raises:
        ReadingError: With the entry or placemark at fault.
    """
    return kml_shapes(kmz_document(path), "KMZ")


def kml_shapes(content: bytes, form: str, *, leaves_active: bool = False) -> Reading:
    """Return the shapes of a KML document.

    Args:
        content: The document.
        form: What to call its format.
        leaves_active: Whether what loads or runs something else is left out with a warning,
            instead of refused.

    Raises:
        ReadingError: With the placemark at fault.
    """
    document = xml_document(content)
    if tag(document.root) != "kml":
        raise ReadingError(("", f"the file is no KML: its root is <{tag(document.root)}>"))
    shapes: list[Shape] = []
    number = 0
    skipped: dict[str, int] = {}
    for element in document.root.iter():
        name = tag(element)
        if name in _LOADS and not leaves_active:
            raise ReadingError((f"<{name}>", "loads or runs something else; take it out"))
        if name in _LOADS + _PICTURES:
            skipped[name] = skipped.get(name, 0) + 1
        if name == "Placemark":
            number += 1
            if number > FEATURES_MAX:
                raise ReadingError(("", f"more than the {FEATURES_MAX} placemarks taken"))
            if leaves_active and _disarm(element):
                skipped["active text"] = skipped.get("active text", 0) + 1
            shapes += _placemark(number, element, document)
    warnings = [
        f"{count} {name} left out: only shapes are taken." for name, count in skipped.items()
    ]
    return Reading(form, shapes=shapes, warnings=warnings)


def _disarm(placemark: Element) -> bool:
    """Take active content out of a placemark's texts; tell whether there was any."""
    found = False
    for child in placemark.iter():
        if any(word in (child.text or "").lower() for word in _ACTIVE):
            child.text, found = "", True
        for key, text in child.attrib.items():
            if any(word in text.lower() for word in _ACTIVE):
                child.attrib[key], found = "", True
    return found


def _placemark(number: int, placemark: Element, document: XmlDocument) -> Iterator[Shape]:
    name = ""
    words: dict[str, Any] = {}
    for child in placemark.iter():
        for text in (child.text or "", *child.attrib.values()):
            _refuse_active(f"feature {number}", text)
        if tag(child) == "name" and not name:
            name = (child.text or "").strip()
        if tag(child) == "Data":
            words[child.get("name") or ""] = "".join(child.itertext()).strip()
    for element in placemark.iter():
        rings: list[list[_Vertex]] = []
        match tag(element):
            case "Polygon":
                outer = _boundaries(number, element, "outerBoundaryIs")
                rings = [*outer[:1], *_boundaries(number, element, "innerBoundaryIs")]
                if not outer:
                    line = document.lines[element]
                    reason = f"a polygon has no outer boundary of a LinearRing (line {line})"
                    raise ReadingError((f"feature {number}", reason))
                kind = "polygon"
            case "LineString":
                rings, kind = [_kml_coordinates(number, element)], "line"
            case "Point":
                rings, kind = [_kml_coordinates(number, element)], "point"
            case _:
                continue
        shape = _shape(number, name, kind, rings)
        _take_words(shape, words)
        shape.altitude_mode = next(
            ((e.text or "").strip() for e in element if tag(e) == "altitudeMode"), ""
        )
        yield shape


def _boundaries(number: int, polygon: Element, which: str) -> list[list[_Vertex]]:
    found = [child for child in polygon if tag(child) == which]
    rings = [each for one in found for each in one.iter() if tag(each) == "LinearRing"]
    return [_kml_coordinates(number, ring) for ring in rings]


def _kml_coordinates(number: int, element: Element) -> list[_Vertex]:
    text = next((e.text or "" for e in element.iter() if tag(e) == "coordinates"), "")
    try:
        places = [tuple(map(float, part.split(",")[:3])) for part in text.split()]
        return [(at[0], at[1], at[2] if len(at) > 2 else None) for at in places]
    except (ValueError, IndexError) as error:
        raise ReadingError(
            (f"feature {number}", f"its coordinates are no numbers: {text.strip()[:40]!r}")
        ) from error


def read_gpx(path: Path) -> Reading:
    """Read GPX: waypoints are places, a track or route that closes is a polygon.

    Raises:
        ReadingError: With the feature at fault.
    """
    root = xml_document(file_bytes(path)).root
    if tag(root) != "gpx":
        raise ReadingError(("", f"the file is no GPX: its root is <{tag(root)}>"))
    shapes: list[Shape] = []
    warnings: list[str] = []
    for number, element in enumerate((e for e in root if tag(e) in ("wpt", "rte", "trk")), 1):
        if number > FEATURES_MAX:
            raise ReadingError(("", f"more than the {FEATURES_MAX} features taken"))
        name = next(((e.text or "").strip() for e in element if tag(e) == "name"), "")
        for each in element.iter():
            _refuse_active(f"feature {number}", each.text or "")
        points = [element] if tag(element) == "wpt" else []
        points += [e for e in element.iter() if tag(e) in ("rtept", "trkpt")]
        try:
            ring = [(float(e.attrib["lon"]), float(e.attrib["lat"])) for e in points]
        except (KeyError, ValueError) as error:
            raise ReadingError((f"feature {number}", "a point has no lat and lon")) from error
        if not ring:
            raise ReadingError((f"feature {number}", "has no points"))
        kind = "point" if tag(element) == "wpt" else _closed(ring)
        if kind == "line":
            warnings.append(f"feature {number} is a way that does not close; it is left out.")
        shape = _shape(number, name, kind, [[(*at, None) for at in ring]])
        _take_words(shape, {"kind": next((e.text for e in element if tag(e) == "type"), "")})
        shapes.append(shape)
    return Reading("GPX", shapes=shapes, warnings=warnings)


def _closed(ring: list[tuple[float, float]]) -> str:
    steps = [math.dist(a, b) for a, b in itertools.pairwise(ring)]
    is_closed = len(set(ring)) > 2 and math.dist(ring[0], ring[-1]) <= _CLOSED_SHARE * sum(steps)
    return "polygon" if is_closed else "line"


def _refuse_active(place: str, text: str) -> None:
    folded = text.lower()
    for word in _ACTIVE:
        if word in folded:
            raise ReadingError((place, f"holds active content ({word.strip('<=:')}); take it out"))
