"""Cloud of places where a target may be: finds a robot by its beacon.

The cloud forgets no place that all ranges since the beginning allow. It works in the site frame
with the robot's own position, which fixes hold where there are any.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.filter import cloud_kernel

PARTICLES = 4000
PERSISTENCE = 2.8
"""The variance of a range counts so many times: an error of the robot's own position lasts over
many ranges, which therefore tell less than their number."""
STEADY_S = 300.0
"""Time over which a target forgets its velocity; its standard deviation stays what is expected."""
WALK_M_SQRT_S = 0.02
"""How every place strays, so that no two particles stay the same."""
OUTLIER_STDS = 4.0
"""A range contradicts no place by more standard deviations than this, so that one that is wrong
empties none."""
DOUBT_SHARE = 0.1
"""Share of the newest range in the mean log likelihood of all of them."""
DOUBT = -3.5
"""Mean log likelihood below which the ranges contradict the whole cloud; ``OUTLIER_STDS`` allows
-8."""


class TargetCloud:
    """Where a target may be, by all ranges since the beginning.

    Args:
        config: First guess, range noise, and how fast a target may be.
        generator: Source of its random numbers.
        guess_std_m: How far off the first guess may be, per axis; the configured one unless said
            otherwise.
    """

    def __init__(
        self,
        config: TrackingConfig,
        generator: np.random.Generator,
        *,
        guess_std_m: float | None = None,
    ) -> None:
        self._speed_std_m_s = config.filter.target_speed_std_m_s
        self._std_m = math.sqrt(PERSISTENCE * config.ranging.variance_m2)
        self._generator = generator
        std_m = config.target.guess_std_m if guess_std_m is None else guess_std_m
        guess = std_m * generator.standard_normal((PARTICLES, 2))
        guess += (config.target.north_m, config.target.east_m)
        self._particles = np.hstack([guess, self._velocities()])
        self._spare = np.empty_like(self._particles)
        self._noise = np.empty_like(self._particles)
        self._weights = np.full(PARTICLES, 1.0 / PARTICLES)
        self._heard_s: float | None = None
        self._agreement = 0.0

    def hear(self, time_s: float, own_ne_m: tuple[float, float], range_m: float) -> None:
        """Take in a range; one that contradicts every place together with others begins anew.

        Args:
            time_s: When it held; one before the last counts as of the same time.
            own_ne_m: Where the robot was then.
            range_m: Horizontal range.
        """
        is_first = self._heard_s is None
        before_s = time_s if self._heard_s is None else self._heard_s
        self._heard_s = max(time_s, before_s)
        self._drift(self._heard_s - before_s)
        likelihood = cloud_kernel.weigh(
            self._particles, self._weights, *own_ne_m, range_m, self._std_m, OUTLIER_STDS
        )
        self._agreement += DOUBT_SHARE * (likelihood - self._agreement)
        is_elsewhere = is_first and likelihood < 2.0 * DOUBT
        if is_elsewhere or self._agreement < DOUBT:
            self._begin_anew(own_ne_m, range_m)
        elif float(self._weights @ self._weights) > 2.0 / PARTICLES:
            self._resample()

    def stray(self, variance_m2: float) -> None:
        """Let every place stray by so much more, per axis."""
        self._generator.standard_normal(out=self._noise)
        cloud_kernel.drift(self._particles, 0.0, math.sqrt(variance_m2), 1.0, 0.0, self._noise)

    def moments(self) -> tuple[FloatArray, FloatArray]:
        """Return the mean of place and velocity as of the newest range, and the covariance.

        Returns:
            North, east, and the velocity along them, m and m/s, shape ``(4,)``; shape ``(4, 4)``.
        """
        mean = self._weights @ self._particles
        off = self._particles - mean
        return mean, off.T @ (self._weights[:, None] * off)

    def _drift(self, dt_s: float) -> None:
        kept = math.exp(-dt_s / STEADY_S)
        fresh_m_s = self._speed_std_m_s * math.sqrt(1.0 - kept * kept)
        walk_m = WALK_M_SQRT_S * math.sqrt(dt_s)
        self._generator.standard_normal(out=self._noise)
        cloud_kernel.drift(self._particles, dt_s, walk_m, kept, fresh_m_s, self._noise)

    def _resample(self) -> None:
        offset = float(self._generator.random())
        cloud_kernel.resample_into(self._spare, self._particles, self._weights, offset)
        self._particles, self._spare = self._spare, self._particles
        self._weights[:] = 1.0 / PARTICLES

    def _begin_anew(self, own_ne_m: tuple[float, float], range_m: float) -> None:
        """Believe the range, and no bearing."""
        angles = self._generator.uniform(-math.pi, math.pi, PARTICLES)
        distances = range_m + self._std_m * self._generator.standard_normal(PARTICLES)
        ring = np.column_stack([np.cos(angles), np.sin(angles)]) * distances[:, None]
        self._particles = np.hstack([ring + np.array(own_ne_m), self._velocities()])
        self._weights[:] = 1.0 / PARTICLES
        self._agreement = 0.0

    def _velocities(self) -> FloatArray:
        return self._speed_std_m_s * self._generator.standard_normal((PARTICLES, 2))
