"""Are covariances honest? The normalized estimation error squared, and its bounds.

An estimator is consistent if its errors are as large as it says: for ``d`` numbers the mean of
``e' P^-1 e`` is ``d``. More is overconfidence, less is needless doubt.

An average over runs is judged by the draws that it really holds. Were the errors of a run all
independent, ``N`` runs of ``m`` moments would give ``N m d`` degrees of freedom of a chi square;
were they one error that lasts, ``N d``. What they are shows in the runs themselves: the average of
one run has variance ``2 mean^2 / (d n)`` if it holds ``n`` independent draws, so ``n`` follows from
the spread between the runs, which are independent by their seeds. The bounds are those of a chi
square of ``N n d`` degrees of freedom, with ``n`` between 1 and the number of moments: never wider
than one draw a run, and the narrower the more alike the runs are.

Source:
    Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation
    (2001), section 5.4.2.
"""

import math
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
    """Below it an average over these runs is unlikely (2.5 %)."""
    high: float
    """Above it an average over these runs is unlikely (2.5 %)."""
    share_inside: float
    """Part of the time for which the average over the runs lies inside the 95 % bounds of one
    moment, one draw a run; 0.95 if every moment is honest."""
    draws: float
    """Effective number of independent draws in one run."""
    runs: int
    dimensions: int

    @property
    def is_overconfident(self) -> bool:
        """Whether the errors are larger than the estimator says."""
        return self.mean > self.high

    @property
    def doubt(self) -> float:
        """How many times larger than the errors the stated standard deviations are."""
        return math.sqrt(self.dimensions / self.mean) if self.mean else math.inf


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


def bounds(draws: float, dimensions: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return between what a normalized squared error lies, averaged over independent draws.

    Args:
        draws: How many; need not be whole where draws depend on each other.
        dimensions: Of the error.
        confidence: Probability of the interval.
    """
    tail = 0.5 * (1.0 - confidence)
    freedom = draws * dimensions
    low, high = chi2.ppf([tail, 1.0 - tail], freedom) / draws
    return float(low), float(high)


def consistency(squares: FloatArray, dimensions: int) -> Consistency:
    """Judge normalized errors squared of independent runs.

    Args:
        squares: Shape ``(runs, times)``.
        dimensions: Numbers in each error.

    Raises:
        ValueError: If there is nothing to judge or a number is not finite.
    """
    if squares.ndim != 2 or squares.size == 0 or not np.isfinite(squares).all():
        raise ValueError("consistency needs finite squares of shape (runs, times)")
    runs, moments = squares.shape
    mean = float(squares.mean())
    spread = float(np.var(squares.mean(axis=1), ddof=1)) if runs > 1 else math.inf
    fewest = 2.0 * mean**2 / (dimensions * moments)
    draws = max(2.0 * mean**2 / (dimensions * max(spread, fewest)), 1.0) if mean else 1.0
    low, high = bounds(runs * draws, dimensions)
    floor, ceiling = bounds(runs, dimensions)
    at_each_time = squares.mean(axis=0)
    inside = (at_each_time >= floor) & (at_each_time <= ceiling)
    return Consistency(mean, low, high, float(inside.mean()), draws, runs, dimensions)
