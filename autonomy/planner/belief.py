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

    def noise(self, position_std: FloatArray, thresholds_m: tuple[float, ...]) -> FloatArray:
        """Return the noise variance of samples by the fidelity of their positions.

        A sample taken eta away from where it is believed differs from the field there by about
        eta times the horizontal gradient, whose prior variance is ``3 s² (1/l_n² + 1/l_e²)``. The
        samples of a level count as if eta were the threshold that the level begins at, so those of
        the best level have the measurement's own noise.

        Args:
            position_std: Standard deviation of each horizontal position, shape ``(n,)``, m.
            thresholds_m: Boundaries of the fidelity levels, ascending; empty for one level.

        Returns:
            Shape ``(n,)``.
        """
        return self.level_noise(thresholds_m)[np.searchsorted(thresholds_m, position_std)]

    def level_noise(self, thresholds_m: tuple[float, ...]) -> FloatArray:
        """Return the noise variance of each fidelity level, best level first."""
        north, east, _ = self.length_scales_m
        gradient = 3.0 * self.signal_variance * (1.0 / north**2 + 1.0 / east**2)
        return self.noise_variance + gradient * np.array([0.0, *thresholds_m]) ** 2

    def sample_noise(self, thresholds_m: tuple[float, ...]) -> FloatArray:
        """Return the noise variance of every past sample, shape ``(n,)``."""
        if self.sample_position_std is None:
            return np.full(len(self.sample_points), self.noise_variance)
        return self.noise(self.sample_position_std, thresholds_m)


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
