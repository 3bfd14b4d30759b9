"""A Gaussian process with any prior, conditioned on noisy samples."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.model.factorization import (
    cholesky,
    solve_lower,
    solve_lower_transposed,
    whiten_in_place,
)
from autonomy.field.model.model_prior import Places, Prior

_BLOCK = 512
"""Targets taken at once: their covariances with 3,000 samples take 12 MB."""


class Posterior:
    """Mean, variance and covariance of a zero-mean field given samples; without any, the prior.

    Source:
        Coleman, thesis, equations (5.1) and (5.2).
    """

    def __init__(
        self, prior: Prior, places: Places, values: FloatArray, noise: FloatArray | None = None
    ) -> None:
        """Condition on samples.

        Args:
            prior: Covariances and noise.
            places: Where the samples were taken, ``n`` of them.
            values: Measurements less the prior mean, shape ``(n,)``.
            noise: Noise variances ``(n,)`` or covariances ``(n, n)``; the prior's if not given.

        Raises:
            ValueError: If the covariance of the samples has no factor.
        """
        self._prior = prior
        self.places = places
        """Where and when the samples were taken."""
        self._factor = np.empty((0, 0))
        if len(places):
            covariance = prior.covariance(places, places)
            noise = prior.noise(places) if noise is None else noise
            if noise.ndim == 2:
                covariance += noise
            else:
                covariance[np.diag_indices(len(places))] += noise
            self._factor = cholesky(covariance, prior.variance)
        self.z = self.whitened(values)
        """``L^-1`` times the values, shape ``(n,)``."""
        self._weights = self.z
        if len(places):
            self._weights = solve_lower_transposed(self._factor, self.z)

    @property
    def weights(self) -> FloatArray:
        """Inverse covariance of the samples times their values, shape ``(n,)``."""
        return self._weights

    def whitened(self, right: FloatArray) -> FloatArray:
        """Return ``L^-1 right`` for the factor ``L`` of the samples' covariance, noise included.

        Both have the shape ``(n, k)`` or ``(n,)``.
        """
        return solve_lower(self._factor, right) if len(self.places) else right

    def mean(self, targets: Places) -> FloatArray:
        """Return the posterior mean at ``q`` targets, shape ``(q,)``."""
        mean = np.zeros(len(targets))
        if len(self.places):
            for block in targets.blocks(_BLOCK):
                mean[block] = self._prior.covariance(targets[block], self.places) @ self._weights
        return mean

    def marginals(self, targets: Places) -> tuple[FloatArray, FloatArray]:
        """Return posterior mean and variance of the field, without noise, each ``(q,)``.

        Targets are taken in blocks, so that memory stays bounded by the samples.
        """
        mean, variance = np.zeros(len(targets)), np.full(len(targets), self._prior.variance)
        if not len(self.places):
            return mean, variance
        for block in targets.blocks(_BLOCK):
            cross = self._prior.covariance(targets[block], self.places)  # (b, n)
            mean[block] = cross @ self._weights
            whitened = whiten_in_place(self._factor, cross)  # (b, n)
            variance[block] -= np.einsum("bn,bn->b", whitened, whitened)
        return mean, np.maximum(variance, 0.0)

    def covariance(self, targets: Places) -> FloatArray:
        """Return the posterior covariance of the field between targets, shape ``(q, q)``."""
        result = self._prior.covariance(targets, targets)
        if len(self.places):
            cross = self._prior.covariance(targets, self.places)  # (q, n)
            whitened = whiten_in_place(self._factor, cross)
            result -= whitened @ whitened.T
        return result

    def log_marginal_likelihood(self) -> float:
        """Return the log density of the values under the prior with noise."""
        n = len(self.places)
        log_determinant = 2.0 * float(np.sum(np.log(np.diagonal(self._factor))))
        quadratic = float(self.z @ self.z)
        return -0.5 * (quadratic + log_determinant + n * math.log(2.0 * math.pi))


class PosteriorAtPoints:
    """A posterior seen at points of the mapped field: its best level, at one time.

    Base of the models that are one Gaussian process.
    """

    def __init__(self, posterior: Posterior, level: int, now_s: float) -> None:
        """See ``posterior`` at ``level`` and time ``now_s``."""
        self.posterior = posterior
        self._level = level
        self._now_s = now_s

    def mean(self, targets: FloatArray) -> FloatArray:
        """Return the posterior mean at targets ``(q, 3)``, shape ``(q,)``."""
        return self.posterior.mean(self._at(targets))

    def variance(self, targets: FloatArray) -> FloatArray:
        """Return the posterior variance of the field, without noise, at targets, shape ``(q,)``."""
        return self.posterior.marginals(self._at(targets))[1]

    def marginals(self, targets: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance in one go, each of shape ``(q,)``."""
        return self.posterior.marginals(self._at(targets))

    def covariance(self, targets: FloatArray) -> FloatArray:
        """Return the posterior covariance of the field between targets, shape ``(q, q)``."""
        return self.posterior.covariance(self._at(targets))

    def log_marginal_likelihood(self) -> float:
        """Return the log density of the values under the prior with noise."""
        return self.posterior.log_marginal_likelihood()

    def _at(self, targets: FloatArray) -> Places:
        return Places.of(targets, level=self._level, time_s=self._now_s)
