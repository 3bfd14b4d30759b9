"""The position filter of the onboard program (thesis 5.4.2), which sees no current.

``autonomy.estimation.position`` has its model, and the readable reference of its covariance.
"""

import math
from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import EstimatorConfig
from autonomy.estimation.kernel import step_position


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
