"""The ways that a robot really takes on many legs, side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.outline import Indices
from autonomy.planner.leg import drift
from autonomy.planner.plan import Leg, PrimitiveKind

CHORD_RAD = 0.02
_RIM_CORNERS = 65
_ENDS = (0.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class TrueWays:
    """Corners of the ways of legs, one way after the other."""

    corners: FloatArray
    """North, east and down, m, shape ``(m, 3)``."""
    first: Indices
    """Number of each way's first corner, shape ``(n,)``; no way has less than two corners."""
    way: Indices
    """Number of each corner's way, shape ``(m,)``."""

    @classmethod
    def of(cls, ways: Sequence[FloatArray | Sequence[tuple[float, float, float]]]) -> Self:
        """Return ways that have at least two corners each."""
        counts = np.array([len(way) for way in ways], dtype=np.intp)
        corners = np.array([corner for way in ways for corner in way])
        return cls(corners, np.cumsum(counts) - counts, np.repeat(np.arange(len(ways)), counts))

    @classmethod
    def along(cls, legs: Sequence[Leg], courses: Sequence[drift.Course]) -> Self:
        """Return the ways that a robot really takes on legs; a spiral is cut into short chords.

        Of a stay at the surface they are the rim of what it may drift to.
        """
        return cls.of([_true_way(leg, course) for leg, course in zip(legs, courses, strict=True)])

    @property
    def is_straight(self) -> BoolArray:
        """Whether each way is one straight piece, shape ``(n,)``."""
        return np.diff(self.first, append=len(self.way)) == len(_ENDS)

    def pieces(self) -> tuple[FloatArray, FloatArray, Indices]:
        """Return begins and ends of all pieces, ``(p, 3)``, and the first piece of each way."""
        goes_on = np.flatnonzero(self.way[1:] == self.way[:-1])
        return (
            self.corners[goes_on],
            self.corners[goes_on + 1],
            self.first - np.arange(len(self.first)),
        )

    def least(self, of_corners: FloatArray) -> FloatArray:
        """Return for each way the least of what its corners have, shapes ``(m, ...)``."""
        return np.minimum.reduceat(of_corners, self.first)


def _true_way(leg: Leg, course: drift.Course) -> list[tuple[float, float, float]]:
    if leg.kind is PrimitiveKind.KEEP:
        north, east, down = leg.end_ned
        angles = np.linspace(0.0, 2.0 * np.pi, _RIM_CORNERS)
        norths, easts = north + leg.radius_m * np.cos(angles), east + leg.radius_m * np.sin(angles)
        return [(n, e, down) for n, e in zip(norths.tolist(), easts.tolist(), strict=True)]
    parts = _ENDS
    if leg.kind is PrimitiveKind.SPIRAL:
        chords = max(int(np.ceil(abs(leg.turn_rad) / CHORD_RAD)), 1)
        parts = tuple(np.linspace(0.0, 1.0, chords + 1).tolist())
    return [drift.position_at(leg, course, part) for part in parts]
