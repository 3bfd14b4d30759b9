"""Closed rings of straight sides in a plane: what lies inside of them, and how far from them.

Rings have up to tens of thousands of corners, so nothing here compares every place with every side:
places are sorted, or put into cells, and only what can matter is compared.
"""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from autonomy.arrays import BoolArray, FloatArray

PAIRS_MAX = 2_000_000
"""Places times sides that are compared at once: 16 MB an array."""
_CELLS_MAX = 1 << 12
"""Cells along one axis."""
Indices = npt.NDArray[np.intp]


class Outline:
    """Rings whose inside is what an odd number of them encloses: an outer one and its holes.

    Args:
        rings: Corners of each ring, north and east, shape ``(n, 2)``; the last is joined to the
            first.
    """

    def __init__(self, rings: Sequence[FloatArray]) -> None:
        self.rings = tuple(np.asarray(ring, dtype=np.float64) for ring in rings)
        self.begins = np.concatenate(self.rings)
        """Where each side begins, shape ``(s, 2)``."""
        self.ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in self.rings])
        self.low, self.high = np.minimum(self.begins, self.ends), np.maximum(self.begins, self.ends)
        """Smallest and largest north and east of each side, shape ``(s, 2)``."""

    def contains(self, north_m: npt.ArrayLike, east_m: npt.ArrayLike) -> BoolArray:
        """Tell which places lie inside.

        Args:
            north_m: Northings, any shape.
            east_m: Eastings, of a shape that goes with it.
        """
        x, y = np.broadcast_arrays(np.asarray(north_m, float), np.asarray(east_m, float))
        order = np.argsort(y, axis=None)
        sorted_x, sorted_y = x.ravel()[order], y.ravel()[order]
        crossings = np.zeros(order.shape, dtype=np.int64)
        if not len(order):
            return np.zeros(x.shape, dtype=np.bool_)
        beside = (self.high[:, 1] > sorted_y[0]) & (self.low[:, 1] <= sorted_y[-1])
        begins, ends = self.begins[beside], self.ends[beside]
        first = np.searchsorted(sorted_y, self.low[beside, 1], side="left")
        behind = np.searchsorted(sorted_y, self.high[beside, 1], side="left")
        for side, place in ragged(first, behind):
            (x0, y0), (x1, y1) = begins[side].T, ends[side].T
            hit = sorted_x[place] < x0 + (sorted_y[place] - y0) * ((x1 - x0) / (y1 - y0))
            crossings += np.bincount(place[hit], minlength=len(order))
        inside = np.empty(order.shape, dtype=np.bool_)
        inside[order] = crossings % 2 == 1
        return inside.reshape(x.shape)

    def distance_m(
        self, north_m: npt.ArrayLike, east_m: npt.ArrayLike, within_m: float = math.inf
    ) -> FloatArray:
        """Return how far places are from the rings, positive outside and negative inside.

        Args:
            north_m: Northings, any shape.
            east_m: Eastings, of a shape that goes with it.
            within_m: Distance beyond which only the side matters: it is told for all that is
                farther, and the search is the faster the smaller it is.
        """
        x, y = np.broadcast_arrays(np.asarray(north_m, float), np.asarray(east_m, float))
        places = np.stack([x.ravel(), y.ravel()], axis=1)
        distance = self._least_distance(places, within_m)
        return np.where(self.contains(x, y), -1.0, 1.0) * distance.reshape(x.shape)

    def sides_near(self, low: npt.ArrayLike, high: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return begins and ends of the sides whose bounds meet a box, each shape ``(k, 2)``."""
        near = ((self.high >= low) & (self.low <= high)).all(axis=1)
        return self.begins[near], self.ends[near]

    def _least_distance(self, places: FloatArray, within_m: float) -> FloatArray:
        count = len(places)
        if not count:
            return np.empty(0)
        begins, ends = self.begins, self.ends
        if math.isfinite(within_m):
            begins, ends = self.sides_near(
                places.min(axis=0) - within_m, places.max(axis=0) + within_m
            )
        if not len(begins):
            return np.full(count, within_m)
        if count * len(begins) <= PAIRS_MAX:
            squared = squared_distances(places[:, None], begins, ends).min(axis=1)
            return np.minimum(np.sqrt(squared), within_m)
        if math.isfinite(within_m):
            return self._distance_by_cells(places, within_m)
        blocks = np.array_split(places, math.ceil(count * len(self.begins) / PAIRS_MAX))
        return np.concatenate([self._least_distance(block, within_m) for block in blocks])

    def _distance_by_cells(self, places: FloatArray, within_m: float) -> FloatArray:
        """Return distances up to a reach: only cells that a side comes so near are looked at."""
        origin = places.min(axis=0)
        extent = float(np.ptp(places, axis=0).max())
        cell = max(within_m, extent / math.sqrt(4.0 * len(places)), extent / _CELLS_MAX, 1e-9)
        shape = np.floor((places.max(axis=0) - origin) / cell).astype(np.intp) + 1
        own = np.floor((places - origin) / cell).astype(np.intp)
        number = own[:, 0] * shape[1] + own[:, 1]
        order = np.argsort(number, kind="stable")
        cells = np.searchsorted(number[order], np.arange(shape[0] * shape[1] + 1))
        squared = np.full(len(places), within_m**2)
        begins, ends = _pieces(
            *self.sides_near(origin - within_m, places.max(axis=0) + within_m), cell
        )
        low = np.floor((np.minimum(begins, ends) - within_m - origin) / cell).astype(np.intp)
        high = np.floor((np.maximum(begins, ends) + within_m - origin) / cell).astype(np.intp)
        low, high = np.maximum(low, 0), np.minimum(high, shape - 1)
        rows = np.maximum(high[:, 0] - low[:, 0] + 1, 0)
        rows[high[:, 1] < low[:, 1]] = 0
        piece = np.repeat(np.arange(len(begins)), rows)
        row = low[piece, 0] + np.arange(len(piece)) - np.repeat(np.cumsum(rows) - rows, rows)
        # the cells of one row lie one after the other, and so do their places
        first = cells[row * shape[1] + low[piece, 1]]
        behind = cells[row * shape[1] + high[piece, 1] + 1]
        for part, at in ragged(first, behind):
            place, side = order[at], piece[part]
            found = squared_distances(places[place], begins[side], ends[side])
            np.minimum.at(squared, place, found)
        return np.sqrt(squared)


def squared_distances(places: FloatArray, begins: FloatArray, ends: FloatArray) -> FloatArray:
    """Return squared distances of places from sides, of shapes ``(..., 2)`` that go together."""
    along, offset = ends - begins, places - begins
    length = np.maximum(np.einsum("...i,...i", along, along), 1e-300)
    part = np.clip(np.einsum("...i,...i", offset, along) / length, 0.0, 1.0)
    away = offset - part[..., None] * along
    return np.einsum("...i,...i", away, away)


def _pieces(begins: FloatArray, ends: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
    """Cut sides into pieces that are not longer than a size."""
    length = np.hypot(*(ends - begins).T)
    count = np.maximum(np.ceil(length / (4.0 * size)).astype(np.intp), 1)
    if not len(begins) or count.max() == 1:
        return begins, ends
    side = np.repeat(np.arange(len(begins)), count)
    step = np.arange(len(side)) - np.repeat(np.cumsum(count) - count, count)
    along = (ends - begins)[side]
    share = (step / count[side])[:, None], ((step + 1) / count[side])[:, None]
    return begins[side] + share[0] * along, begins[side] + share[1] * along


def ragged(first: Indices, behind: Indices) -> "list[tuple[Indices, Indices]]":
    """Return pairs of each range's number and each index in it, in blocks of bounded size."""
    sizes = np.maximum(behind - first, 0)
    used = np.flatnonzero(sizes)
    blocks: list[tuple[Indices, Indices]] = []
    total = np.cumsum(sizes[used])
    begin = 0
    while begin < len(used):
        done = total[begin - 1] if begin else 0
        end = max(int(np.searchsorted(total, done + PAIRS_MAX, side="right")), begin + 1)
        part = used[begin:end]
        count = sizes[part]
        number = np.repeat(part, count)
        inner = np.arange(len(number)) - np.repeat(np.cumsum(count) - count, count)
        blocks.append((number, first[number] + inner))
        begin = end
    return blocks


def first_crossing(corners: FloatArray) -> tuple[int, int] | None:
    """Return the numbers from 0 of two sides of a ring that meet though they are no neighbours.

    Args:
        corners: North and east, shape ``(n, 2)``.
    """
    count = len(corners)
    begins, ends = corners, np.roll(corners, -1, axis=0)
    low, high = np.minimum(begins, ends), np.maximum(begins, ends)
    # sweep along the axis on which the sides are spread most
    axis = int(np.argmax(np.ptp(corners, axis=0)))
    order = np.argsort(low[:, axis], kind="stable")
    sorted_low = low[order, axis]
    rank = np.arange(count)
    behind = np.searchsorted(sorted_low, high[order, axis], side="right")
    found: tuple[int, int] | None = None
    for first, at in ragged(rank + 1, behind):
        one, other = order[first], order[at]
        across = 1 - axis
        near = (low[one, across] <= high[other, across]) & (low[other, across] <= high[one, across])
        one, other = one[near], other[near]
        gap = np.abs(one - other)
        apart = (gap > 1) & (gap < count - 1)
        one, other = one[apart], other[apart]
        meets = _meet(begins[one], ends[one], begins[other], ends[other])
        for i, j in zip(one[meets].tolist(), other[meets].tolist(), strict=True):
            pair = (min(i, j), max(i, j))
            found = pair if found is None else min(found, pair)
    return found


def _meet(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> BoolArray:
    """Tell which sides a-b and c-d, whose bounds meet, have a place in common."""
    return (_turn(a, b, c) * _turn(a, b, d) <= 0.0) & (_turn(c, d, a) * _turn(c, d, b) <= 0.0)


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return the sign of the turn from the way a-b to the way a-c; 0 on one line."""
    ab, ac = b - a, c - a
    return np.sign(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
