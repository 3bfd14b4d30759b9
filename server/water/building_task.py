"""Makes a water's document, and its chart if it needs one, of what an operator confirmed.

Runs in a worker process. The document of a water with a chart holds an outline and a floor that are
coarser, but leave the chart's water nowhere: whoever has not the chart stays in the water.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from autonomy.arrays import FloatArray
from autonomy.chart import CHARTS, CORNERS_MAX, LINES_MAX, Chart, DepthGrid, keep_chart
from autonomy.frames import ned_from_wgs84, wgs84_from_ned
from autonomy.site import CORNERS_MAX as DOCUMENT_CORNERS_MAX
from autonomy.site import Area, Bathymetry, Box, ChartSummary, Place, Site
from server.water.proposal import (
    DepthField,
    LatitudeLongitude,
    Reading,
    ReadingError,
    Shape,
    load_reading,
    refusal,
)
from server.water.simple_shore import simpler_area, simpler_floor, simpler_shore

TASK = f"{__name__}:run"
_DOCUMENT_ISLANDS_MAX = 64
_DOCUMENT_LINES_MAX = 64
_MESH = 64
"""Pieces a side in which places of the frame are turned to the file's coordinates exactly."""
_ROWS_AT_ONCE = 256
_ROUND_M = 2
Rings = tuple[FloatArray, ...]


@dataclass(frozen=True, slots=True)
class Confirmed:
    """A proposal as the operator confirmed it."""

    token: str
    are_heights: bool | None = None
    """Whether depths are negative heights; None for as it was proposed."""
    roles: Mapping[int, str] = field(default_factory=dict)
    """Other roles of features, by their numbers."""


@dataclass(frozen=True, slots=True)
class BuildOrder:
    """What is to be made of which proposals."""

    site: Site
    """The water as it is; of a new one its words."""
    is_new: bool
    """Whether origin, box and depth are to come from the proposals."""
    depth_max_m: float | None
    """How deep the water is where no grid tells."""
    proposals: tuple[Confirmed, ...]
    proposal_folder: Path
    chart_folder: Path


def run(
    order: BuildOrder, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> dict[str, Any]:
    """Return ``{"site": document}``, or an ``ImportRefusal``."""
    del report, is_cancelled
    CHARTS.open(order.chart_folder)
    try:
        return {"site": _built(order).model_dump(mode="json")}
    except ReadingError as error:
        return dict(refusal(error))
    except ValidationError as error:
        faults = [(".".join(map(str, one["loc"])), one["msg"]) for one in error.errors()]
        return dict(refusal(ReadingError(*faults[:20])))


def _built(order: BuildOrder) -> Site:
    readings = [_confirmed(order, one) for one in order.proposals]
    shapes = [shape for reading in readings for shape in reading.shapes]
    outline = _outline(shapes)
    field_ = next((one.depths for one in reversed(readings) if one.depths is not None), None)
    site = order.site
    origin = (site.origin_latitude_deg, site.origin_longitude_deg)
    if order.is_new:
        origin = _middle(outline, field_, shapes)
    rings = _rings(outline, shapes, origin) if outline else _known_rings(site)
    box = site.water
    if outline is not None:
        box = _box_around(rings[0], site.water.depth_max_m)
    elif order.is_new and field_ is not None:
        box = _box_inside(field_, origin)
    grid = _known_depths(site) if field_ is None else _resampled(field_, box, origin)
    deepest = _deepest(order, grid, is_told=field_ is not None)
    box = box.model_copy(update={"depth_max_m": deepest})
    changes: dict[str, Any] = {
        "origin_latitude_deg": origin[0],
        "origin_longitude_deg": origin[1],
        "water": box,
        "domain": box if order.is_new or outline is not None else _within(site.domain, box),
        "keep_outs": [*site.keep_outs, *_keep_outs(shapes, origin, site.keep_outs)],
        "places": [*site.places, *_places(shapes, origin, site.places)],
        **_forms(rings, grid, order.chart_folder),
    }
    return Site.model_validate({**dict(site), **changes})


def _confirmed(order: BuildOrder, one: Confirmed) -> Reading:
    try:
        reading = load_reading(order.proposal_folder, one.token)
    except FileNotFoundError as error:
        raise ReadingError(
            ("proposals", f"there is no proposal {one.token!r} any more; import the file again")
        ) from error
    if reading.depths is not None and one.are_heights is not None:
        reading.depths.are_heights = one.are_heights
    numbers = {shape.number for shape in reading.shapes}
    for number, role in one.roles.items():
        if number not in numbers:
            raise ReadingError(("proposals", f"the file has no feature {number}"))
        for shape in reading.shapes:
            if shape.number == number:
                _give_role(shape, role)
    return reading


def _give_role(shape: Shape, role: str) -> None:
    is_area = role in ("outline", "island", "keep_out")
    if is_area != (shape.geometry == "polygon") and role != "ignored":
        raise ReadingError((f"feature {shape.number}", f"is a {shape.geometry}, no {role}"))
    shape.role = role  # pyright: ignore[reportAttributeAccessIssue] - the request's model holds it


def _outline(shapes: Sequence[Shape]) -> Shape | None:
    outlines = [shape for shape in shapes if shape.role == "outline"]
    if len(outlines) > 1:
        raise ReadingError(("proposals", "more than one feature is an outline; a water has one"))
    return outlines[0] if outlines else None


def _middle(
    outline: Shape | None, grid: DepthField | None, shapes: Sequence[Shape]
) -> LatitudeLongitude:
    if outline is not None:
        places = np.array(outline.rings[0])
    elif grid is not None:
        x, y = np.meshgrid([grid.x[0], grid.x[-1]], [grid.y[0], grid.y[-1]])
        places = _to_wgs84(grid.crs, x.ravel(), y.ravel())
    else:
        places = np.array([at for shape in shapes for ring in shape.rings for at in ring])
    low, high = places.min(axis=0), places.max(axis=0)
    latitude, longitude = (0.5 * (low + high)).round(6).tolist()
    return latitude, longitude


def _rings(outline: Shape, shapes: Sequence[Shape], origin: LatitudeLongitude) -> Rings:
    """Return the shoreline and its islands in the frame; islands that are no holes are cut out."""
    from shapely import union_all
    from shapely.geometry import Polygon

    rings = [_framed(ring, origin) for ring in outline.rings]
    water = Polygon(rings[0], rings[1:])
    land = [Polygon(_framed(shape.rings[0], origin)) for shape in shapes if shape.role == "island"]
    if land:
        cut: Any = water.difference(union_all(land))
        if cut.geom_type != "Polygon" or cut.is_empty:
            raise ReadingError(
                (f"feature {outline.number}", "the islands cut the water into several pieces")
            )
        water = cut
    found = tuple(np.array(ring.coords)[:-1] for ring in (water.exterior, *water.interiors))
    if sum(map(len, found)) > CORNERS_MAX:
        raise ReadingError(("", f"the outline has more than {CORNERS_MAX} corners"))
    return found


def _framed(ring: Sequence[LatitudeLongitude], origin: LatitudeLongitude) -> FloatArray:
    latitude, longitude = np.array(ring, dtype=np.float64).T
    return ned_from_wgs84(latitude, longitude, *origin)


def _known_rings(site: Site) -> Rings:
    return () if site.shore is None else site.shore.rings


def _known_depths(site: Site) -> DepthGrid | None:
    chart = None if site.chart is None else CHARTS.find(site.chart.sha256)
    if chart is not None and chart.depths is not None:
        return chart.depths
    known = site.bathymetry
    if known is None:
        return None
    depth = np.array(known.depth_m, dtype=np.float32)
    return DepthGrid(np.array(known.north_m), np.array(known.east_m), depth)


def _box_around(ring: FloatArray, depth_m: float) -> Box:
    (x0, y0), (x1, y1) = ring.min(axis=0).tolist(), ring.max(axis=0).tolist()
    return Box(
        x_min_m=math.floor(x0),
        x_max_m=math.ceil(x1),
        y_min_m=math.floor(y0),
        y_max_m=math.ceil(y1),
        depth_max_m=depth_m,
    )


def _box_inside(grid: DepthField, origin: LatitudeLongitude) -> Box:
    """Return a box of the frame of which no part is beyond the grid."""
    x, y = np.linspace(grid.x[0], grid.x[-1], 33), np.linspace(grid.y[0], grid.y[-1], 33)

    def side(xs: FloatArray, ys: FloatArray) -> FloatArray:
        latitude, longitude = _to_wgs84(grid.crs, xs, ys).T
        return ned_from_wgs84(latitude, longitude, *origin)

    south, north = side(x, np.full(33, y[0]))[:, 0], side(x, np.full(33, y[-1]))[:, 0]
    west, east = side(np.full(33, x[0]), y)[:, 1], side(np.full(33, x[-1]), y)[:, 1]
    return Box(
        x_min_m=float(math.ceil(south.max())),
        x_max_m=float(math.floor(north.min())),
        y_min_m=float(math.ceil(west.max())),
        y_max_m=float(math.floor(east.min())),
        depth_max_m=1.0,
    )


def _to_wgs84(crs: str, x: FloatArray, y: FloatArray) -> FloatArray:
    from pyproj import Transformer

    longitude, latitude = Transformer.from_crs(crs, "EPSG:4326", always_xy=True).transform(x, y)
    return np.stack([latitude, longitude], axis=-1)


def _resampled(source: DepthField, box: Box, origin: LatitudeLongitude) -> DepthGrid:
    """Lay a file's grid on even lines of the frame; what the file does not know is land."""
    from pyproj import Transformer

    turn = Transformer.from_crs("EPSG:4326", source.crs, always_xy=True)
    sides = (box.x_max_m - box.x_min_m, box.y_max_m - box.y_min_m)
    mesh_north = np.linspace(box.x_min_m, box.x_max_m, _MESH + 1)
    mesh_east = np.linspace(box.y_min_m, box.y_max_m, _MESH + 1)
    places = np.stack(np.meshgrid(mesh_north, mesh_east, indexing="ij"), axis=-1)
    globe = wgs84_from_ned(places, *origin)
    mesh = np.stack(turn.transform(globe[..., 1], globe[..., 0]), axis=-1)  # x, y of the file
    if not np.isfinite(mesh).all():
        raise ReadingError(
            ("crs", "the water lies where the file's reference system means nothing")
        )
    steps = np.abs(np.diff(mesh, axis=0)).max(), np.abs(np.diff(mesh, axis=1)).max()
    finest = min(float(np.diff(source.x).min()), float(np.diff(source.y).min()))
    counts = [min(max(math.ceil(_MESH * step / finest) + 1, 2), LINES_MAX) for step in steps]
    north = np.linspace(box.x_min_m, box.x_max_m, counts[0])
    east = np.linspace(box.y_min_m, box.y_max_m, counts[1])
    sign = -1.0 if source.are_heights else 1.0
    depth = np.empty((counts[0], counts[1]), dtype=np.float32)
    across = (east - box.y_min_m) / sides[1] * _MESH
    for first in range(0, counts[0], _ROWS_AT_ONCE):
        rows = slice(first, min(first + _ROWS_AT_ONCE, counts[0]))
        along = (north[rows] - box.x_min_m) / sides[0] * _MESH
        at = _bilinear(mesh, along[:, None], across[None, :])
        values = sign * _looked_up(source, at[..., 0], at[..., 1])
        depth[rows] = np.where(np.isfinite(values), values, 0.0)
    if not (depth > 0.0).any():
        raise ReadingError(("depths", "the file knows no water here; is it of another place?"))
    return DepthGrid(north, east, depth.round(_ROUND_M))


def _bilinear(table: FloatArray, row: FloatArray, column: FloatArray) -> FloatArray:
    i = np.clip(row.astype(np.intp), 0, len(table) - 2)
    j = np.clip(column.astype(np.intp), 0, table.shape[1] - 2)
    a, b = row - i, column - j
    if table.ndim == 3:
        a, b = a[..., None], b[..., None]
    south = table[i, j] * (1.0 - b) + table[i, j + 1] * b
    north = table[i + 1, j] * (1.0 - b) + table[i + 1, j + 1] * b
    return south * (1.0 - a) + north * a


def _looked_up(source: DepthField, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return a file's values at places, NaN beyond its outermost points."""
    row = np.interp(y, source.y, np.arange(len(source.y)), left=np.nan, right=np.nan)
    column = np.interp(x, source.x, np.arange(len(source.x)), left=np.nan, right=np.nan)
    is_known = np.isfinite(row) & np.isfinite(column)
    row, column = np.where(is_known, row, 0.0), np.where(is_known, column, 0.0)
    found = _bilinear(source.values.astype(np.float64), row, column)
    return np.where(is_known, found, np.nan)


def _deepest(order: BuildOrder, grid: DepthGrid | None, *, is_told: bool) -> float:
    """Return how deep the box of water is: as its grid tells, else as the operator did."""
    if order.depth_max_m is not None:
        return order.depth_max_m
    if grid is None or not is_told:
        if order.is_new:
            raise ReadingError(("depth_max_m", "say how deep the water is; no file tells"))
        return order.site.water.depth_max_m
    deepest = float(grid.depth_m.max()) + order.site.tide_offset_m
    if deepest <= 0.0:
        raise ReadingError(("depths", "there is no water: nothing lies below the datum"))
    return math.ceil(10.0 * deepest) / 10.0


def _within(domain: Box, water: Box) -> Box:
    """Return the part of a domain that is in the water, all of the water where there is none."""
    try:
        return Box(
            x_min_m=max(domain.x_min_m, water.x_min_m),
            x_max_m=min(domain.x_max_m, water.x_max_m),
            y_min_m=max(domain.y_min_m, water.y_min_m),
            y_max_m=min(domain.y_max_m, water.y_max_m),
            depth_max_m=min(domain.depth_max_m, water.depth_max_m),
        )
    except ValidationError:
        return water


def _keep_outs(
    shapes: Sequence[Shape], origin: LatitudeLongitude, known: Sequence[Area]
) -> list[Area]:
    names = {area.name for area in known}
    areas: list[Area] = []
    for shape in shapes:
        if shape.role == "keep_out":
            name = _free_name(shape.name or f"Keep-out {shape.number}", names)
            ring = simpler_area(_framed(shape.rings[0], origin))
            areas.append(Area(name=name, corners_m=_corners(ring)))
    return areas


def _places(
    shapes: Sequence[Shape], origin: LatitudeLongitude, known: Sequence[Place]
) -> list[Place]:
    names = {place.name for place in known}
    places: list[Place] = []
    for shape in shapes:
        if shape.role == "place":
            latitude, longitude = shape.rings[0][0]
            north, east = _framed(shape.rings[0][:1], origin)[0].tolist()
            places.append(
                Place.model_validate(
                    {
                        "name": _free_name(shape.name or f"Place {shape.number}", names),
                        "kind": shape.place_kind,
                        "latitude_deg": latitude,
                        "longitude_deg": longitude,
                        "north_m": round(north, _ROUND_M),
                        "east_m": round(east, _ROUND_M),
                        "depth_m": shape.depth_m,
                    }
                )
            )
    return places


def _free_name(wish: str, taken: set[str]) -> str:
    names = (wish[:60], *(f"{wish[:55]} {number}" for number in range(2, len(taken) + 3)))
    found = next(name for name in names if name not in taken)
    taken.add(found)
    return found


def _forms(rings: Rings, grid: DepthGrid | None, chart_folder: Path) -> dict[str, Any]:
    """Return outline, floor and chart as the document has them."""
    is_long = (
        len(rings) > 1 + _DOCUMENT_ISLANDS_MAX
        or max(map(len, rings), default=0) > DOCUMENT_CORNERS_MAX
        or sum(map(len, rings)) > 2 * DOCUMENT_CORNERS_MAX
    )
    is_large = grid is not None and max(grid.depth_m.shape) > _DOCUMENT_LINES_MAX
    summary = None
    if is_long or is_large:
        chart = Chart(rings, grid)
        summary = _summary(keep_chart(chart_folder, chart), chart)
    if is_long:
        rings = simpler_shore(rings)
    if is_large and grid is not None:
        grid = simpler_floor(grid)
    shore = [Area(name="Shore", corners_m=_corners(ring)) for ring in rings[:1]]
    return {
        "chart": summary,
        "shoreline": shore[0] if shore else None,
        "islands": [
            Area(name=f"Island {number}", corners_m=_corners(ring))
            for number, ring in enumerate(rings[1:], start=1)
        ],
        "bathymetry": None if grid is None else _bathymetry(grid),
    }


def _summary(sha256: str, chart: Chart) -> ChartSummary:
    grid = chart.depths
    spacing = 0.0
    if grid is not None:
        spacing = max(float(np.diff(axis).max()) for axis in (grid.north_m, grid.east_m))
    return ChartSummary(
        sha256=sha256,
        corners=sum(map(len, chart.rings)),
        islands=max(len(chart.rings) - 1, 0),
        rows=0 if grid is None else len(grid.north_m),
        columns=0 if grid is None else len(grid.east_m),
        spacing_m=round(spacing, 3),
    )


def _bathymetry(grid: DepthGrid) -> Bathymetry:
    depth: npt.NDArray[np.float64] = grid.depth_m.astype(np.float64)
    return Bathymetry(
        north_m=tuple(grid.north_m.tolist()),
        east_m=tuple(grid.east_m.tolist()),
        depth_m=tuple(tuple(row) for row in depth.round(_ROUND_M).tolist()),
    )


def _corners(ring: FloatArray) -> tuple[tuple[float, float], ...]:
    return tuple((north, east) for north, east in ring.round(_ROUND_M).tolist())
