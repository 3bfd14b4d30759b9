"""The covariance functions of every field model, with one length scale per axis."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters, KernelShape

_ROOT_3 = np.sqrt(3.0)
_ROOT_5 = np.sqrt(5.0)
_LEAST_NOISE = 1e-9


def covariance(a: FloatArray, b: FloatArray, parameters: KernelParameters) -> FloatArray:
    r"""Return the prior covariance of the field between two sets of points.

    With :math:`d^2 = \sum_j ((a_j - b_j) / l_j)^2` it is :math:`\sigma^2` times
    :math:`e^{-d}` (Matern-1/2), :math:`(1 + \sqrt 3 d) e^{-\sqrt 3 d}` (Matern-3/2),
    :math:`(1 + \sqrt 5 d + \frac53 d^2) e^{-\sqrt 5 d}` (Matern-5/2) or
    :math:`e^{-d^2 / 2}` (squared exponential).

    Args:
        a: Points, shape ``(n, 3)``, m.
        b: Points, shape ``(m, 3)``, m.
        parameters: Shape, signal variance and length scales.

    Returns:
        Covariances, shape ``(n, m)``.

    Source:
        Rasmussen and Williams, Gaussian Processes for Machine Learning, section 4.2. Coleman,
        thesis, section 5.5.1, takes Matern-3/2; as printed there (``exp(1 + sqrt(3) d)``, and
        ``d`` squared) it would be constant.
    """
    length_scales = np.array(parameters.length_scales_m())
    distance = _distances(a / length_scales, b / length_scales)
    result = _correlation(distance, parameters.shape)
    result *= parameters.signal_variance
    return result


def gradient_covariance(
    a: FloatArray, b: FloatArray, parameters: KernelParameters
) -> tuple[FloatArray, FloatArray]:
    r"""Return the prior covariance of horizontal gradients at ``a`` with the field at ``b``.

    These are :math:`\partial k(a_i, b_j) / \partial a_i` along north and along east; the posterior
    mean's gradient is this times :math:`K_y^{-1} y`.

    Args:
        a: Points of the gradients, shape ``(n, 3)``, m.
        b: Points of the field, shape ``(m, 3)``, m.
        parameters: Shape, signal variance and length scales.

    Returns:
        North and east, each of shape ``(n, m)``, in the model's scale squared per m.

    Raises:
        ValueError: If the shape is Matern-1/2, whose field has no gradient.
    """
    offset, distance = _horizontal_offset(a, b, parameters)
    first, _ = _radial_derivatives(distance, parameters)
    north, east, _ = parameters.length_scales_m()
    return first * offset[0] / north, first * offset[1] / east


def gradient_gradient_covariance(
    a: FloatArray, b: FloatArray, parameters: KernelParameters
) -> tuple[FloatArray, FloatArray, FloatArray]:
    r"""Return the prior covariance between the field's horizontal gradients at ``a`` and ``b``.

    Args:
        a: Points, shape ``(n, 3)``, m.
        b: Points, shape ``(m, 3)``, m.
        parameters: Shape, signal variance and length scales.

    Returns:
        North with north, east with east, and north with east (which is symmetric in the two
        axes), each of shape ``(n, m)``, in the model's scale squared per m^2.

    Raises:
        ValueError: If the shape is Matern-1/2, whose field has no gradient.
    """
    offset, distance = _horizontal_offset(a, b, parameters)
    first, second = _radial_derivatives(distance, parameters)
    north, east, _ = parameters.length_scales_m()
    return (
        -(first + second * offset[0] ** 2) / north**2,
        -(first + second * offset[1] ** 2) / east**2,
        -second * offset[0] * offset[1] / (north * east),
    )


def gradient_variance(parameters: KernelParameters) -> tuple[float, float]:
    """Return the prior variance of the field's slope north and east.

    Raises:
        ValueError: If the shape is Matern-1/2, whose field has no gradient.
    """
    first, _ = _radial_derivatives(np.zeros((1, 1)), parameters)
    north, east, _ = parameters.length_scales_m()
    return float(-first[0, 0]) / north**2, float(-first[0, 0]) / east**2


def noise_variance(parameters: KernelParameters) -> float:
    """Return the noise variance that a factorization can bear: at least 1e-9 of the signal's."""
    return max(parameters.noise_variance, _LEAST_NOISE * parameters.signal_variance)


def _correlation(distance: FloatArray, shape: KernelShape) -> FloatArray:
    """Turn scaled distances into correlations; the array given is overwritten."""
    if shape == "squared_exponential":
        np.square(distance, out=distance)
        distance *= -0.5
        return np.exp(distance, out=distance)
    if shape == "matern12":
        np.negative(distance, out=distance)
        return np.exp(distance, out=distance)
    distance *= _ROOT_3 if shape == "matern32" else _ROOT_5
    decay = np.exp(-distance)
    if shape == "matern52":
        decay *= 1.0 + distance + np.square(distance) / 3.0
    else:
        distance += 1.0
        decay *= distance
    return decay


def _horizontal_offset(
    a: FloatArray, b: FloatArray, parameters: KernelParameters
) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    length_scales = np.array(parameters.length_scales_m())
    a, b = a / length_scales, b / length_scales
    north = np.subtract.outer(a[:, 0], b[:, 0])
    east = np.subtract.outer(a[:, 1], b[:, 1])
    return (north, east), _distances(a, b)


def _distances(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distance of each of n points from each of m, shape ``(n, m)``."""
    # Here: a station that starts need not wait for it. The package and not its module, which would
    # be found half made where another thread imports the package meanwhile.
    from scipy.spatial import distance

    return np.asarray(distance.cdist(a, b), dtype=np.float64)


def _radial_derivatives(
    distance: FloatArray, parameters: KernelParameters
) -> tuple[FloatArray, FloatArray]:
    r"""Return :math:`k' / d` and :math:`(k'' - k' / d) / d^2` by the scaled distance :math:`d`.

    With these the derivative of the kernel by the scaled offset :math:`u_i` is ``first u_i``, and
    the second one by :math:`u_i, u_j` is ``first [i = j] + second u_i u_j``.
    """
    variance = parameters.signal_variance
    if parameters.shape == "squared_exponential":
        value = variance * np.exp(-0.5 * np.square(distance))
        return -value, value
    if parameters.shape == "matern52":
        decay = variance * np.exp(-_ROOT_5 * distance)
        return -5.0 / 3.0 * (1.0 + _ROOT_5 * distance) * decay, 25.0 / 3.0 * decay
    if parameters.shape == "matern32":
        decay = variance * np.exp(-_ROOT_3 * distance)
        # 3 sqrt(3) / d is infinite at d = 0, where it is only ever multiplied by offsets of 0
        return -3.0 * decay, 3.0 * _ROOT_3 * decay / np.maximum(distance, 1e-12)
    raise ValueError("a field with a Matern-1/2 kernel has no gradient: choose a smoother shape")
