"""Velocity of a target from where it seems to be (ETV): the reference of ``velocity_into``.

Thesis section 4.4.1 estimates the target's velocity "in addition to the relative position"; here a
Kalman filter of constant velocity per axis does so, and what it measures is the robot's
dead-reckoned place minus the estimated relative position. Dead reckoning is through the water, so
the velocity is too, which is what the prediction of the relative position asks for.
"""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import FilterConfig


@dataclass(frozen=True, slots=True, eq=False)
class TargetMotion:
    """Place and velocity of a target."""

    mean: FloatArray
    """Rows place (m) and velocity (m/s), columns north and east; shape ``(2, 2)``."""
    P: FloatArray
    """Covariance of place and velocity, the same for both axes; shape ``(2, 2)``."""


def start_motion(place_ne_m: tuple[float, float], config: FilterConfig) -> TargetMotion:
    """Return what is believed at the first place."""
    variances = [config.target_position_variance_m2, config.target_speed_std_m_s**2]
    return TargetMotion(np.array([place_ne_m, (0.0, 0.0)]), np.diag(variances))


def step_motion(
    motion: TargetMotion, place_ne_m: tuple[float, float], dt_s: float, config: FilterConfig
) -> TargetMotion:
    """Let ``dt_s`` pass under white acceleration, then take in where the target seems to be."""
    F = np.array([[1.0, dt_s], [0.0, 1.0]])
    spread = np.array([[dt_s**3 / 3.0, dt_s**2 / 2.0], [dt_s**2 / 2.0, dt_s]])
    mean = F @ motion.mean
    P = F @ motion.P @ F.T + config.target_acceleration_density * spread
    gain = P[:, 0] / (P[0, 0] + config.target_position_variance_m2)
    mean = mean + np.outer(gain, np.array(place_ne_m) - mean[0])
    return TargetMotion(mean, P - np.outer(gain, P[0]))
