"""Where there is water enough: the depth that a plan may use, exactly and as a raster.

Exactly, a robot may be at a place if that lies inside the shoreline and the survey area and outside
of every keep-out, in all cases by the margin, down to the floor less its margin. The raster holds
this for searches, which ask millions of times: each cell has the depth that may be used in all of
it.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from autonomy.arrays import BoolArray, FloatArray
from autonomy.outline import Outline
from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import PositionNed
from autonomy.site import Area, Site

CLOSED = -1.0
"""Usable depth where no robot may be, not even at the surface."""
_ROOM_SHARE = 0.5
"""Part of the way from the domain's sides to those of the water, within which belief may stray."""
_CELLS_MAX = 256
"""Cells along the longer side of the domain."""
_SLACK_SHARE = 0.1
"""By how much of its size a cell's depth holds around the cell too; chords of an arc use this."""
CHORD_MAX_RAD = math.pi / 4.0
"""Longest chord of an arc."""


class Waterway(NamedTuple):
    """Usable depth on square cells over the domain; compiled code takes it as it is."""

    x_min: float
    y_min: float
    cell: float
    """Side of a cell, m."""
    slack: float
    """What holds for a cell holds this far around it too, m."""
    is_everywhere: bool
    """Whether nothing but the domain limits a plan."""
    depth: FloatArray
    """Usable depth in all of a cell, m, or ``CLOSED``, shape (north, east), or (0, 0)."""
    x_room: tuple[float, float]
    y_room: tuple[float, float]
    """Where a robot in a current may believe to be, m: its own limits act on what it believes."""


def closed_areas(config: PlannerConfig, site: Site | None) -> tuple[Area, ...]:
    """Return the keep-outs of a survey and those of its water."""
    return config.keep_outs if site is None else (*config.keep_outs, *site.keep_outs)


def bounds_of(config: PlannerConfig, site: Site | None) -> tuple[tuple[str, Outline], ...]:
    """Return what a survey stays inside of, by name: the shoreline and its own area."""
    found: list[tuple[str, Outline]] = []
    if site is not None and site.shore is not None:
        name = "Shore" if site.shoreline is None else site.shoreline.name
        found.append((f'the shoreline "{name}"', site.shore))
    if config.area is not None:
        found.append((f'the survey area "{config.area.name}"', config.area.outline))
    return tuple(found)


def usable_depth_m(
    config: PlannerConfig, site: Site | None, north_m: npt.ArrayLike, east_m: npt.ArrayLike
) -> FloatArray:
    """Return how deep a robot may be at places, or ``CLOSED``.

    Args:
        config: Keep-outs, margins and the domain's depth.
        site: Shoreline and floor; None for water without end.
        north_m: Northings, any shape.
        east_m: Eastings, of the same shape.
    """
    x, y = np.asarray(north_m, float), np.asarray(east_m, float)
    deepest = np.full(x.shape, config.domain.depth_max_m)
    if site is not None:
        deepest = np.minimum(deepest, site.floor_m(x, y) - config.floor_margin_m)
    return np.where(_clearance_m(config, site, x, y) >= config.margin_m, _opened(deepest), CLOSED)


def waterway_of(config: PlannerConfig, site: Site | None) -> Waterway:
    """Lay the raster over the domain.

    A cell is closed unless all of it is open, and as deep as its shallowest place.

    Args:
        config: Domain, keep-outs and margins.
        site: Shoreline and floor; None for water without end.
    """
    domain = config.domain
    rooms = _rooms(config, site)
    if site is None and not config.keep_outs and config.area is None:
        return Waterway(domain.x_min_m, domain.y_min_m, 1.0, 0.0, True, np.empty((0, 0)), *rooms)
    width, length = domain.x_max_m - domain.x_min_m, domain.y_max_m - domain.y_min_m
    cell = max(width, length) / _CELLS_MAX
    slack = _SLACK_SHARE * cell
    lines = (_cells(domain.x_min_m, width, cell), _cells(domain.y_min_m, length, cell))
    x, y = np.meshgrid(lines[0] + 0.5 * cell, lines[1] + 0.5 * cell, indexing="ij")
    reach = (0.5 * cell + slack) * math.sqrt(2.0)
    is_open = _is_clear(config, site, x, y, config.margin_m + reach)
    depth = np.where(is_open, _opened(_floor_of_cells(config, site, lines, cell, slack)), CLOSED)
    is_everywhere = bool((depth >= domain.depth_max_m).all())
    if is_everywhere:
        depth = np.empty((0, 0))
    return Waterway(domain.x_min_m, domain.y_min_m, cell, slack, is_everywhere, depth, *rooms)


def holds_line(waterway: Waterway, start: PositionNed, end: PositionNed) -> bool:
    """Tell whether a straight way stays in the water: the readable form of the compiled one."""
    if waterway.is_everywhere:
        return True
    (x0, y0, z0), (x1, y1, z1) = start, end
    crossings = [0.0, 1.0]
    for low, begin, change in ((waterway.x_min, x0, x1 - x0), (waterway.y_min, y0, y1 - y0)):
        if change != 0.0:
            first, last = sorted(
                ((begin - low) / waterway.cell, (begin + change - low) / waterway.cell)
            )
            lines = range(math.ceil(first), math.floor(last) + 1)
            crossings += [(low + k * waterway.cell - begin) / change for k in lines]
    for before, after in itertools.pairwise(sorted(crossings)):
        if not 0.0 <= before <= after <= 1.0:
            continue
        middle = 0.5 * (before + after)
        depth = depth_at(waterway, x0 + middle * (x1 - x0), y0 + middle * (y1 - y0))
        if depth < max(z0 + before * (z1 - z0), z0 + after * (z1 - z0)):
            return False
    return True


def depth_at(waterway: Waterway, north_m: float, east_m: float) -> float:
    """Return the usable depth of the cell at a place, that of the nearest one beyond the raster."""
    rows, columns = waterway.depth.shape
    if not rows:
        return math.inf
    i = math.floor((north_m - waterway.x_min) / waterway.cell)
    j = math.floor((east_m - waterway.y_min) / waterway.cell)
    return float(waterway.depth[min(max(i, 0), rows - 1), min(max(j, 0), columns - 1)])


def chords(waterway: Waterway, radius_m: float, turn_rad: float) -> int:
    """Return of how many chords an arc is made so that none is farther off than the slack."""
    widest = 2.0 * math.acos(max(1.0 - waterway.slack / radius_m, 0.0))
    return max(math.ceil(abs(turn_rad) / min(widest, CHORD_MAX_RAD)), 1)


def _rooms(
    config: PlannerConfig, site: Site | None
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return how far north and east belief may stray: half-way to the borders of the water."""
    domain = config.domain
    water = domain if site is None else site.water

    def between(own: float, outer: float) -> float:
        return own + _ROOM_SHARE * (outer - own)

    return (
        (between(domain.x_min_m, water.x_min_m), between(domain.x_max_m, water.x_max_m)),
        (between(domain.y_min_m, water.y_min_m), between(domain.y_max_m, water.y_max_m)),
    )


def _cells(begin: float, size: float, cell: float) -> FloatArray:
    """Return where each cell of one axis begins."""
    return begin + cell * np.arange(max(math.ceil(size / cell - 1e-9), 1), dtype=np.float64)


def _clearance_m(
    config: PlannerConfig, site: Site | None, x: FloatArray, y: FloatArray
) -> FloatArray:
    """Return the distance to the nearest shore, keep-out or end of the survey area.

    It is negative on land, inside of a keep-out and outside of the area.

    It is told up to a metre more than the margin.
    """
    clearance = np.full(x.shape, np.inf)
    within_m = config.margin_m + 1.0
    for _, outline in bounds_of(config, site):
        clearance = np.minimum(clearance, -outline.distance_m(x, y, within_m))
    for area in closed_areas(config, site):
        clearance = np.minimum(clearance, area.outline.distance_m(x, y, within_m))
    return clearance


def _is_clear(
    config: PlannerConfig, site: Site | None, x: FloatArray, y: FloatArray, margin_m: float
) -> BoolArray:
    """Tell which places are at least so far from shore, keep-outs and the survey area's end."""
    clear = np.ones(x.shape, dtype=np.bool_)
    for _, outline in bounds_of(config, site):
        clear &= -outline.distance_m(x, y, margin_m) >= margin_m
    for area in closed_areas(config, site):
        near = _around(area.outline, x, y, margin_m)
        clear[near] &= area.outline.distance_m(x[near], y[near], margin_m) >= margin_m
    return clear


def _around(area: Outline, x: FloatArray, y: FloatArray, margin_m: float) -> BoolArray:
    """Tell which places are within a margin of an area's bounding box."""
    (x0, y0), (x1, y1) = area.low.min(axis=0), area.high.max(axis=0)
    return (x > x0 - margin_m) & (x < x1 + margin_m) & (y > y0 - margin_m) & (y < y1 + margin_m)


def _opened(depth: FloatArray) -> FloatArray:
    return np.where(depth > 0.0, depth, CLOSED)


def _floor_of_cells(
    config: PlannerConfig,
    site: Site | None,
    lines: tuple[FloatArray, FloatArray],
    cell: float,
    slack: float,
) -> FloatArray:
    """Return the usable depth at the shallowest place of each cell, shape (north, east).

    A bilinear floor is shallowest at a corner of a cell or where a line of the bathymetry meets
    the cell's border or another line, so it is enough to look there.
    """
    deepest = config.domain.depth_max_m
    if site is None:
        return np.full((len(lines[0]), len(lines[1])), deepest)
    known = site.depth_lines or (np.empty(0), np.empty(0))
    axes, windows = zip(
        *(_windows(line, own, cell, slack) for line, own in zip(lines, known, strict=True)),
        strict=True,
    )
    floor = site.floor_m(axes[0][:, None], axes[1][None, :])
    for axis, window in enumerate(windows):
        # one more line that is never the shallowest, for windows that end with the last one
        padding = [(0, 0), (0, 0)]
        padding[axis] = (0, 1)
        padded = np.pad(floor, padding, constant_values=np.inf)
        every_other = np.minimum.reduceat(padded, window, axis=axis)
        floor = every_other[::2] if axis == 0 else every_other[:, ::2]
    return np.minimum(floor - config.floor_margin_m, deepest)


def _windows(
    lines: FloatArray, known: FloatArray, cell: float, slack: float
) -> tuple[FloatArray, npt.NDArray[np.intp]]:
    """Return where to look along one axis, and first and behind-last place of each cell's own."""
    low, high = lines - slack, lines + cell + slack
    inside = known[(known > low[0]) & (known < high[-1])]
    axis = np.unique(np.concatenate([low, high, inside]))
    first = np.searchsorted(axis, low)
    behind = np.searchsorted(axis, high, side="right")
    return axis, np.stack([first, behind], axis=1).ravel()
