"""Factors of covariance matrices, and products with what they have whitened.

Everything large goes through scipy's BLAS: numpy carries a second one with threads of its own, and
on a small machine the two wait for each other longer than they compute.
"""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.model.algebra import factorize_in_place, solve_in_place

_FIRST_JITTER = 1e-10
_LAST_JITTER = 1e-2


def cholesky(matrix: FloatArray, scale: float) -> FloatArray:
    """Factorize a covariance matrix as ``L L^T``.

    A matrix that rounding left without a factor (two samples at one place and hardly any noise)
    gets a jitter on its diagonal, from 1e-10 of ``scale``, ten times more at each failure.

    Args:
        matrix: Symmetric and positive semi-definite up to rounding, shape ``(n, n)``.
        scale: Prior variance of what the matrix describes, which its rounding errors go with.

    Returns:
        Lower triangular factor, shape ``(n, n)``, Fortran order.

    Raises:
        ValueError: If the matrix is not a covariance matrix, even with 1 % of ``scale`` on its
            diagonal.
    """
    jitter = 0.0
    while jitter <= _LAST_JITTER:
        factor = np.asfortranarray(np.tril(matrix))
        factor[np.diag_indices(len(matrix))] += jitter * scale
        if factorize_in_place(factor):
            return factor
        jitter = 10.0 * jitter or _FIRST_JITTER
    raise ValueError("the matrix to factorize is not a covariance matrix")


def solve_lower(factor: FloatArray, right: FloatArray) -> FloatArray:
    """Return ``L^-1 right`` for a lower triangular factor.

    Args:
        factor: Shape ``(n, n)``; not copied when in Fortran order.
        right: Shape ``(n,)`` or ``(n, m)``.

    Returns:
        Shape of ``right``.
    """
    return _solved(factor, right, transposed=False)


def whiten_in_place(factor: FloatArray, rows: FloatArray) -> FloatArray:
    """Return ``L^-1`` times each of some vectors, which are overwritten.

    Args:
        factor: Lower triangular, shape ``(n, n)``, Fortran order.
        rows: One vector a row, shape ``(m, n)``, C order.

    Returns:
        One whitened vector a row, shape ``(m, n)``; the memory of ``rows``.
    """
    solve_in_place(factor, rows.T)
    return rows


def solve_lower_transposed(factor: FloatArray, right: FloatArray) -> FloatArray:
    """Return ``L^-T right`` for a lower triangular factor; shapes as in ``solve_lower``."""
    return _solved(factor, right, transposed=True)


def _solved(factor: FloatArray, right: FloatArray, *, transposed: bool) -> FloatArray:
    columns = right[:, None] if right.ndim == 1 else right
    solution = np.array(columns, dtype=np.float64, order="F")
    solve_in_place(np.asfortranarray(factor), solution, transposed=transposed)
    return solution[:, 0] if right.ndim == 1 else solution
