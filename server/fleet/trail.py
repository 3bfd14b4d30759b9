"""The track of one robot as the 3D scene draws it: in memory, thinned, bounded."""

import math
from array import array
from collections.abc import Iterable, Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.fidelity import fidelity_level
from autonomy.planner.plan import PositionNed
from robot_link.messages import RobotMode
from webui.scene.source import TrackPiece

DRIFT_MODES = frozenset((RobotMode.IDLE, RobotMode.SURFACED, RobotMode.HOLDING))
"""Modes in which the robot floats at the surface and goes where the water takes it."""
POINTS_MAX = 20_000
_GENERATION = 2**32
"""A cursor is the generation of the track times this, plus the number of points seen."""
_WIDTH = 5
"""Numbers of a point: north, east, down, standard deviation, and 1 where it is adrift."""


class Track:
    """Points at least ``spacing_m`` apart; when they are too many, every second one is dropped.

    One thread adds, any thread reads.
    """

    def __init__(self, spacing_m: float, thresholds_m: Sequence[float]) -> None:
        self._spacing_m = spacing_m
        self._thresholds_m = tuple(thresholds_m)
        self._values = array("d")
        self._generation = 1

    @property
    def levels(self) -> int:
        """Number of fidelity levels."""
        return len(self._thresholds_m) + 1

    @property
    def thresholds_m(self) -> tuple[float, ...]:
        """Position uncertainties that part the fidelity levels."""
        return self._thresholds_m

    def add(self, position_ned: PositionNed, position_std_m: float, mode: RobotMode | None) -> bool:
        """Append a point unless it lies closer than the spacing to the last one; tell whether."""
        return self._append(position_ned, position_std_m, mode in DRIFT_MODES)

    def _append(self, position_ned: PositionNed, position_std_m: float, is_adrift: bool) -> bool:
        values = self._values
        if values and math.dist(values[-_WIDTH : 3 - _WIDTH], position_ned) < self._spacing_m:
            return False
        values.extend((*position_ned, position_std_m, is_adrift))
        if len(values) > _WIDTH * POINTS_MAX:
            self._values = array("d", _points(values)[::2].tobytes())
            self._spacing_m *= 2.0
            self._generation += 1
        return True

    def replace(self, points: Iterable[tuple[PositionNed, float, RobotMode | None]]) -> None:
        """Begin again from positions with their standard deviations and modes."""
        self._values = array("d")
        self._generation += 1
        for position_ned, position_std_m, mode in points:
            self.add(position_ned, position_std_m, mode)

    def begin_with(self, points: Iterable[tuple[PositionNed, float, RobotMode | None]]) -> None:
        """Put earlier positions before those that there are."""
        later = _points(self._values).tolist()
        self.replace(points)
        for north, east, down, position_std_m, is_adrift in later:
            self._append((north, east, down), position_std_m, bool(is_adrift))

    def set_thresholds(self, thresholds_m: Sequence[float]) -> None:
        """Assign all points anew to fidelity levels."""
        if tuple(thresholds_m) != self._thresholds_m:
            self._thresholds_m = tuple(thresholds_m)
            self._generation += 1

    def since(self, cursor: int) -> TrackPiece:
        """Return the points after ``cursor``; see ``webui.scene.source.SceneSource``."""
        generation, values, thresholds_m = self._generation, self._values, self._thresholds_m
        seen_generation, seen = divmod(cursor, _GENERATION)
        restarted = seen_generation != generation
        end = len(values) // _WIDTH
        piece = _points(values[0 if restarted else _WIDTH * seen : _WIDTH * end])
        return TrackPiece(
            cursor=generation * _GENERATION + end,
            restarted=restarted,
            position_ned=piece[:, :3],
            position_std_m=piece[:, 3],
            fidelity=fidelity_level(piece[:, 3], thresholds_m),
            is_adrift=piece[:, 4].astype(np.bool_),
        )


def _points(values: "array[float]") -> FloatArray:
    """Return points as an array of their own, shape ``(n, 5)``."""
    return np.array(values, dtype=np.float64).reshape(-1, _WIDTH)
