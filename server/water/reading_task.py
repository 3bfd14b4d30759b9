"""Reads one file into a proposal, in a worker process."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.chart import CORNERS_MAX
from autonomy.frames import ned_from_wgs84
from autonomy.outline import first_crossing
from server.water import depth_file, shape_file
from server.water.proposal import (
    DepthField,
    Extent,
    ImportProposal,
    LatitudeLongitude,
    ReadDepths,
    ReadFeature,
    Reading,
    ReadingError,
    ReadingStoppedError,
    Shape,
    extent_of,
    keep_reading,
    refusal,
)

TASK = f"{__name__}:run"
_SHOWN_FEATURES = 500
_SKETCH_CORNERS = 200
_SKETCH_RINGS = 8
_SKETCH_SIDE = 800.0
"""Of a sketch: corners of a ring, rings, and how fine it is of its length or width."""
_REACH_M = 500_000.0
"""A water is at most so far from its middle."""
_KEEP_OUT_WORDS = re.compile(r"keep.?out|no.?go|restrict|forbid|exclu|prohibit", re.IGNORECASE)
_ISLAND_WORDS = re.compile(r"island|isle|islet|land", re.IGNORECASE)
FORMATS = ("geojson", "kml", "kmz", "gpx", "geotiff", "netcdf", "xyz")
_SUFFIXES: Mapping[str, str] = {
    ".geojson": "geojson",
    ".json": "geojson",
    ".kml": "kml",
    ".kmz": "kmz",
    ".gpx": "gpx",
    ".tif": "geotiff",
    ".tiff": "geotiff",
    ".nc": "netcdf",
    ".nc4": "netcdf",
    ".xyz": "xyz",
    ".txt": "xyz",
    ".csv": "xyz",
    ".dat": "xyz",
}


@dataclass(frozen=True, slots=True)
class ReadingOrder:
    """What is to be read."""

    path: Path
    file: str
    """Its name, as the operator knows it."""
    format: str
    """One of ``FORMATS``, or "" to go by the name."""
    crs: str
    """What its coordinates are; "" believes the file."""
    folder: Path
    token: str


def run(
    order: ReadingOrder, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> dict[str, Any]:
    """Read a file and keep what was read as a proposal.

    Returns:
        ``ImportProposal``, or ``ImportRefusal`` with the faults.
    """

    def tick(share: float) -> None:
        if is_cancelled():
            raise ReadingStoppedError
        report((0.1 + 0.7 * share, "Reading the file"))

    try:
        reading = _read(order, tick)
        report((0.85, "Looking at what was read"))
        _take_roles(reading.shapes)
        _check_shapes(reading)
        if is_cancelled():
            raise ReadingStoppedError
        proposal = _proposal(order, reading)
    except ReadingError as error:
        return dict(refusal(error))
    keep_reading(order.folder, order.token, reading)
    return dict(proposal)


def _read(order: ReadingOrder, tick: depth_file.Tick) -> Reading:
    form = order.format or _SUFFIXES.get(Path(order.file).suffix.lower(), "")
    project = _projection(order.crs) if order.crs else None
    match form:
        case "geojson":
            return shape_file.read_geojson(order.path, project)
        case "kml":
            return shape_file.read_kml(order.path)
        case "kmz":
            return shape_file.read_kmz(order.path)
        case "gpx":
            return shape_file.read_gpx(order.path)
        case "geotiff":
            return depth_file.read_geotiff(order.path, order.crs, tick)
        case "netcdf":
            return depth_file.read_netcdf(order.path, order.crs, tick)
        case "xyz":
            return depth_file.read_xyz(order.path, order.crs, tick)
        case _:
            known = ", ".join(sorted(_SUFFIXES))
            raise ReadingError(("format", f"{order.file!r} tells none; known are {known}"))


def _projection(crs: str) -> shape_file.Project:
    from pyproj import Transformer

    depth_file.describe_crs(crs)
    turn = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)

    def project(ring: Sequence[tuple[float, float]]) -> list[LatitudeLongitude]:
        longitude, latitude = turn.transform(*np.array(ring).T)
        if not (np.isfinite(longitude).all() and np.isfinite(latitude).all()):
            raise ReadingError(("crs", f"a corner lies where {crs} means nothing"))
        return list(zip(latitude.tolist(), longitude.tolist(), strict=True))

    return project


def _take_roles(shapes: list[Shape]) -> None:
    """Say what each shape is taken for, unless its own words did.

    The largest polygon is the outline; others are keep-outs unless their names speak of land.
    """
    polygons = [each for each in shapes if each.geometry == "polygon"]
    if not any(each.role == "outline" for each in polygons):
        open_ = [
            each
            for each in polygons
            if each.role == "ignored" and not _KEEP_OUT_WORDS.search(each.name)
        ]
        if open_:
            max(open_, key=lambda each: _area(each.rings[0])).role = "outline"
    for each in polygons:
        if each.role == "ignored":
            is_land = _ISLAND_WORDS.search(each.name) and not _KEEP_OUT_WORDS.search(each.name)
            each.role = "island" if is_land else "keep_out"
    for each in shapes:
        if each.geometry == "point":
            each.role = "place"


def _area(ring: list[LatitudeLongitude]) -> float:
    latitude, longitude = np.array(ring).T
    x, y = longitude * math.cos(math.radians(float(latitude.mean()))), latitude
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def _check_shapes(reading: Reading) -> None:
    """Refuse shapes that are no areas of one water, each by its feature."""
    used = [each for each in reading.shapes if each.role != "ignored"]
    if reading.depths is None and not used:
        raise ReadingError(("", "the file holds no polygon and no point"))
    if len({each.number for each in used if each.role == "outline"}) > 1:
        raise ReadingError(("", "more than one feature is an outline; a water has one"))
    corners = sum(len(ring) for each in used for ring in each.rings)
    if corners > CORNERS_MAX:
        largest = max(used, key=lambda each: sum(map(len, each.rings)))
        raise ReadingError(
            (
                f"feature {largest.number}",
                f"the file has {corners} corners; {CORNERS_MAX} are the most",
            )
        )
    faults: list[tuple[str, str]] = []
    for each in used:
        if each.geometry == "polygon":
            faults += [(f"feature {each.number}", text) for text in _flaws(each)]
    if faults:
        raise ReadingError(*faults[:20])
    outlines = [each for each in used if each.role == "outline"]
    if len(outlines) > 1:
        raise ReadingError(
            (f"feature {outlines[0].number}", "is in several parts; a water is in one piece")
        )


def _flaws(shape: Shape) -> list[str]:
    from shapely.geometry import Polygon
    from shapely.validation import explain_validity

    latitude, longitude = np.mean(shape.rings[0], axis=0).tolist()
    origin = (latitude, longitude)
    rings = [_framed(ring, origin) for ring in shape.rings]
    if np.abs(rings[0]).max() > 2.0 * _REACH_M:
        return [f"is more than {2 * _REACH_M / 1e3:.0f} km wide"]
    for number, ring in enumerate(rings):
        crossing = first_crossing(ring)
        if crossing is not None:
            of = "" if number == 0 else f" of hole {number}"
            return [
                f"crosses itself: the side after corner {crossing[0] + 1}{of}"
                f" meets the side after corner {crossing[1] + 1}"
            ]
    polygon = Polygon(rings[0], rings[1:])
    if not polygon.is_valid:
        return [f"is no area: {explain_validity(polygon)} (north and east, m, from its middle)"]
    if polygon.area < 1.0:
        return ["encloses less than a square metre"]
    return []


def _framed(places: Sequence[LatitudeLongitude], origin: LatitudeLongitude) -> FloatArray:
    latitude, longitude = np.array(places).T
    return ned_from_wgs84(latitude, longitude, *origin)


def _proposal(order: ReadingOrder, reading: Reading) -> ImportProposal:
    places = [at for each in reading.shapes for ring in each.rings for at in ring]
    grid = reading.depths
    if grid is not None:
        places = _grid_border(grid)
    extent = extent_of(places)
    origin = (0.5 * (extent["south"] + extent["north"]), 0.5 * (extent["west"] + extent["east"]))
    reach = np.abs(_framed(places, origin)).max()
    if reach > _REACH_M or extent["east"] - extent["west"] > 180.0:
        raise ReadingError(
            (
                "",
                f"spans {_words_of(extent)}; a water is at most {2 * _REACH_M / 1e3:.0f} km wide,"
                " on one side of the antimeridian",
            )
        )
    proposal = ImportProposal(
        proposal=order.token,
        kind="shapes" if grid is None else "depths",
        file=order.file,
        format=reading.format,
        crs=reading.crs
        if grid is not None or not order.crs
        else depth_file.describe_crs(order.crs)[0],
        datum=reading.datum
        if grid is not None or not order.crs
        else depth_file.describe_crs(order.crs)[1],
        extent=extent,
        origin_latitude_deg=round(origin[0], 6),
        origin_longitude_deg=round(origin[1], 6),
        features=[_feature(each) for each in reading.shapes[:_SHOWN_FEATURES]],
        features_total=len(reading.shapes),
        warnings=reading.warnings,
    )
    if grid is not None:
        proposal["depths"] = _depths(grid, origin)
    return proposal


def _words_of(extent: Extent) -> str:
    return (
        f"latitude {extent['south']:.4g} to {extent['north']:.4g},"
        f" longitude {extent['west']:.4g} to {extent['east']:.4g}"
    )


def _feature(shape: Shape) -> ReadFeature:
    return ReadFeature(
        number=shape.number,
        name=shape.name,
        role=shape.role,
        geometry=shape.geometry,
        corners=sum(map(len, shape.rings)),
        holes=max(len(shape.rings) - 1, 0) if shape.geometry == "polygon" else 0,
        sketch=_sketch(shape),
    )


def _sketch(shape: Shape) -> list[list[LatitudeLongitude]]:
    """Return the largest rings of a feature with few corners; what is smaller is not seen."""
    if shape.geometry == "point":
        return shape.rings
    from shapely import LineString

    rings = sorted(shape.rings, key=len, reverse=True)[:_SKETCH_RINGS]
    places = np.concatenate([np.array(ring) for ring in rings])
    within_deg = float(np.ptp(places, axis=0).max()) / _SKETCH_SIDE
    simple: list[list[LatitudeLongitude]] = []
    for ring in rings:
        line = LineString(ring).simplify(within_deg if len(ring) > _SKETCH_CORNERS else 0.0)
        step = max(1, len(line.coords) // _SKETCH_CORNERS)
        simple.append([(round(at[0], 7), round(at[1], 7)) for at in line.coords[::step]])
    return simple


def _grid_border(grid: DepthField) -> list[LatitudeLongitude]:
    """Return places along the border of a grid, WGS84."""
    x, y = np.linspace(grid.x[0], grid.x[-1], 25), np.linspace(grid.y[0], grid.y[-1], 25)
    border = [(a, b) for a in x.tolist() for b in (y[0], y[-1])]
    border += [(a, b) for b in y.tolist() for a in (x[0], x[-1])]
    return _projection(grid.crs)(border)


def _depths(grid: DepthField, origin: LatitudeLongitude) -> ReadDepths:
    depth = -grid.values if grid.are_heights else grid.values
    known = depth[np.isfinite(depth)]
    wet = known[known > 0.0]
    if not len(wet):
        raise ReadingError(("", "the file holds no water: nothing in it is below its datum"))
    i, j = len(grid.y) // 2, len(grid.x) // 2
    corner = _projection(grid.crs)(
        [
            (float(grid.x[j + dj - 1]), float(grid.y[i + di - 1]))
            for di, dj in ((0, 0), (1, 0), (0, 1))
        ]
    )
    here = _framed(corner, origin)
    return ReadDepths(
        rows=len(grid.y),
        columns=len(grid.x),
        spacing_m=round(float(np.hypot(*(here[1:] - here[0]).T).max()), 3),
        are_heights=grid.are_heights,
        shallowest_m=round(float(wet.min()), 3),
        deepest_m=round(float(wet.max()), 3),
        land_share=round(float((known <= 0.0).mean()), 4),
        unknown_share=round(float(np.isnan(grid.values).mean()), 4),
    )
