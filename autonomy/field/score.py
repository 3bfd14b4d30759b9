"""How good a map is: four numbers that must be read together."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.model.factorization import cholesky, solve_lower

_JITTER = 1e-9
_NORMAL_90 = 1.6448536269514722
"""Half width of the central 90 % of a standard normal distribution."""


@dataclass(frozen=True, slots=True)
class Scores:
    """Agreement of a map with the truth.

    Accuracy alone is ``rmse``; the other three judge the stated uncertainty too. Inflating the
    variance drives ``wmse`` to 0 and ``coverage_90`` to 1: neither is better when it passes its
    calibrated value.
    """

    rmse: float
    """Root mean square error, in the model's scale."""
    nlpd: float
    """Negative log predictive density per point, in nats; lower is better."""
    wmse: float
    """Mean square error weighted by the inverse covariance; 1 when calibrated."""
    coverage_90: float
    """Share of points inside the central 90 % interval; 0.9 when calibrated."""


def score(mean: FloatArray, covariance: FloatArray, truth: FloatArray) -> Scores:
    r"""Score a prediction.

    Args:
        mean: Predicted values, shape ``(q,)``, in the model's scale.
        covariance: Predictive covariance, shape ``(q, q)``. That of the field itself when
            ``truth`` is the field; with the noise variance on its diagonal when ``truth`` holds
            measurements.
        truth: True values, shape ``(q,)``.

    Returns:
        The scores; ``wmse`` is :math:`e^T \Sigma^{-1} e / q` with the full covariance and a
        jitter of 1e-9 of its mean diagonal.

    Raises:
        ValueError: If there are no points, or a number is not finite.

    Source:
        Coleman, thesis, section 5.5.3 (WMSE).
    """
    error = truth - mean
    if not len(error) or not (np.isfinite(error).all() and np.isfinite(covariance).all()):
        raise ValueError("scores need at least one point and finite numbers")
    q = len(error)
    diagonal = np.diagonal(covariance)
    scale = max(float(np.mean(diagonal)), np.finfo(np.float64).tiny)
    floor = _JITTER * scale
    whitened = solve_lower(cholesky(covariance + floor * np.eye(q), scale), error)
    variance = np.maximum(diagonal, floor)
    squared = error**2 / variance
    return Scores(
        rmse=float(np.sqrt(np.mean(error**2))),
        nlpd=float(0.5 * np.mean(squared + np.log(2.0 * math.pi * variance))),
        wmse=float(whitened @ whitened) / q,
        coverage_90=float(np.mean(np.sqrt(squared) <= _NORMAL_90)),
    )
