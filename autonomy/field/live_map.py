"""The map of one variable, kept up to date while samples arrive."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import FieldConfig, KernelParameters
from autonomy.field.fidelity import fidelity_level
from autonomy.field.grid import Grid
from autonomy.field.growing import GrowingGaussianProcess
from autonomy.field.recursive import RecursiveGaussianProcess
from autonomy.field.scale import to_model
from autonomy.field.thinning import space_filling

_KEPT_WHEN_FULL = 0.75


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The field at chosen points, in the model's scale."""

    mean: FloatArray
    """Shape ``(q,)``."""
    covariance: FloatArray
    """Covariance of the field itself, without measurement noise, shape ``(q, q)``."""


class LiveMap:
    """Mean and standard deviation of a field on a grid, updated in place with each sample.

    Both models are one here: the single model is the recursive one with one level. Every level of
    the model is a growing Gaussian process whose targets are the grid and the samples of the
    levels above, so that their residuals follow when a level below learns something.

    Samples beyond ``config.max_samples`` make the map keep an evenly spread three quarters of
    that number and begin anew from them; ``samples_dropped`` counts those left out.
    """

    def __init__(self, config: FieldConfig, grid: Grid) -> None:
        """Begin with the prior on ``grid``."""
        self.config = config
        self.grid = grid
        self.samples_dropped = 0
        self._begin()

    @property
    def mean(self) -> FloatArray:
        """Expected field at ``grid.points`` in the model's scale, shape ``(q,)``; a copy."""
        q = len(self.grid.points)
        total = np.full(q, self.config.prior_mean)
        for process in self._processes:
            total += process.mean[:q]
        return total

    @property
    def std(self) -> FloatArray:
        """Standard deviation of the field at ``grid.points``, shape ``(q,)``; a copy."""
        q = len(self.grid.points)
        variance = np.zeros(q)
        for process in self._processes:
            variance += np.maximum(process.variance[:q], 0.0)
        return np.sqrt(variance)

    @property
    def points(self) -> FloatArray:
        """Positions of the kept samples, shape ``(n, 3)``, m, ordered by level."""
        return np.concatenate(self._points)

    @property
    def values(self) -> FloatArray:
        """Kept samples in the model's scale, shape ``(n,)``, ordered as ``points``."""
        return np.concatenate(self._values)

    @property
    def sample_levels(self) -> IntArray:
        """Fidelity level of each kept sample, shape ``(n,)``, in both models."""
        return np.concatenate(self._fidelity)

    @property
    def samples_per_level(self) -> tuple[int, ...]:
        """Number of kept samples of each fidelity level, worst located first, in both models."""
        levels = len(self.config.fidelity_thresholds_m) + 1
        return tuple(np.bincount(self.sample_levels, minlength=levels).tolist())

    def append(self, points: FloatArray, values: FloatArray, position_std: FloatArray) -> None:
        """Take in samples: all of them, or none if one cannot be used.

        Args:
            points: Estimated positions in the site's NED frame, shape ``(m, 3)``, m.
            values: Measurements in the variable's unit, shape ``(m,)``.
            position_std: Standard deviation of each horizontal position, shape ``(m,)``, m.

        Raises:
            ValueError: If shapes disagree, a number is not finite, or a ``position_std`` is
                negative.
        """
        points, values, position_std = _checked(points, values, position_std)
        if not len(values):
            return
        seen = to_model(self.config.resolved_scale(), values)
        fidelity = fidelity_level(position_std, self.config.fidelity_thresholds_m)
        if len(self.values) + len(values) > self.config.max_samples:
            points, seen, fidelity = self._thinned(points, seen, fidelity)
            self._begin()
        self._take_in(points, seen, fidelity)

    def predict(self, targets: FloatArray) -> Prediction:
        """Return mean and full covariance of the field at any points, shape ``(q, 3)``, m.

        It conditions anew in ``O(n^3)``: meant for scores and plans, not for each sample.
        """
        residuals = self.values - self.config.prior_mean
        levels = np.repeat(np.arange(len(self._values)), [len(values) for values in self._values])
        model = RecursiveGaussianProcess(self._levels, self.points, residuals, levels)
        mean = self.config.prior_mean + model.mean(targets)
        return Prediction(mean, model.covariance(targets))

    @property
    def _levels(self) -> tuple[KernelParameters, ...]:
        return (self.config.single,) if self.config.model == "single" else self.config.levels

    def _begin(self) -> None:
        grid = self.grid.points
        self._processes = [GrowingGaussianProcess(level, grid) for level in self._levels]
        self._points = [np.empty((0, 3)) for _ in self._levels]
        self._values = [np.empty(0) for _ in self._levels]
        self._fidelity = [np.empty(0, dtype=np.int64) for _ in self._levels]
        self._targets = [np.empty((len(self._levels), 0), dtype=np.int64) for _ in self._levels]
        """Which targets of each level below (first axis) the samples of a level are."""

    def _take_in(self, points: FloatArray, values: FloatArray, fidelity: IntArray) -> None:
        levels = np.minimum(fidelity, len(self._processes) - 1)
        moved = False
        for level, process in enumerate(self._processes):
            mine = levels == level
            known = len(self._values[level])
            if mine.any():
                self._remember(level, points[mine], values[mine], fidelity[mine])
            residuals = self._residuals(level)
            if moved and known:
                process.replace_values(residuals[:known])
            process.append(self._points[level][known:], residuals[known:])
            moved = moved or bool(mine.any())

    def _remember(
        self, level: int, points: FloatArray, values: FloatArray, fidelity: IntArray
    ) -> None:
        """Store samples of a level and make them targets of the levels below."""
        numbers = np.zeros((len(self._processes), len(values)), dtype=np.int64)
        for below, process in enumerate(self._processes[:level]):
            first = len(process.mean)
            process.add_targets(points)
            numbers[below] = np.arange(first, first + len(values))
        self._points[level] = np.concatenate([self._points[level], points])
        self._values[level] = np.concatenate([self._values[level], values])
        self._fidelity[level] = np.concatenate([self._fidelity[level], fidelity])
        self._targets[level] = np.concatenate([self._targets[level], numbers], axis=1)

    def _residuals(self, level: int) -> FloatArray:
        """Return what the levels below leave unexplained of a level's samples."""
        residuals = self._values[level] - self.config.prior_mean
        for below, process in enumerate(self._processes[:level]):
            residuals -= process.mean[self._targets[level][below]]
        return residuals

    def _thinned(
        self, points: FloatArray, values: FloatArray, fidelity: IntArray
    ) -> tuple[FloatArray, FloatArray, IntArray]:
        all_points = np.concatenate([self.points, points])
        count = int(_KEPT_WHEN_FULL * self.config.max_samples)
        kept = space_filling(all_points, count, self.config.single.length_scales_m())
        self.samples_dropped += len(all_points) - len(kept)
        all_values = np.concatenate([self.values, values])
        all_fidelity = np.concatenate([self.sample_levels, fidelity])
        return all_points[kept], all_values[kept], all_fidelity[kept]


def _checked(
    points: FloatArray, values: FloatArray, position_std: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    points = np.asarray(points, dtype=np.float64)
    values = np.asarray(values, dtype=np.float64)
    position_std = np.asarray(position_std, dtype=np.float64)
    if points.shape != (len(values), 3) or position_std.shape != values.shape:
        raise ValueError(
            f"samples need points (m, 3), values (m,) and position_std (m,), not "
            f"{points.shape}, {values.shape} and {position_std.shape}"
        )
    for name, array in (("points", points), ("values", values), ("position_std", position_std)):
        if not np.isfinite(array).all():
            bad = int(np.argmin(np.isfinite(array.reshape(len(values), -1)).all(axis=1)))
            raise ValueError(f"{name} of sample {bad} is not finite")
    if (position_std < 0).any():
        raise ValueError("position_std must not be negative")
    return points, values, position_std
