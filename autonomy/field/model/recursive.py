"""The thesis's multi-fidelity model, written as its equations: the reference of the live map."""

from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters
from autonomy.field.level_scale import scale_factors
from autonomy.field.model.gaussian_process import Ageing
from autonomy.field.model.model_prior import Places, SinglePrior
from autonomy.field.model.posterior import Posterior


class RecursiveGaussianProcess:
    r"""One Gaussian process per fidelity level, each on what the levels below leave unexplained.

    :math:`\mu_i = \rho_i \mu_{i-1} + K_i (K_i + \sigma_i^2 I)^{-1} (y_i - \rho_i
    \mu_{i-1}(X_i))` and :math:`\Sigma_i = \bar\Sigma_i + \rho_i^2 \Sigma_{i-1}`; level 0 is the
    worst located. A level without samples adds nothing to the mean and its prior variance to the
    variance. With one level this is a plain Gaussian process.

    Source:
        Coleman, thesis, equations (5.7) to (5.12), where every :math:`\rho_i = 1`. The printed
        :math:`K_i^{-1}` lacks the noise that section 5.5.2 adds, and (5.10) means
        :math:`\Sigma_0`.
    """

    def __init__(
        self,
        levels: Sequence[KernelParameters],
        points: FloatArray,
        values: FloatArray,
        sample_levels: Sequence[int] | np.ndarray,
        *,
        rho: Sequence[float] = (),
        ageing: Ageing | None = None,
    ) -> None:
        """Condition on samples.

        Args:
            levels: Kernel of each level, worst located first.
            points: Estimated positions of the samples, shape ``(n, 3)``, m.
            values: Measurements in the model's scale, less the prior mean, shape ``(n,)``.
            sample_levels: Level of each sample, shape ``(n,)``.
            rho: Factor by which the field of each level enters the one above; none for 1.
            ageing: Times, if the field changes.
        """
        self._factors: list[float] = [0.0, *scale_factors(rho, len(levels)).tolist()][: len(levels)]
        """By which what is below enters each level."""
        self._now_s = 0.0 if ageing is None else ageing.now_s
        self._processes: list[Posterior] = []
        assigned = np.asarray(sample_levels)
        places = Places.of(points, time_s=0.0 if ageing is None else ageing.time_s)
        for level, parameters in enumerate(levels):
            mine = assigned == level
            still = SinglePrior(parameters)
            prior = still if ageing is None else ageing.prior(still)
            residuals = values[mine] - self._factors[level] * self._mean(places[mine])
            self._processes.append(Posterior(prior, places[mine], residuals))

    def mean(self, targets: FloatArray) -> FloatArray:
        """Return the posterior mean at targets ``(q, 3)``, shape ``(q,)``."""
        return self._mean(self._at(targets))

    def variance(self, targets: FloatArray) -> FloatArray:
        """Return the posterior variance of the field at targets, shape ``(q,)``."""
        return self.marginals(targets)[1]

    def marginals(self, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance in one go, each of shape ``(q,)``."""
        mean, variance = np.zeros(len(targets)), np.zeros(len(targets))
        for rho, process in zip(self._factors, self._processes, strict=True):
            added_mean, added_variance = process.marginals(self._at(targets))
            mean = rho * mean + added_mean
            variance = rho**2 * variance + added_variance
        return mean, variance

    def covariance(self, targets: FloatArray) -> FloatArray:
        """Return the posterior covariance of the field between targets, shape ``(q, q)``."""
        total = np.zeros((len(targets), len(targets)))
        for rho, process in zip(self._factors, self._processes, strict=True):
            total = rho**2 * total + process.covariance(self._at(targets))
        return total

    def log_marginal_likelihood(self) -> float:
        """Return the log density of the values, of each level given what is below explained."""
        return sum(process.log_marginal_likelihood() for process in self._processes)

    def _mean(self, targets: Places) -> FloatArray:
        total = np.zeros(len(targets))
        for rho, process in zip(self._factors, self._processes, strict=False):
            total = rho * total + process.mean(targets)
        return total

    def _at(self, targets: FloatArray) -> Places:
        return Places.of(targets, time_s=self._now_s)
