"""The position filter, and the covariance that it will have along a path not yet swum.

Model (thesis 5.4.2): constant velocity driven by white acceleration. Near the surface position and
velocity are measured, deeper only depth and velocity. All noise is diagonal, so north, east and
down decouple and one axis has a covariance of three numbers.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig


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


def expected_position_std(
    config: EstimatorConfig,
    depth_m: Sequence[float] | FloatArray,
    dt_s: float,
    start: AxisCovariance | None = None,
) -> FloatArray:
    r"""Predict how well the robot will know its position along a path.

    Args:
        config: Noise that the filter assumes.
        depth_m: Depth at each point of the path, ``dt_s`` apart, shape ``(n,)``.
        dt_s: Time between two points, s.
        start: Covariance at the first point; by default the one settled at the surface.

    Returns:
        :math:`\eta = \sqrt{\lambda_{max}(P_{xy})}` at each point, shape ``(n,)``, m.
    """
    axis = start or surface_covariance(config, dt_s)
    std = np.empty(len(depth_m))
    for i, depth in enumerate(depth_m):
        if i > 0:
            axis = axis.step(config, dt_s, has_fix=bool(depth <= config.surface_depth_m))
        std[i] = math.sqrt(axis.position)
    return std


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
        self._state = np.concatenate([np.asarray(position_ned, dtype=np.float64), np.zeros(3)])
        self._covariance = np.diag([position_std_m**2] * 3 + [velocity_std_m_s**2] * 3)

    @property
    def position_ned(self) -> tuple[float, float, float]:
        """Estimated position, m."""
        x, y, z = self._state[:3]
        return (float(x), float(y), float(z))

    @property
    def velocity_ned(self) -> tuple[float, float, float]:
        """Estimated velocity, m/s."""
        vx, vy, vz = self._state[3:]
        return (float(vx), float(vy), float(vz))

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the state, shape ``(6, 6)``; a copy."""
        return self._covariance.copy()

    @property
    def position_std_m(self) -> float:
        """Standard deviation of the horizontal position along its worst direction, m."""
        return math.sqrt(float(np.linalg.eigvalsh(self._covariance[:2, :2])[-1]))

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
        fix = fix_xy_m if depth_m <= self._config.surface_depth_m else None
        measured = np.array([*(fix or ()), depth_m, *velocity_ned])
        if not (dt_s > 0 and np.isfinite(measured).all()):
            raise ValueError("the position filter needs dt > 0 and finite measurements")
        self._predict(dt_s)
        config = self._config
        variance = [config.fix_std_m**2] * (2 if fix else 0) + [config.depth_std_m**2]
        variance += [config.drift_m_sqrt_s**2 / dt_s] * 3
        self._update(np.eye(6)[0 if fix else 2 :], measured, np.diag(variance))

    def _predict(self, dt_s: float) -> None:
        eye = np.eye(3)
        F = np.block([[eye, dt_s * eye], [np.zeros((3, 3)), eye]])
        q = self._config.acceleration_density
        Q = q * np.block([[dt_s**3 / 3 * eye, dt_s**2 / 2 * eye], [dt_s**2 / 2 * eye, dt_s * eye]])
        self._state = F @ self._state
        self._covariance = F @ self._covariance @ F.T + Q

    def _update(self, H: FloatArray, measured: FloatArray, R: FloatArray) -> None:
        P = self._covariance
        S = H @ P @ H.T + R
        gain = np.linalg.solve(S, H @ P).T
        self._state = self._state + gain @ (measured - H @ self._state)
        I_KH = np.eye(6) - gain @ H
        # Joseph's form keeps P symmetric and positive definite over days of steps.
        self._covariance = I_KH @ P @ I_KH.T + gain @ R @ gain.T
