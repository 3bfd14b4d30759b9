"""Hyperparameters from data, by the marginal likelihood."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.optimize import minimize

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters
from autonomy.field.factorization import cholesky, solve_lower, solve_lower_transposed

(_potri,) = get_lapack_funcs(("potri",), dtype=np.float64)

_ROOT_3 = math.sqrt(3.0)
_LOG_RANGE = math.log(1e3)
"""How far from its start, as a factor, a hyperparameter may go."""


@dataclass(frozen=True, slots=True)
class Learned:
    """Outcome of learning hyperparameters."""

    parameters: KernelParameters
    log_likelihood: float
    """Log marginal likelihood of the values with these parameters."""
    converged: bool
    message: str
    """How the search ended, for a person."""


def learn(
    points: FloatArray,
    values: FloatArray,
    starts: Sequence[KernelParameters],
    *,
    noise_floor: float,
    max_iterations: int = 100,
) -> Learned:
    """Fit the kernel and noise of a zero-mean Gaussian process, from each start, keep the best.

    Args:
        points: Where the values were measured, shape ``(n, 3)``, m.
        values: Measurements less their mean, shape ``(n,)``.
        starts: Where to begin; no parameter goes farther than a factor of 1,000 from its start.
        noise_floor: Smallest noise variance. Smooth data drive the noise to nothing, and the map
            then claims to know what it interpolates.
        max_iterations: Limit of each search.

    Raises:
        ValueError: If there are fewer than two values, or no start.

    Source:
        Coleman, thesis, equation (5.3), with the noise and the constant that it leaves out.
    """
    if len(values) < 2 or not starts:
        raise ValueError("learning needs at least two values and one start")
    objective = _objective(points, values)
    outcomes = [_search(objective, start, noise_floor, max_iterations) for start in starts]
    return max(outcomes, key=lambda outcome: outcome.log_likelihood)


def negative_log_likelihood(
    log_parameters: FloatArray, squared_distances: FloatArray, values: FloatArray
) -> tuple[float, FloatArray]:
    r"""Return the negative log marginal likelihood and its gradient.

    Args:
        log_parameters: Logarithms of signal variance, three length scales (m), noise variance.
        squared_distances: Along each axis, between all samples, shape ``(3, n, n)``, m^2.
        values: Shape ``(n,)``.

    Returns:
        The value, and its gradient by ``log_parameters``, shape ``(5,)``:
        :math:`\frac12 tr((K_y^{-1} - \alpha \alpha^T) \partial K_y)`.
    """
    signal, *lengths, noise = np.exp(log_parameters)
    inverse_squared = 1.0 / np.square(lengths)
    scaled = _ROOT_3 * np.sqrt(np.tensordot(inverse_squared, squared_distances, axes=1))  # (n, n)
    decay = signal * np.exp(-scaled)
    K = (1.0 + scaled) * decay

    factor = cholesky(K + noise * np.eye(len(values)), signal + noise)
    whitened = solve_lower(factor, values)
    alpha = solve_lower_transposed(factor, whitened)
    lower, _ = _potri(factor, lower=1)  # lower triangle of the inverse
    W = np.tril(lower) + np.tril(lower, -1).T - np.outer(alpha, alpha)

    by_lengths = 3.0 * inverse_squared * np.tensordot(squared_distances, W * decay, axes=2)
    gradient = 0.5 * np.array([np.sum(W * K), *by_lengths, noise * np.trace(W)])
    log_determinant = 2.0 * float(np.sum(np.log(np.diagonal(factor))))
    n = len(values)
    value = 0.5 * (float(whitened @ whitened) + log_determinant + n * math.log(2.0 * math.pi))
    return value, gradient


_Objective = Callable[[FloatArray], tuple[float, FloatArray]]


def _objective(points: FloatArray, values: FloatArray) -> _Objective:
    squared_distances = np.square(points.T[:, :, None] - points.T[:, None, :])  # (3, n, n)
    return lambda theta: negative_log_likelihood(theta, squared_distances, values)


def _search(
    objective: _Objective, start: KernelParameters, noise_floor: float, max_iterations: int
) -> Learned:
    first = np.log(
        [
            start.signal_variance,
            *start.length_scales_m(),
            max(start.noise_variance, noise_floor),
        ]
    )
    bounds = [(theta - _LOG_RANGE, theta + _LOG_RANGE) for theta in first]
    bounds[-1] = (math.log(noise_floor), max(bounds[-1][1], math.log(noise_floor)))
    found = minimize(
        objective,
        first,
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": max_iterations},
    )
    signal, length_x, length_y, length_z, noise = np.exp(found.x).tolist()
    parameters = KernelParameters(
        signal_variance=signal,
        length_x_m=length_x,
        length_y_m=length_y,
        length_z_m=length_z,
        noise_variance=noise,
    )
    return Learned(parameters, -float(found.fun), bool(found.success), str(found.message))
