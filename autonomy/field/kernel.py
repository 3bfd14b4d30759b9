"""The covariance function of every field model: Matern-3/2 with one length scale per axis."""

import numpy as np
from scipy.spatial.distance import cdist

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters

_ROOT_3 = np.sqrt(3.0)
_LEAST_NOISE = 1e-9


def matern32(a: FloatArray, b: FloatArray, parameters: KernelParameters) -> FloatArray:
    r"""Return the prior covariance of the field between two sets of points.

    :math:`k = \sigma^2 (1 + \sqrt 3 d) e^{-\sqrt 3 d}` with
    :math:`d^2 = \sum_j ((a_j - b_j) / l_j)^2`.

    Args:
        a: Points, shape ``(n, 3)``, m.
        b: Points, shape ``(m, 3)``, m.
        parameters: Signal variance and length scales.

    Returns:
        Covariances, shape ``(n, m)``.

    Source:
        Coleman, thesis, section 5.5.1. As printed there (``exp(1 + sqrt(3) d)``, and ``d``
        squared) the kernel would be constant; this is the Matern kernel that it names.
    """
    length_scales = np.array(parameters.length_scales_m())
    scaled = cdist(a / length_scales, b / length_scales)  # (n, m)
    scaled *= _ROOT_3
    covariance = np.exp(-scaled)
    scaled += 1.0
    covariance *= scaled
    covariance *= parameters.signal_variance
    return covariance


def noise_variance(parameters: KernelParameters) -> float:
    """Return the noise variance that a factorization can bear: at least 1e-9 of the signal's."""
    return max(parameters.noise_variance, _LEAST_NOISE * parameters.signal_variance)
