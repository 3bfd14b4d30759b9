"""The marginal likelihood of every exact field model, with its analytic gradient."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_lapack_funcs

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.level_scale import scale_factors, share_slopes, shares
from autonomy.field.model.factorization import cholesky, solve_lower, solve_lower_transposed

_potrf, _potri = get_lapack_funcs(("potrf", "potri"), dtype=np.float64)

PER_LEVEL = 5
"""Hyperparameters of one level: signal variance, three length scales, noise variance."""


@dataclass(frozen=True, slots=True, eq=False)
class Derivatives:
    """How the negative log likelihood changes with the hyperparameters, as they are passed."""

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
    """Computes the derivatives, at twice the cost of the value; once another set of hyperparameters
    has been evaluated, at three times."""


class MarginalLikelihood:
    r"""Likelihood of samples of an auto-regressive field with any number of fidelity levels.

    The field of level ``i`` is :math:`f_i = \rho_i f_{i-1} + g_i` with independent components
    :math:`g_t` of kernels :math:`k_t`, so samples of levels ``i`` and ``k`` covary by
    :math:`\sum_{t \le \min(i, k)} s_{ti} s_{tk} k_t` with :math:`s_{ti} = \rho_{t+1} \dots
    \rho_i`, and each level has a noise of its own. With one level this is a plain Gaussian process.

    Hyperparameters are passed as logarithms, level after level, worst located first: signal
    variance, length scales north, east, down (m), noise variance; then, where ``learns_rho``,
    the scale factors of the steps as they are, for they may be negative. The gradient is
    :math:`\frac12 tr((K^{-1} - \alpha \alpha^T) \partial K)`; coefficients of the mean are at
    their optimum for every set, so they add nothing to it.

    Large matrices are kept and used again, because a fresh one costs as much as it takes to fill
    it; so an instance serves one thread at a time.

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
        rho: Sequence[float] = (),
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
            rho: Scale factor of each step between levels, where not learned; none for 1.
            learns_rho: Whether the scale factors are the last hyperparameters.
            age: Time of each sample over the memory of the field, shape ``(n,)``.
            held_noise: Noise covariance that is not learned, shape ``(n, n)``.
            basis: Functions of position whose weighted sum is the mean, shape ``(n, p)``.
        """
        # imported late: what imports this module need not load the compiler
        from autonomy.field.learning import likelihood_kernel

        self._kernels = likelihood_kernel
        n = len(values)
        levels = np.zeros(n, dtype=np.int64) if sample_levels is None else sample_levels
        self._order = np.argsort(levels, kind="stable")  # each component is in the last samples
        self._axes = np.ascontiguousarray(points[self._order].T)  # (3, n)
        self._values = np.asarray(values, dtype=np.float64)[self._order]
        self._levels = levels[self._order]
        self._shapes = tuple(likelihood_kernel.SHAPE_NUMBER[shape] for shape in shapes)
        self._bounds = np.searchsorted(self._levels, np.arange(len(shapes) + 1))
        self._factors = scale_factors(rho, len(shapes))
        self._learned_factors = len(self._factors) if learns_rho else 0
        self._age = np.zeros(n) if age is None else age[self._order]
        self._held = None
        if held_noise is not None:  # its upper triangle, which LAPACK sees as the lower one
            self._held = np.triu(held_noise[np.ix_(self._order, self._order)])
        self._basis = np.zeros((n, 0)) if basis is None else basis[self._order]
        self._total = np.empty((n, n))
        self._inverse = np.empty((n, n), order="F")
        self._decays = [np.empty((n - first, n - first)) for first in self._bounds[:-1].tolist()]
        self._current: _Current | None = None

    @property
    def size(self) -> int:
        """Number of hyperparameters."""
        return PER_LEVEL * len(self._shapes) + self._learned_factors

    def at(self, log_parameters: FloatArray) -> "Evaluation":
        """Evaluate the negative log likelihood.

        Args:
            log_parameters: Shape ``(size,)``.

        Raises:
            ValueError: If the covariance has no factor even with jitter.
        """
        table, factors = self._unpacked(log_parameters)
        current = self._current = _Current(table, *self._factored(table, factors))
        factor = current.factor
        whitened = self._whitened(factor)
        log_determinant = 2.0 * float(np.sum(np.log(np.diagonal(factor))))
        constant = len(factor) * math.log(2.0 * math.pi)
        square = float(whitened.residuals @ whitened.residuals)
        value = 0.5 * (square + log_determinant + constant)

        def derivatives() -> Derivatives:
            if self._current is not current:  # its matrices hold something else by now
                self._current = None
                again = self._factored(table, factors)
                return self._derivatives(_Current(table, *again), share_slopes(factors), whitened)
            return self._derivatives(current, share_slopes(factors), whitened)

        return Evaluation(value, whitened.trend, derivatives)

    def _unpacked(self, log_parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        kernels = PER_LEVEL * len(self._shapes)
        factors = log_parameters[kernels:] if self._learned_factors else self._factors
        return np.exp(log_parameters[:kernels]).reshape(-1, PER_LEVEL), factors

    def _factored(self, table: FloatArray, factors: FloatArray) -> tuple[FloatArray, list["_Part"]]:
        """Return the factor of the covariance, and what each component is."""
        parts = [self._part(t, table, share[t:]) for t, share in enumerate(shares(factors))]
        self._fill(table, parts)
        factor, failed = _potrf(self._total.T, lower=1, overwrite_a=1, clean=1)
        if failed:
            self._fill(table, parts)
            lower = self._total.T
            factor = cholesky(lower + np.tril(lower, -1).T, float(table[:, 0].sum()))
        return factor, parts

    def _part(self, t: int, table: FloatArray, share: FloatArray) -> "_Part":
        """Return what a component is at the samples that it has a part in."""
        first, decays = self._bounds[t], self._decays[t]
        scaled = self._axes[:, first:] / table[t, 1:4, None]
        self._kernels.fill_exponents(decays, scaled, self._age[first:], self._shapes[t])
        np.exp(decays, out=decays)
        return _Part(self._shapes[t], first, self._bounds[t:] - first, share, scaled, decays)

    def _fill(self, table: FloatArray, parts: list["_Part"]) -> None:
        """Put in the covariance of the samples: ``[j, i]`` with ``i >= j``, 0 elsewhere."""
        total = self._total
        total[:] = 0.0 if self._held is None else self._held
        for part, signal in zip(parts, table[:, 0].tolist(), strict=True):
            self._kernels.add_covariance(
                total, part.decays, part.scaled, part.share, part.bounds, part.shape, signal
            )
        total[np.diag_indices(len(total))] += table[self._levels, 4]

    def _whitened(self, factor: FloatArray) -> "_Whitened":
        values = solve_lower(factor, self._values)
        if not self._basis.shape[1]:
            return _Whitened(values, self._basis, np.zeros(0))
        basis = solve_lower(factor, self._basis)
        trend = _least_squares(basis, values)
        return _Whitened(values - basis @ trend, basis, trend)

    def _derivatives(
        self, current: "_Current", slopes: FloatArray, whitened: "_Whitened"
    ) -> Derivatives:
        factor = current.factor
        alpha = solve_lower_transposed(factor, whitened.residuals)
        np.copyto(self._inverse, factor)
        inverse, _ = _potri(self._inverse, lower=1, overwrite_c=1)
        traces, products = self._contracted(current, slopes, inverse.T, alpha)
        gradient = traces - 0.5 * (products @ alpha)
        directions = whitened.without_trend(solve_lower(factor, products.T))  # (n, size)
        return Derivatives(gradient, 0.5 * (directions.T @ directions))

    def _contracted(
        self, current: "_Current", slopes: FloatArray, inverse: FloatArray, alpha: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return ``tr(K^-1 dK) / 2``, shape ``(size,)``, and ``dK alpha``, ``(size, n)``."""
        table = current.table
        kernels = PER_LEVEL * len(table)
        traces, products = np.zeros(self.size), np.zeros((self.size, len(alpha)))
        half = 0.5 * np.diagonal(inverse)
        for t, part in enumerate(current.parts):
            signal, noise, first = table[t, 0], table[t, 4], part.first
            sums = part.contracted(self._kernels.contract, inverse, alpha[first:])
            level = self._levels[first:] - t
            at = PER_LEVEL * t
            traces[at], products[at, first:] = sums.changed(part.share, part.share, level)
            traces[at + 1 : at + 4], products[at + 1 : at + 4, first:] = sums.by_length
            traces[at : at + 4] *= signal
            products[at : at + 4] *= signal
            mine = self._levels == t
            traces[at + 4] = noise * float(half[mine].sum())
            products[at + 4, mine] = noise * alpha[mine]
            for step in range(self._learned_factors):
                trace, product = sums.changed(part.share, 2.0 * slopes[step, t, t:], level)
                traces[kernels + step] += signal * trace
                products[kernels + step, first:] += signal * product
        return traces, products


@dataclass(frozen=True, slots=True, eq=False)
class _Current:
    """What the large matrices of a likelihood hold."""

    table: FloatArray
    """Hyperparameters, a level a row, shape ``(levels, PER_LEVEL)``."""
    factor: FloatArray
    """Lower triangular factor of the samples' covariance, shape ``(n, n)``, Fortran order."""
    parts: list["_Part"]


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """One component of the field, at the last ``m`` samples, of ``k`` levels."""

    shape: int
    first: int
    """Number of the first of these samples."""
    bounds: IntArray
    """Where each level begins among them, and ``m``, shape ``(k + 1,)``."""
    share: FloatArray
    """Of the component in each level, shape ``(k,)``."""
    scaled: FloatArray
    """Positions over length scales, shape ``(3, m)``."""
    decays: FloatArray
    """The correlations' exponentials, shape ``(m, m)``."""

    def contracted(
        self, contract: Callable[..., None], inverse: FloatArray, alpha: FloatArray
    ) -> "_Sums":
        """Sum correlations and their derivatives with the inverse and ``alpha`` ``(m,)``."""
        k, m = len(self.share), len(alpha)
        pairs, wholes = np.zeros((k, k)), np.empty((k, m))
        traces, products = np.empty(3), np.empty((3, m))
        contract(
            inverse,
            alpha,
            self.decays,
            self.scaled,
            self.share,
            self.bounds,
            self.shape,
            pairs,
            traces,
            wholes,
            products,
        )
        return _Sums(pairs, wholes, (traces, products))


@dataclass(frozen=True, slots=True, eq=False)
class _Sums:
    """What a component's correlations come to, for a signal variance of 1."""

    pairs: FloatArray
    """As ``contract`` leaves them, shape ``(k, k)``."""
    wholes: FloatArray
    """As ``contract`` leaves them, shape ``(k, m)``."""
    by_length: tuple[FloatArray, FloatArray]
    """Traces and products by the logarithms of the length scales."""

    def changed(
        self, share: FloatArray, other: FloatArray, level: IntArray
    ) -> tuple[float, FloatArray]:
        """Return trace and product of the correlations weighted by two shares, made symmetric.

        Args:
            share: In each level, shape ``(k,)``.
            other: In each level, shape ``(k,)``; the same for the whole component, and twice its
                derivative for the derivative of the component.
            level: Of each sample, less the component's, shape ``(m,)``.
        """
        trace = 0.5 * float(share @ self.pairs @ other + other @ self.pairs @ share)
        product = share[level] * (other @ self.wholes) + other[level] * (share @ self.wholes)
        return trace, 0.5 * product


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
