"""Outlines and floors that are coarser than those of a chart, and leave its water nowhere."""

from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from autonomy.arrays import FloatArray
from autonomy.chart import DepthGrid
from server.water.proposal import ReadingError

SHORE_CORNERS_MAX = 128
ISLAND_CORNERS_MAX = 384
"""Of all islands together."""
ISLANDS_MAX = 64
LINES_MAX = 32
_AREA_CORNERS_MAX = 64
_FIRST_SHARE = 2e-4
_GROWTH = 1.35
_STEPS = 30
_SIMPLIFIED_SHARE = 0.9
"""Of what an outline is moved inwards, simplifying it may move it back by so much."""
_ROUND_M = 2


def simpler_shore(rings: tuple[FloatArray, ...]) -> tuple[FloatArray, ...]:
    """Return an outline with its islands that lies in the one given, with few corners.

    It is moved inwards and then simplified by less than that, ever more until few corners are
    left; of waters that fall apart on the way, the largest stays.

    Raises:
        ReadingError: If nothing is left of it.
    """
    from shapely.geometry import Polygon

    water = Polygon(rings[0], rings[1:])
    extent = float(np.ptp(rings[0], axis=0).max())
    for step in range(_STEPS):
        move = extent * _FIRST_SHARE * _GROWTH**step
        found: Any = water.buffer(-move, quad_segs=2).simplify(_SIMPLIFIED_SHARE * move)
        if found.is_empty:
            break
        part = max(getattr(found, "geoms", [found]), key=lambda each: each.area)
        outer = np.array(part.exterior.coords)[:-1].round(_ROUND_M)
        holes = [np.array(ring.coords)[:-1].round(_ROUND_M) for ring in part.interiors]
        if (
            len(outer) <= SHORE_CORNERS_MAX
            and len(holes) <= ISLANDS_MAX
            and sum(map(len, holes)) <= ISLAND_CORNERS_MAX
            and water.contains(Polygon(outer, holes))
        ):
            return (outer, *holes)
    raise ReadingError(("outline", "is too narrow and winding for a simple one to be found in it"))


def simpler_area(ring: FloatArray) -> FloatArray:
    """Return an area with few corners that holds the one given: a keep-out may only grow."""
    from shapely.geometry import Polygon

    if len(ring) <= _AREA_CORNERS_MAX:
        return ring
    area = Polygon(ring)
    extent = float(np.ptp(ring, axis=0).max())
    for step in range(_STEPS):
        move = extent * _FIRST_SHARE * _GROWTH**step
        found: Any = area.buffer(move, quad_segs=2).simplify(_SIMPLIFIED_SHARE * move)
        outer = np.array(found.exterior.coords)[:-1].round(_ROUND_M)
        if len(outer) <= _AREA_CORNERS_MAX and Polygon(outer).contains(area):
            return outer
    envelope: Any = area.envelope
    return np.array(envelope.exterior.coords)[:-1]


def simpler_floor(grid: DepthGrid) -> DepthGrid:
    """Return a floor of few lines that is nowhere deeper than the one given.

    Each crossing has the shallowest of all that lies in the four fields around it, so what is in
    between, being a mean of crossings, is no deeper either.
    """
    axes = [_fewer(axis) for axis in (grid.north_m, grid.east_m)]
    depth = grid.depth_m
    for axis, (lines, known) in enumerate(zip(axes, (grid.north_m, grid.east_m), strict=True)):
        # lines of the fine grid at and just beyond the sides of each field
        first = np.clip(np.searchsorted(known, lines[:-1], side="right") - 1, 0, len(known) - 1)
        last = np.clip(np.searchsorted(known, lines[1:], side="left"), 0, len(known) - 1)
        fields = np.stack(
            [depth.take(range(a, b + 1), axis).min(axis) for a, b in zip(first, last, strict=True)],
            axis,
        )
        padded = np.pad(fields, [(1, 1) if k == axis else (0, 0) for k in (0, 1)], mode="edge")
        depth = sliding_window_view(padded, 2, axis).min(axis=-1)
    # rounding must not deepen it
    return DepthGrid(
        axes[0], axes[1], np.floor(depth * 100.0).astype(np.float32) / np.float32(100.0)
    )


def _fewer(axis: FloatArray) -> FloatArray:
    return np.linspace(axis[0], axis[-1], min(len(axis), LINES_MAX))
