"""Between a measured value and the scale in which a Gaussian process sees it."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.variable import Scale

SMALLEST_OF_LOG = 0.5
"""A value below this is read as this in the logarithmic scale: half a count of a converter."""


def to_model(scale: Scale, values: FloatArray) -> FloatArray:
    """Bring measured values of any shape, in the variable's unit, to the model's scale."""
    if scale == "log":
        return np.log(np.maximum(values, SMALLEST_OF_LOG))
    return np.asarray(values, dtype=np.float64)


def from_model(scale: Scale, values: FloatArray) -> FloatArray:
    """Bring values of any shape in the model's scale back to the variable's unit."""
    if scale == "log":
        return np.exp(values)
    return np.asarray(values, dtype=np.float64)
