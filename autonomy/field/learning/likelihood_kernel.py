"""Compiled sums of the marginal likelihood: covariance of one component, and its derivatives.

Samples are sorted by level, so that a component's share is the same along a run of each row, and
inner loops are plain enough for vector instructions. Matrices lie as LAPACK left them: element
``[j, i]`` with ``i >= j`` of the C-ordered view is the lower triangle of the Fortran-ordered one.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.compiled import inlined_kernel, summing_kernel

SHAPE_NUMBER = {"matern12": 0, "matern32": 1, "matern52": 2, "squared_exponential": 3}
"""How the kernels below call each shape."""

_ROOT_3 = math.sqrt(3.0)
_ROOT_5 = math.sqrt(5.0)


@inlined_kernel
def _squared(x: float, y: float, z: float) -> float:
    return x * x + y * y + z * z


@inlined_kernel
def correlation(shape: int, squared: float, decay: float) -> tuple[float, float]:
    r"""Return a correlation and its slope.

    Args:
        shape: One of ``SHAPE_NUMBER``.
        squared: Squared distance in length scales, :math:`d^2`.
        decay: Exponential of what ``fill_exponents`` gives.

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


@summing_kernel
def fill_exponents(
    exponents: FloatArray, scaled_axes: FloatArray, age: FloatArray, shape: int
) -> None:
    """Put in what the correlations' exponentials are of.

    Args:
        exponents: Shape ``(m, m)``; overwritten.
        scaled_axes: Positions over length scales, an axis a row, shape ``(3, m)``.
        age: Time of each sample over the memory of the field, shape ``(m,)``.
        shape: One of ``SHAPE_NUMBER``.
    """
    x, y, z = scaled_axes[0], scaled_axes[1], scaled_axes[2]
    root = 1.0 if shape == 0 else _ROOT_3 if shape == 1 else _ROOT_5
    for j in range(len(age)):
        row = exponents[j]
        if shape == 3:
            for i in range(len(age)):
                squared = _squared(x[i] - x[j], y[i] - y[j], z[i] - z[j])
                row[i] = -0.5 * squared - abs(age[i] - age[j])
        else:
            for i in range(len(age)):
                squared = _squared(x[i] - x[j], y[i] - y[j], z[i] - z[j])
                row[i] = -root * math.sqrt(squared) - abs(age[i] - age[j])


@summing_kernel
def add_covariance(
    total: FloatArray,
    decays: FloatArray,
    scaled_axes: FloatArray,
    shares: FloatArray,
    bounds: IntArray,
    shape: int,
    signal_variance: float,
) -> None:
    """Add one component's covariance of the samples that have a part in it.

    Args:
        total: Shape ``(n, n)``, C order; elements ``[j, i]`` with ``i >= j`` of the last ``m``
            samples change.
        decays: Exponentials of what ``fill_exponents`` gives, shape ``(m, m)``.
        scaled_axes: Positions over length scales, an axis a row, shape ``(3, m)``.
        shares: Share of the component in each level that has a part in it, shape ``(k,)``.
        bounds: Where each level's samples begin among the ``m``, and ``m``, shape ``(k + 1,)``.
        shape: One of ``SHAPE_NUMBER``.
        signal_variance: Prior variance of the component.
    """
    x, y, z = scaled_axes[0], scaled_axes[1], scaled_axes[2]
    first = len(total) - len(decays)
    for a in range(len(shares)):
        for j in range(bounds[a], bounds[a + 1]):
            row, kept = total[first + j, first:], decays[j]
            for b in range(a, len(shares)):
                factor = signal_variance * shares[a] * shares[b]
                for i in range(max(j, bounds[b]), bounds[b + 1]):
                    squared = _squared(x[i] - x[j], y[i] - y[j], z[i] - z[j])
                    row[i] += factor * correlation(shape, squared, kept[i])[0]


@summing_kernel
def contract(
    inverse: FloatArray,
    alpha: FloatArray,
    decays: FloatArray,
    scaled_axes: FloatArray,
    shares: FloatArray,
    bounds: IntArray,
    shape: int,
    pairs: FloatArray,
    traces: FloatArray,
    wholes: FloatArray,
    products: FloatArray,
) -> None:
    r"""Sum one component's correlations, and their derivatives, with two known matrices.

    The derivatives :math:`\partial K` are by the logarithms of the three length scales, for a
    signal variance of 1. Correlations :math:`c` are summed without the shares, level by level:
    what depends on signal variance and scale factors follows from that.

    Args:
        inverse: ``K^-1``, shape ``(n, n)``, C order; 0 at ``[j, i]`` with ``i < j``.
        alpha: ``K^-1 y`` of the last ``m`` samples, shape ``(m,)``.
        decays: Exponentials of what ``fill_exponents`` gives, shape ``(m, m)``.
        scaled_axes: Positions over length scales, an axis a row, shape ``(3, m)``.
        shares: As in ``add_covariance``, shape ``(k,)``.
        bounds: As in ``add_covariance``, shape ``(k + 1,)``.
        shape: One of ``SHAPE_NUMBER``.
        pairs: Gets, where it has zeros, half the sum of :math:`K^{-1}_{ij} c_{ij}` over samples of
            levels ``a`` and ``b``, all of it at ``[a, b]`` with ``a <= b``, shape ``(k, k)``.
        traces: Gets :math:`\frac12 tr(K^{-1} \partial K)`, shape ``(3,)``.
        wholes: Gets :math:`\sum_i c_{ji} \alpha_i` over the samples ``i`` of level ``b`` at
            ``[b, j]``, shape ``(k, m)``.
        products: Gets :math:`\partial K \alpha`, shape ``(3, m)``.
    """
    x, y, z = scaled_axes[0], scaled_axes[1], scaled_axes[2]
    first = len(inverse) - len(alpha)
    trace_x, trace_y, trace_z = 0.0, 0.0, 0.0
    for a in range(len(shares)):
        for j in range(bounds[a], bounds[a + 1]):
            row, kept = inverse[first + j, first:], decays[j]
            product_x, product_y, product_z = 0.0, 0.0, 0.0
            for b in range(len(shares)):
                whole, along_x, along_y, along_z = 0.0, 0.0, 0.0, 0.0
                pair, by_x, by_y, by_z = 0.0, 0.0, 0.0, 0.0
                for i in range(bounds[b], bounds[b + 1]):
                    dx, dy, dz = x[i] - x[j], y[i] - y[j], z[i] - z[j]
                    dx, dy, dz = dx * dx, dy * dy, dz * dz
                    value, slope = correlation(shape, dx + dy + dz, kept[i])
                    seen, known = slope * alpha[i], slope * row[i]
                    whole += value * alpha[i]
                    along_x += dx * seen
                    along_y += dy * seen
                    along_z += dz * seen
                    pair += value * row[i]
                    by_x += dx * known
                    by_y += dy * known
                    by_z += dz * known
                both = shares[a] * shares[b]
                wholes[b, j] = whole
                product_x += both * along_x
                product_y += both * along_y
                product_z += both * along_z
                pairs[a, b] += pair
                trace_x += both * by_x
                trace_y += both * by_y
                trace_z += both * by_z
            products[0, j], products[1, j], products[2, j] = product_x, product_y, product_z
            pairs[a, a] -= 0.5 * row[j]
    traces[0], traces[1], traces[2] = trace_x, trace_y, trace_z


def warm_up() -> None:
    """Compile every kernel of this module, or load it from the cache."""
    axes, ones, square = np.zeros((3, 2)), np.ones(2), np.zeros((2, 2))
    bounds = np.array([0, 2])
    fill_exponents(square, axes, ones, 1)
    add_covariance(np.eye(2), square, axes, ones[:1], bounds, 1, 1.0)
    results = np.zeros((1, 1)), np.zeros(3), np.zeros((1, 2)), np.zeros((3, 2))
    contract(np.eye(2), ones, square, axes, ones[:1], bounds, 1, *results)
