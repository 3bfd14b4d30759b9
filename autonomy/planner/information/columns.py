"""Compiled preparation of staged edges for information gain: their points and whitened columns."""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel
from autonomy.planner.graph import STAGED, Graph, first_staged
from autonomy.planner.information.cholesky import half_log_determinant
from autonomy.planner.information.covariance import fill_block, noise_of
from autonomy.planner.information.information import BAND, Float32Array, Information


@inner_kernel
def whiten(graph: Graph, info: Information) -> None:
    """Put the points of every staged edge on the stack and whiten their columns.

    Whitened columns are ``L^-1 k(known, points)``; all are products of large matrices.
    """
    stack, past = info.stack, info.white_past.shape[2]
    rows = 0
    for staged in range(graph.tally[STAGED]):
        stack.begin[staged] = rows
        rows = _average_points(graph, info, staged, rows)
    stack.begin[graph.tally[STAGED]] = rows
    if rows == 0:
        return
    size = info.known.shape[1]
    columns = stack.columns[: size * rows].reshape(size, rows)
    white = stack.white[: size * rows].reshape(size, rows)
    fill_block(info.covariance, info.known, 0, stack.place, 0, info.distance, columns)
    at = 0
    for first in range(0, size, BAND):
        last = min(first + BAND, size)
        band = info.inverse[at : at + (last - first) * last].reshape(last - first, last)
        np.dot(band, columns[:last], white[first:last])
        at += (last - first) * last
    for i in range(rows):
        for j in range(past):
            stack.past[i, j] = white[j, i]
        for j in range(past, size):
            stack.test[i, j - past] = white[j, i]


@inner_kernel
def find_own_gains(graph: Graph, info: Information) -> None:
    """Set the covariances among the points of every staged edge, and the gain of the edge alone."""
    stack = info.stack
    for staged in range(graph.tally[STAGED]):
        begin, end = stack.begin[staged], stack.begin[staged + 1]
        k = end - begin
        given_past, given_both = stack.own[staged, 0, :k, :k], stack.own[staged, 1, :k, :k]
        fill_block(
            info.covariance, stack.place, begin, stack.place, begin, info.distance, given_past
        )
        for i in range(k):
            given_past[i, i] += stack.noise[begin + i]
        if info.white_past.shape[2] > 0:
            subtract_product(info, stack.past[begin:end], given_past)
        given_both[:, :] = given_past
        subtract_product(info, stack.test[begin:end], given_both)
        first, second = info.chains.factor[0], info.chains.factor[1]
        first[:k, :k] = given_past
        second[:k, :k] = given_both
        stack.gain[staged] = half_log_determinant(first, k) - half_log_determinant(second, k)


@inner_kernel
def subtract_product(info: Information, columns: Float32Array, matrix: FloatArray) -> None:
    """Subtract ``columns columns^T`` of a few points."""
    k = len(columns)
    product = info.chains.work[3][: k * k].reshape(k, k)
    np.dot(columns, columns.T, product)
    matrix -= product


@inner_kernel
def _average_points(graph: Graph, info: Information, staged: int, row: int) -> int:
    """Average runs of planned points until few enough are left (``belief.averaged_samples``).

    Returns:
        The row behind the last one that was written.
    """
    number = graph.staged_point_count[staged]
    run = -(-number // info.place.shape[2])
    place = info.stack.place
    for begin in range(0, number, run):
        total = 0.0
        place[:, row] = 0.0
        for i in range(begin, min(begin + run, number)):
            point = graph.staged_points[staged, i]
            weight = 1.0 / noise_of(info.covariance, info.sample_noise, point[4])
            total += weight
            for axis in range(3):
                place[axis, row] += weight * (point[1 + axis] - info.origin[axis])
        for axis in range(3):
            place[axis, row] *= info.scale[axis] / total
        info.stack.noise[row] = 1.0 / total
        row += 1
    return row


@inner_kernel
def copy_columns(graph: Graph, info: Information, source: int, target: int) -> None:
    """Copy an edge's points and columns to a kept or elite edge."""
    first = first_staged(graph)
    if source < first:
        info.samples[target] = info.samples[source]
        info.place[target] = info.place[source]
        info.noise[target] = info.noise[source]
        info.white_past[target] = info.white_past[source]
        info.white_test[target] = info.white_test[source]
        return
    stack = info.stack
    begin, end = stack.begin[source - first], stack.begin[source - first + 1]
    k = end - begin
    info.samples[target] = k
    info.place[target, :, :k] = stack.place[:, begin:end]
    info.noise[target, :k] = stack.noise[begin:end]
    info.white_past[target, :k] = stack.past[begin:end]
    info.white_test[target, :k] = stack.test[begin:end]
