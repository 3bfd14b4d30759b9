"""Which samples to keep when there are more than a Gaussian process can hold."""

import numpy as np

from autonomy.arrays import FloatArray, IntArray


def space_filling(points: FloatArray, count: int, length_scales_m: tuple[float, ...]) -> IntArray:
    """Choose samples that lie as far from each other as possible.

    Farthest-point selection: begin with the sample nearest to the middle, then always take the
    one farthest from those already taken; samples at one place are taken last. ``O(n count)``.

    Args:
        points: Where the samples were taken, shape ``(n, 3)``, m.
        count: How many to keep.
        length_scales_m: Distance along each axis over which the field stays alike; distances are
            measured in these.

    Returns:
        Ascending indices of the kept samples, shape ``(min(n, count),)``.
    """
    if count >= len(points):
        return np.arange(len(points))
    scaled = points / np.asarray(length_scales_m)
    next_one = int(np.argmin(_squared_distance(scaled, scaled.mean(axis=0))))
    distance = np.full(len(scaled), np.inf)
    kept = np.empty(count, dtype=np.int64)
    for i in range(count):
        kept[i] = next_one
        distance = np.minimum(distance, _squared_distance(scaled, scaled[next_one]))
        distance[next_one] = -1.0
        next_one = int(np.argmax(distance))
    return np.sort(kept)


def _squared_distance(points: FloatArray, centre: FloatArray) -> FloatArray:
    offset = points - centre
    return np.einsum("nd,nd->n", offset, offset)
