"""The map of one variable, kept up to date while samples arrive."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import FieldConfig
from autonomy.field.fidelity import fidelity_level
from autonomy.field.grid import Grid
from autonomy.field.growing_model import growing_model
from autonomy.field.model import FieldModel, centred_values, condition
from autonomy.field.samples import FieldSamples, checked, joined
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

    Any of the four models; a field that changes is shown at the time of its newest sample.

    Samples beyond ``config.max_samples`` make the map keep an evenly spread three quarters of
    that number and begin anew from them; ``samples_dropped`` counts those left out.
    """

    def __init__(self, config: FieldConfig, grid: Grid) -> None:
        """Begin with the prior on ``grid``."""
        self.config = config
        self.grid = grid
        self.samples_dropped = 0
        self._prior_mean = config.prior_mean_at(grid.points)
        self._begin(FieldSamples.none())

    @property
    def mean(self) -> FloatArray:
        """Expected field at ``grid.points`` in the model's scale, shape ``(q,)``; a copy."""
        return self._prior_mean + self._model.mean

    @property
    def std(self) -> FloatArray:
        """Standard deviation of the field at ``grid.points``, shape ``(q,)``; a copy."""
        return np.sqrt(self._model.variance)

    @property
    def samples(self) -> FieldSamples:
        """The kept samples in order of arrival."""
        return self._samples

    @property
    def points(self) -> FloatArray:
        """Positions of the kept samples, shape ``(n, 3)``, m, in order of arrival."""
        return self._samples.points

    @property
    def values(self) -> FloatArray:
        """Kept samples in the model's scale, shape ``(n,)``, in order of arrival."""
        return to_model(self.config.resolved_scale(), self._samples.values)

    @property
    def sample_levels(self) -> IntArray:
        """Fidelity level of each kept sample, shape ``(n,)``, in every model."""
        return fidelity_level(self._samples.position_std_m, self.config.fidelity_thresholds_m)

    @property
    def samples_per_level(self) -> tuple[int, ...]:
        """Number of kept samples of each fidelity level, worst located first, in every model."""
        levels = len(self.config.fidelity_thresholds_m) + 1
        return tuple(np.bincount(self.sample_levels, minlength=levels).tolist())

    def append(self, samples: FieldSamples) -> None:
        """Take in samples: all of them, or none if one cannot be used.

        Raises:
            ValueError: If ``checked`` refuses a sample, or the model cannot hold the samples.
        """
        checked(samples)
        if not len(samples):
            return
        if len(self._samples) + len(samples) > self.config.max_samples:
            self._begin(self._thinned(joined(self._samples, samples)))
            return
        try:
            self._model.append(samples, centred_values(self.config, samples))
        except ValueError:
            self._begin(self._samples)
            raise
        self._samples = joined(self._samples, samples)

    def replace(self, samples: FieldSamples) -> None:
        """Make the map of other samples: all that there are, some of them smoothed.

        Raises:
            ValueError: As ``append`` does; the map then stays as it was.
        """
        checked(samples)
        self.samples_dropped = 0
        self._begin(self._thinned(samples) if len(samples) > self.config.max_samples else samples)

    def conditioned(self) -> FieldModel:
        """Return the map's model conditioned anew on the kept samples, in ``O(n^3)``.

        It is the map at any other points: samples have the noise with which the map took them in.
        """
        return condition(self.config, self._samples, noise=self._model.noise_covariance)

    def predict(self, targets: FloatArray) -> Prediction:
        """Return mean and full covariance of the field at any points, shape ``(q, 3)``, m.

        It conditions anew in ``O(n^3)``: meant for scores and plans, not for each sample.
        """
        model = self.conditioned()
        return Prediction(model.mean(targets), model.covariance(targets))

    def _begin(self, samples: FieldSamples) -> None:
        model = growing_model(self.config, self.grid.points)
        if len(samples):
            model.append(samples, centred_values(self.config, samples))
        self._model = model
        self._samples = samples

    def _thinned(self, samples: FieldSamples) -> FieldSamples:
        count = int(_KEPT_WHEN_FULL * self.config.max_samples)
        kept = space_filling(samples.points, count, self.config.single.length_scales_m())
        self.samples_dropped += len(samples) - len(kept)
        return samples[kept]
