"""Extended Kalman filter of a target by its range: the readable reference of ``filter_kernel``.

The state is relative position (robot minus target, north and east), heading and speed. Thesis
section 4.4 speaks of "the relative position" alone; only four states use all of Eq. 4.15.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import wrap_angle
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.filter.filter_kernel import CLOSEST_M


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """What the filter believes at one time."""

    x: FloatArray
    """Relative position north and east, m, heading, rad, and speed, m/s; shape ``(4,)``."""
    P: FloatArray
    """Covariance, shape ``(4, 4)``."""


def start_estimate(
    relative_ne_m: tuple[float, float],
    heading_rad: float,
    speed_m_s: float,
    position_variance_m2: float,
    config: TrackingConfig,
) -> Estimate:
    """Return a first guess; heading and speed are as uncertain as one measurement of them."""
    noise = config.filter
    variances = [position_variance_m2, position_variance_m2]
    variances += [noise.heading_variance_rad2, noise.speed_variance_m2_s2]
    return Estimate(np.array([*relative_ne_m, heading_rad, speed_m_s]), np.diag(variances))


def predict(
    estimate: Estimate,
    command: tuple[float, float],
    dt_s: float,
    target_velocity_ne_m_s: tuple[float, float],
    config: TrackingConfig,
) -> Estimate:
    """Let ``dt_s`` pass under a turn rate (rad/s) and an acceleration (m/s2), by the midpoint rule.

    Source:
        Unicycle of thesis Eq. 4.14; discretisation of the specification, section 1.
    """
    noise = config.filter
    turn_rate, acceleration = command
    x_r, y_r, psi, v = estimate.x
    middle, speed = psi + 0.5 * turn_rate * dt_s, v + 0.5 * acceleration * dt_s
    c, s = math.cos(middle), math.sin(middle)
    north, east = target_velocity_ne_m_s
    x = [x_r + (speed * c - north) * dt_s, y_r + (speed * s - east) * dt_s]
    x += [psi + turn_rate * dt_s, v + acceleration * dt_s]
    F = np.eye(4)
    F[0, 2:] = -speed * s * dt_s, c * dt_s
    F[1, 2:] = speed * c * dt_s, s * dt_s
    densities = [noise.position_density_m2_s, noise.position_density_m2_s]
    densities += [noise.heading_density_rad2_s, noise.speed_density_m2_s3]
    return Estimate(np.array(x), F @ estimate.P @ F.T + np.diag(densities) * dt_s)


def update(
    estimate: Estimate,
    heading_rad: float,
    speed_m_s: float,
    range_m: float | None,
    config: TrackingConfig,
) -> tuple[Estimate, float]:
    """Take in heading, speed and then the range if there is one (thesis Eq. 4.15).

    A range is left out where the estimate is on top of the target and has no bearing.

    Returns:
        The new estimate, and the log likelihood of what was taken in.
    """
    noise = config.filter
    turned = float(wrap_angle(heading_rad - estimate.x[2]))
    estimate, total = _correct(estimate, np.eye(4)[2], turned, noise.heading_variance_rad2)
    faster = speed_m_s - float(estimate.x[3])
    estimate, likelihood = _correct(estimate, np.eye(4)[3], faster, noise.speed_variance_m2_s2)
    total += likelihood
    distance = math.hypot(*estimate.x[:2])
    if range_m is not None and distance >= CLOSEST_M:
        sight = np.array([*(estimate.x[:2] / distance), 0.0, 0.0])
        farther = range_m - distance
        estimate, likelihood = _correct(estimate, sight, farther, config.ranging.variance_m2)
        total += likelihood
    return estimate, total


def _correct(
    estimate: Estimate, H: FloatArray, innovation: float, variance: float
) -> tuple[Estimate, float]:
    K = estimate.P @ H
    S = float(H @ K) + variance
    likelihood = -0.5 * (innovation**2 / S + math.log(2.0 * math.pi * S))
    x, P = estimate.x + K / S * innovation, estimate.P - np.outer(K, K) / S
    return Estimate(x, P), likelihood
