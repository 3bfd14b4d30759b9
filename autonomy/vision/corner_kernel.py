"""Compiled line fit of a tag's corners; ``autonomy.vision.corner`` says what it does."""

import math
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel

Picture: TypeAlias = npt.NDArray[np.uint8]

FROM_SHARE, TO_SHARE = 0.09, 0.91
"""Part of a side along which its edge is sampled."""
FEWEST_SAMPLES, MOST_SAMPLES = 12, 60
REACH_CELLS, LEAST_REACH_PX, GREATEST_REACH_PX = 0.9, 1.2, 4.0
"""How far across the edge a profile goes, on either side."""
STEP_PX = 0.25
"""Between two places of a profile."""
TAIL = 0.15
"""The gradient counts where it is above this part of its peak."""
FAINT = 0.3
"""A sample counts whose peak is above this part of the side's median."""
LEAST_RISE = 0.001
"""Rise of light over two steps of a profile below which there is no edge."""
LEAST_SHARE = 0.5
"""So many of a side's samples must count."""
ROUNDS = 3
REWEIGHTINGS = 5
OUTLYING = 2.5
"""Distance from the line, in standard deviations, from which on a sample counts less."""
LEAST_SCATTER_PX = 0.01
CELLS = 8
MAD_TO_STD = 1.4826
TAIL_VARIANCE = 0.755
"""Part of a Gaussian's variance that is left when its tails below 15 % of the peak are cut off."""
BOX_VARIANCE_PX2 = 0.25 + STEP_PX**2 / 3.0
"""What pixels, interpolation and differences add to the square of a gradient's width."""


@inner_kernel
def _light(picture: Picture, table: FloatArray, u: float, v: float) -> float:
    """Return the light at a place between pixels; NaN outside of the picture."""
    height, width = picture.shape
    if not (0.0 <= u <= width - 1.0 and 0.0 <= v <= height - 1.0):
        return math.nan
    i, j = min(int(v), height - 2), min(int(u), width - 2)
    b, a = v - i, u - j
    top = (1.0 - a) * table[picture[i, j]] + a * table[picture[i, j + 1]]
    bottom = (1.0 - a) * table[picture[i + 1, j]] + a * table[picture[i + 1, j + 1]]
    return float((1.0 - b) * top + b * bottom)


@inner_kernel
def _median(values: FloatArray) -> float:
    """Return the median of few values, by insertion."""
    n = values.shape[0]
    ordered = values.copy()
    for i in range(1, n):
        value = ordered[i]
        j = i
        while j > 0 and ordered[j - 1] > value:
            ordered[j] = ordered[j - 1]
            j -= 1
        ordered[j] = value
    return float(0.5 * (ordered[(n - 1) // 2] + ordered[n // 2]))


@inner_kernel
def _crossing(
    picture: Picture,
    table: FloatArray,
    u: float,
    v: float,
    out_u: float,
    out_v: float,
    half: int,
    light: FloatArray,
) -> tuple[float, float, float]:
    """Return peak, centroid and variance of a profile's gradient; peak 0 if there is none."""
    for j in range(2 * half + 1):
        way = STEP_PX * (j - half)
        light[j] = _light(picture, table, u + way * out_u, v + way * out_v)
    peak, at = 0.0, -1
    for j in range(1, 2 * half):
        rise = light[j + 1] - light[j - 1]
        if not rise < math.inf:
            return 0.0, 0.0, 0.0
        if rise > peak:
            peak, at = rise, j
    if at < 0:
        return 0.0, 0.0, 0.0
    first, last = at, at
    while first > 1 and light[first] - light[first - 2] > TAIL * peak:
        first -= 1
    while last < 2 * half - 1 and light[last + 2] - light[last] > TAIL * peak:
        last += 1
    total, mean = 0.0, 0.0
    for j in range(first, last + 1):
        rise = light[j + 1] - light[j - 1]
        total += rise
        mean += rise * STEP_PX * (j - half)
    mean /= total
    variance = 0.0
    for j in range(first, last + 1):
        rise = light[j + 1] - light[j - 1]
        variance += rise * (STEP_PX * (j - half) - mean) ** 2
    return peak, mean, variance / total


@inner_kernel
def _straight(along: FloatArray, across: FloatArray) -> tuple[float, float]:
    """Return offset and slope of the line through points of which a few are outliers."""
    n = along.shape[0]
    weight, off = np.ones(n), np.empty(n)
    offset, slope = 0.0, 0.0
    for _ in range(REWEIGHTINGS):
        total, mean_a, mean_c = 0.0, 0.0, 0.0
        for i in range(n):
            total += weight[i]
            mean_a += weight[i] * along[i]
            mean_c += weight[i] * across[i]
        mean_a /= total
        mean_c /= total
        square, product = 0.0, 0.0
        for i in range(n):
            square += weight[i] * (along[i] - mean_a) ** 2
            product += weight[i] * (along[i] - mean_a) * (across[i] - mean_c)
        slope = product / square if square > 0.0 else 0.0
        offset = mean_c - slope * mean_a
        for i in range(n):
            off[i] = abs(across[i] - offset - slope * along[i])
        limit = OUTLYING * max(MAD_TO_STD * _median(off), LEAST_SCATTER_PX)
        for i in range(n):
            weight[i] = 1.0 if off[i] <= limit else limit / off[i]
    return offset, slope


@inner_kernel
def _side(
    picture: Picture,
    table: FloatArray,
    corners: FloatArray,
    k: int,
    area: float,
    line: FloatArray,
) -> float:
    """Write a point of a side's line and its direction; return its variance, or -1 where it is not.

    The inside lies to the right of the way from corner ``k`` to the next.
    """
    m = (k + 1) % 4
    du, dv = corners[m, 0] - corners[k, 0], corners[m, 1] - corners[k, 1]
    length = math.hypot(du, dv)
    if not length > 1.0:
        return -1.0
    du, dv = du / length, dv / length
    reach = REACH_CELLS * area / length / CELLS
    half = int(min(max(reach, LEAST_REACH_PX), GREATEST_REACH_PX) / STEP_PX)
    n = int(min(max(length, FEWEST_SAMPLES), MOST_SAMPLES))
    light = np.empty(2 * half + 1)
    along, across = np.empty(n), np.empty(n)
    peaks, spread = np.empty(n), np.empty(n)
    for i in range(n):
        along[i] = length * (FROM_SHARE + (TO_SHARE - FROM_SHARE) * i / (n - 1))
        u, v = corners[k, 0] + along[i] * du, corners[k, 1] + along[i] * dv
        peaks[i], across[i], spread[i] = _crossing(picture, table, u, v, dv, -du, half, light)
    least, kept = max(FAINT * _median(peaks), LEAST_RISE), 0
    for i in range(n):
        if peaks[i] > least:
            along[kept], across[kept], spread[kept] = along[i], across[i], spread[i]
            kept += 1
    if kept < LEAST_SHARE * n:
        return -1.0
    offset, slope = _straight(along[:kept], across[:kept])
    line[0] = corners[k, 0] + offset * dv
    line[1] = corners[k, 1] - offset * du
    line[2], line[3] = du + slope * dv, dv - slope * du
    return _median(spread[:kept])


@kernel
def fit_into(picture: Picture, table: FloatArray, corners: FloatArray) -> float:
    """Move a tag's corners to where the lines through its edges meet; return how wide edges are.

    Args:
        picture: Grey values, shape ``(rows, columns)``, uint8.
        table: Light of each grey value, shape ``(256,)``.
        corners: In order, shape ``(4, 2)``, px; are left as they were where there is no fit.

    Returns:
        Mean square of the width of the gradients, px^2; -1 if there is no fit.
    """
    found, lines = corners.copy(), np.empty((4, 4))
    variance = 0.0
    for _ in range(ROUNDS):
        area = 0.0
        for k in range(4):
            m = (k + 1) % 4
            area += 0.5 * (found[k, 0] * found[m, 1] - found[m, 0] * found[k, 1])
        variance = 0.0
        for k in range(4):
            spread = _side(picture, table, found, k, area, lines[k]) if area > 0.0 else -1.0
            if spread < 0.0:
                return -1.0
            variance += 0.25 * spread
        for k in range(4):
            p, q = lines[(k + 3) % 4], lines[k]
            determinant = p[2] * q[3] - p[3] * q[2]
            if abs(determinant) < 1e-3 * math.hypot(p[2], p[3]) * math.hypot(q[2], q[3]):
                return -1.0
            way = ((q[0] - p[0]) * q[3] - (q[1] - p[1]) * q[2]) / determinant
            found[k, 0], found[k, 1] = p[0] + way * p[2], p[1] + way * p[3]
    corners[:] = found
    return variance


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    picture = np.full((32, 32), 255, dtype=np.uint8)
    picture[8:24, 8:24] = 0
    corners = np.array([[7.5, 7.5], [23.5, 7.5], [23.5, 23.5], [7.5, 23.5]])
    fit_into(picture, np.linspace(0.0, 1.0, 256), corners)
