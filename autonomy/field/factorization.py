"""Factors of covariance matrices, and products with what they have whitened.

Everything large goes through scipy's BLAS: numpy carries a second one with threads of its own, and
on a small machine the two wait for each other longer than they compute.
"""

import numpy as np
from scipy.linalg import LinAlgError, get_blas_funcs, get_lapack_funcs
from scipy.linalg import cholesky as scipy_cholesky

from autonomy.arrays import FloatArray

(_trtrs,) = get_lapack_funcs(("trtrs",), dtype=np.float64)
(_trsm,) = get_blas_funcs(("trsm",), dtype=np.float64)

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
        try:
            jittered = matrix + jitter * scale * np.eye(len(matrix)) if jitter else matrix
            return scipy_cholesky(jittered, lower=True, check_finite=False)
        except LinAlgError:
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
    solution, _ = _trtrs(factor, right, lower=1)
    return solution


def whiten_in_place(factor: FloatArray, rows: FloatArray) -> FloatArray:
    """Return ``L^-1`` times each of some vectors, which are overwritten.

    Args:
        factor: Lower triangular, shape ``(n, n)``, Fortran order.
        rows: One vector a row, shape ``(m, n)``, C order.

    Returns:
        One whitened vector a row, shape ``(m, n)``; the memory of ``rows``.
    """
    return _trsm(1.0, factor, rows.T, lower=1, overwrite_b=1).T


def solve_lower_transposed(factor: FloatArray, right: FloatArray) -> FloatArray:
    """Return ``L^-T right`` for a lower triangular factor; shapes as in ``solve_lower``."""
    solution, _ = _trtrs(factor, right, lower=1, trans=1)
    return solution
