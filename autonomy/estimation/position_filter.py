"""The position filter of the thesis (5.4.2), which learns no current but allows for one.

Beside the thesis's covariance it keeps how far a steady current of the expected strength may have
carried the robot since its last fix: ``b t`` per axis.

``autonomy.estimation.position`` has its model, and the readable reference of its covariance.
"""

import math
from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig, OutlierConfig
from autonomy.estimation.fix_watch import SHORTEST_DIVE_S, FixGate, FixWatch, Verdict
from autonomy.estimation.kernel import step_position, take_late_fix

GREATEST_SPEED_M_S = 1.0
"""No robot of this kind moves faster over ground."""


class PositionFilter:
    """Kalman filter of position and velocity in the site's NED frame.

    State ``[x, y, z, vx, vy, vz]`` in m and m/s. Call ``step`` once per control period.
    """

    def __init__(
        self,
        config: EstimatorConfig,
        position_ned: Sequence[float],
        position_std_m: float,
        velocity_std_m_s: float = 0.1,
    ) -> None:
        """Begin at a position known to ``position_std_m`` per axis, at rest."""
        self._config = config
        self.surface_depth_m = config.surface_depth_m
        """Deeper than this, a fix of ``step`` is not believed."""
        outlier = OutlierConfig()
        self._watch = FixWatch(config.doubt)
        self._gate = FixGate(
            outlier.limit, outlier.fix_patience, GREATEST_SPEED_M_S, config.fix_std_m
        )
        self._doubt = self._watch.doubt
        self._blind_s = 0.0
        self._believed_fix: tuple[float, float] | None = None
        self._noise = position_noise(config)
        self._fix_shift_m = (0.0, 0.0)
        self._axes = np.zeros((3, 5))
        self._axes[:, 0] = position_ned
        self._axes[:, 2] = position_std_m**2
        self._axes[:, 4] = velocity_std_m_s**2

    @property
    def position_ned(self) -> tuple[float, float, float]:
        """Estimated position, m."""
        x, y, z = self._axes[:, 0].tolist()
        return (x, y, z)

    @property
    def velocity_ned(self) -> tuple[float, float, float]:
        """Estimated velocity, m/s."""
        vx, vy, vz = self._axes[:, 1].tolist()
        return (vx, vy, vz)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of ``[x, y, z, vx, vy, vz]`` without current and doubt, ``(6, 6)``."""
        a, b, d = (np.diag(self._axes[:, k]) for k in (2, 3, 4))
        return np.block([[a, b], [b, d]])

    @property
    def position_std_m(self) -> float:
        """Standard deviation of the horizontal position along its worst direction, m."""
        return self._doubt * math.sqrt(max(self._axes[:2, 2].tolist()) + self._carried_m**2)

    @property
    def fix_shift_ne_m(self) -> tuple[float, float]:
        """How far the last fix of ``step`` or ``take_late_fix`` moved the position; 0 without."""
        return self._fix_shift_m

    @property
    def doubt(self) -> float:
        """How many times larger than its covariance the filter states its deviations to be."""
        return self._doubt

    @property
    def dives(self) -> int:
        """How many dives that is judged by."""
        return self._watch.dives

    @property
    def refused_fixes(self) -> int:
        """How many fixes were not believed so far."""
        return self._gate.refused

    @property
    def _carried_m(self) -> float:
        """How far the unknown current may have carried the robot, standard deviation per axis."""
        return self._config.steady_current_m_s * self._blind_s

    def step(
        self,
        dt_s: float,
        velocity_ned: Sequence[float],
        depth_m: float,
        fix_xy_m: tuple[float, float] | None,
    ) -> None:
        """Let ``dt_s`` pass, then take in what was measured at its end.

        Args:
            dt_s: Time since the last step, s; positive.
            velocity_ned: Velocity that the velocity observer reports, m/s.
            depth_m: Depth from the pressure sensor.
            fix_xy_m: Northing and easting from outside, or ``None`` without a fix. A fix deeper
                than ``surface_depth_m`` is not believed.

        Raises:
            ValueError: If ``dt_s`` is not positive or a measurement is not finite.
        """
        fix = fix_xy_m if depth_m <= self.surface_depth_m else None
        velocity = np.array(velocity_ned, dtype=np.float64)
        xy = np.array(fix or (0.0, 0.0), dtype=np.float64)
        if not (0.0 < dt_s < math.inf and np.isfinite([*velocity, depth_m, *xy]).all()):
            raise ValueError("the position filter needs dt > 0 and finite measurements")
        self._blind_s += dt_s
        is_believed = fix is not None and self._takes(fix)
        self._fix_shift_m = step_position(
            self._axes, dt_s, velocity, depth_m, xy, is_believed, self._noise
        )

    def take_late_fix(self, fix_ne_m: tuple[float, float], variance_m2: float) -> bool:
        """Take in a fix that says of itself how sure it is, after ``step``.

        Args:
            fix_ne_m: Northing and easting now: what was measured, moved by the way made since.
            variance_m2: Of that per axis, what was lost on that way included. Fixes that follow
                each other have most of their error in common, so that it does not average out: no
                axis becomes surer by a fix than the fix is.

        Returns:
            Whether it was believed.
        """
        self._fix_shift_m = (0.0, 0.0)
        if not self._takes(fix_ne_m, math.sqrt(variance_m2)):
            return False
        before = self._axes[:2, 0].copy()
        take_late_fix(self._axes, np.array(fix_ne_m, dtype=np.float64), variance_m2)
        north, east = (self._axes[:2, 0] - before).tolist()
        self._fix_shift_m = (north, east)
        return True

    def _takes(self, fix: tuple[float, float], std_m: float | None = None) -> bool:
        """Judge a fix; the way that the current may have made becomes part of the covariance."""
        off = np.array(fix) - self._axes[:2, 0]
        noise = (self._config.fix_std_m if std_m is None else std_m) ** 2
        squared = float(np.sum(off**2 / (self._axes[:2, 2] + self._carried_m**2 + noise)))
        away_m = 0.0 if self._believed_fix is None else math.dist(fix, self._believed_fix)
        verdict = self._gate.judge(fix, squared / self._doubt**2, away_m, self._blind_s, std_m)
        if verdict is Verdict.REFUSED:
            return False
        if self._blind_s >= SHORTEST_DIVE_S and self._believed_fix is not None:
            self._watch.take(squared)
            self._doubt = self._watch.doubt
        self._axes[:2, 2] += self._carried_m**2
        if verdict is Verdict.REOPENED:
            self._axes[:2, 2] += float(off @ off)
        self._believed_fix, self._blind_s = fix, 0.0
        return True


def position_noise(config: EstimatorConfig) -> FloatArray:
    """Return the noise as ``kernel.step_position`` takes it, shape ``(4,)``."""
    return np.array(
        [
            config.acceleration_density,
            config.drift_m_sqrt_s,
            config.fix_std_m,
            config.depth_std_m,
        ]
    )
