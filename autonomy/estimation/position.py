"""The covariance that the position filter will have along a path not yet swum.

Model (thesis 5.4.2): constant velocity driven by white acceleration. Near the surface position and
velocity are measured, deeper only depth and velocity. All noise is diagonal, so north, east and
down decouple and one axis has a covariance of three numbers. A steady current of standard deviation
b that nobody knows adds ``b^2 t^2``, t the time since the last fix. Nothing here is compiled: the
station plans with it, and never loads a compiler.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig

STD_95 = 2.4477
"""Semi-axis of the 95 % ellipse of a two-dimensional Gaussian, in standard deviations."""


@dataclass(frozen=True, slots=True)
class AxisCovariance:
    """Covariance of position and velocity along one axis."""

    position: float
    """Variance of the position, m^2."""
    cross: float
    """Covariance of position and velocity, m^2/s."""
    velocity: float
    """Variance of the velocity, m^2/s^2."""

    def predict(self, dt_s: float, acceleration_density: float) -> "AxisCovariance":
        """Let ``dt_s`` pass without a measurement."""
        q, d = acceleration_density, self.velocity
        return AxisCovariance(
            position=self.position + 2 * dt_s * self.cross + dt_s**2 * d + q * dt_s**3 / 3,
            cross=self.cross + dt_s * d + q * dt_s**2 / 2,
            velocity=d + q * dt_s,
        )

    def measure_velocity(self, variance: float) -> "AxisCovariance":
        """Measure the velocity with this noise variance, m^2/s^2."""
        s = self.velocity + variance
        return AxisCovariance(
            position=self.position - self.cross**2 / s,
            cross=self.cross * variance / s,
            velocity=self.velocity * variance / s,
        )

    def measure_position(self, variance: float) -> "AxisCovariance":
        """Measure the position with this noise variance, m^2."""
        s = self.position + variance
        return AxisCovariance(
            position=self.position * variance / s,
            cross=self.cross * variance / s,
            velocity=self.velocity - self.cross**2 / s,
        )

    def step(self, config: EstimatorConfig, dt_s: float, has_fix: bool) -> "AxisCovariance":
        """Advance one horizontal axis: predict, measure velocity and, with a fix, position."""
        later = self.predict(dt_s, config.acceleration_density)
        later = later.measure_velocity(config.drift_m_sqrt_s**2 / dt_s)
        return later.measure_position(config.fix_std_m**2) if has_fix else later


def surface_covariance(config: EstimatorConfig, dt_s: float) -> AxisCovariance:
    """Return the covariance that a horizontal axis settles at while fixes arrive every ``dt_s``."""
    axis = AxisCovariance(config.fix_std_m**2, 0.0, config.drift_m_sqrt_s**2 / dt_s)
    while True:
        later = axis.step(config, dt_s, has_fix=True)
        if abs(later.position - axis.position) <= 1e-12 * axis.position:
            return later
        axis = later


class ExpectedPosition:
    """How well a robot will know its position along dives that each follow a stay on top.

    Every dive begins with the same covariance and, as long as it gets no fix at a point, goes on
    alike: that course is worked out once, as far as the longest dive needs it.

    Args:
        config: Noise that the filter assumes.
        interval_s: Time between fixes before a dive, and between most points of one.
    """

    def __init__(self, config: EstimatorConfig, interval_s: float) -> None:
        self._config, self._interval_s = config, interval_s
        self._unseen = [surface_covariance(config, interval_s)]
        """After so many intervals without a fix, from 0 on."""
        self._unseen_std: list[float] = []
        """After so many intervals without a fix, from 1 on."""

    def std(self, times_s: FloatArray, depths_m: FloatArray) -> FloatArray:
        r"""Predict it for the points of one dive.

        Args:
            times_s: Time of each point since the start, ascending, shape ``(m,)``.
            depths_m: Depth of each, shape ``(m,)``.

        Returns:
            :math:`\eta = \sqrt{\lambda_{max}(P_{xy})}` at each point, shape ``(m,)``, m.
        """
        config, points = self._config, list(zip(times_s.tolist(), depths_m.tolist(), strict=True))
        alike = self._alike(points)
        axis, std = self._unseen[alike], self._unseen_std[:alike]
        before = blind_s = points[alike - 1][0] if alike else 0.0
        for time, depth in points[alike:]:
            step_s, has_fix = time - before, depth <= config.surface_depth_m
            axis = axis.step(config, step_s, has_fix=has_fix)
            blind_s = 0.0 if has_fix else blind_s + step_s
            std.append(self._std(axis, blind_s))
            before = time
        return np.array(std)

    def _alike(self, points: list[tuple[float, float]]) -> int:
        """Return how many points come one interval after the other without a fix.

        As many are known then.
        """
        alike, before = 0, 0.0
        for time, depth in points:
            is_usual = math.isclose(time - before, self._interval_s)
            if depth <= self._config.surface_depth_m or not is_usual:
                break
            alike, before = alike + 1, time
        for number in range(len(self._unseen), alike + 1):
            axis = self._unseen[-1].step(self._config, self._interval_s, has_fix=False)
            self._unseen.append(axis)
            self._unseen_std.append(self._std(axis, number * self._interval_s))
        return alike

    def _std(self, axis: AxisCovariance, blind_s: float) -> float:
        variance = axis.position + (self._config.steady_current_m_s * blind_s) ** 2
        return self._config.doubt * math.sqrt(variance)


def expected_position_std(
    config: EstimatorConfig, times_s: FloatArray, depths_m: FloatArray, interval_s: float
) -> FloatArray:
    """Predict how well the robot will know its position at the points of one dive.

    ``ExpectedPosition`` says what is given and returned, and does the same for many dives.
    """
    return ExpectedPosition(config, interval_s).std(times_s, depths_m)


def drifted_variance(config: EstimatorConfig, blind_s: float) -> float:
    """Return by what variance a position is lost per axis in a time without a fix, m^2."""
    steady_m = config.steady_current_m_s * blind_s
    return config.doubt**2 * (config.drift_m_sqrt_s**2 * blind_s + steady_m**2)


def blind_time_s(config: EstimatorConfig, variance: float) -> float:
    """Return how long a robot may go without a fix until its position is lost by a variance.

    Args:
        config: Its drift and the current that nobody knows.
        variance: Of the position per axis, m^2.
    """
    walk, steady = config.drift_m_sqrt_s**2, config.steady_current_m_s**2
    variance /= config.doubt**2
    # the root of steady t^2 + walk t = variance in the form that holds for steady = 0 too
    return 2.0 * variance / (walk + math.sqrt(walk**2 + 4.0 * steady * variance))
