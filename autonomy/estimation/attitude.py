"""Attitude from gyro and tilt sensors: the gyro for the moment, the measured angles for good."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.kernel import step_attitude

CORRECTION_S = 1.0
"""Time constant with which the measured attitude corrects the integrated gyro."""
RATE_SMOOTHING_S = 0.3
"""Time constant of the smoothed rates."""


class AttitudeFilter:
    """Complementary filter of roll, pitch and heading; angles stay in ``[-pi, pi)``.

    Args:
        attitude_rad: First measured roll, pitch and heading.
        gyro_rad_s: First measured rates in body axes.
    """

    def __init__(
        self,
        attitude_rad: tuple[float, float, float],
        gyro_rad_s: tuple[float, float, float],
    ) -> None:
        self.attitude_rad: FloatArray = np.array(attitude_rad, dtype=np.float64)
        """Estimated roll, pitch and heading, shape ``(3,)``."""
        self.rates_rad_s: FloatArray = np.array(gyro_rad_s, dtype=np.float64)
        """Smoothed rates in body axes, shape ``(3,)``."""

    def step(
        self,
        dt_s: float,
        attitude_rad: tuple[float, float, float],
        gyro_rad_s: tuple[float, float, float],
    ) -> None:
        """Let ``dt_s`` pass, then take in what is measured at its end.

        Raises:
            ValueError: If ``dt_s`` is not positive or a measurement is not finite.
        """
        if not (dt_s > 0.0 and np.isfinite([dt_s, *attitude_rad, *gyro_rad_s]).all()):
            raise ValueError("the attitude filter needs dt > 0 and finite measurements")
        attitude, rates = self.attitude_rad.copy(), self.rates_rad_s.copy()
        step_attitude(
            attitude,
            rates,
            np.array(attitude_rad, dtype=np.float64),
            np.array(gyro_rad_s, dtype=np.float64),
            dt_s,
            min(dt_s / CORRECTION_S, 1.0),
            min(dt_s / RATE_SMOOTHING_S, 1.0),
        )
        self.attitude_rad, self.rates_rad_s = attitude, rates
