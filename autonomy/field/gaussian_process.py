"""Gaussian process regression as in a textbook: the readable reference of the live map."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters
from autonomy.field.factorization import cholesky, solve_lower, solve_lower_transposed
from autonomy.field.kernel import matern32, noise_variance


class GaussianProcess:
    """A zero-mean Gaussian process conditioned on noisy samples at exactly known points.

    Without samples it is the prior.

    Source:
        Coleman, thesis, equations (5.1) and (5.2).
    """

    def __init__(
        self, parameters: KernelParameters, points: FloatArray, values: FloatArray
    ) -> None:
        """Condition on ``values`` of shape ``(n,)`` at ``points`` of shape ``(n, 3)``."""
        self._parameters = parameters
        self._points = points
        self._values = values
        covariance = matern32(points, points, parameters)
        covariance[np.diag_indices(len(points))] += noise_variance(parameters)
        self._factor = (
            cholesky(covariance, parameters.signal_variance) if len(points) else covariance
        )
        self._whitened_values = self._whiten(values)

    def mean(self, targets: FloatArray) -> FloatArray:
        """Return the posterior mean at targets ``(q, 3)``, shape ``(q,)``."""
        if not len(self._points):
            return np.zeros(len(targets))
        weights = solve_lower_transposed(self._factor, self._whitened_values)
        return matern32(targets, self._points, self._parameters) @ weights

    def variance(self, targets: FloatArray) -> FloatArray:
        """Return the posterior variance of the field, without noise, at targets, shape ``(q,)``."""
        whitened = self._whiten(matern32(self._points, targets, self._parameters))  # (n, q)
        return self._parameters.signal_variance - np.einsum("nq,nq->q", whitened, whitened)

    def covariance(self, targets: FloatArray) -> FloatArray:
        """Return the posterior covariance of the field between targets, shape ``(q, q)``."""
        whitened = self._whiten(matern32(self._points, targets, self._parameters))  # (n, q)
        return matern32(targets, targets, self._parameters) - whitened.T @ whitened

    def log_marginal_likelihood(self) -> float:
        """Return the log density of the values under the prior with noise."""
        n = len(self._points)
        log_determinant = 2.0 * float(np.sum(np.log(np.diagonal(self._factor))))
        quadratic = float(self._whitened_values @ self._whitened_values)
        return -0.5 * (quadratic + log_determinant + n * math.log(2.0 * math.pi))

    def _whiten(self, right: FloatArray) -> FloatArray:
        return solve_lower(self._factor, right) if len(self._points) else right
