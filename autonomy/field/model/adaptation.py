r"""The kernel that a survey's own samples bear out, near the one that was told.

A kernel is told before the survey: learned elsewhere, or by a preset. Signal variance and length
scales of the water at hand may be others, and then the stated deviations are wrong by the same
factor however well positions are known. Here both are multiplied by factors of their own, chosen
so that each dive is predicted best from all the others: samples of one dive lie close together and
err together, so leaving out one sample would tell little, but a dive lies where the map is needed.
With the inverse :math:`Q` of the samples' covariance and :math:`\alpha = Q y`, the log density of
dive :math:`d` given the others is that of a normal vector of mean 0 and precision
:math:`Q_{dd}` at :math:`Q_{dd}^{-1} \alpha_d`. Log-normal priors about the told kernel hold the
factors where few dives speak.

Source:
    Rasmussen and Williams, Gaussian Processes for Machine Learning, section 5.4.2, for one sample
    left out; blocks follow from the same inverse.
"""

import math

import numpy as np
from scipy.linalg import get_lapack_funcs

from autonomy.arrays import FloatArray, IntArray
from autonomy.field.config import KernelParameters
from autonomy.field.model.factorization import cholesky
from autonomy.field.model.kernel import covariance, noise_variance

(_potri,) = get_lapack_funcs(("potri",), dtype=np.float64)

FEWEST_DIVES = 6
"""Dives from which on a survey says anything about its kernel."""
FEWEST_SAMPLES = 40
MOST_SAMPLES = 300
"""With more, every so many is looked at: each trial takes ``O(n^3)``."""
_SIGNAL_SPREAD = 1.4
"""Standard deviation of the logarithm of the signal variance's factor: four times, either way."""
_LENGTH_SPREAD = 0.4
"""That of the length scales: one and a half times, either way."""
_EVALUATIONS = 32
_FIRST_STEP = 0.6
_LARGEST = 1e6


def adapted(
    kernel: KernelParameters,
    points: FloatArray,
    values: FloatArray,
    dive: IntArray,
    noise: FloatArray,
    fading: FloatArray | None = None,
) -> KernelParameters:
    """Return the kernel by which each dive is predicted best from the others.

    Args:
        kernel: As told.
        points: Where the samples were taken, shape ``(n, 3)``, m.
        values: Measurements less the prior mean, shape ``(n,)``.
        dive: Number of each sample's dive, shape ``(n,)``.
        noise: Covariance of what position errors add, shape ``(n, n)``.
        fading: What time leaves of covariances, shape ``(n, n)``; all if not given.

    Returns:
        The kernel with other signal variance and length scales; the one told where there are too
        few dives or samples.
    """
    groups = _groups(dive)
    if len(groups) < FEWEST_DIVES or len(values) < FEWEST_SAMPLES:
        return kernel
    held = noise + noise_variance(kernel) * np.eye(len(values))

    def lost(logarithms: FloatArray) -> float:
        signal, length = logarithms.tolist()
        tried = scaled_kernel(kernel, math.exp(signal), math.exp(length))
        total = covariance(points, points, tried)
        if fading is not None:
            total *= fading
        held_back = (signal / _SIGNAL_SPREAD) ** 2 + (length / _LENGTH_SPREAD) ** 2
        try:
            density = left_out_density(total + held, values, groups)
        except ValueError:
            return math.inf
        return 0.5 * held_back - density

    corners = _FIRST_STEP * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    from scipy.optimize import minimize  # here: a station that starts need not wait for it

    found = minimize(
        lost,
        np.zeros(2),
        method="Nelder-Mead",
        options={"initial_simplex": corners, "maxfev": _EVALUATIONS, "xatol": 0.02, "fatol": 0.02},
    )
    signal, length = np.exp(found.x).tolist()
    return scaled_kernel(kernel, signal, length)


def left_out_density(total: FloatArray, values: FloatArray, groups: list[IntArray]) -> float:
    """Return the log density of each group of values given all the others, summed up.

    Args:
        total: Covariance of the values, noise included, shape ``(n, n)``.
        values: Of mean 0, shape ``(n,)``.
        groups: Indices of each group; together they are all.

    Raises:
        ValueError: If ``total`` is not a covariance.
    """
    factor = cholesky(total, float(np.mean(np.diagonal(total))))
    lower, _ = _potri(factor, lower=1)
    precision = np.tril(lower) + np.tril(lower, -1).T
    alpha = precision @ values
    density = -0.5 * len(values) * math.log(2.0 * math.pi)
    for mine in groups:
        block = cholesky(precision[np.ix_(mine, mine)], 1.0)
        error = np.linalg.solve(block, alpha[mine])
        density += float(np.sum(np.log(np.diagonal(block)))) - 0.5 * float(error @ error)
    return density


def scaled_kernel(kernel: KernelParameters, signal: float, length: float) -> KernelParameters:
    """Return a kernel with signal variance and length scales times factors."""
    x, y, z = kernel.length_scales_m()
    return kernel.model_copy(
        update={
            "signal_variance": min(signal * kernel.signal_variance, _LARGEST),
            "length_x_m": min(length * x, _LARGEST),
            "length_y_m": min(length * y, _LARGEST),
            "length_z_m": min(length * z, _LARGEST),
        }
    )


def _groups(dive: IntArray) -> list[IntArray]:
    order = np.argsort(dive, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(dive[order])) + 1)
