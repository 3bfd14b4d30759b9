"""Compiled steps of the cloud of places where a target may be; ``cloud`` says when to call which.

A *particle* is four numbers: place north and east in the site frame, m, and velocity, m/s. No
kernel allocates.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel


@kernel
def drift(
    particles: FloatArray,
    dt: float,
    walk_m: float,
    kept: float,
    fresh_m_s: float,
    noise: FloatArray,
) -> None:
    """Let ``dt`` pass, in place.

    Args:
        particles: Shape ``(n, 4)``.
        dt: Time, s.
        walk_m: Standard deviation by which each place strays meanwhile, per axis.
        kept: Share of its velocity that a target keeps.
        fresh_m_s: Standard deviation of what it gains instead, per axis.
        noise: Standard normal numbers, shape ``(n, 4)``.
    """
    for i in range(len(particles)):
        particles[i, 0] += particles[i, 2] * dt + walk_m * noise[i, 0]
        particles[i, 1] += particles[i, 3] * dt + walk_m * noise[i, 1]
        particles[i, 2] = kept * particles[i, 2] + fresh_m_s * noise[i, 2]
        particles[i, 3] = kept * particles[i, 3] + fresh_m_s * noise[i, 3]


@kernel
def weigh(
    particles: FloatArray,
    weights: FloatArray,
    north_m: float,
    east_m: float,
    range_m: float,
    std_m: float,
    outlier_stds: float,
) -> float:
    """Weigh every particle by a range, in place; the weights add up to 1 again.

    Args:
        particles: Shape ``(n, 4)``.
        weights: Shape ``(n,)``.
        north_m: Where the robot was.
        east_m: The same.
        range_m: Horizontal range.
        std_m: Its standard deviation.
        outlier_stds: The range contradicts no particle by more standard deviations than this; at
            most 30, beyond which every weight could underflow to 0.

    Returns:
        Log of the mean likelihood, against 0 for a range that all particles expected.
    """
    total = 0.0
    for i in range(len(particles)):
        distance = math.hypot(particles[i, 0] - north_m, particles[i, 1] - east_m)
        off = min(abs(range_m - distance) / std_m, outlier_stds)
        weights[i] *= math.exp(-0.5 * off * off)
        total += weights[i]
    for i in range(len(particles)):
        weights[i] /= total
    return math.log(total)


@kernel
def resample_into(
    chosen: FloatArray, particles: FloatArray, weights: FloatArray, offset: float
) -> None:
    """Choose as many particles of equal weight, by systematic resampling.

    Args:
        chosen: Is filled with them, shape ``(n, k)``.
        particles: Shape ``(n, k)``.
        weights: Shape ``(n,)``; they add up to 1.
        offset: Uniform in 0..1.
    """
    count = len(particles)
    reached, j = weights[0], 0
    for i in range(count):
        while reached < (i + offset) / count and j < count - 1:
            j += 1
            reached += weights[j]
        for k in range(particles.shape[1]):
            chosen[i, k] = particles[j, k]


def warm_up() -> None:
    """Compile every kernel of this module."""
    particles, weights = np.zeros((2, 4)), np.full(2, 0.5)
    drift(particles, 0.1, 0.1, 0.9, 0.1, np.zeros((2, 4)))
    weigh(particles, weights, 1.0, 0.0, 1.0, 0.1, 4.0)
    resample_into(np.empty_like(particles), particles, weights, 0.5)
