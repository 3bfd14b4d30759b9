"""Covariance of the field between scaled points, compiled, for every shape of kernel."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel
from autonomy.planner.belief import FieldBelief
from autonomy.planner.position_error import difference_step_m

_FAR = 50.0
"""Beyond this scaled distance a covariance counts as that at this distance, which is nothing."""


class Covariance(NamedTuple):
    """A kernel ``s² (1 + a t + b t²) exp(-t)`` of the distance t, or of its square."""

    signal_variance: float
    linear: float
    quadratic: float
    is_squared: bool
    displaced: float
    """Scaled distance of a position that is off by 1 m along north and along east."""
    step_north: float
    """Scaled displacement to the north by which differences of the field are compared."""
    step_east: float


_SHAPES = {
    "matern12": (1.0, 0.0, 0.0, False),
    "matern32": (math.sqrt(3.0), 1.0, 0.0, False),
    "matern52": (math.sqrt(5.0), 1.0, 1.0 / 3.0, False),
    "squared_exponential": (math.sqrt(0.5), 0.0, 0.0, True),
}
"""What the distance in length scales is multiplied with, a, b, and whether it is squared."""


def covariance_of(belief: FieldBelief) -> Covariance:
    """Return the kernel of a belief as compiled code takes it."""
    _, linear, quadratic, is_squared = _SHAPES[belief.shape]
    scale = scale_of(belief)
    displaced = float(np.hypot(*scale[:2]))
    step_north, step_east = difference_step_m(belief) * scale[:2]
    return Covariance(
        belief.signal_variance,
        linear,
        quadratic,
        is_squared,
        displaced,
        float(step_north),
        float(step_east),
    )


def scale_of(belief: FieldBelief) -> FloatArray:
    """Return what coordinates are multiplied with before their distance is taken, ``(3,)``."""
    return _SHAPES[belief.shape][0] / np.asarray(belief.length_scales_m)


@inner_kernel
def fill_row(
    covariance: Covariance,
    point: tuple[float, float, float],
    places: FloatArray,
    begin: int,
    count: int,
    distance: FloatArray,
    row: npt.NDArray[np.floating],
) -> None:
    """Compute the covariances of one point with others, all scaled.

    The exponential is a power of its Taylor sum, which the compiler can vectorize; the error is
    below 1e-9 of the signal variance.

    Args:
        covariance: Kernel.
        point: The one point.
        places: The others, shape ``(3, n)``.
        begin: First of them that counts.
        count: How many count.
        distance: Room for as many numbers.
        row: Receives the covariances.
    """
    x, y, z = point
    for j in range(count):
        dx, dy, dz = places[0, begin + j] - x, places[1, begin + j] - y, places[2, begin + j] - z
        distance[j] = dx * dx + dy * dy + dz * dz
    if covariance.is_squared:
        for j in range(count):
            distance[j] = min(distance[j], _FAR)
    else:
        for j in range(count):
            distance[j] = min(math.sqrt(distance[j]), _FAR)
    for j in range(count):
        t = distance[j] * (-1.0 / 256.0)
        power = 1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t / 120.0))))
        for _ in range(8):
            power *= power
        t = distance[j]
        polynomial = 1.0 + t * (covariance.linear + t * covariance.quadratic)
        row[j] = covariance.signal_variance * polynomial * power


@inner_kernel
def fill_block(
    covariance: Covariance,
    ones: FloatArray,
    begin: int,
    others: FloatArray,
    other_begin: int,
    distance: FloatArray,
    block: npt.NDArray[np.floating],
) -> None:
    """Compute the covariances of some points with others, all scaled; places ``(3, n)``."""
    for i in range(len(block)):
        point = (ones[0, begin + i], ones[1, begin + i], ones[2, begin + i])
        fill_row(covariance, point, others, other_begin, block.shape[1], distance, block[i])


@inner_kernel
def correlation(covariance: Covariance, square: float) -> float:
    """Return the field's correlation at the square of a scaled distance."""
    t = square if covariance.is_squared else math.sqrt(square)
    polynomial = 1.0 + t * (covariance.linear + t * covariance.quadratic)
    return polynomial * math.exp(-t)


@inner_kernel
def displacement_noise(covariance: Covariance, position_std: float) -> float:
    """Return what a position error adds to a sample (``FieldBelief.displacement_noise``)."""
    away = covariance.displaced * position_std
    return 2.0 * covariance.signal_variance * (1.0 - correlation(covariance, away * away))


@inner_kernel
def difference_correlation(covariance: Covariance, dx: float, dy: float, dz: float) -> float:
    """Return how alike the field differs across equal displacements at two scaled places.

    This is ``position_error.difference_correlation``.
    """
    north, east = covariance.step_north, covariance.step_east
    here = correlation(covariance, dx * dx + dy * dy + dz * dz)
    along = 4.0 * here
    off = dy * dy + dz * dz
    along -= correlation(covariance, (dx + north) ** 2 + off)
    along -= correlation(covariance, (dx - north) ** 2 + off)
    off = dx * dx + dz * dz
    along -= correlation(covariance, (dy + east) ** 2 + off)
    along -= correlation(covariance, (dy - east) ** 2 + off)
    whole = 2.0 - correlation(covariance, north * north) - correlation(covariance, east * east)
    return 0.5 * along / whole
