"""Compiled twin of ``autonomy.planner.leg.waterway``: looks the raster up along a way."""

import math

from autonomy.compiled import kernel
from autonomy.planner.leg.waterway import CHORD_MAX_RAD, Waterway


@kernel
def is_open(waterway: Waterway, x: float, y: float) -> bool:
    """Tell whether a robot may surface at a place (``waterway.depth_at`` is not closed)."""
    rows, columns = waterway.depth.shape
    if rows == 0:
        return True
    i = min(max(math.floor((x - waterway.x_min) / waterway.cell), 0), rows - 1)
    j = min(max(math.floor((y - waterway.y_min) / waterway.cell), 0), columns - 1)
    return waterway.depth[i, j] >= 0.0


@kernel
def holds_line(
    waterway: Waterway, start: tuple[float, float, float], end: tuple[float, float, float]
) -> bool:
    """Tell whether a straight way stays in the water (``waterway.holds_line``).

    It goes from cell to cell, and wants each deep enough for the deeper end of the way in it.
    """
    rows, columns = waterway.depth.shape
    if rows == 0:
        return True
    x, y, z = start
    dx, dy, dz = (end[0] - x) / waterway.cell, (end[1] - y) / waterway.cell, end[2] - z
    x = (x - waterway.x_min) / waterway.cell
    y = (y - waterway.y_min) / waterway.cell
    i = min(max(math.floor(x), 0), rows - 1)
    j = min(max(math.floor(y), 0), columns - 1)
    north = 1 if dx > 0.0 else -1
    east = 1 if dy > 0.0 else -1
    at_row = (i + (dx > 0.0) - x) / dx if dx != 0.0 else math.inf
    at_column = (j + (dy > 0.0) - y) / dy if dy != 0.0 else math.inf
    part = 0.0
    while True:
        leaves = min(at_row, at_column, 1.0)
        if max(z + part * dz, z + leaves * dz) > waterway.depth[i, j]:
            return False
        if leaves >= 1.0:
            return True
        part = leaves
        if at_row <= at_column:
            i += north
            at_row += 1.0 / abs(dx)
            if not 0 <= i < rows:
                i, at_row = i - north, math.inf
        else:
            j += east
            at_column += 1.0 / abs(dy)
            if not 0 <= j < columns:
                j, at_column = j - east, math.inf


@kernel
def chords(waterway: Waterway, radius: float, turn: float) -> int:
    """Return of how many chords to make an arc (``waterway.chords``)."""
    widest = 2.0 * math.acos(max(1.0 - waterway.slack / radius, 0.0))
    return max(math.ceil(abs(turn) / min(widest, CHORD_MAX_RAD)), 1)
