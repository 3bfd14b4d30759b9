"""The covariance that the position filter will have along a path not yet swum.

Model (thesis 5.4.2): constant velocity driven by white acceleration. Near the surface position and
velocity are measured, deeper only depth and velocity. All noise is diagonal, so north, east and
down decouple and one axis has a covariance of three numbers. A steady current that is known to a
standard deviation b adds ``b^2 t^2``, t the time since the last fix, and what becomes of it in that
time (``known_current``). Nothing here is compiled: the station plans with it, and never loads a
compiler.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.known_current import carried_variance, forgotten_per_s3

STD_95 = 2.4477
"""Semi-axis of the 95 % ellipse of a two-dimensional Gaussian, in standard deviations."""
_NEWTON_STEPS = 60
"""From far beyond, where the cube rules, each takes a third off."""


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

    def take_late_fix(self, variance: float) -> "AxisCovariance":
        """Take a fix from outside whose error stays from one to the next.

        Args:
            variance: Of the fix when it is taken, m^2. Most of it does not average out, so it
                makes no position surer than itself.
        """
        after = self.measure_position(variance)
        least = min(self.position, variance)
        return AxisCovariance(max(after.position, least), after.cross, after.velocity)

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

    def std(self, times_s: FloatArray, depths_m: FloatArray) -> FloatArray:
        r"""Predict it for the points of one dive, the current known as the settings say.

        Args:
            times_s: Time of each point since the start, ascending, shape ``(m,)``.
            depths_m: Depth of each, shape ``(m,)``.

        Returns:
            :math:`\eta = \sqrt{\lambda_{max}(P_{xy})}` at each point, shape ``(m,)``, m.
        """
        walked, blind_s = self.walk(times_s, depths_m)
        return position_std(self._config, self._config.steady_current_m_s, walked, blind_s)

    def walk(self, times_s: FloatArray, depths_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what of it is no steady current, as a variance, and the times without a fix.

        Args:
            times_s: Time of each point since the start, ascending, shape ``(m,)``.
            depths_m: Depth of each, shape ``(m,)``.

        Returns:
            Variance per axis, m^2, and time since the last fix, s, at each point, shape ``(m,)``.
        """
        config, points = self._config, list(zip(times_s.tolist(), depths_m.tolist(), strict=True))
        alike = self._alike(points)
        axis = self._unseen[alike]
        walked = [one.position for one in self._unseen[1 : alike + 1]]
        blind = [number * self._interval_s for number in range(1, alike + 1)]
        before = blind_s = points[alike - 1][0] if alike else 0.0
        for time, depth in points[alike:]:
            step_s, has_fix = time - before, depth <= config.surface_depth_m
            axis = axis.step(config, step_s, has_fix=has_fix)
            blind_s = 0.0 if has_fix else blind_s + step_s
            walked.append(axis.position)
            blind.append(blind_s)
            before = time
        return np.array(walked), np.array(blind)

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
        while len(self._unseen) <= alike:
            axis = self._unseen[-1].step(self._config, self._interval_s, has_fix=False)
            self._unseen.append(axis)
        return alike


def position_std(
    config: EstimatorConfig, current_std_m_s: float, walked: FloatArray, blind_s: FloatArray
) -> FloatArray:
    """Return how uncertain a robot states its position to be, m.

    Args:
        config: How far it doubts itself, and what becomes of what it knows of the current.
        current_std_m_s: How well the current is known when the last fix comes.
        walked: As ``ExpectedPosition.walk`` returns it.
        blind_s: Likewise.
    """
    return config.doubt * np.sqrt(walked + carried_variance(config, current_std_m_s, blind_s))


def expected_position_std(
    config: EstimatorConfig, times_s: FloatArray, depths_m: FloatArray, interval_s: float
) -> FloatArray:
    """Predict how well the robot will know its position at the points of one dive.

    ``ExpectedPosition`` says what is given and returned, and does the same for many dives.
    """
    return ExpectedPosition(config, interval_s).std(times_s, depths_m)


def drifted_variance(config: EstimatorConfig, blind_s: float) -> float:
    """Return by what variance a position is lost per axis in a time without a fix, m^2."""
    carried = carried_variance(config, config.steady_current_m_s, blind_s)
    return config.doubt**2 * (config.drift_m_sqrt_s**2 * blind_s + carried)


def blind_time_s(config: EstimatorConfig, variance: float) -> float:
    """Return how long a robot may go without a fix until its position is lost by a variance.

    Args:
        config: Its drift and the current that nobody knows.
        variance: Of the position per axis, m^2.
    """
    walk, steady = config.drift_m_sqrt_s**2, config.steady_current_m_s**2
    variance /= config.doubt**2
    # the root of steady t^2 + walk t = variance in the form that holds for steady = 0 too
    time_s = 2.0 * variance / (walk + math.sqrt(walk**2 + 4.0 * steady * variance))
    growth = forgotten_per_s3(config, config.steady_current_m_s)
    if growth == 0.0 or not math.isfinite(time_s):
        return time_s
    # beyond the root of growth t^3 + steady t^2 + walk t, which is convex, Newton comes down to it
    for _ in range(_NEWTON_STEPS):
        beyond = time_s * (walk + time_s * (steady + time_s * growth)) - variance
        time_s -= beyond / (walk + time_s * (2.0 * steady + 3.0 * time_s * growth))
    return time_s
