"""Where a field is above a value, as far as a map can tell."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.channel import Scale

_NUGGETS = (1e-10, 1e-8, 1e-6)
"""Parts of the largest variance that are added until a covariance has a factor."""


def level_of(scale: Scale, value: float) -> float:
    """Return a value in the model's scale; nothing is below a value that has no logarithm."""
    if scale == "log":
        return math.log(value) if value > 0.0 else -math.inf
    return value


def drawn_fields(
    mean: FloatArray, covariance: FloatArray, count: int, rng: np.random.Generator
) -> FloatArray:
    """Draw fields that agree with a map at some points together, shape ``(count, q)``.

    Args:
        mean: Shape ``(q,)``.
        covariance: Shape ``(q, q)``; what rounding took from it is put back.
        count: How many.
        rng: Source of randomness.

    Raises:
        ValueError: If the covariance is none.
    """
    largest = float(np.diag(covariance).max(initial=0.0))
    for nugget in _NUGGETS:
        try:
            factor = np.linalg.cholesky(covariance + nugget * largest * np.eye(len(mean)))
        except np.linalg.LinAlgError:
            continue
        return mean + rng.standard_normal((count, len(mean))) @ factor.T
    raise ValueError("the covariance of the map is not positive definite")


def share_above(level: float, fields: FloatArray) -> tuple[float, float]:
    """Return the share of points above a level that 5 and 95 % of drawn fields do not exceed."""
    low, high = np.quantile((fields > level).mean(axis=1), (0.05, 0.95))
    return float(low), float(high)
