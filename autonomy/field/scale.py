"""Between a measured value and the scale in which a Gaussian process sees it."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.channel import Scale


def to_model(scale: Scale, values: FloatArray, log_floor: float) -> FloatArray:
    """Bring measured values of any shape, in the variable's unit, to the model's scale.

    On the logarithmic one a value below ``log_floor`` is read as that.
    """
    if scale == "log":
        return np.log(np.maximum(values, log_floor))
    return np.asarray(values, dtype=np.float64)


def from_model(scale: Scale, values: FloatArray) -> FloatArray:
    """Bring values of any shape in the model's scale back to the variable's unit."""
    if scale == "log":
        return np.exp(values)
    return np.asarray(values, dtype=np.float64)
