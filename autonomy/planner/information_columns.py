"""Compiled preparation of edges for information gain: points, whitened columns, own gain."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.planner.graph import STAGED, Graph, first_staged
from autonomy.planner.information import Information

_TINY_VARIANCE = 1e-12


@kernel
def whiten(graph: Graph, info: Information) -> None:
    """Prepare every staged edge."""
    first = first_staged(graph)
    last = first + graph.tally[STAGED]
    width = 0
    for edge in range(first, last):
        _average_points(graph, info, edge - first, edge)
        width += info.samples[edge]
    size = len(info.known)
    columns = info.columns[0][: size * width].reshape(size, width)
    white = info.columns[1][: size * width].reshape(size, width)
    at = 0
    for edge in range(first, last):
        for i in range(size):
            for j in range(info.samples[edge]):
                columns[i, at + j] = covariance(info, info.known[i], info.place[edge, j])
        at += info.samples[edge]
    np.dot(info.inverse, columns, white)
    at = 0
    for edge in range(first, last):
        graph.edge_worth[edge] = _take_columns(info, edge, white, at)
        at += info.samples[edge]


@kernel
def covariance(info: Information, a: FloatArray, b: FloatArray) -> float:
    """Return the Matern-3/2 covariance of two scaled points."""
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    distance = math.sqrt(x * x + y * y + z * z)
    return info.signal_variance * (1.0 + distance) * math.exp(-distance)


@kernel
def factorize(matrix: FloatArray, k: int) -> float:
    """Cholesky-factorize the lower triangle in place; return half its log-determinant.

    A pivot that rounding brought below the smallest sensible variance is raised to it.
    """
    total = 0.0
    for j in range(k):
        for i in range(j, k):
            value = matrix[i, j]
            for m in range(j):
                value -= matrix[i, m] * matrix[j, m]
            if i == j:
                root = math.sqrt(max(value, _TINY_VARIANCE))
                total += math.log(root)
                matrix[j, j] = root
            else:
                matrix[i, j] = value / matrix[j, j]
    return total


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
            weight = 1.0 / (info.noise_variance + info.noise_factor * point[4] * point[4])
            total += weight
            for axis in range(3):
                info.place[edge, k, axis] += weight * point[1 + axis] * info.scale[axis]
        info.place[edge, k] /= total
        info.noise[edge, k] = 1.0 / total
        k += 1
    info.samples[edge] = k


@kernel
def _take_columns(info: Information, edge: int, white: FloatArray, at: int) -> float:
    """Copy an edge's whitened columns, set its own covariances; return its gain."""
    k, past = info.samples[edge], info.past
    size = len(info.known)
    for j in range(k):
        for i in range(past):
            info.white_past[edge, j, i] = white[i, at + j]
        for i in range(past, size):
            info.white_test[edge, j, i - past] = white[i, at + j]
    given_past, given_both = info.own[edge, 0], info.own[edge, 1]
    for a in range(k):
        for b in range(a + 1):
            from_past = 0.0
            for i in range(past):
                from_past += white[i, at + a] * white[i, at + b]
            from_test = 0.0
            for i in range(past, size):
                from_test += white[i, at + a] * white[i, at + b]
            prior = covariance(info, info.place[edge, a], info.place[edge, b])
            if a == b:
                prior += info.noise[edge, a]
            given_past[a, b] = prior - from_past
            given_both[a, b] = prior - from_past - from_test
    info.factor[0, :k, :k] = given_past[:k, :k]
    info.factor[1, :k, :k] = given_both[:k, :k]
    return factorize(info.factor[0], k) - factorize(info.factor[1], k)
