"""The mean current on a grid of place, depth and time, linear in between, for hot loops.

Compiled code has a twin of ``flow_at`` (``autonomy.planner.leg.flow_kernel``).
"""

import base64
import math
from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np
from pydantic import Field, model_validator

from autonomy.arrays import FloatArray
from autonomy.configuration import Configuration, quantity

TABLE_SHAPE = (8, 8, 4, 12)
"""Points north, east, down and in time."""


class FlowTable(NamedTuple):
    """A current by place, depth and time; beyond its ends it is what it is at them."""

    values: FloatArray
    """North and east, m/s, shape ``(nx, ny, nz, nt, 2)``; nobody changes it."""
    low: tuple[float, float, float, float]
    """Least north, east, depth, m, and time, s."""
    per_step: tuple[float, float, float, float]
    """Steps of the grid per m and s; 0 along an axis of one point."""


@lru_cache(maxsize=32)
def uniform_table(north_m_s: float, east_m_s: float) -> FlowTable:
    """Return the table of a current that is the same everywhere and always."""
    values = np.array([north_m_s, east_m_s]).reshape(1, 1, 1, 1, 2)
    return FlowTable(values, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))


class FlowRecord(Configuration):
    """A table as a plan keeps it: what it was planned in."""

    shape: tuple[int, int, int, int] = quantity(..., title="Points")
    """Points north, east, down and in time."""
    low: tuple[float, float, float] = quantity(..., "m", title="From")
    """Least north, east and depth, m."""
    high: tuple[float, float, float] = quantity(..., "m", title="To")
    """Greatest north, east and depth, m."""
    from_s: float = quantity(..., "s", title="Begin")
    """Moment of the table's own time 0, s from the epoch."""
    duration_s: float = quantity(..., "s", title="Duration", gt=0.0)
    """For how long it tells."""
    dives: int = quantity(..., title="Dives", ge=0)
    """How many dives the map was made of."""
    values: str = Field(title="Values", max_length=4_000_000, repr=False)
    """Base64 of 32-bit numbers, the least first: north and east, m/s, by north, east, depth and
    time, the last fastest."""

    @model_validator(mode="after")
    def _has_all_numbers(self) -> Self:
        if min(self.shape) < 1 or len(base64.b64decode(self.values)) != 8 * math.prod(self.shape):
            raise ValueError("values are not those of the shape")
        return self


def table_of(record: FlowRecord) -> FlowTable:
    """Return the table of a record."""
    spans = [b - a for a, b in zip(record.low, record.high, strict=True)]
    steps = [
        (count - 1) / span
        for count, span in zip(record.shape, (*spans, record.duration_s), strict=True)
    ]
    low = (*record.low, 0.0)
    return FlowTable(
        _unpacked(record.values, record.shape), low, (steps[0], steps[1], steps[2], steps[3])
    )


@lru_cache(maxsize=32)
def _unpacked(values: str, shape: tuple[int, ...]) -> FloatArray:
    raw = np.frombuffer(base64.b64decode(values), dtype="<f4")
    return raw.reshape(*shape, 2).astype(np.float64)


def is_uniform(table: FlowTable) -> bool:
    """Tell whether a table has one current only."""
    return table.values.size == 2


def uniform_flow(table: FlowTable) -> tuple[float, float]:
    """Return the one current of a table that has one only, north and east."""
    north, east = table.values.ravel().tolist()
    return north, east


def largest_speed_m_s(record: FlowRecord) -> float:
    """Return the speed of the strongest current of a record, looked for once."""
    return _strongest_m_s(record.values, record.shape)


@lru_cache(maxsize=32)
def _strongest_m_s(values: str, shape: tuple[int, ...]) -> float:
    flow = _unpacked(values, shape)
    return float(np.hypot(flow[..., 0], flow[..., 1]).max())


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
