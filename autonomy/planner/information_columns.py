"""Compiled preparation of edges for information gain: points, whitened columns, own gain."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.planner.cholesky import factorize
from autonomy.planner.graph import STAGED, Graph, first_staged
from autonomy.planner.information import TILE, Information

_FAR = 50.0


@kernel
def whiten(graph: Graph, info: Information) -> None:
    """Prepare every staged edge: average its points, whiten their columns, find its own gain.

    The points of all edges stand in a row, cut into tiles that fit the processor's cache.
    """
    first = first_staged(graph)
    last = first + graph.tally[STAGED]
    width = 0
    for edge in range(first, last):
        _average_points(graph, info, edge - first, edge)
        for j in range(info.samples[edge]):
            info.tile_place[width // TILE, :, width % TILE] = info.place[edge, j]
            width += 1
    for tile in range(-(-width // TILE)):
        used = min(width - tile * TILE, TILE)
        place, white = info.tile_place[tile], info.tile_white[tile]
        _fill_tile(info.known, place, info.signal_variance, used, info.tile_columns)
        _multiply_tile(info.inverse, info.tile_columns, used, white)
    begin = 0
    for edge in range(first, last):
        _take_columns(info, edge, begin)
        graph.edge_worth[edge] = _own_gain(info, edge)
        begin += info.samples[edge]


@kernel
def covariance(signal_variance: float, a: FloatArray, b: FloatArray) -> float:
    """Return the Matern-3/2 covariance of two scaled points."""
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    distance = math.sqrt(x * x + y * y + z * z)
    return signal_variance * (1.0 + distance) * math.exp(-distance)


@kernel
def _fill_tile(
    known: FloatArray, place: FloatArray, signal_variance: float, used: int, columns: FloatArray
) -> None:
    """Compute the covariances of the known points with one tile's points.

    The exponential is a power of its Taylor sum, which the compiler can vectorize; the error is
    below 1e-9 of the signal variance.
    """
    for i in range(len(known)):
        north, east, down = known[i]
        row = columns[i]
        for j in range(used):
            x, y, z = north - place[0, j], east - place[1, j], down - place[2, j]
            row[j] = min(math.sqrt(x * x + y * y + z * z), _FAR)
        for j in range(used):
            t = row[j] * (-1.0 / 256.0)
            power = 1.0 + t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t / 120.0))))
            for _ in range(8):
                power *= power
            row[j] = signal_variance * (1.0 + row[j]) * power


@kernel
def _multiply_tile(
    triangle: FloatArray, columns: FloatArray, used: int, product: FloatArray
) -> None:
    """Multiply a lower triangle with a tile, two rows and four columns of it at a time.

    The triangle's size must be a multiple of 4. A library's product would start threads, which
    stall a machine that has other work.
    """
    for i in range(0, len(triangle), 2):
        one, two = triangle[i], triangle[i + 1]
        upper, lower = product[i], product[i + 1]
        upper[:] = 0.0
        lower[:] = 0.0
        for m in range(0, i + 2, 4):
            a, b, c, d = one[m], one[m + 1], one[m + 2], one[m + 3]
            e, f, g, h = two[m], two[m + 1], two[m + 2], two[m + 3]
            p, q, r, s = columns[m], columns[m + 1], columns[m + 2], columns[m + 3]
            for j in range(used):
                upper[j] += a * p[j] + b * q[j] + c * r[j] + d * s[j]
                lower[j] += e * p[j] + f * q[j] + g * r[j] + h * s[j]


@kernel
def _average_points(graph: Graph, info: Information, staged: int, edge: int) -> None:
    """Average runs of planned points until few enough are left (``belief.averaged_samples``)."""
    number = graph.staged_point_count[staged]
    run = -(-number // info.place.shape[1])
    k = 0
    for begin in range(0, number, run):
        total = 0.0
        info.place[edge, k] = 0.0
        for i in range(begin, min(begin + run, number)):
            point = graph.staged_points[staged, i]
            weight = 1.0 / info.level_noise[np.searchsorted(info.threshold, point[4])]
            total += weight
            for axis in range(3):
                info.place[edge, k, axis] += weight * point[1 + axis] * info.scale[axis]
        info.place[edge, k] /= total
        info.noise[edge, k] = 1.0 / total
        k += 1
    info.samples[edge] = k


@kernel
def _take_columns(info: Information, edge: int, begin: int) -> None:
    """Copy an edge's whitened columns, of which the first is number ``begin``."""
    past = info.past
    for j in range(info.samples[edge]):
        white = info.tile_white[(begin + j) // TILE]
        column = (begin + j) % TILE
        for i in range(past):
            info.white_past[edge, j, i] = white[i, column]
        for i in range(past, len(info.known)):
            info.white_test[edge, j, i - past] = white[i, column]


@kernel
def _own_gain(info: Information, edge: int) -> float:
    """Set the covariances among an edge's points; return the gain of the edge alone."""
    k = info.samples[edge]
    explained = info.work[2][: k * k].reshape(k, k)
    explained[:, :] = np.float32(0.0)
    if info.past > 0:
        np.dot(info.white_past[edge][:k], info.white_past[edge][:k].T, explained)
    given_past, given_both = info.own[edge, 0], info.own[edge, 1]
    for a in range(k):
        for b in range(a + 1):
            given_past[a, b] = covariance(
                info.signal_variance, info.place[edge, a], info.place[edge, b]
            )
            given_past[a, b] -= explained[a, b]
        given_past[a, a] += info.noise[edge, a]
    np.dot(info.white_test[edge][:k], info.white_test[edge][:k].T, explained)
    for a in range(k):
        for b in range(a + 1):
            given_both[a, b] = given_past[a, b] - explained[a, b]
    info.factor[0, :k, :k] = given_past[:k, :k]
    info.factor[1, :k, :k] = given_both[:k, :k]
    return factorize(info.factor[0], k) - factorize(info.factor[1], k)
