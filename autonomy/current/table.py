"""The mean current on a grid of place, depth and time, linear in between, for hot loops.

Compiled code has a twin of ``flow_at`` (``autonomy.planner.leg.flow_kernel``).
"""

import math
from typing import NamedTuple

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.current.model import CurrentMap
from autonomy.site import Box

TABLE_SHAPE = (8, 8, 4, 12)
"""Points north, east, down and in time."""


class FlowTable(NamedTuple):
    """A current by place, depth and time; beyond its ends it is what it is at them."""

    values: FloatArray
    """North and east, m/s, shape ``(nx, ny, nz, nt, 2)``."""
    low: tuple[float, float, float, float]
    """Least north, east, depth, m, and time, s."""
    per_step: tuple[float, float, float, float]
    """Steps of the grid per m and s; 0 along an axis of one point."""


def uniform_table(north_m_s: float, east_m_s: float) -> FlowTable:
    """Return the table of a current that is the same everywhere and always."""
    values = np.array([north_m_s, east_m_s]).reshape(1, 1, 1, 1, 2)
    return FlowTable(values, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))


def tabulate(
    known: CurrentMap,
    domain: Box,
    from_s: float,
    until_s: float,
    shape: tuple[int, int, int, int] = TABLE_SHAPE,
) -> FlowTable:
    """Return the mean current of a map over a domain and a time.

    Args:
        known: The map.
        domain: Where.
        from_s: From when, s; the table's own time 0.
        until_s: Until when, s.
        shape: Points north, east, down and in time, at least two each.
    """
    low = (domain.x_min_m, domain.y_min_m, 0.0, from_s)
    high = (domain.x_max_m, domain.y_max_m, domain.depth_max_m, max(until_s, from_s + 1.0))
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, shape, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 4)
    values = known.mean_flow(grid).reshape(*shape, 2)
    per_step = [(n - 1) / (b - a) for a, b, n in zip(low, high, shape, strict=True)]
    return FlowTable(
        values,
        (low[0], low[1], 0.0, 0.0),
        (per_step[0], per_step[1], per_step[2], per_step[3]),
    )


def largest_speed_m_s(table: FlowTable) -> float:
    """Return the speed of the strongest current of a table."""
    return float(np.hypot(table.values[..., 0], table.values[..., 1]).max())


def displacement_along(
    table: FlowTable, time_s: FloatArray, position_ned: FloatArray
) -> tuple[float, float]:
    """Return how far a table's current carries a robot along a believed track; readable form."""
    carried = np.zeros(2)
    for i in range(len(time_s) - 1):
        middle = 0.5 * (position_ned[i] + position_ned[i + 1])
        at_s = 0.5 * (time_s[i] + time_s[i + 1])
        place = (middle[0] + carried[0], middle[1] + carried[1], middle[2])
        u = np.array(flow_at(table, place[0], place[1], place[2], at_s))
        carried += u * (time_s[i + 1] - time_s[i])
    return float(carried[0]), float(carried[1])


def flow_at(table: FlowTable, x: float, y: float, z: float, t: float) -> tuple[float, float]:
    """Return the current at a place, depth and time of a table, north and east."""
    values = table.values
    i, a = _cell(x, table.low[0], table.per_step[0], values.shape[0])
    j, b = _cell(y, table.low[1], table.per_step[1], values.shape[1])
    k, c = _cell(z, table.low[2], table.per_step[2], values.shape[2])
    n, d = _cell(t, table.low[3], table.per_step[3], values.shape[3])
    north, east = 0.0, 0.0
    for corner in range(16):
        di, dj, dk, dn = corner & 1, (corner >> 1) & 1, (corner >> 2) & 1, corner >> 3
        weight = (
            (a if di else 1.0 - a)
            * (b if dj else 1.0 - b)
            * (c if dk else 1.0 - c)
            * (d if dn else 1.0 - d)
        )
        if weight > 0.0:
            here = values[i + di, j + dj, k + dk, n + dn]
            north += weight * here[0]
            east += weight * here[1]
    return north, east


def _cell(at: float, low: float, per_step: float, count: int) -> tuple[int, float]:
    """Return the cell of a grid that a coordinate lies in, and how far in; kept within the grid."""
    if per_step == 0.0:
        return 0, 0.0
    steps = min(max((at - low) * per_step, 0.0), count - 1.0)
    cell = min(math.floor(steps), count - 2)
    return cell, steps - cell
