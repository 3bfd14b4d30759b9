"""Derivatives by finite differences, for tests that hold others against them."""

from collections.abc import Callable

import numpy as np

from autonomy.arrays import FloatArray


def finite_differences(
    function: Callable[[FloatArray], FloatArray], at: FloatArray, step: float = 1e-5
) -> FloatArray:
    """Return the derivatives of a function of n numbers, shape ``(..., n)``."""
    columns: list[FloatArray] = []
    for i in range(len(at)):
        unit = step * np.eye(len(at))[i]
        near = function(at + unit) - function(at - unit)
        far = function(at + 2.0 * unit) - function(at - 2.0 * unit)
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.stack(columns, axis=-1)
