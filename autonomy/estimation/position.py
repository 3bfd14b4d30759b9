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
from autonomy.estimation.kernel import step_position


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
        self._noise = position_noise(config)
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
        """Covariance of the state ``[x, y, z, vx, vy, vz]``, shape ``(6, 6)``."""
        a, b, d = (np.diag(self._axes[:, k]) for k in (2, 3, 4))
        return np.block([[a, b], [b, d]])

    @property
    def position_std_m(self) -> float:
        """Standard deviation of the horizontal position along its worst direction, m."""
        return math.sqrt(max(self._axes[:2, 2].tolist()))

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
        velocity = np.array(velocity_ned, dtype=np.float64)
        xy = np.array(fix or (0.0, 0.0), dtype=np.float64)
        if not (0.0 < dt_s < math.inf and np.isfinite([*velocity, depth_m, *xy]).all()):
            raise ValueError("the position filter needs dt > 0 and finite measurements")
        step_position(self._axes, dt_s, velocity, depth_m, xy, fix is not None, self._noise)


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
