"""Compiled Cholesky factors of small matrices.

A library would start threads for matrices of a few hundred rows, and on a machine that is busy
those wait for each other longer than the factorization takes.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel

_TINY_VARIANCE = 1e-12


@kernel
def factorize(matrix: FloatArray, k: int) -> float:
    """Cholesky-factorize the lower triangle in place; return half its log-determinant.

    A pivot that rounding brought below the smallest sensible variance is raised to it.
    """
    total = 0.0
    for j in range(k):
        for i in range(j, k):
            value = matrix[i, j]
            for m in range(j):
                value -= matrix[i, m] * matrix[j, m]
            if i == j:
                root = math.sqrt(max(value, _TINY_VARIANCE))
                total += math.log(root)
                matrix[j, j] = root
            else:
                matrix[i, j] = value / matrix[j, j]
    return total


@kernel
def inverse_factor(matrix: FloatArray) -> FloatArray:
    """Return the inverse of a matrix's lower Cholesky factor; the matrix is overwritten."""
    size = len(matrix)
    factorize(matrix, size)
    inverse = np.zeros((size, size))
    for i in range(size):
        row = inverse[i]
        row[i] = 1.0
        for m in range(i):
            part = matrix[i, m]
            above = inverse[m]
            for j in range(m + 1):
                row[j] -= part * above[j]
        scale = 1.0 / matrix[i, i]
        for j in range(i + 1):
            row[j] *= scale
    return inverse
