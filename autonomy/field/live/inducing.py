r"""A Gaussian process of very many samples, summed up at inducing points.

Samples are taken in a block at a time, so that memory stays ``O(m^2 + m block)`` for ``m``
inducing points, and time ``O(m^2)`` a sample. With the factor :math:`L` of the inducing points'
prior covariance, :math:`v_i = L^{-1} k(Z, x_i)` and :math:`\lambda_i` the noise of sample ``i``
and what the inducing points leave unexplained of its prior variance, everything that is kept is

.. math::
    B = I + \sum_i v_i v_i^T / \lambda_i, \qquad c = \sum_i v_i y_i / \lambda_i,

and mean and variance at a target with :math:`v_* = L^{-1} k(Z, x_*)` are :math:`v_*^T B^{-1} c` and
:math:`k_{**} - v_*^T v_* + v_*^T B^{-1} v_*`.

Source:
    Snelson and Ghahramani, Sparse Gaussian processes using pseudo-inputs, 2005 (FITC), with a
    noise of each sample's own. It is exact where the inducing points are the samples.
"""

import math

import numpy as np
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from autonomy.arrays import FloatArray
from autonomy.field.model.factorization import (
    cholesky,
    solve_lower,
    solve_lower_transposed,
    whiten_in_place,
)
from autonomy.field.model.model_prior import Places, Prior
from autonomy.field.thinning import space_filling

(_syrk,) = get_blas_funcs(("syrk",), dtype=np.float64)
(_potri,) = get_lapack_funcs(("potri",), dtype=np.float64)

_BLOCK = 1024
"""Samples and targets taken at once."""


def inducing_places(
    places: Places, count: int, length_scales_m: tuple[float, float, float]
) -> Places:
    """Choose inducing points among samples: as far from each other as possible, ``O(n count)``.

    Args:
        places: Of the samples, ``n`` of them.
        count: How many to choose.
        length_scales_m: Distances along each axis in which to measure.
    """
    return places[space_filling(places.points, count, length_scales_m)]


class InducingPosterior:
    """Mean, variance and covariance of a zero-mean field given any number of samples."""

    def __init__(self, prior: Prior, inducing: Places) -> None:
        """Begin without samples.

        Args:
            prior: Covariances and noise.
            inducing: Places at which samples are summed up, ``m`` of them, at least one.

        Raises:
            ValueError: If there is no inducing point.
        """
        if not len(inducing):
            raise ValueError("a sum of samples needs at least one inducing point")
        m = len(inducing)
        self._prior = prior
        self._inducing = inducing
        self._factor = cholesky(prior.covariance(inducing, inducing), prior.variance)
        self._precision = np.asfortranarray(np.eye(m))  # B, lower triangle
        self._whitened_sum = np.zeros(m)  # c
        self._samples = 0
        self._log_noise = 0.0
        self._square_sum = 0.0
        self._unexplained = 0.0
        self._past_evidence = self._first_evidence = 0.0
        self._solve()

    @property
    def samples(self) -> int:
        """Number of samples taken in."""
        return self._samples

    @property
    def unexplained_share(self) -> float:
        """Mean share of the samples' prior variance that the inducing points cannot express.

        It counts as noise: where it is large, more inducing points would tell more.
        """
        return self._unexplained / max(self._samples, 1)

    @property
    def memory_bytes(self) -> int:
        """What the sums take."""
        return self._factor.nbytes + self._precision.nbytes + self._sum_factor.nbytes

    @property
    def inducing(self) -> Places:
        """Where samples are summed up."""
        return self._inducing

    @property
    def weights(self) -> FloatArray:
        """The mean is the covariance with the inducing points times these, shape ``(m,)``."""
        solved = solve_lower_transposed(self._sum_factor, self._solved)
        return solve_lower_transposed(self._factor, solved)

    def told(self, cross: FloatArray) -> FloatArray:
        """Return by how much the samples lower a prior variance.

        Args:
            cross: Prior covariance of something with the field at the inducing points, one a row,
                shape ``(q, m)``, C order; overwritten.

        Returns:
            Shape ``(q,)``.
        """
        whitened = whiten_in_place(self._factor, cross)
        known = np.einsum("qm,qm->q", whitened, whitened)
        solved = whiten_in_place(self._sum_factor, whitened)
        return known - np.einsum("qm,qm->q", solved, solved)

    def append(self, places: Places, values: FloatArray, noise: FloatArray | None = None) -> None:
        """Take in samples.

        Args:
            places: Of the samples, ``n`` of them.
            values: Measurements less the prior mean, shape ``(n,)``.
            noise: Noise variances, shape ``(n,)``; the prior's if not given.

        Raises:
            ValueError: If the sums have no factor.
        """
        noise = self._prior.noise(places) if noise is None else noise
        for block in places.blocks(_BLOCK):
            self._add(places[block], values[block], noise[block])
        self._solve()

    def age(self, fade: float) -> None:
        """Let time pass in a field that changes: an Ornstein-Uhlenbeck process at each place.

        What was told fades and the prior variance comes back; samples taken in from now on are
        of the field as it is then. ``O(m^3)``.

        Args:
            fade: Correlation of the field with itself over the time that passes, in ``0 .. 1``.

        Raises:
            ValueError: If the sums have no factor.
        """
        self._past_evidence += self._evidence() - self._first_evidence
        told = solve_lower_transposed(self._sum_factor, self._solved)  # B^-1 c
        spread = fade**2 * _inverse(self._sum_factor)
        spread[np.diag_indices(len(told))] += 1.0 - fade**2
        self._precision = np.asfortranarray(_inverse(cholesky(spread, 1.0)))
        self._whitened_sum = self._precision @ (fade * told)
        self._solve()
        self._first_evidence = self._evidence()

    def mean(self, targets: Places) -> FloatArray:
        """Return the posterior mean at ``q`` targets, shape ``(q,)``."""
        mean, weights = np.empty(len(targets)), self.weights
        for block in targets.blocks(_BLOCK):
            mean[block] = self._prior.covariance(targets[block], self._inducing) @ weights
        return mean

    def marginals(self, targets: Places) -> tuple[FloatArray, FloatArray]:
        """Return posterior mean and variance of the field, without noise, each ``(q,)``."""
        mean, variance = np.empty(len(targets)), np.full(len(targets), self._prior.variance)
        weights = self.weights
        for block in targets.blocks(_BLOCK):
            cross = self._prior.covariance(targets[block], self._inducing)  # (b, m)
            mean[block] = cross @ weights
            variance[block] -= self.told(cross)
        return mean, np.maximum(variance, 0.0)

    def covariance(self, targets: Places) -> FloatArray:
        """Return the posterior covariance of the field between targets, shape ``(q, q)``."""
        whitened = self._whitened(targets)  # (q, m)
        result = self._prior.covariance(targets, targets) - whitened @ whitened.T
        solved = whiten_in_place(self._sum_factor, whitened)
        return result + solved @ solved.T

    def log_marginal_likelihood(self) -> float:
        """Return the log density of the values under the approximate prior, with noise."""
        constant = self._samples * math.log(2.0 * math.pi)
        own = -0.5 * (self._square_sum + self._log_noise + constant)
        return own + self._past_evidence + self._evidence() - self._first_evidence

    def _evidence(self) -> float:
        log_determinant = 2.0 * float(np.sum(np.log(np.diagonal(self._sum_factor))))
        return 0.5 * (float(self._solved @ self._solved) - log_determinant)

    def _whitened(self, places: Places) -> FloatArray:
        """Return ``L^-1 k(Z, x)`` of each place, one a row, shape ``(n, m)``."""
        return whiten_in_place(self._factor, self._prior.covariance(places, self._inducing))

    def _add(self, places: Places, values: FloatArray, noise: FloatArray) -> None:
        whitened = self._whitened(places)  # (n, m)
        explained = np.einsum("nm,nm->n", whitened, whitened)
        unexplained = np.maximum(self._prior_variance(places) - explained, 0.0)
        total = noise + unexplained
        whitened /= np.sqrt(total)[:, None]
        scaled = values / np.sqrt(total)
        self._precision = _syrk(
            1.0, whitened.T, beta=1.0, c=self._precision, lower=1, overwrite_c=1
        )
        self._whitened_sum += scaled @ whitened
        self._samples += len(values)
        self._log_noise += float(np.sum(np.log(total)))
        self._square_sum += float(scaled @ scaled)
        self._unexplained += float(np.sum(unexplained / self._prior.variance))

    def _prior_variance(self, places: Places) -> FloatArray:
        """Return the prior variance at places, ``(n,)``: the same for all of one level."""
        variance = np.empty(len(places))
        for level in np.unique(places.level):
            mine = np.flatnonzero(places.level == level)
            one = places[mine[:1]]
            variance[mine] = self._prior.covariance(one, one)[0, 0]
        return variance

    def _solve(self) -> None:
        lower = np.tril(self._precision)
        self._sum_factor = cholesky(lower + np.tril(lower, -1).T, 1.0)
        self._solved = solve_lower(self._sum_factor, self._whitened_sum)


def _inverse(factor: FloatArray) -> FloatArray:
    """Return ``(L L^T)^-1`` of a lower triangular factor."""
    lower, _ = _potri(factor, lower=1)
    return np.tril(lower) + np.tril(lower, -1).T
