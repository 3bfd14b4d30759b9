"""Floor and border of the water, compiled; ``autonomy.site.Site`` is the readable form."""

import math

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel
from simulator.ahead.state import State, Water


@inner_kernel
def _between(lines: FloatArray, value: float) -> tuple[int, float]:
    """Return the line below a value, and how far (0..1) it is on to the next."""
    low, high = 0, lines.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if lines[middle] <= value:
            low = middle
        else:
            high = middle
    part = (value - lines[low]) / (lines[low + 1] - lines[low])
    return low, min(max(part, 0.0), 1.0)


@inner_kernel
def floor_m(water: Water, north: float, east: float) -> float:
    """Return the depth of the floor, 0 or less on land."""
    depth = water.floor_depth
    if depth.size == 1:
        return depth[0, 0]
    i, along = _between(water.floor_north, north)
    j, across = _between(water.floor_east, east)
    south = depth[i, j] + across * (depth[i, j + 1] - depth[i, j])
    farther = depth[i + 1, j] + across * (depth[i + 1, j + 1] - depth[i + 1, j])
    return south + along * (farther - south)


@inner_kernel
def clearance_m(water: Water, north: float, east: float) -> float:
    """Return how far a place is from the nearest wall or shore, negative outside of the water."""
    box = water.box
    to_wall = min(north - box[0], box[1] - north, east - box[2], box[3] - east)
    if water.begins.shape[0] == 0:
        return to_wall
    squared, is_inside = math.inf, False
    for k in range(water.begins.shape[0]):
        x0, y0 = water.begins[k, 0], water.begins[k, 1]
        x1, y1 = water.ends[k, 0], water.ends[k, 1]
        dx, dy = x1 - x0, y1 - y0
        length = dx * dx + dy * dy
        part = 0.0
        if length > 0.0:
            part = min(max(((north - x0) * dx + (east - y0) * dy) / length, 0.0), 1.0)
        off_x, off_y = north - x0 - part * dx, east - y0 - part * dy
        squared = min(squared, off_x * off_x + off_y * off_y)
        if (y0 <= east) != (y1 <= east) and north < x0 + (east - y0) * dx / dy:
            is_inside = not is_inside
    distance = math.sqrt(squared)
    return min(to_wall, distance if is_inside else -distance)


@inner_kernel
def is_near_border(s: State, water: Water, north: float, east: float, kept_m: float) -> bool:
    """Tell whether wall or shore are nearer than a distance.

    No place is nearer to them than the last one that was looked up, less the way from it.
    """
    way = math.hypot(north - s.border_at[0], east - s.border_at[1])
    if s.border_m - way >= kept_m:
        return False
    s.border_at[0], s.border_at[1] = north, east
    s.border_m = clearance_m(water, north, east)
    return s.border_m < kept_m
