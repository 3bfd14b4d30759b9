"""Are covariances honest? The normalized estimation error squared, and its bounds.

An estimator is consistent if its errors are as large as it says: for ``d`` numbers the mean of
``e' P^-1 e`` is ``d``. More is overconfidence, less is needless doubt.

Source:
    Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation
    (2001), section 5.4.2.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from autonomy.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class Consistency:
    """How honest an estimator was over several independent runs."""

    mean: float
    """Normalized estimation error squared, averaged over runs and time; ``dimensions`` is best."""
    low: float
    """Below it an average over this many runs is unlikely (2.5 %)."""
    high: float
    """Above it an average over this many runs is unlikely (2.5 %)."""
    share_inside: float
    """Part of the time for which the average over the runs lies between both."""
    runs: int
    dimensions: int

    @property
    def is_consistent(self) -> bool:
        """Whether the average lies inside its 95 % bounds."""
        return self.low <= self.mean <= self.high


def normalized_error_squared(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return ``e' P^-1 e`` of each error.

    Args:
        error: Truth less estimate, shape ``(..., d)``.
        covariance: What the estimator said of it, shape ``(..., d, d)``.

    Returns:
        Shape ``(...)``.

    Raises:
        numpy.linalg.LinAlgError: If a covariance is not positive definite.
    """
    factor = np.linalg.cholesky(covariance)
    whitened = np.linalg.solve(factor, error[..., None])[..., 0]
    return np.sum(whitened**2, axis=-1)


def bounds(runs: int, dimensions: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return between what the average over independent runs lies with this probability."""
    tail = 0.5 * (1.0 - confidence)
    freedom = runs * dimensions
    low, high = chi2.ppf([tail, 1.0 - tail], freedom) / runs
    return float(low), float(high)


def consistency(squares: FloatArray, dimensions: int) -> Consistency:
    """Judge normalized errors squared of independent runs.

    The errors of one run are alike for a long time, so the bounds count each run once however long
    it is.

    Args:
        squares: Shape ``(runs, times)``.
        dimensions: Numbers in each error.

    Raises:
        ValueError: If there is nothing to judge or a number is not finite.
    """
    if squares.ndim != 2 or squares.size == 0 or not np.isfinite(squares).all():
        raise ValueError("consistency needs finite squares of shape (runs, times)")
    runs = len(squares)
    low, high = bounds(runs, dimensions)
    at_each_time = squares.mean(axis=0)
    inside = (at_each_time >= low) & (at_each_time <= high)
    return Consistency(
        float(at_each_time.mean()), low, high, float(inside.mean()), runs, dimensions
    )
