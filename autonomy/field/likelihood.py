"""The marginal likelihood of every exact field model, with its analytic gradient."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_lapack_funcs

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.factorization import cholesky, solve_lower, solve_lower_transposed

_potrf, _potri = get_lapack_funcs(("potrf", "potri"), dtype=np.float64)

PER_LEVEL = 5
"""Hyperparameters of one level: signal variance, three length scales, noise variance."""


@dataclass(frozen=True, slots=True, eq=False)
class Derivatives:
    """How the negative log likelihood changes with the logarithms of the hyperparameters."""

    gradient: FloatArray
    """In the order of the hyperparameters, shape ``(p,)``."""
    information: FloatArray
    r"""Average information :math:`\frac12 w_a^T P w_b`, :math:`w_a = \partial_a K \alpha`: it is
    positive semi-definite, and its expectation is Fisher's information; shape ``(p, p)``."""


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """Negative log likelihood of one set of hyperparameters."""

    value: float
    trend: FloatArray
    """Generalized least squares coefficients of the mean's basis, shape ``(b,)``."""
    derivatives: Callable[[], Derivatives]
    """Computes the derivatives, at twice the cost of the value."""


class MarginalLikelihood:
    r"""Likelihood of samples of an auto-regressive field with any number of fidelity levels.

    The field of level ``i`` is :math:`f_i = \rho f_{i-1} + g_i` with independent components
    :math:`g_t` of kernels :math:`k_t`, so samples of levels ``i`` and ``k`` covary by
    :math:`\sum_{t \le \min(i, k)} \rho^{i-t} \rho^{k-t} k_t`, and each level has a noise of its
    own. With one level this is a plain Gaussian process.

    Hyperparameters are passed as logarithms, level after level, worst located first: signal
    variance, length scales north, east, down (m), noise variance; then, where ``learns_rho``,
    the scale factor. :math:`\partial = \frac12 tr((K^{-1} - \alpha \alpha^T) \partial K)`;
    coefficients of the mean are at their optimum for every set, so they add nothing to it.

    Source:
        Coleman, thesis, equation (5.3) with the noise and the constant that it leaves out;
        Kennedy and O'Hagan (2000) for the covariance between the levels; Gilmour, Thompson and
        Cullis (1995) for the average information.
    """

    def __init__(
        self,
        points: FloatArray,
        values: FloatArray,
        *,
        shapes: tuple[str, ...] = ("matern32",),
        sample_levels: IntArray | None = None,
        rho: float = 1.0,
        learns_rho: bool = False,
        age: FloatArray | None = None,
        held_noise: FloatArray | None = None,
        basis: FloatArray | None = None,
    ) -> None:
        """Prepare what does not depend on the hyperparameters.

        Args:
            points: Positions, shape ``(n, 3)``, m.
            values: Measurements in the model's scale, shape ``(n,)``.
            shapes: Shape of each level's kernel, worst located level first.
            sample_levels: Level of each sample, shape ``(n,)``; all 0 if left out.
            rho: Scale factor between neighbouring levels, where it is not learned.
            learns_rho: Whether the scale factor is the last hyperparameter.
            age: Time of each sample over the memory of the field, shape ``(n,)``.
            held_noise: Noise covariance that is not learned, shape ``(n, n)``.
            basis: Functions of position whose weighted sum is the mean, shape ``(n, p)``.
        """
        # imported late: what imports this module need not load the compiler
        from autonomy.field.likelihood_kernel import SHAPE_NUMBER, add_covariance, contract

        self._add_covariance, self._contract = add_covariance, contract
        n = len(values)
        levels = np.zeros(n, dtype=np.int64) if sample_levels is None else sample_levels
        self._order = np.argsort(levels, kind="stable")  # each component acts on the last samples
        self._axes = np.ascontiguousarray(points[self._order].T)  # (3, n)
        self._values = np.asarray(values, dtype=np.float64)[self._order]
        self._levels = levels[self._order]
        self._shapes = tuple(SHAPE_NUMBER[shape] for shape in shapes)
        self._firsts = np.searchsorted(self._levels, np.arange(len(shapes) + 1)).tolist()
        self._rho = rho
        self._learns_rho = learns_rho
        self._age = np.zeros(n) if age is None else age[self._order]
        self._held = None if held_noise is None else held_noise[np.ix_(self._order, self._order)]
        self._basis = np.zeros((n, 0)) if basis is None else basis[self._order]

    @property
    def size(self) -> int:
        """Number of hyperparameters."""
        return PER_LEVEL * len(self._shapes) + int(self._learns_rho)

    def at(self, log_parameters: FloatArray) -> "Evaluation":
        """Evaluate the negative log likelihood.

        Args:
            log_parameters: Shape ``(size,)``.

        Raises:
            ValueError: If the covariance has no factor even with jitter.
        """
        table, rho = self._unpacked(log_parameters)
        factor, decays = self._factor(table, rho)
        whitened = self._whitened(factor)
        log_determinant = 2.0 * float(np.sum(np.log(np.diagonal(factor))))
        constant = len(factor) * math.log(2.0 * math.pi)
        square = float(whitened.residuals @ whitened.residuals)
        value = 0.5 * (square + log_determinant + constant)

        def derivatives() -> Derivatives:
            return self._derivatives(table, rho, factor, decays, whitened)

        return Evaluation(value, whitened.trend, derivatives)

    def _unpacked(self, log_parameters: FloatArray) -> tuple[FloatArray, float]:
        parameters = np.exp(log_parameters)
        rho = float(parameters[-1]) if self._learns_rho else self._rho
        return parameters[: PER_LEVEL * len(self._shapes)].reshape(-1, PER_LEVEL), rho

    def _factor(self, table: FloatArray, rho: float) -> tuple[FloatArray, FloatArray]:
        n = len(self._values)
        decays = np.empty((len(table), n, n))
        total = np.zeros((n, n)) if self._held is None else self._held.copy()
        for t, (signal, *lengths, _) in enumerate(table):
            scaled = self._axes / np.array(lengths)[:, None]
            weights, _ = self._weights(t, rho)
            self._add_covariance(
                total,
                decays[t],
                scaled,
                self._age,
                weights,
                self._shapes[t],
                signal,
                self._firsts[t],
            )
        total[np.diag_indices(n)] += table[self._levels, 4]
        factor, failed = _potrf(total.T, lower=1, overwrite_a=0, clean=1)
        if failed:
            lower = np.tril(total.T)
            factor = cholesky(lower + np.tril(lower, -1).T, float(table[:, 0].sum()))
        return factor, decays

    def _weights(self, t: int, rho: float) -> tuple[FloatArray, FloatArray]:
        """Return the share of component ``t`` in each sample, and the power of rho in it."""
        powers = (self._levels - t).astype(np.float64)
        return rho ** np.maximum(powers, 0.0), powers

    def _whitened(self, factor: FloatArray) -> "_Whitened":
        values = solve_lower(factor, self._values)
        if not self._basis.shape[1]:
            return _Whitened(values, self._basis, np.zeros(0))
        basis = solve_lower(factor, self._basis)
        trend = _least_squares(basis, values)
        return _Whitened(values - basis @ trend, basis, trend)

    def _derivatives(
        self,
        table: FloatArray,
        rho: float,
        factor: FloatArray,
        decays: FloatArray,
        whitened: "_Whitened",
    ) -> Derivatives:
        alpha = solve_lower_transposed(factor, whitened.residuals)
        inverse, _ = _potri(factor, lower=1)
        traces, products = self._contracted(table, rho, inverse.T, decays, alpha)
        gradient = traces - 0.5 * (products @ alpha)
        directions = whitened.without_trend(solve_lower(factor, products.T))  # (n, size)
        return Derivatives(gradient, 0.5 * (directions.T @ directions))

    def _contracted(
        self,
        table: FloatArray,
        rho: float,
        inverse: FloatArray,
        decays: FloatArray,
        alpha: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return ``tr(K^-1 dK) / 2``, shape ``(size,)``, and ``dK alpha``, ``(size, n)``."""
        n, kernels = len(alpha), PER_LEVEL * len(table)
        traces, products = np.zeros(kernels + 1), np.zeros((kernels + 1, n))
        half = 0.5 * np.diagonal(inverse)
        for t, (signal, *lengths, noise) in enumerate(table):
            scaled = self._axes / np.array(lengths)[:, None]
            weights, powers = self._weights(t, rho)
            trace, product = np.zeros(PER_LEVEL), np.zeros((PER_LEVEL, n))
            self._contract(
                inverse,
                alpha,
                decays[t],
                scaled,
                weights,
                powers if self._learns_rho else powers[:0],
                self._shapes[t],
                self._firsts[t],
                trace,
                product,
            )
            own = slice(PER_LEVEL * t, PER_LEVEL * t + 4)
            traces[own], products[own] = signal * trace[:4], signal * product[:4]
            traces[-1] += signal * trace[4]
            products[-1] += signal * product[4]
            mine = self._levels == t
            traces[PER_LEVEL * t + 4] = noise * float(half[mine].sum())
            products[PER_LEVEL * t + 4, mine] = noise * alpha[mine]
        return traces[: self.size], products[: self.size]


@dataclass(frozen=True, slots=True, eq=False)
class _Whitened:
    """Values and basis after division by the factor of their covariance."""

    residuals: FloatArray
    basis: FloatArray
    trend: FloatArray

    def without_trend(self, columns: FloatArray) -> FloatArray:
        """Take out of whitened columns, shape ``(n, p)``, what the basis can explain."""
        if not len(self.trend):
            return columns
        return columns - self.basis @ _least_squares(self.basis, columns)


def _least_squares(matrix: FloatArray, right: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64)
