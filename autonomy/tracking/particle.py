"""Particle filter of a target by its range: an independent check of the filter bank.

It needs no linearisation and can hold any number of places at once, at a thousand times the cost.
Motion and noise are those of ``filter``.
"""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import wrap_angle
from autonomy.tracking.config import TrackingConfig


@dataclass(frozen=True, slots=True, eq=False)
class ParticleCloud:
    """Equally likely or weighted states of robot and target."""

    states: FloatArray
    """Relative position north and east, m, heading, rad, speed, m/s; shape ``(n, 4)``."""
    weights: FloatArray
    """Shape ``(n,)``; they add up to 1."""

    @property
    def mean_ne_m(self) -> tuple[float, float]:
        """Mean relative position."""
        north, east = (self.weights @ self.states[:, :2]).tolist()
        return (north, east)

    @property
    def covariance_m2(self) -> FloatArray:
        """Covariance of the relative position, shape ``(2, 2)``."""
        off = self.states[:, :2] - np.array(self.mean_ne_m)
        return off.T @ (self.weights[:, None] * off)

    def share_within(self, relative_ne_m: tuple[float, float], radius_m: float) -> float:
        """Return the probability that the relative position is this close to a place."""
        off = self.states[:, :2] - np.array(relative_ne_m)
        return float(self.weights[np.hypot(off[:, 0], off[:, 1]) <= radius_m].sum())


def gaussian_cloud(
    mean: tuple[float, float, float, float],
    position_std_m: float,
    count: int,
    config: TrackingConfig,
    generator: np.random.Generator,
) -> ParticleCloud:
    """Draw a first guess; heading and speed are as uncertain as one measurement of them."""
    noise = config.filter
    std = [position_std_m, position_std_m]
    std += [math.sqrt(noise.heading_variance_rad2), math.sqrt(noise.speed_variance_m2_s2)]
    states = np.array(mean) + generator.standard_normal((count, 4)) * np.array(std)
    return ParticleCloud(states, np.full(count, 1.0 / count))


def ring_cloud(
    range_m: float,
    heading_rad: float,
    speed_m_s: float,
    count: int,
    config: TrackingConfig,
    generator: np.random.Generator,
) -> ParticleCloud:
    """Draw places in every direction at one measured range."""
    mean = (0.0, 0.0, heading_rad, speed_m_s)
    cloud = gaussian_cloud(mean, math.sqrt(config.ranging.variance_m2), count, config, generator)
    angles = generator.uniform(-math.pi, math.pi, count)
    distances = range_m + cloud.states[:, 0]
    cloud.states[:, 0] = distances * np.cos(angles)
    cloud.states[:, 1] = distances * np.sin(angles)
    return cloud


def predict(
    cloud: ParticleCloud,
    command: tuple[float, float],
    dt_s: float,
    target_velocity_ne_m_s: tuple[float, float],
    config: TrackingConfig,
    generator: np.random.Generator,
) -> ParticleCloud:
    """Let ``dt_s`` pass under a turn rate (rad/s) and an acceleration (m/s2)."""
    noise = config.filter
    x, (turn_rate, acceleration) = cloud.states, command
    middle = x[:, 2] + 0.5 * turn_rate * dt_s
    speed = x[:, 3] + 0.5 * acceleration * dt_s
    north, east = target_velocity_ne_m_s
    densities = [noise.position_density_m2_s, noise.position_density_m2_s]
    densities += [noise.heading_density_rad2_s, noise.speed_density_m2_s3]
    moved = generator.standard_normal(x.shape) * np.sqrt(np.array(densities) * dt_s)
    moved[:, 0] += x[:, 0] + (speed * np.cos(middle) - north) * dt_s
    moved[:, 1] += x[:, 1] + (speed * np.sin(middle) - east) * dt_s
    moved[:, 2] += x[:, 2] + turn_rate * dt_s
    moved[:, 3] += x[:, 3] + acceleration * dt_s
    return ParticleCloud(moved, cloud.weights)


def update(
    cloud: ParticleCloud,
    heading_rad: float,
    speed_m_s: float,
    range_m: float | None,
    config: TrackingConfig,
    generator: np.random.Generator,
) -> ParticleCloud:
    """Weigh by heading, speed and the range if there is one; resample when few particles count."""
    noise, x = config.filter, cloud.states
    chi2 = wrap_angle(heading_rad - x[:, 2]) ** 2 / noise.heading_variance_rad2
    chi2 += (speed_m_s - x[:, 3]) ** 2 / noise.speed_variance_m2_s2
    if range_m is not None:
        chi2 += (range_m - np.hypot(x[:, 0], x[:, 1])) ** 2 / config.ranging.variance_m2
    weights = cloud.weights * np.exp(-0.5 * (chi2 - chi2.min()))
    weights /= weights.sum()
    if 1.0 / float(weights @ weights) > 0.5 * len(weights):
        return ParticleCloud(x, weights)
    count = len(weights)
    steps = (np.arange(count) + generator.random()) / count
    chosen = np.minimum(np.searchsorted(np.cumsum(weights), steps), count - 1)
    return ParticleCloud(x[chosen], np.full(count, 1.0 / count))
