"""Compiled Cholesky factors of small matrices.

A library would start threads for matrices of a few hundred rows, and on a machine that is busy
those wait for each other longer than the factorization takes.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel

_TINY_VARIANCE = 1e-12


@inner_kernel
def half_log_determinant(matrix: FloatArray, k: int) -> float:
    """Factorize the first k rows and columns in place as ``U^T U``; only their upper half is read.

    A pivot that rounding brought below the smallest sensible variance is raised to it.

    Returns:
        Half the logarithm of the determinant.
    """
    total = 0.0
    for j in range(k):
        pivot = matrix[j]
        root = math.sqrt(max(pivot[j], _TINY_VARIANCE))
        total += math.log(root)
        pivot[j] = root
        scale = 1.0 / root
        for m in range(j + 1, k):
            pivot[m] *= scale
        for i in range(j + 1, k):
            part, row = pivot[i], matrix[i]
            for m in range(i, k):
                row[m] -= part * pivot[m]
    return total


@inner_kernel
def invert_upper(upper: FloatArray, inverse: FloatArray) -> None:
    """Invert an upper triangular matrix; what is below the diagonal becomes 0."""
    for i in range(len(upper) - 1, -1, -1):
        row = inverse[i]
        row[:] = 0.0
        for m in range(i + 1, len(upper)):
            part, below = upper[i, m], inverse[m]
            for j in range(m, len(upper)):
                row[j] -= part * below[j]
        scale = 1.0 / upper[i, i]
        for j in range(i + 1, len(upper)):
            row[j] *= scale
        row[i] = scale


@kernel
def inverse_factor(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a matrix's lower Cholesky factor; the matrix is overwritten."""
    half_log_determinant(matrix, len(matrix))
    inverse = np.empty_like(matrix)
    invert_upper(matrix, inverse)
    return inverse.T
