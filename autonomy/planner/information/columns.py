"""Compiled preparation of staged edges for information gain: their points and whitened columns."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel
from autonomy.planner.graph import STAGED, Graph, first_staged
from autonomy.planner.information.cholesky import half_log_determinant
from autonomy.planner.information.covariance import (
    correlation,
    difference_correlation,
    displacement_noise,
    fill_block,
)
from autonomy.planner.information.information import BAND, Float32Array, Information
from autonomy.planner.position_error import SURFACE_M

_TIME, _DIVE, _VARIANCE, _ADDED = range(4)
"""Columns of ``Stack.run``."""


@inner_kernel
def whiten(graph: Graph, info: Information) -> None:
    """Put the points of every staged edge on the stack and whiten their columns.

    Whitened columns are ``L^-1 k(past, points)``; all are products of large matrices.
    """
    stack, size = info.stack, info.past.shape[1]
    rows = 0
    for staged in range(graph.tally[STAGED]):
        stack.begin[staged] = rows
        rows = _average_points(graph, info, staged, rows)
        _find_noise(info, staged, rows)
    stack.begin[graph.tally[STAGED]] = rows
    if rows == 0 or size == 0:
        return
    columns = stack.columns[: size * rows].reshape(size, rows)
    white = stack.whitened[: size * rows].reshape(size, rows)
    fill_block(info.covariance, info.past, 0, stack.place, 0, info.distance, columns)
    at = 0
    for first in range(0, size, BAND):
        last = min(first + BAND, size)
        band = info.inverse[at : at + (last - first) * last].reshape(last - first, last)
        np.dot(band, columns[:last], white[first:last])
        at += (last - first) * last
    for i in range(rows):
        for j in range(size):
            stack.white[i, j] = white[j, i]


@inner_kernel
def find_own_gains(graph: Graph, info: Information) -> None:
    """Set the covariances among the points of every staged edge, and the gain of the edge alone."""
    stack = info.stack
    for staged in range(graph.tally[STAGED]):
        begin, end = stack.begin[staged], stack.begin[staged + 1]
        k = end - begin
        own, factor = stack.own[staged, :k, :k], info.chains.factor
        fill_block(info.covariance, stack.place, begin, stack.place, begin, info.distance, own)
        own += stack.noise[staged, :k, :k]
        if info.white.shape[2] > 0:
            _subtract_product(info, stack.white[begin:end], own)
        factor[:k, :k] = own
        stack.gain[staged] = half_log_determinant(factor, k) - stack.half_noise[staged]


@inner_kernel
def _subtract_product(info: Information, columns: Float32Array, matrix: FloatArray) -> None:
    """Subtract ``columns columns^T`` of a few points."""
    k = len(columns)
    product = info.chains.work[2][: k * k].reshape(k, k)
    np.dot(columns, columns.T, product)
    matrix -= product


@inner_kernel
def _average_points(graph: Graph, info: Information, staged: int, row: int) -> int:
    """Average runs of planned points until few enough are left.

    The noise of a run's measurements is that of their mean; the error of its position is one for
    all of them, but at the surface, where every fix has its own.

    Returns:
        The row behind the last one that was written.
    """
    number = graph.staged_point_count[staged]
    length = -(-number // info.place.shape[2])
    place, run = info.stack.place, info.stack.run
    variance = info.stack.noise[staged]
    began, dive = 0.0, 0
    for at, begin in enumerate(range(0, number, length)):
        end = min(begin + length, number)
        place[:, row] = 0.0
        run[at] = 0.0
        measured = 0.0
        for i in range(begin, end):
            point = graph.staged_points[staged, i]
            part = 1.0 / (end - begin)
            for axis in range(3):
                place[axis, row] += part * (point[1 + axis] - info.origin[axis])
            run[at, _TIME] += part * (point[0] - began)
            run[at, _VARIANCE] += part * point[4] * point[4]
            if i == (begin + end) // 2:
                run[at, _DIVE] = dive
            measured += part * part * _level_noise(info, point[4])
            if point[3] <= SURFACE_M:
                began = point[0]
                dive += 1
        for axis in range(3):
            place[axis, row] *= info.scale[axis]
        variance[at, at] = measured
        if info.sample_noise.is_continuous:
            added = displacement_noise(info.covariance, math.sqrt(run[at, _VARIANCE]))
            run[at, _ADDED] = math.sqrt(max(added, 0.0))
        row += 1
    return row


@inner_kernel
def _level_noise(info: Information, position_std: float) -> float:
    """Return the noise that samples do not share: the measurement's, or that of a level."""
    noise = info.sample_noise
    if noise.is_continuous:
        return float(noise.level_noise[0])
    return float(noise.level_noise[np.searchsorted(noise.threshold, position_std)])


@inner_kernel
def _find_noise(info: Information, staged: int, end: int) -> None:
    """Set the covariance of the noise of a staged edge's points (``position_error``)."""
    stack = info.stack
    begin = stack.begin[staged]
    k = end - begin
    noise, factor = stack.noise[staged], info.chains.factor
    for i in range(k):
        own = noise[i, i]
        for j in range(i):
            noise[i, j] = noise[j, i] = _shared_noise(info, begin, i, j)
        noise[i, i] = own + stack.run[i, _ADDED] * stack.run[i, _ADDED]
    for i in range(k):
        for j in range(i, k):
            factor[i, j] = noise[i, j] + _fine_covariance(info, begin + i, begin + j)
    stack.half_noise[staged] = half_log_determinant(factor, k)


@inner_kernel
def _fine_covariance(info: Information, i: int, j: int) -> float:
    """Return the covariance of what lies between test points at two points of the stack."""
    square = 0.0
    for axis in range(3):
        square += (info.stack.place[axis, i] - info.stack.place[axis, j]) ** 2
    near = info.fine.nearness * info.fine.nearness
    return info.fine.variance * correlation(info.covariance, near * square)


@inner_kernel
def _shared_noise(info: Information, begin: int, i: int, j: int) -> float:
    """Return the covariance of what position errors add to two points of a staged edge."""
    one, other = info.stack.run[i], info.stack.run[j]
    if one[_ADDED] * other[_ADDED] == 0.0 or one[_DIVE] != other[_DIVE]:
        return 0.0
    current = info.sample_noise.unknown_current_std_m_s
    std, other_std = math.sqrt(one[_VARIANCE]), math.sqrt(other[_VARIANCE])
    carried = min(current * max(one[_TIME], 0.0), std)
    other_carried = min(current * max(other[_TIME], 0.0), other_std)
    walked = min(std * std - carried * carried, other_std * other_std - other_carried**2)
    alike = (walked + carried * other_carried) / (std * other_std)
    place = info.stack.place
    alike *= difference_correlation(
        info.covariance,
        place[0, begin + i] - place[0, begin + j],
        place[1, begin + i] - place[1, begin + j],
        place[2, begin + i] - place[2, begin + j],
    )
    return float(one[_ADDED] * other[_ADDED] * alike)


@inner_kernel
def copy_columns(graph: Graph, info: Information, source: int, target: int) -> None:
    """Copy an edge's points and columns to a kept or elite edge."""
    first = first_staged(graph)
    if source < first:
        info.samples[target] = info.samples[source]
        info.place[target] = info.place[source]
        info.noise[target] = info.noise[source]
        info.half_noise[target] = info.half_noise[source]
        info.white[target] = info.white[source]
        return
    stack, staged = info.stack, source - first
    begin, end = stack.begin[staged], stack.begin[staged + 1]
    k = end - begin
    info.samples[target] = k
    info.place[target, :, :k] = stack.place[:, begin:end]
    info.noise[target, :k, :k] = stack.noise[staged, :k, :k]
    info.half_noise[target] = stack.half_noise[staged]
    info.white[target, :k] = stack.white[begin:end]
