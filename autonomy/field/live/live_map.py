"""The map of one variable, kept up to date while samples arrive."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import FieldConfig
from autonomy.field.fidelity import fidelity_level
from autonomy.field.grid import Grid
from autonomy.field.live.growing_model import GrowingModel, growing_model
from autonomy.field.live.inducing_model import GrowingInducing
from autonomy.field.model.model import FieldAboutMean, FieldModel, centred_values, condition
from autonomy.field.samples import FieldSamples, checked, joined
from autonomy.field.thinning import space_filling

_KEPT_WHEN_FULL = 0.75
_CHOSEN_ANEW = 1.5
_MOST_NUMBERS = 250_000_000
"""Most numbers of the largest array of a map, samples times points of its grid: 2 GB."""
_FEWEST_SAMPLES = 50
"""Samples that a map holds over any grid."""


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

    With samples beyond ``config.max_samples``, or beyond what fits in memory over a very large
    grid, the map does what ``config.beyond`` says. It keeps an
    evenly spread three quarters of that number and begins anew from them, and ``samples_dropped``
    counts those left out; or it keeps all and sums them up at inducing points, which it chooses
    anew when it holds half as many samples again.
    """

    def __init__(self, config: FieldConfig, grid: Grid) -> None:
        """Begin with the prior on ``grid``."""
        self.config = config
        self.grid = grid
        self.samples_dropped = 0
        self._prior_mean = config.prior_mean_at(grid.points)
        bearable = max(_FEWEST_SAMPLES, _MOST_NUMBERS // len(grid.points))
        self._most_exact = min(config.max_samples, bearable)
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
    def sample_levels(self) -> IntArray:
        """Fidelity level of each kept sample, shape ``(n,)``, in every model."""
        return fidelity_level(self._samples.position_std_m, self.config.fidelity_thresholds_m)

    @property
    def samples_per_level(self) -> tuple[int, ...]:
        """Number of kept samples of each fidelity level, worst located first, in every model."""
        levels = len(self.config.fidelity_thresholds_m) + 1
        return tuple(np.bincount(self.sample_levels, minlength=levels).tolist())

    @property
    def inducing_points(self) -> int:
        """Number of points at which the samples are summed up; 0 where the map is exact."""
        return self._model.field.inducing_points if isinstance(self._model, GrowingInducing) else 0

    @property
    def memory_bytes(self) -> int:
        """What is kept to take in the next sample: about 8 x samples x grid points."""
        return self._model.memory_bytes

    def append(self, samples: FieldSamples) -> None:
        """Take in samples: all of them, or none if one cannot be used.

        Raises:
            ValueError: If ``checked`` refuses a sample, or the model cannot hold the samples.
        """
        checked(samples)
        if not len(samples):
            return
        if len(self._samples) + len(samples) > self._most_samples:
            self._begin_with(joined(self._samples, samples), self.samples_dropped)
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
        self._begin_with(samples, 0)

    def conditioned(self) -> FieldModel:
        """Return the map's model, conditioned anew on the kept samples in ``O(n^3)``.

        It is the map at any other points: samples have the noise with which the map took them in.
        Where samples are summed up, it is the sum itself, and follows the map.
        """
        if isinstance(self._model, GrowingInducing):
            return FieldAboutMean(self.config, self._model.field)
        config, kernel = self.config, self._model.kernel
        if kernel is not None:
            config = config.model_copy(update={"single": kernel})
        return condition(config, self._samples, noise=self._model.noise_covariance)

    def predict(self, targets: FloatArray) -> Prediction:
        """Return mean and full covariance of the field at any points, shape ``(q, 3)``, m.

        It conditions anew in ``O(n^3)``: meant for scores and plans, not for each sample.
        """
        model = self.conditioned()
        return Prediction(model.mean(targets), model.covariance(targets))

    def _begin(self, samples: FieldSamples) -> None:
        config, points = self.config, self.grid.points
        values = centred_values(config, samples)
        if len(samples) > self._most_exact:
            model = GrowingInducing(config, points, samples, values)
            self._most_samples = int(_CHOSEN_ANEW * len(samples))
        else:
            model = growing_model(config, points)
            if len(samples):
                model.append(samples, values)
            self._most_samples = self._most_exact
        self._model: GrowingModel = model
        self._samples = samples

    def _begin_with(self, samples: FieldSamples, dropped: int) -> None:
        """Begin anew with as many of the samples as the map keeps."""
        config, kept = self.config, samples
        if len(samples) > self._most_exact and config.beyond == "thin":
            count = int(_KEPT_WHEN_FULL * self._most_exact)
            scales_m = config.single.length_scales_m()
            kept = samples[space_filling(samples.points, count, scales_m)]
        self._begin(kept)
        self.samples_dropped = dropped + len(samples) - len(kept)
