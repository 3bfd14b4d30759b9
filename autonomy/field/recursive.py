"""The thesis's multi-fidelity model, written as its equations: the reference of the live map."""

from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters
from autonomy.field.gaussian_process import GaussianProcess


class RecursiveGaussianProcess:
    r"""One Gaussian process per fidelity level, each on what the levels below leave unexplained.

    :math:`\mu_i = \mu_{i-1} + K_i (K_i + \sigma_i^2 I)^{-1} (y_i - \mu_{i-1}(X_i))` and
    :math:`\Sigma_i = \bar\Sigma_i + \Sigma_{i-1}`; level 0 is the worst located. A level without
    samples adds nothing to the mean and its prior variance to the variance. With one level this
    is a plain Gaussian process.

    Source:
        Coleman, thesis, equations (5.7) to (5.12) with :math:`\rho = 1`. The printed
        :math:`K_i^{-1}` lacks the noise that section 5.5.2 adds, and (5.10) means
        :math:`\Sigma_0`.
    """

    def __init__(
        self,
        levels: Sequence[KernelParameters],
        points: FloatArray,
        values: FloatArray,
        sample_levels: Sequence[int] | np.ndarray,
    ) -> None:
        """Condition on samples.

        Args:
            levels: Kernel of each level, worst located first.
            points: Estimated positions of the samples, shape ``(n, 3)``, m.
            values: Measurements in the model's scale, less the prior mean, shape ``(n,)``.
            sample_levels: Level of each sample, shape ``(n,)``.
        """
        self._processes: list[GaussianProcess] = []
        assigned = np.asarray(sample_levels)
        for level, parameters in enumerate(levels):
            mine = assigned == level
            residuals = values[mine] - self.mean(points[mine])
            self._processes.append(GaussianProcess(parameters, points[mine], residuals))

    def mean(self, targets: FloatArray) -> FloatArray:
        """Return the posterior mean at targets ``(q, 3)``, shape ``(q,)``."""
        total = np.zeros(len(targets))
        for process in self._processes:
            total += process.mean(targets)
        return total

    def variance(self, targets: FloatArray) -> FloatArray:
        """Return the posterior variance of the field at targets, shape ``(q,)``."""
        total = np.zeros(len(targets))
        for process in self._processes:
            total += process.variance(targets)
        return total

    def covariance(self, targets: FloatArray) -> FloatArray:
        """Return the posterior covariance of the field between targets, shape ``(q, q)``."""
        total = np.zeros((len(targets), len(targets)))
        for process in self._processes:
            total += process.covariance(targets)
        return total
