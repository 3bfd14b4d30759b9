"""A robot that is a point: it follows plans exactly, but for what it does not know of its place."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.position import surface_covariance
from autonomy.estimation.smoother import Dive
from autonomy.planner.leg.edge import (
    POINT_DOWN,
    POINT_EAST,
    POINT_NORTH,
    POINT_STD,
    POINT_TIME,
)

_FIX_PERIOD_S = 2.0
"""Time between the fixes at the surface before the first dive."""
_RETURN_S = 10.0
"""Time in which the robot makes good two thirds (1 - 1/e) of an offset that it knows of."""


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """Where a flown plan led, at each of ``n`` moments."""

    time_s: FloatArray
    """Since the survey began, shape ``(n,)``."""
    believed_ned: FloatArray
    """Where the robot believed to be, shape ``(n, 3)``, m."""
    true_ned: FloatArray
    """Where it was, shape ``(n, 3)``, m."""
    std_m: FloatArray
    """Standard deviation of each horizontal position, as stated by its filter, shape ``(n,)``."""
    dive: IntArray
    """Number of the fix that the position is reckoned from, shape ``(n,)``."""
    finished: tuple[Dive, ...]
    """What each fix told of the dive that it ended."""


class PointRobot:
    """Follows plans by its own belief of where it is.

    The error of that belief is a random walk on each horizontal axis, which a fix near the surface
    ends: from then on the error is the fix's own. What the fix has told, the offset from the plan,
    the robot makes good within some seconds.
    """

    def __init__(
        self,
        position_filter: EstimatorConfig,
        drift_m_sqrt_s: float,
        start_ne_m: tuple[float, float],
        rng: np.random.Generator,
    ) -> None:
        """Start at the surface, with a fix.

        Args:
            position_filter: What the robot's filter assumes, its drift and the depth of a fix.
            drift_m_sqrt_s: What the error's walk really is.
            start_ne_m: North and east of the start, by the fix.
            rng: Draws the errors.
        """
        self._filter = position_filter
        self._drift = drift_m_sqrt_s
        self._rng = rng
        self._time_s = 0.0
        self._dive = 0
        self._dive_began_s = 0.0
        self._std_m = math.sqrt(surface_covariance(position_filter, _FIX_PERIOD_S).position)
        self._error = self._std_m * rng.standard_normal(2)
        self._believed = np.array([*start_ne_m, 0.0])

    def stay(self) -> Flight:
        """Return the one moment before the first dive."""
        true = self._believed - np.array([*self._error, 0.0])
        return Flight(
            np.array([self._time_s]),
            self._believed[None].copy(),
            true[None],
            np.array([self._std_m]),
            np.array([self._dive]),
            (),
        )

    @property
    def believed_ne_m(self) -> tuple[float, float]:
        """North and east where the robot believes to be."""
        return float(self._believed[0]), float(self._believed[1])

    def fly(self, points: FloatArray, planned_start_ne_m: tuple[float, float]) -> Flight:
        """Follow a plan.

        Args:
            points: Time from the plan's start s, north, east, down m, stated standard deviation m,
                shape ``(n, 5)``.
            planned_start_ne_m: Where the plan begins.
        """
        offset = self._believed[:2] - planned_start_ne_m
        began_s = self._time_s
        believed, true = np.empty((len(points), 3)), np.empty((len(points), 3))
        dive = np.empty(len(points), dtype=np.int64)
        finished: list[Dive] = []
        for i, point in enumerate(points):
            dt = began_s + point[POINT_TIME] - self._time_s
            planned = point[POINT_NORTH : POINT_EAST + 1]
            offset = offset * math.exp(-dt / _RETURN_S)
            self._error = self._error + self._drift * math.sqrt(dt) * self._rng.standard_normal(2)
            reckoned = planned + offset
            here = reckoned - self._error
            self._time_s += dt
            if point[POINT_DOWN] <= self._filter.surface_depth_m:
                finished.append(self._fix(here, reckoned, dt, float(point[POINT_STD])))
                offset = here + self._error - planned
            self._std_m = float(point[POINT_STD])
            self._believed = np.array([*(here + self._error), point[POINT_DOWN]])
            believed[i], true[i] = self._believed, (*here, point[POINT_DOWN])
            dive[i] = self._dive
        times_s = began_s + points[:, POINT_TIME]
        return Flight(times_s, believed, true, points[:, POINT_STD].copy(), dive, tuple(finished))

    def _fix(self, true_ne: FloatArray, reckoned_ne: FloatArray, dt_s: float, std_m: float) -> Dive:
        """Take a fix, which begins a new dive; return what it tells of the last one."""
        self._error = std_m * self._rng.standard_normal(2)
        fixed = true_ne + self._error
        ended = Dive(
            start_s=self._dive_began_s,
            end_s=self._time_s - dt_s,
            fix_time_s=self._time_s,
            fix_ne_m=(float(fixed[0]), float(fixed[1])),
            fix_std_m=std_m,
            reckoned_ne_m=(float(reckoned_ne[0]), float(reckoned_ne[1])),
            reckoned_std_m=math.sqrt(self._std_m**2 + self._filter.drift_m_sqrt_s**2 * dt_s),
        )
        self._dive += 1
        self._dive_began_s = self._time_s
        return ended
