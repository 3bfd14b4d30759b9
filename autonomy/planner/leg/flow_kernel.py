"""The current along legs, compiled; ``drift`` and ``table.flow_at`` are the readable form."""

from autonomy.compiled import inlined_kernel, inner_kernel
from autonomy.current.table import FlowTable


@inlined_kernel
def _cell(at: float, low: float, per_step: float, count: int) -> tuple[int, float]:
    """Return the cell of a grid that a coordinate lies in, and how far in (``table``)."""
    if per_step == 0.0:
        return 0, 0.0
    steps = min(max((at - low) * per_step, 0.0), count - 1.0)
    cell = min(int(steps), count - 2)
    return cell, steps - cell


@inlined_kernel
def is_uniform(table: FlowTable) -> bool:
    """Tell whether a table has one current only."""
    return table.values.size == 2


@inner_kernel
def flow_at(table: FlowTable, x: float, y: float, z: float, t: float) -> tuple[float, float]:
    """Return the current at a place, depth and time of a table, north and east."""
    values = table.values
    if values.size == 2:
        return values[0, 0, 0, 0, 0], values[0, 0, 0, 0, 1]
    i, a = _cell(x, table.low[0], table.per_step[0], values.shape[0])
    j, b = _cell(y, table.low[1], table.per_step[1], values.shape[1])
    k, c = _cell(z, table.low[2], table.per_step[2], values.shape[2])
    n, d = _cell(t, table.low[3], table.per_step[3], values.shape[3])
    north, east = 0.0, 0.0
    for di in range(2 if a > 0.0 else 1):
        wi = a if di else 1.0 - a
        for dj in range(2 if b > 0.0 else 1):
            wj = wi * (b if dj else 1.0 - b)
            for dk in range(2 if c > 0.0 else 1):
                row = values[i + di, j + dj, k + dk]
                weight = wj * (c if dk else 1.0 - c)
                north += weight * (1.0 - d) * row[n, 0]
                east += weight * (1.0 - d) * row[n, 1]
                if d > 0.0:
                    north += weight * d * row[n + 1, 0]
                    east += weight * d * row[n + 1, 1]
    return north, east
