"""What the planner is told about the field: a Gaussian process and where it was sampled."""

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.field.config import FieldConfig, KernelParameters, KernelShape
from autonomy.field.level_scale import scale_factors, shares
from autonomy.field.model.kernel import covariance
from autonomy.planner.config import PlannerConfig


@dataclass(frozen=True, slots=True)
class FieldBelief:
    """State of a field map as the planner needs it, in the Gaussian process's own scale.

    Information gain reads the kernel and the positions; the ergodic objective reads ``mean`` and
    ``std``. Positions are NED in the site's frame, m.
    """

    signal_variance: float
    length_scales_m: tuple[float, float, float]
    """Length scales along north, east and depth."""
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

    shape: KernelShape = "matern32"
    """Shape of the kernel."""
    planned_points: FloatArray | None = None
    """Where samples will be taken before the plan begins, by other robots or on the rest of the
    running round, shape ``(m, 3)``; they count like past ones, but nobody knows their values."""
    planned_std: FloatArray | None = None
    """Standard deviation that their horizontal positions will have, ``(m,)``, m; None for 0."""
    counts: Literal["noise", "levels"] = "noise"
    """How much a badly located sample counts: each with the noise that its own position's
    uncertainty makes, or every sample of a fidelity level alike."""

    def kernel(self) -> KernelParameters:
        """Return the kernel as the field package takes it."""
        north, east, down = self.length_scales_m
        return KernelParameters(
            shape=self.shape,
            signal_variance=self.signal_variance,
            length_x_m=north,
            length_y_m=east,
            length_z_m=down,
            noise_variance=self.noise_variance,
        )

    def displacement_noise(self, position_std_m: FloatArray) -> FloatArray:
        r"""Return by what variance samples differ from the field where they are believed to be.

        The difference of the field across a displacement e has variance
        :math:`2 (\sigma^2 - k(e))`; e is the standard deviation along north and along east. For
        a small e this is :math:`e^2` times the prior variance of the horizontal gradient, as in
        ``autonomy.field.model.position_noise``.

        This is what each counts by itself; what samples of one dive share of it is told by
        ``position_error``.

        Args:
            position_std_m: Standard deviation of each horizontal position, shape ``(n,)``, m.

        Returns:
            Shape ``(n,)``, in the model's scale squared.
        """
        std = np.asarray(position_std_m, dtype=np.float64)
        displaced = np.column_stack([std, std, np.zeros(len(std))])
        with_itself = covariance(displaced, np.zeros((1, 3)), self.kernel())[:, 0]
        return 2.0 * (self.signal_variance - with_itself)

    def known_samples(self, noise: "SampleNoise") -> tuple[FloatArray, FloatArray]:
        """Return positions ``(n + m, 3)`` and noise variances of past and planned samples."""
        count = len(self.sample_points)
        past = np.zeros(count) if self.sample_position_std is None else self.sample_position_std
        if self.planned_points is None:
            return self.sample_points, noise.of(self, past)
        planned = len(self.planned_points)
        ahead = np.zeros(planned) if self.planned_std is None else self.planned_std
        points = np.concatenate([self.sample_points, self.planned_points])
        return points, noise.of(self, np.concatenate([past, ahead]))

    def at(self, points: FloatArray) -> "FieldBelief":
        """Return the belief with other test points, of which mean and deviation are not known."""
        unknown = np.full(len(points), np.nan)
        return replace(self, test_points=points, mean=unknown, std=unknown)

    def within(self, mask: BoolArray) -> "FieldBelief":
        """Return the belief about some of the test points only, such as those in the water.

        Args:
            mask: Which ones, shape ``(q,)``.
        """
        return replace(
            self, test_points=self.test_points[mask], mean=self.mean[mask], std=self.std[mask]
        )


def planning_kernel(config: FieldConfig) -> KernelParameters:
    """Return the kernel of the field that a configured model maps, as one kernel.

    The field of a model with levels is a sum of independent parts, and the sum of their kernels is
    none of them. In its place stands one with the same variance and, along each axis, the same
    integral of the covariance: its lengths are those of the parts, weighted with their variances.
    It has the shape of the strongest part, and the measurement noise of the best level. Parts of
    other lengths are rounded off by this: in both presets the lowest level has 93 % of the variance
    or more in the joint model, and 78 % or more in the recursive one.

    Args:
        config: Settings of the map.
    """
    if config.model in {"single", "position_noise"}:
        return config.single
    levels = config.joint_levels if config.model == "joint" else config.levels
    share = shares(scale_factors(config.rho, len(levels)))[:, -1]
    variance = share**2 * [level.signal_variance for level in levels]  # (levels,)
    lengths_m = variance @ np.array([level.length_scales_m() for level in levels])
    north_m, east_m, down_m = lengths_m / variance.sum()
    return KernelParameters(
        shape=levels[int(np.argmax(variance))].shape,
        signal_variance=variance.sum(),
        length_x_m=north_m,
        length_y_m=east_m,
        length_z_m=down_m,
        noise_variance=levels[-1].noise_variance,
    )


class SampleNoise(NamedTuple):
    """Which noise variance a sample counts with, by the uncertainty of its position.

    A named tuple of arrays and numbers, because compiled code takes it too.
    """

    is_continuous: bool
    """Whether every sample counts with its own noise; otherwise with its level's."""
    threshold: FloatArray
    """Boundaries of the levels in position std, ascending, ``(M,)``, m."""
    level_noise: FloatArray
    """Noise variance of each level, best level first, ``(M + 1,)``."""
    unknown_current_std_m_s: float
    """Standard deviation per axis of the current that is not known, m/s: along a dive it makes the
    errors of positions more alike than a walk does."""

    def of(self, belief: FieldBelief, position_std_m: FloatArray) -> FloatArray:
        """Return the noise variance of samples, shape ``(n,)``."""
        if self.is_continuous:
            return belief.noise_variance + belief.displacement_noise(position_std_m)
        return self.level_noise[np.searchsorted(self.threshold, position_std_m)]


def sample_noise(config: PlannerConfig, belief: FieldBelief) -> SampleNoise:
    """Return how the samples of a plan are to be counted.

    The samples of a level count as if their position were off by the threshold that the level
    begins at, so those of the best level have the measurement's own noise alone.
    """
    thresholds = config.counted_thresholds_m() if belief.counts == "levels" else ()
    threshold = np.array(thresholds, dtype=np.float64)
    begins = np.concatenate([[0.0], threshold])
    return SampleNoise(
        is_continuous=config.fidelity_counts and belief.counts == "noise",
        threshold=threshold,
        level_noise=belief.noise_variance + belief.displacement_noise(begins),
        unknown_current_std_m_s=config.position_filter.doubt
        * config.position_filter.steady_current_m_s,
    )


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
