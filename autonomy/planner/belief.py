"""What the planner is told about the field: a Gaussian process and where it was sampled."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters


@dataclass(frozen=True, slots=True)
class FieldBelief:
    """State of a field map as the planner needs it, in the Gaussian process's own scale.

    Information gain reads the kernel and the positions; the ergodic objective reads ``mean`` and
    ``std``. Positions are NED in the site's frame, m.
    """

    signal_variance: float
    length_scales_m: tuple[float, float, float]
    """Matern-3/2 length scales along north, east and depth."""
    noise_variance: float
    """Variance of one measurement."""
    sample_points: FloatArray
    """Where samples were taken, in order of time, shape ``(n, 3)``; ``n`` may be 0."""
    test_points: FloatArray
    """Points that stand for the domain (X* of the thesis), shape ``(q, 3)``."""
    mean: FloatArray
    """Mean at the test points, shape ``(q,)``."""
    std: FloatArray
    """Standard deviation at the test points, shape ``(q,)``."""
    sample_position_std: FloatArray | None = None
    """Standard deviation of each sample's horizontal position, shape ``(n,)``, m; None for 0."""

    def kernel(self) -> KernelParameters:
        """Return the kernel as the field package takes it."""
        north, east, down = self.length_scales_m
        return KernelParameters(
            signal_variance=self.signal_variance,
            length_x_m=north,
            length_y_m=east,
            length_z_m=down,
            noise_variance=self.noise_variance,
        )

    def position_noise_factor(self) -> float:
        """Return the variance that 1 m² of horizontal position variance adds to a measurement.

        It is the prior variance of the field's horizontal gradient, summed over both axes:
        ``3 s² (1/l_n² + 1/l_e²)`` for the Matern-3/2 kernel.
        """
        north, east, _ = self.length_scales_m
        return 3.0 * self.signal_variance * (1.0 / north**2 + 1.0 / east**2)

    def sample_noise(self, position_error_counts: bool) -> FloatArray:
        """Return the noise variance of every past sample, shape ``(n,)``."""
        noise = np.full(len(self.sample_points), self.noise_variance)
        if position_error_counts and self.sample_position_std is not None:
            noise += self.position_noise_factor() * self.sample_position_std**2
        return noise


def averaged_samples(
    points: FloatArray, noise: FloatArray, limit: int
) -> tuple[FloatArray, FloatArray]:
    """Average runs of successive samples until at most ``limit`` remain.

    A run of k neighbours is one measurement at their weighted centre, with the noise of the
    weighted mean. This holds as long as a run is short beside the length scales.

    Args:
        points: Positions in order of time, shape ``(n, 3)``.
        noise: Noise variance of each, shape ``(n,)``.
        limit: Greatest number of samples to return.

    Returns:
        Positions ``(k, 3)`` and noise variances ``(k,)`` with ``k <= limit``.
    """
    n = len(points)
    if n <= limit:
        return points, noise
    starts = np.arange(0, n, -(-n // limit))
    weight = 1.0 / noise  # (n,)
    total = np.add.reduceat(weight, starts)  # (k,)
    centre = np.add.reduceat(points * weight[:, None], starts, axis=0) / total[:, None]  # (k, 3)
    return centre, 1.0 / total
