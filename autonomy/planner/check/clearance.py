"""How far a way stays from shores, keep-outs and the floor, exactly."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.outline import PAIRS_MAX, Indices, Outline, ragged, squared_distances
from autonomy.planner.check.true_ways import TrueWays
from autonomy.site import Area, Site

_FLOOR_POINTS = 9
"""Places between two lines of the bathymetry at which a way is compared with the floor."""


@dataclass(frozen=True, slots=True)
class FloorContact:
    """Where a way is nearest to the floor, or deepest under it."""

    clearance_m: float
    """Height above the floor, negative under it."""
    floor_m: float
    north_m: float
    east_m: float


def clearance_m(area: Area | Outline, way: FloatArray, within_m: float = math.inf) -> float:
    """Return the least horizontal distance between a way and an area's outline, 0 if they meet.

    Args:
        area: The area.
        way: Corners of the way, shape ``(m, 2)`` or more columns.
        within_m: Distance beyond which the answer may be infinite; the nearer, the faster.
    """
    ends = way[1:] if len(way) > 1 else way
    return float(clearances_m(area, way[: len(ends)], ends, within_m).min())


def clearances_m(
    area: Area | Outline, begins: FloatArray, ends: FloatArray, within_m: float = math.inf
) -> FloatArray:
    """Return the least horizontal distance between straight pieces and an area's outline.

    Args:
        area: The area.
        begins: Where the pieces begin, shape ``(p, 2)`` or more columns.
        ends: Where they end, of the same shape.
        within_m: Distance beyond which an answer may be infinite; the nearer, the faster.

    Returns:
        For each piece, 0 if it meets the outline; shape ``(p,)``, m.
    """
    outline = area.outline if isinstance(area, Area) else area
    begins, ends = begins[:, :2], ends[:, :2]
    low, high = np.minimum(begins, ends) - within_m, np.maximum(begins, ends) + within_m
    corners, following = outline.sides_near(low.min(axis=0), high.max(axis=0))
    side_low, side_high = np.minimum(corners, following), np.maximum(corners, following)
    least = np.full(len(begins), math.inf)
    for part in np.array_split(
        np.arange(len(begins)), -(-len(corners) * len(begins) // PAIRS_MAX) or 1
    ):
        near = (
            (side_high[:, 0] >= low[part, :1])
            & (side_low[:, 0] <= high[part, :1])
            & (side_high[:, 1] >= low[part, 1:])
            & (side_low[:, 1] <= high[part, 1:])
        )
        which, side = np.nonzero(near)
        piece = part[which]
        between = _apart_m(begins[piece], ends[piece], corners[side], following[side])
        np.minimum.at(least, piece, between)
    return least


def nearest_m(area: Area | Outline, way: FloatArray, side: float) -> float:
    """Return how near a way comes to an outline; not above 0 if it crosses that.

    Args:
        area: What to keep away from.
        way: Corners of the way, shape ``(m, 2)`` or more columns.
        side: 1 if the way must stay outside, -1 if inside.
    """
    outline = area.outline if isinstance(area, Area) else area
    extent = float(np.ptp(outline.begins, axis=0).max()) + float(np.ptp(way[:, :2], axis=0).max())
    reach, distance = extent / 1024.0, math.inf
    while distance > reach and reach < 512.0 * extent:
        reach *= 4.0
        distance = clearance_m(outline, way, reach)
    is_wrong = outline.contains(way[:, 0], way[:, 1]) == (side > 0.0)
    if is_wrong.any():
        beyond = way[is_wrong]
        return min(distance, -float(np.abs(outline.distance_m(beyond[:, 0], beyond[:, 1])).max()))
    return distance


def floor_contacts(site: Site, ways: TrueWays) -> list[FloorContact]:
    """Return where each way is nearest to the floor; the first place of several.

    Args:
        site: The floor.
        ways: The ways; corners of a bend must lie close to each other.
    """
    is_bent = ~ways.is_straight
    straight, begins = np.flatnonzero(~is_bent), ways.corners[ways.first[~is_bent]]
    changes = ways.corners[ways.first[~is_bent] + 1] - begins
    piece, part = _parts_over_lines(site, begins, begins + changes)
    bends = is_bent[ways.way]
    track = np.concatenate([begins[piece] + part[:, None] * changes[piece], ways.corners[bends]])
    way = np.concatenate([straight[piece], ways.way[bends]])
    floor = site.floor_m(track[:, 0], track[:, 1])
    above = floor - track[:, 2]
    order = np.lexsort((above, way))
    nearest = order[np.searchsorted(way[order], np.arange(len(ways.first)))]
    columns = np.stack([above[nearest], floor[nearest], *track[nearest, :2].T], axis=1)
    return [FloorContact(*row) for row in columns.tolist()]


def _parts_over_lines(
    site: Site, begins: FloatArray, ends: FloatArray
) -> tuple[Indices, FloatArray]:
    """Return at which parts (0..1) of pieces to look: in and between crossed lines.

    Returns:
        The number of the piece, ascending, and the part of it, ascending with each.
    """
    every = np.arange(len(begins))
    pieces, parts = [every, every], [np.zeros(len(begins)), np.ones(len(begins))]
    for axis, lines in enumerate(site.depth_lines or ()):
        begin, end = begins[:, axis], ends[:, axis]
        first = np.searchsorted(lines, np.minimum(begin, end), side="right")
        behind = np.searchsorted(lines, np.maximum(begin, end), side="left")
        for piece, line in ragged(first, behind):
            pieces.append(piece)
            parts.append((lines[line] - begin[piece]) / (end - begin)[piece])
    piece, part = np.concatenate(pieces), np.concatenate(parts)
    order = np.lexsort((part, piece))
    piece, part = piece[order], part[order]
    goes_on = np.flatnonzero(piece[1:] == piece[:-1])
    shares = np.linspace(0.0, 1.0, _FLOOR_POINTS)
    between = part[goes_on, None] + shares * (part[goes_on + 1] - part[goes_on])[:, None]
    return np.repeat(piece[goes_on], _FLOOR_POINTS), between.ravel()


def _apart_m(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Return the distances of pieces a-b from sides c-d, each ``(p, 2)``; 0 where they cross."""
    squared = np.minimum(
        np.minimum(squared_distances(a, c, d), squared_distances(b, c, d)),
        np.minimum(squared_distances(c, a, b), squared_distances(d, a, b)),
    )
    crosses = (_turn(a, b, c) * _turn(a, b, d) < 0.0) & (_turn(c, d, a) * _turn(c, d, b) < 0.0)
    return np.where(crosses, 0.0, np.sqrt(squared))


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return twice the area of triangles, positive where the way a-c lies to starboard of a-b."""
    ab, ac = b - a, c - a
    return ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
