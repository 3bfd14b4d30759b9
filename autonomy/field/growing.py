"""A Gaussian process that takes in samples one by one and keeps its targets up to date."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters
from autonomy.field.factorization import cholesky, solve_lower, weighted_rows
from autonomy.field.kernel import matern32, noise_variance

_FIRST_ROWS = 64
_MOST_SPARE_ROWS = 256


class GrowingGaussianProcess:
    """Posterior mean and variance at fixed targets, updated in place in ``O(n^2 + n q)`` a sample.

    Kept between samples: the factor ``L`` of the samples' covariance, ``V = L^-1 K(X, targets)``
    and ``z = L^-1 y``. Appending a sample appends one row to each; nothing is solved again, so
    the result equals conditioning anew. ``GaussianProcess`` is the readable reference.

    Buffers hold spare rows. The factor's spare part is an identity, so the whole buffer is a
    factor and is solved with as it lies, without a copy; spare targets are columns of zeros.
    """

    def __init__(self, parameters: KernelParameters, targets: FloatArray) -> None:
        """Begin with the prior at ``targets``, shape ``(q, 3)``, m."""
        self._parameters = parameters
        self._samples = 0
        self._target_count = len(targets)
        self._targets = targets.copy()
        self._mean = np.zeros(len(targets))
        self._variance = np.full(len(targets), parameters.signal_variance)
        self._points = np.zeros((_FIRST_ROWS, 3))
        self._factor = np.asfortranarray(np.eye(_FIRST_ROWS))
        self._whitened = np.zeros((_FIRST_ROWS, len(targets)))  # V
        self._z = np.zeros(_FIRST_ROWS)

    @property
    def mean(self) -> FloatArray:
        """Posterior mean at every target, shape ``(q,)``; changes in place."""
        return self._mean[: self._target_count]

    @property
    def variance(self) -> FloatArray:
        """Posterior variance of the field at every target, shape ``(q,)``; changes in place."""
        return self._variance[: self._target_count]

    def append(self, points: FloatArray, values: FloatArray) -> None:
        """Take in samples: ``points`` of shape ``(m, 3)``, ``values`` of shape ``(m,)``."""
        n, m, q = self._samples, len(points), self._target_count
        if not m:
            return
        self._reserve_rows(n + m)
        prior = self._parameters
        cross = np.zeros((len(self._z), m), order="F")
        cross[:n] = matern32(self._points[:n], points, prior)
        B = solve_lower(self._factor, cross)[:n]  # (n, m)
        schur = matern32(points, points, prior) - B.T @ B
        schur[np.diag_indices(m)] += noise_variance(prior)
        L = cholesky(schur, prior.signal_variance)  # (m, m)
        remaining = matern32(points, self._targets[:q], prior)
        remaining -= weighted_rows(B, self._whitened[:n])[:, :q]
        v = solve_lower(L, remaining)  # (m, q)
        z = solve_lower(L, values - B.T @ self._z[:n])  # (m,)

        new = slice(n, n + m)
        self._points[new] = points
        self._factor[new, :n] = B.T
        self._factor[new, new] = L
        self._whitened[new, :q] = v
        self._z[new] = z
        self._mean[:q] += weighted_rows(z, v)
        self._variance[:q] -= np.einsum("mq,mq->q", v, v)
        self._samples = n + m

    def replace_values(self, values: FloatArray) -> None:
        """Change the values of all samples, shape ``(n,)``; variances do not depend on them."""
        n, q = self._samples, self._target_count
        right = np.zeros(len(self._z))
        right[:n] = values
        self._z = solve_lower(self._factor, right)
        self._mean[:q] = weighted_rows(self._z[:n], self._whitened[:n])[:q]

    def add_targets(self, points: FloatArray) -> None:
        """Keep the posterior up to date at ``points`` too, shape ``(m, 3)``, after the others."""
        n, q, m = self._samples, self._target_count, len(points)
        self._reserve_targets(q + m)
        cross = np.zeros((len(self._z), m), order="F")
        cross[:n] = matern32(self._points[:n], points, self._parameters)
        v = solve_lower(self._factor, cross)[:n]  # (n, m)
        new = slice(q, q + m)
        self._targets[new] = points
        self._whitened[:n, new] = v
        self._mean[new] = weighted_rows(self._z[:n], v)
        self._variance[new] = self._parameters.signal_variance - np.einsum("nm,nm->m", v, v)
        self._target_count = q + m

    def _reserve_rows(self, rows: int) -> None:
        old = len(self._z)
        if rows <= old:
            return
        size = max(rows, old + min(old, _MOST_SPARE_ROWS))
        n = self._samples
        factor = np.asfortranarray(np.eye(size))
        factor[:n, :n] = self._factor[:n, :n]
        self._factor = factor
        self._points = _grown(self._points, n, (size, 3))
        self._z = _grown(self._z, n, (size,))
        self._whitened = _grown(self._whitened, n, (size, self._whitened.shape[1]))

    def _reserve_targets(self, targets: int) -> None:
        old = len(self._mean)
        if targets <= old:
            return
        size = targets + _MOST_SPARE_ROWS
        n, q = self._samples, self._target_count
        self._targets = _grown(self._targets, q, (size, 3))
        self._mean = _grown(self._mean, q, (size,))
        self._variance = _grown(self._variance, q, (size,))
        whitened = np.zeros((len(self._z), size))
        whitened[:n, :q] = self._whitened[:n, :q]
        self._whitened = whitened


def _grown(array: FloatArray, used: int, shape: tuple[int, ...]) -> FloatArray:
    larger = np.zeros(shape)
    larger[:used] = array[:used]
    return larger
