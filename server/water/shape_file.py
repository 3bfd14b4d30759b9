"""Outlines, keep-outs and places from GeoJSON (RFC 7946), KML, KMZ and GPX.

Everything comes out in WGS84 degrees. What runs or loads something else is refused: a file of a
map has no business with either.
"""

import io
import itertools
import json
import math
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ParseError

from server.water.proposal import LatitudeLongitude, Reading, ReadingError, Shape

BYTES_MAX = 64 << 20
FEATURES_MAX = 5_000
KMZ_ENTRIES_MAX = 200
KMZ_RATIO_MAX = 200
_ACTIVE = ("<script", "javascript:", "<iframe", "onload=", "onerror=")
_CLOSED_SHARE = 0.05
"""A track whose ends are nearer than this share of its length is an outline."""
_LONGEST_TURN_DEG = 180.0
_PLACE_KINDS = ("dock", "beacon", "receiver", "landmark")
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
    document = _json(_bytes(path))
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


def _json(content: bytes) -> Any:  # noqa: ANN401 - any JSON
    try:
        return json.loads(content.decode("utf-8-sig"), parse_constant=_no_number)
    except UnicodeDecodeError as error:
        raise ReadingError(("", f"the file is no UTF-8 text: byte {error.start}")) from error
    except json.JSONDecodeError as error:
        raise ReadingError((f"line {error.lineno}", f"no JSON: {error.msg}")) from error
    except RecursionError as error:
        raise ReadingError(("", "the file is nested too deeply")) from error


def _no_number(name: str) -> float:
    raise ReadingError(("", f"{name} is no number of JSON"))


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
            rings = [[(float(p[0]), float(p[1])) for p in ring] for ring in coordinates]
        except (TypeError, ValueError, IndexError, KeyError) as error:
            raise ReadingError(
                (f"feature {number}", "its coordinates are no lists of two numbers")
            ) from error
        shape = _shape(number, name, kind, [_geographic(number, ring, project) for ring in rings])
        _take_words(shape, words)
        yield shape


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
    number: int, ring: list[tuple[float, float]], project: Project | None
) -> list[LatitudeLongitude]:
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


def _shape(number: int, name: str, kind: str, rings: list[list[LatitudeLongitude]]) -> Shape:
    """Return a feature whose rings are closed, but do not repeat their first corner."""
    place = f"feature {number}"
    if not rings or not rings[0]:
        raise ReadingError((place, "has no coordinates"))
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
    return Shape(number, name[:60], _simple(kind), rings)


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
    depth = words.get("depth_m")
    if isinstance(depth, int | float) and math.isfinite(depth) and 0.0 <= depth <= 12_000.0:
        shape.depth_m = float(depth)


def read_kml(path: Path) -> Reading:
    """Read KML.

    Raises:
        ReadingError: With the placemark at fault.
    """
    return _kml(_bytes(path), "KML")


def read_kmz(path: Path) -> Reading:
    """Read KMZ: a ZIP archive with a KML document.

    Raises:
        ReadingError: With the entry or placemark at fault.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            _check_archive(entries)
            documents = [e for e in entries if e.filename.lower().endswith(".kml")]
            if not documents:
                raise ReadingError(("", "the archive holds no KML document"))
            first = min(documents, key=lambda e: (e.filename.count("/"), e.filename != "doc.kml"))
            with archive.open(first) as file:
                content = file.read(BYTES_MAX + 1)  # whatever the directory says
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise ReadingError(("", f"no KMZ archive: {error}")) from error
    if len(content) > BYTES_MAX:
        raise ReadingError((first.filename, f"unpacks to more than {BYTES_MAX >> 20} MB"))
    return _kml(content, "KMZ")


def _check_archive(entries: Sequence[zipfile.ZipInfo]) -> None:
    if len(entries) > KMZ_ENTRIES_MAX:
        raise ReadingError(
            ("", f"{len(entries)} entries are more than the {KMZ_ENTRIES_MAX} taken")
        )
    if sum(entry.file_size for entry in entries) > BYTES_MAX:
        raise ReadingError(("", f"the archive unpacks to more than {BYTES_MAX >> 20} MB"))
    for entry in entries:
        if entry.file_size > KMZ_RATIO_MAX * max(entry.compress_size, 1024):
            raise ReadingError(
                (entry.filename, f"unpacks to more than {KMZ_RATIO_MAX} times its size")
            )


def _kml(content: bytes, form: str) -> Reading:
    root = _xml(content)
    if _tag(root) != "kml":
        raise ReadingError(("", f"the file is no KML: its root is <{_tag(root)}>"))
    shapes: list[Shape] = []
    warnings: list[str] = []
    number = 0
    skipped: dict[str, int] = {}
    for element in root.iter():
        tag = _tag(element)
        if tag in ("NetworkLink", "NetworkLinkControl", "Script"):
            raise ReadingError((f"<{tag}>", "loads or runs something else; take it out"))
        if tag in ("GroundOverlay", "ScreenOverlay", "PhotoOverlay"):
            skipped[tag] = skipped.get(tag, 0) + 1
        if tag == "Placemark":
            number += 1
            if number > FEATURES_MAX:
                raise ReadingError(("", f"more than the {FEATURES_MAX} placemarks taken"))
            shapes += _placemark(number, element)
    warnings += [
        f"{count} {tag} left out: only shapes are taken." for tag, count in skipped.items()
    ]
    return Reading(form, shapes=shapes, warnings=warnings)


def _placemark(number: int, placemark: Element) -> Iterator[Shape]:
    name = ""
    words: dict[str, Any] = {}
    for child in placemark.iter():
        for text in (child.text or "", *child.attrib.values()):
            _refuse_active(f"feature {number}", text)
        if _tag(child) == "name" and not name:
            name = (child.text or "").strip()
        if _tag(child) == "Data":
            words[child.get("name") or ""] = "".join(child.itertext()).strip()
    for element in placemark.iter():
        rings: list[list[tuple[float, float]]] = []
        match _tag(element):
            case "Polygon":
                outer = _boundaries(number, element, "outerBoundaryIs")
                rings = [*outer[:1], *_boundaries(number, element, "innerBoundaryIs")]
                if not outer:
                    raise ReadingError((f"feature {number}", "a polygon has no outer boundary"))
                kind = "polygon"
            case "LineString":
                rings, kind = [_kml_coordinates(number, element)], "line"
            case "Point":
                rings, kind = [_kml_coordinates(number, element)], "point"
            case _:
                continue
        shape = _shape(number, name, kind, [_geographic(number, ring, None) for ring in rings])
        _take_words(shape, words)
        yield shape


def _boundaries(number: int, polygon: Element, which: str) -> list[list[tuple[float, float]]]:
    found = [child for child in polygon if _tag(child) == which]
    rings = [each for one in found for each in one.iter() if _tag(each) == "LinearRing"]
    return [_kml_coordinates(number, ring) for ring in rings]


def _kml_coordinates(number: int, element: Element) -> list[tuple[float, float]]:
    text = next((e.text or "" for e in element.iter() if _tag(e) == "coordinates"), "")
    try:
        places = [tuple(map(float, part.split(",")[:2])) for part in text.split()]
        return [(x, y) for x, y in places]
    except ValueError as error:
        raise ReadingError(
            (f"feature {number}", f"its coordinates are no numbers: {text.strip()[:40]!r}")
        ) from error


def read_gpx(path: Path) -> Reading:
    """Read GPX: waypoints are places, a track or route that closes is a polygon.

    Raises:
        ReadingError: With the feature at fault.
    """
    root = _xml(_bytes(path))
    if _tag(root) != "gpx":
        raise ReadingError(("", f"the file is no GPX: its root is <{_tag(root)}>"))
    shapes: list[Shape] = []
    warnings: list[str] = []
    for number, element in enumerate((e for e in root if _tag(e) in ("wpt", "rte", "trk")), 1):
        if number > FEATURES_MAX:
            raise ReadingError(("", f"more than the {FEATURES_MAX} features taken"))
        name = next(((e.text or "").strip() for e in element if _tag(e) == "name"), "")
        for each in element.iter():
            _refuse_active(f"feature {number}", each.text or "")
        points = [element] if _tag(element) == "wpt" else []
        points += [e for e in element.iter() if _tag(e) in ("rtept", "trkpt")]
        try:
            ring = [(float(e.attrib["lon"]), float(e.attrib["lat"])) for e in points]
        except (KeyError, ValueError) as error:
            raise ReadingError((f"feature {number}", "a point has no lat and lon")) from error
        if not ring:
            raise ReadingError((f"feature {number}", "has no points"))
        kind = "point" if _tag(element) == "wpt" else _closed(ring)
        if kind == "line":
            warnings.append(f"feature {number} is a way that does not close; it is left out.")
        shape = _shape(number, name, kind, [_geographic(number, ring, None)])
        _take_words(shape, {"kind": next((e.text for e in element if _tag(e) == "type"), "")})
        shapes.append(shape)
    return Reading("GPX", shapes=shapes, warnings=warnings)


def _closed(ring: list[tuple[float, float]]) -> str:
    steps = [math.dist(a, b) for a, b in itertools.pairwise(ring)]
    is_closed = len(set(ring)) > 2 and math.dist(ring[0], ring[-1]) <= _CLOSED_SHARE * sum(steps)
    return "polygon" if is_closed else "line"


def _bytes(path: Path) -> bytes:
    size = path.stat().st_size
    if size > BYTES_MAX:
        raise ReadingError(("", f"{size / 2**20:.0f} MB are more than the {BYTES_MAX >> 20} taken"))
    if size == 0:
        raise ReadingError(("", "the file is empty"))
    return path.read_bytes()


def _xml(content: bytes) -> Element:
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import parse

    try:
        root = parse(io.BytesIO(content), forbid_dtd=True).getroot()
    except ParseError as error:
        raise ReadingError((f"line {error.position[0]}", f"no XML: {error}")) from error
    except DefusedXmlException as error:
        raise ReadingError(("", "the file declares entities or a document type")) from error
    except (ValueError, LookupError) as error:
        raise ReadingError(("", f"no XML: {error}")) from error
    if root is None:
        raise ReadingError(("", "the file is empty"))
    return root


def _tag(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _refuse_active(place: str, text: str) -> None:
    folded = text.lower()
    for word in _ACTIVE:
        if word in folded:
            raise ReadingError((place, f"holds active content ({word.strip('<=:')}); take it out"))
