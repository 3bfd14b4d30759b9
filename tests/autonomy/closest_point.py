"""Random problems of the closest point under one constraint in a box, solved by enumeration."""

import itertools

import numpy as np

from autonomy.arrays import BoolArray, FloatArray


def problems(
    count: int, seed: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return n, g, b, low, high with every kind of degeneracy among them."""
    rng = np.random.default_rng(seed)
    low = -rng.uniform(0.01, 1.5, (count, 2))
    high = rng.uniform(0.01, 1.5, (count, 2))
    n = rng.normal(0.0, 1.5, (count, 2))
    g = rng.normal(0.0, 1.0, (count, 2)) * 10.0 ** rng.uniform(-3.0, 1.0, (count, 2))
    b = rng.normal(0.0, 1.0, count) * np.abs(g).sum(axis=1)
    kinds = rng.integers(0, 12, count)
    g[kinds == 0, 0] = 0.0
    g[kinds == 1, 1] = 0.0
    g[kinds == 2] = 0.0
    n[kinds == 3] = high[kinds == 3]
    n[kinds == 4, 0] = low[kinds == 4, 0]
    g[kinds == 5, 1] = g[kinds == 5, 0]
    for each in (n, g, low, high):  # coarse numbers: ties and exact corners
        each[kinds == 6] = np.round(each[kinds == 6])
    b[kinds == 6] = np.round(b[kinds == 6])
    return n, g, b, np.minimum(low, high), high


def enumerated(
    n: FloatArray, g: FloatArray, b: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Try every set of active bounds and constraint; return the best point and the verdict."""
    tolerance = 1e-12 * (1.0 + np.abs(g).sum(axis=1))
    bounds = np.stack([low, high])  # (2, count, 2)
    square = np.maximum((g**2).sum(axis=1), 1e-300)
    candidates = [n, n + ((b - (g * n).sum(axis=1)) / square)[:, None] * g]
    for side, i in itertools.product((0, 1), (0, 1)):
        for other in (n[:, 1 - i], _met(g, b, bounds[side][:, i], i)):
            point = np.empty_like(n)
            point[:, i], point[:, 1 - i] = bounds[side][:, i], other
            candidates.append(point)
    for first, second in itertools.product((0, 1), (0, 1)):
        candidates.append(np.stack([bounds[first][:, 0], bounds[second][:, 1]], axis=1))
    best, distance = np.zeros_like(n), np.full(len(n), np.inf)
    for point in candidates:
        is_in = np.all((point >= low - 1e-12) & (point <= high + 1e-12), axis=1)
        is_in &= (g * point).sum(axis=1) >= b - tolerance
        away = np.where(is_in, ((point - n) ** 2).sum(axis=1), np.inf)
        best[away < distance] = point[away < distance]
        distance = np.minimum(distance, away)
    corners = np.stack([(g * point).sum(axis=1) for point in candidates[-4:]])
    return best, corners.max(axis=0) >= b


def _met(g: FloatArray, b: FloatArray, value: FloatArray, i: int) -> FloatArray:
    """Return the component other than ``i`` where the constraint holds with equality."""
    divisor = np.where(g[:, 1 - i] == 0.0, 1e-300, g[:, 1 - i])
    return np.clip((b - g[:, i] * value) / divisor, -1e9, 1e9)
