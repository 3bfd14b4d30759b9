"""Compiled sums of the marginal likelihood: covariance of one component, and its derivatives.

Both go over one triangle of an ``n x n`` matrix that lies as LAPACK left it: element ``[j, i]``
with ``i >= j`` of the C-ordered view is the lower triangle of the Fortran-ordered matrix.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, kernel

SHAPE_NUMBER = {"matern12": 0, "matern32": 1, "matern52": 2, "squared_exponential": 3}
"""How the kernels below call each shape."""

_ROOT_3 = math.sqrt(3.0)
_ROOT_5 = math.sqrt(5.0)


@inlined_kernel
def exponential(shape: int, squared: float, lag: float) -> float:
    """Return the exponential in a correlation.

    Args:
        shape: One of ``SHAPE_NUMBER``.
        squared: Squared distance in length scales.
        lag: Time between the samples over the memory of the field.
    """
    if shape == 0:
        return math.exp(-math.sqrt(squared) - lag)
    if shape == 1:
        return math.exp(-_ROOT_3 * math.sqrt(squared) - lag)
    if shape == 2:
        return math.exp(-_ROOT_5 * math.sqrt(squared) - lag)
    return math.exp(-0.5 * squared - lag)


@inlined_kernel
def correlation(shape: int, squared: float, decay: float) -> tuple[float, float]:
    r"""Return a correlation and its slope.

    Args:
        shape: One of ``SHAPE_NUMBER``.
        squared: Squared distance in length scales, :math:`d^2`.
        decay: Its ``exponential``.

    Returns:
        The correlation :math:`c`, and :math:`-c'(d) / d`: times the squared distance along one
        axis, in length scales, it is the derivative by the logarithm of that axis' length scale.
    """
    if shape == 0:
        return decay, decay / math.sqrt(squared) if squared > 0.0 else 0.0
    if shape == 1:
        return (1.0 + _ROOT_3 * math.sqrt(squared)) * decay, 3.0 * decay
    if shape == 2:
        scaled = _ROOT_5 * math.sqrt(squared)
        slope = 5.0 / 3.0 * (1.0 + scaled) * decay
        return (1.0 + scaled + scaled * scaled / 3.0) * decay, slope
    return decay, decay


@kernel
def add_covariance(
    total: FloatArray,
    decays: FloatArray,
    scaled_axes: FloatArray,
    age: FloatArray,
    weights: FloatArray,
    shape: int,
    signal_variance: float,
    first: int,
) -> None:
    """Add ``signal w_i w_j c_ij`` of the samples from ``first`` on to one triangle of ``total``.

    Args:
        total: Shape ``(n, n)``, C order; elements ``[j, i]`` with ``i >= j`` change.
        decays: Gets the exponentials of the same elements, shape ``(n, n)``.
        scaled_axes: Positions over length scales, an axis a row, shape ``(3, n)``.
        age: Time of each sample over the memory of the field, shape ``(n,)``.
        weights: Share of this component in each sample, shape ``(n,)``.
        shape: One of ``SHAPE_NUMBER``.
        signal_variance: Prior variance of the component.
        first: Samples before this one have no part in the component.
    """
    x, y, z = scaled_axes[0], scaled_axes[1], scaled_axes[2]
    for j in range(first, len(age)):
        row, kept = total[j], decays[j]
        factor = signal_variance * weights[j]
        for i in range(j, len(age)):
            dx, dy, dz = x[i] - x[j], y[i] - y[j], z[i] - z[j]
            squared = dx * dx + dy * dy + dz * dz
            decay = exponential(shape, squared, abs(age[i] - age[j]))
            kept[i] = decay
            row[i] += factor * weights[i] * correlation(shape, squared, decay)[0]


@kernel
def contract(
    inverse: FloatArray,
    alpha: FloatArray,
    decays: FloatArray,
    scaled_axes: FloatArray,
    weights: FloatArray,
    powers: FloatArray,
    shape: int,
    first: int,
    traces: FloatArray,
    products: FloatArray,
) -> None:
    r"""Sum the derivatives of one component, :math:`\partial K`, with two known matrices.

    The derivatives are by the logarithms of signal variance, the three length scales and the
    scale factor between levels, for a signal variance of 1.

    Args:
        inverse: ``K^-1``, shape ``(n, n)``, C order; only ``[j, i]`` with ``i >= j`` is read.
        alpha: ``K^-1 y``, shape ``(n,)``.
        decays: As ``add_covariance`` left them.
        scaled_axes: Positions over length scales, an axis a row, shape ``(3, n)``.
        weights: Share of this component in each sample, shape ``(n,)``.
        powers: Power of the scale factor in each weight, shape ``(n,)``; none where its derivative
            is not asked for.
        shape: One of ``SHAPE_NUMBER``.
        first: Samples before this one have no part in the component.
        traces: Gets :math:`\frac12 tr(K^{-1} \partial K)`, shape ``(5,)``.
        products: Gets :math:`\partial K \alpha`, shape ``(5, n)``; zeros before.
    """
    x, y, z = scaled_axes[0], scaled_axes[1], scaled_axes[2]
    whole, along_x, along_y, along_z, powered = (
        products[0],
        products[1],
        products[2],
        products[3],
        products[4],
    )
    has_powers = len(powers) > 0
    by_signal, by_x, by_y, by_z, by_factor = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(first, len(alpha)):
        row, kept, mine = inverse[j], decays[j], alpha[j]
        power = powers[j] if has_powers else 0.0
        own = weights[j] * weights[j]
        sum_whole, sum_x, sum_y, sum_z, sum_powered = own * mine, 0.0, 0.0, 0.0, 0.0
        sum_powered += 2.0 * power * own * mine
        by_signal += 0.5 * row[j] * own
        by_factor += row[j] * power * own
        for i in range(j + 1, len(alpha)):
            dx, dy, dz = x[i] - x[j], y[i] - y[j], z[i] - z[j]
            dx, dy, dz = dx * dx, dy * dy, dz * dz
            value, slope = correlation(shape, dx + dy + dz, kept[i])
            share = weights[i] * weights[j]
            value *= share
            slope *= share
            dx *= slope
            dy *= slope
            dz *= slope
            by_signal += row[i] * value
            by_x += row[i] * dx
            by_y += row[i] * dy
            by_z += row[i] * dz
            whole[i] += value * mine
            along_x[i] += dx * mine
            along_y[i] += dy * mine
            along_z[i] += dz * mine
            sum_whole += value * alpha[i]
            sum_x += dx * alpha[i]
            sum_y += dy * alpha[i]
            sum_z += dz * alpha[i]
            if has_powers:
                both = (powers[i] + power) * value
                by_factor += row[i] * both
                powered[i] += both * mine
                sum_powered += both * alpha[i]
        whole[j] += sum_whole
        along_x[j] += sum_x
        along_y[j] += sum_y
        along_z[j] += sum_z
        powered[j] += sum_powered
    traces[0], traces[1], traces[2], traces[3] = by_signal, by_x, by_y, by_z
    traces[4] = by_factor


def warm_up() -> None:
    """Compile every kernel of this module, or load it from the cache."""
    axes, ones, square = np.zeros((3, 2)), np.ones(2), np.eye(2)
    add_covariance(square, square.copy(), axes, ones, ones, 1, 1.0, 0)
    contract(square, ones, square, axes, ones, ones, 1, 0, np.zeros(5), np.zeros((5, 2)))
