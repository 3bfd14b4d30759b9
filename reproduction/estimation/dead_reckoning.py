"""Dead reckoning: where the robot should be when tags or GPS are gone.

The model's velocity through the water and the attitude carry the position on (thesis section
3.4.3). Nothing on board sees the water move, so the covariance grows by that motion; a fix
corrects the position and leaves the unseen current unseen. No robot flies by it: it is what the
filter on the vehicle's model is measured against.
"""

import math
from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.config import DeadReckoningConfig, EstimatorConfig
from autonomy.estimation.kernel import fix_reckoning, reckon

LONGEST_HOLD_S = 5.0
"""Longest time over which the last velocity is believed to go on."""


class DeadReckoning:
    """Horizontal position by the velocity through the water, with the errors that it has.

    Three errors of the velocity are *considered* (Schmidt's filter): eddies, the steady current and
    the model's own error. They widen the covariance and are never estimated, so the covariance
    is honest and the position is what the model's velocity alone can give.

    Args:
        estimator: Drift of the water and noise of a fix.
        config: What dead reckoning does not see.
        position_ne: Northing and easting at the beginning, m.
        position_std_m: How well they are known, per axis.

    Raises:
        ValueError: If the position or its deviation is not finite.
    """

    def __init__(
        self,
        estimator: EstimatorConfig,
        config: DeadReckoningConfig,
        position_ne: Sequence[float],
        position_std_m: float,
    ) -> None:
        if not np.isfinite([*position_ne, position_std_m]).all():
            raise ValueError("dead reckoning must begin at a finite position")
        self._config = config
        self._fix_variance = estimator.fix_std_m**2
        self._noise = velocity_errors(estimator, config)
        self._axes = np.zeros((2, 2 + len(self._noise)))
        self._axes[:, 0] = position_ne
        self._axes[:, 1] = position_std_m**2

    @property
    def position_ne(self) -> tuple[float, float]:
        """Estimated northing and easting, m."""
        north, east = self._axes[:, 0].tolist()
        return (north, east)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of northing and easting, shape ``(2, 2)``, m2."""
        return np.diag(self._axes[:, 1])

    @property
    def position_std_m(self) -> float:
        """Standard deviation of the horizontal position along its worst direction, m."""
        return math.sqrt(max(self._axes[:, 1].tolist()))

    def step(
        self, dt_s: float, velocity_ne: Sequence[float], fix_ne: tuple[float, float] | None = None
    ) -> None:
        """Let ``dt_s`` pass under a velocity, then take in a fix if there is one.

        After a silence longer than ``LONGEST_HOLD_S`` the robot may have gone anywhere at its
        greatest speed, and the covariance says so.

        Args:
            dt_s: Time since the last step, s; positive.
            velocity_ne: Through the water, north and east, m/s.
            fix_ne: Northing and easting from outside, or ``None``.

        Raises:
            ValueError: If ``dt_s`` is not positive or a number is not finite.
        """
        if not (dt_s > 0.0 and np.isfinite([dt_s, *velocity_ne, *(fix_ne or ())]).all()):
            raise ValueError("dead reckoning needs dt > 0 and finite velocities and fixes")
        held_s = min(dt_s, LONGEST_HOLD_S)
        silence = (self._config.greatest_speed_m_s * (dt_s - held_s)) ** 2
        for i in range(2):
            velocity = velocity_ne[i] * held_s / dt_s
            reckon(self._axes[i], dt_s, velocity, self._noise, silence)
            if fix_ne is not None:
                fix_reckoning(self._axes[i], fix_ne[i], self._fix_variance)


def velocity_errors(estimator: EstimatorConfig, config: DeadReckoningConfig) -> FloatArray:
    """Return variance and correlation time of each error of the velocity, shape ``(3, 2)``.

    The rows are eddies, steady current and the model's own error.
    """
    current = config.current
    return np.array(
        [
            (current.eddy_std_m_s(estimator.drift_m_sqrt_s) ** 2, current.eddy_correlation_s),
            (current.steady_std_m_s**2, current.steady_correlation_s),
            (config.speed_error_m_s**2, config.speed_error_correlation_s),
        ]
    )
