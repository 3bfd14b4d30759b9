"""The shortest way along the surface between two places, around keep-outs and headlands."""

import heapq
import math
from collections.abc import Callable, Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.outline import Outline
from autonomy.planner.check.clearance import clearance_m
from autonomy.site import Area, NorthEast, Site

_EXPANSIONS_MAX = 40
"""Corners from which the way on is looked for, before the search is given up."""
_CORNERS_MAX = 256
_BEYOND = 1.02
"""Corners are rounded at this many margins."""
_LEAST_M = 0.01


def shortest_way(
    start: NorthEast,
    goal: NorthEast,
    keep_outs: Sequence[Area],
    site: Site | None,
    margin_m: float,
) -> tuple[NorthEast, ...] | None:
    """Return the corners of the shortest way found, the start left out, or None if none was.

    Args:
        start: Where the way begins. It may lie within the margin: then the way keeps the distance
            that the start has. It may lie beyond the shoreline, which then does not count.
        goal: Where it leads.
        keep_outs: Areas to stay outside of.
        site: The water to stay inside of.
        margin_m: Least distance from their outlines.
    """
    is_free = _freedom(start, keep_outs, None if site is None else site.shore, margin_m)
    if is_free(start, goal):
        return (goal,)
    areas = [*keep_outs]
    if site is not None:
        areas += [*site.islands, *([] if site.shoreline is None else [site.shoreline])]
    places = [start, goal]
    for area in areas:
        places += _corners(area, _BEYOND * margin_m + _LEAST_M)
    places = places[: 2 + _CORNERS_MAX]
    known = {0: 0.0}
    before: dict[int, int] = {}
    done: set[int] = set()
    queue = [(math.dist(start, goal), 0)]
    while queue and len(done) <= _EXPANSIONS_MAX:
        _, here = heapq.heappop(queue)
        if here == 1:
            return _unwound(places, before)
        if here in done:
            continue
        done.add(here)
        for there in range(1, len(places)):
            way = known[here] + math.dist(places[here], places[there])
            if there in done or way >= known.get(there, math.inf):
                continue
            if is_free(places[here], places[there]):
                known[there], before[there] = way, here
                heapq.heappush(queue, (way + math.dist(places[there], goal), there))
    return None


def _unwound(places: list[NorthEast], before: dict[int, int]) -> tuple[NorthEast, ...]:
    way: list[NorthEast] = []
    here = 1
    while here:
        way.append(places[here])
        here = before[here]
    return tuple(reversed(way))


def _freedom(
    start: NorthEast, keep_outs: Sequence[Area], shore: Outline | None, margin_m: float
) -> Callable[[NorthEast, NorthEast], bool]:
    """Return what tells whether a straight way is free."""
    borders = [(area.outline, 1.0) for area in keep_outs]
    if shore is not None and shore.contains(*start):
        borders.append((shore, -1.0))
    limits = [
        (area, side, min(margin_m, float(side * area.distance_m(*start)))) for area, side in borders
    ]

    def is_free(a: NorthEast, b: NorthEast) -> bool:
        way: FloatArray = np.array([a, b])
        for area, side, margin in limits:
            distances = side * area.distance_m(way[:, 0], way[:, 1], margin_m + 1.0)
            if distances.min() < margin - 1e-9:
                return False
            clearance = clearance_m(area, way, margin_m + 1.0)
            if clearance <= 0.0 or clearance < margin - 1e-9:
                return False
        return True

    return is_free


def _corners(area: Area, away_m: float) -> list[NorthEast]:
    """Return places to both sides of each corner, that far from both of its sides."""
    corners = np.array(area.corners_m)
    places: list[NorthEast] = []
    for number, corner in enumerate(corners):
        back = corners[number - 1] - corner
        ahead = corners[(number + 1) % len(corners)] - corner
        back, ahead = back / math.hypot(*back), ahead / math.hypot(*ahead)
        along = ahead - back
        across = np.array([-along[1], along[0]]) / max(math.hypot(*along), 1e-12)
        # how far along the bisector a place is so far from the sides; a needle's is cut short
        half = max(abs(float(across @ np.array([-ahead[1], ahead[0]]))), 0.25)
        for side in (1.0, -1.0):
            north, east = corner + side * (away_m / half) * across
            places.append((float(north), float(east)))
    return places
