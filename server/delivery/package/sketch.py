"""What the figures of a report are drawn from: extremes by time, so that no peak is lost."""

from typing import Final

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from db.column import moment
from db.query.measured.merged_rows import RowBlock
from server.delivery.file_order import FileOrder
from server.delivery.judged import DEPTH, POSITION, Judged
from server.logbook.figure import Mark

PARTS: Final = 600
"""Into how many parts the time of a figure is cut."""
KINDS: Final = {2: "doubtful", 3: "suspect", 4: "bad"}
"""Marks by the flag of OG1.0."""
BATTERY: Final = "battery_v"


class Sketch:
    """Takes the rows block by block; holds as much for a million rows as for a thousand."""

    def __init__(self, found: Judged, order: FileOrder) -> None:
        self.first_us = int(found.at_us[0]) if len(found.at_us) else 0
        self._span_us = (int(found.at_us[-1]) - self.first_us if len(found.at_us) else 0) + 1
        self._flags = {
            key: found.og1(key, order.manual) for key in (POSITION, DEPTH, *order.channels)
        }
        empty = (*order.channels, DEPTH, BATTERY)
        self.low = {key: np.full(PARTS, np.nan) for key in empty}
        self.high = {key: np.full(PARTS, np.nan) for key in empty}
        self._marked = {
            (key, flag): np.full((PARTS, 3), np.nan) for key in self._flags for flag in KINDS
        }
        """Time, and value, or north and east of a position, of the first of each part."""
        self._track = np.full((PARTS, 2), np.nan)
        self._last_place: FloatArray | None = None
        self.jumps: list[tuple[int, float]] = []
        """Moments of fixes that follow dead reckoning, us, and how far they moved the robot, m."""

    def take(self, offset: int, block: RowBlock) -> None:
        """Take rows from one on."""
        parts = (block.measured_at_us - self.first_us) * PARTS // self._span_us
        depth, rows = block.position_ned[:, 2], slice(offset, offset + len(block))
        for key, values in (
            *block.value.items(),
            (DEPTH, depth),
            (BATTERY, block.state[BATTERY]),
        ):
            self._widen(key, parts, values)
            if key in self._flags:
                self._mark(key, parts, rows, block.measured_at_us, values[:, np.newaxis])
        places = block.position_ned[:, :2]
        known: BoolArray = np.asarray(np.isfinite(places).all(axis=1))
        self._mark(POSITION, parts, rows, block.measured_at_us, places)
        self._track[parts[known]] = places[known]
        self._take_jumps(block, known)

    def times(self) -> list[int]:
        """Return the middle of each part, us."""
        return [
            self.first_us + (2 * part + 1) * self._span_us // (2 * PARTS) for part in range(PARTS)
        ]

    def marks(self, series: str) -> list[Mark]:
        """Return what is to be noticed of a series, the worst last."""
        return [
            Mark(moment(int(at)), float(value), kind)
            for flag, kind in KINDS.items()
            for at, value, _ in self._told(series, flag)
        ]

    def places(self) -> tuple[list[float], list[float]]:
        """Return the track, north and east, m."""
        told = self._track[np.isfinite(self._track).all(axis=1)]
        return told[:, 0].tolist(), told[:, 1].tolist()

    def marked_places(self) -> list[tuple[float, float, str]]:
        """Return the places to be noticed, north and east, m, with the kind of mark."""
        return [
            (float(north), float(east), kind)
            for flag, kind in KINDS.items()
            for _, north, east in self._told(POSITION, flag)
        ]

    def _told(self, series: str, flag: int) -> FloatArray:
        marked = self._marked[series, flag]
        return marked[np.isfinite(marked[:, 1])]

    def _widen(self, key: str, parts: IntArray, values: FloatArray) -> None:
        told = np.isfinite(values)
        if not told.any():
            return
        inner, begins = np.unique(parts[told], return_index=True)
        low = np.minimum.reduceat(values[told], begins)
        high = np.maximum.reduceat(values[told], begins)
        self.low[key][inner] = np.fmin(self.low[key][inner], low)
        self.high[key][inner] = np.fmax(self.high[key][inner], high)

    def _mark(
        self, key: str, parts: IntArray, rows: slice, at_us: IntArray, values: FloatArray
    ) -> None:
        flags = self._flags[key][rows]
        for flag in KINDS:
            chosen = np.flatnonzero((flags == flag) & np.isfinite(values).all(axis=1))
            inner, first = np.unique(parts[chosen], return_index=True)
            marked = self._marked[key, flag]
            is_new = np.isnan(marked[inner, 1])
            inner, chosen = inner[is_new], chosen[first[is_new]]
            marked[inner, 0] = at_us[chosen]
            marked[inner, 1 : 1 + values.shape[1]] = values[chosen]

    def _take_jumps(self, block: RowBlock, known: BoolArray) -> None:
        rows = np.flatnonzero(known)
        if not rows.size:
            return
        places, fixed = block.position_ned[rows, :2], block.has_fix[rows]
        before = np.full((1, 3), np.nan) if self._last_place is None else self._last_place
        earlier = np.vstack([before[:, :2], places[:-1]])
        was_fix = np.concatenate([before[:, 2] == 1.0, fixed[:-1]])
        for row in np.flatnonzero(fixed & ~was_fix & np.isfinite(earlier[:, 0])).tolist():
            moved = float(np.hypot(*(places[row] - earlier[row])))
            self.jumps.append((int(block.measured_at_us[rows[row]]), moved))
        self._last_place = np.array([[*places[-1], float(fixed[-1])]])
