"""A noise that predictions bear out, where the marginal likelihood cannot be trusted with it."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import get_lapack_funcs

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters
from autonomy.field.model.factorization import cholesky, solve_lower, solve_lower_transposed
from autonomy.field.model.gaussian_process import GaussianProcess
from autonomy.field.model.kernel import covariance, noise_variance

(_potri,) = get_lapack_funcs(("potri",), dtype=np.float64)

_LOG_TOLERANCE = 0.1
_EVALUATIONS = 12


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Some of the samples."""

    points: FloatArray
    """Shape ``(n, 3)``, m."""
    values: FloatArray
    """Less the prior mean, shape ``(n,)``."""


def cross_validated_noise(
    kernel: KernelParameters, learned_from: Part, left_over: Part, *, floor: float
) -> KernelParameters:
    """Choose the noise variance by which a map predicts measurements best that it has not seen.

    Real measurements have rare spikes and much that is smooth. The marginal likelihood of samples
    spread as evenly as possible sees more than their share of spikes, that of smooth data drives
    the noise to nothing; predictions suffer from both. Here every sample is predicted once: those
    learned from by all the others of them, those left over by all that were learned from. The
    noise with the greatest log density of these is taken, the rest of the kernel stays.

    Args:
        kernel: As learned.
        learned_from: Samples that the map is conditioned on, at least two.
        left_over: Other samples, of which there may be none.
        floor: Smallest noise variance.

    Returns:
        The kernel with that noise variance.
    """
    highest = max(4.0 * float(np.var(learned_from.values)), kernel.noise_variance, 2.0 * floor)

    def lost(log_noise: float) -> float:
        tried = kernel.model_copy(update={"noise_variance": math.exp(log_noise)})
        total = _lost_of_each_other(tried, learned_from)
        if len(left_over.values):
            total += _lost(tried, learned_from, left_over)
        return total

    from scipy.optimize import minimize_scalar  # here: a station that starts need not wait for it

    found = minimize_scalar(
        lost,
        bounds=(math.log(floor), math.log(highest)),
        method="bounded",
        options={"xatol": _LOG_TOLERANCE, "maxiter": _EVALUATIONS},
    )
    return kernel.model_copy(update={"noise_variance": max(math.exp(float(found.x)), floor)})


def leave_one_out(kernel: KernelParameters, part: Part) -> tuple[FloatArray, FloatArray]:
    r"""Predict each sample's measurement from all the others.

    Returns:
        Errors and variances of the predictions, noise included, each of shape ``(n,)``:
        :math:`\alpha_i / K^{-1}_{ii}` and :math:`1 / K^{-1}_{ii}`.

    Source:
        Rasmussen and Williams, Gaussian Processes for Machine Learning, section 5.4.2.
    """
    K = covariance(part.points, part.points, kernel)
    K[np.diag_indices(len(K))] += noise_variance(kernel)
    factor = cholesky(K, kernel.signal_variance)
    alpha = solve_lower_transposed(factor, solve_lower(factor, part.values))
    inverse, _ = _potri(factor, lower=1)
    variance = 1.0 / np.diagonal(inverse)
    return alpha * variance, variance


def _lost_of_each_other(kernel: KernelParameters, part: Part) -> float:
    return _negative_log_density(*leave_one_out(kernel, part))


def _lost(kernel: KernelParameters, learned_from: Part, left_over: Part) -> float:
    process = GaussianProcess(kernel, learned_from.points, learned_from.values)
    mean, variance = process.marginals(left_over.points)
    return _negative_log_density(left_over.values - mean, variance + noise_variance(kernel))


def _negative_log_density(error: FloatArray, variance: FloatArray) -> float:
    return 0.5 * float(np.sum(error**2 / variance + np.log(2.0 * math.pi * variance)))
