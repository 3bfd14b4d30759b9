"""Information gain of paths that a staged edge extends, compiled.

The gain of a path is ``1/2 [logdet(C_pp|D + N) - logdet(N + R)]`` (see
``autonomy.planner.objective.FieldInformation``). Every edge keeps its whitened columns
``L^-1 k(past, points)``; every path keeps the rows that its last edge adds to the Cholesky factor,
so one more edge costs one block row.
"""

import numpy as np

from autonomy.compiled import inner_kernel
from autonomy.planner.graph import DEPTH_MAX, PATHS, Graph, Int32Array, chain_of, first_staged
from autonomy.planner.information.cholesky import half_log_determinant
from autonomy.planner.information.columns import copy_columns
from autonomy.planner.information.covariance import fill_block
from autonomy.planner.information.information import CROSSES, STAMP, USED, Float32Array, Information


@inner_kernel
def begin_edge(info: Information) -> None:
    """Forget the covariances of earlier edges with the edge before."""
    info.tally[STAMP] += 1
    info.tally[CROSSES] = 0


@inner_kernel
def load_chain(graph: Graph, info: Information, path: int, edges: Int32Array) -> int:
    """Write a path's edges and where their rows are to ``chain``; return how many there are."""
    chain = info.chains.chain
    depth = chain_of(graph, path, edges)
    points = 0
    for i in range(depth):
        link = edges[i]
        edge = graph.path_edge[link]
        edges[i] = edge
        chain[i, 0] = edge
        chain[i, 1] = info.chains.row_at[link]
        chain[i, 2] = points
        points += info.samples[edge]
    chain[depth, 2] = points
    return depth


@inner_kernel
def gain_after(graph: Graph, info: Information, depth: int, edge: int) -> float:
    """Return the gain of a staged edge given those of the chain; its rows stay in the room."""
    chains = info.chains
    staged = edge - first_staged(graph)
    k = info.stack.begin[staged + 1] - info.stack.begin[staged]
    points = chains.chain[depth, 2]
    solved = chains.work[0][: points * k].reshape(points, k)
    for i in range(depth):
        _solve_block(info, i, staged, solved)
    factor = chains.factor
    factor[:k, :k] = info.stack.own[staged, :k, :k]
    if points > 0:
        explained = chains.work[1][: k * k].reshape(k, k)
        np.dot(solved.T, solved, explained)
        factor[:k, :k] -= explained
    return float(half_log_determinant(factor, k) - info.stack.half_noise[staged])


@inner_kernel
def has_room(graph: Graph, info: Information, depth: int, edge: int) -> bool:
    """Tell whether the extended path can be kept."""
    staged = edge - first_staged(graph)
    k = info.stack.begin[staged + 1] - info.stack.begin[staged]
    needed = k * (info.chains.chain[depth, 2] + k)
    room = len(info.chains.rows) - info.tally[USED]
    return needed <= room and depth + 1 < DEPTH_MAX and graph.tally[PATHS] < len(graph.path_worth)


@inner_kernel
def keep_rows(
    graph: Graph, info: Information, depth: int, edge: int, kept: int, path: int, gain: float
) -> None:
    """Keep the rows that ``gain_after`` left, for a path that was added."""
    chains = info.chains
    copy_columns(graph, info, edge, kept)
    chains.gain[path] = gain
    chains.row_at[path] = info.tally[USED]
    k, points = info.samples[kept], chains.chain[depth, 2]
    at = info.tally[USED]
    off = chains.rows[at : at + k * points].reshape(k, points)
    off[:, :] = chains.work[0][: points * k].reshape(points, k).T
    at += k * points
    upper = chains.rows[at : at + k * k].reshape(k, k)
    upper[:, :] = chains.factor[:k, :k]
    info.tally[USED] = at + k * k


@inner_kernel
def _solve_block(info: Information, i: int, staged: int, solved: Float32Array) -> None:
    """Solve ``upper^T x = cross - off solved`` for the rows of one earlier edge."""
    chains = info.chains
    other, at, start = chains.chain[i]
    count, k = info.samples[other], solved.shape[1]
    if chains.cross_stamp[other] != info.tally[STAMP]:
        _cross(info, other, staged)
    block = solved[start : start + count]
    block[:, :] = chains.cross[chains.cross_slot[other]][: count * k].reshape(count, k)
    if start > 0:
        off = chains.rows[at : at + count * start].reshape(count, start)
        product = chains.work[1][: count * k].reshape(count, k)
        np.dot(off, solved[:start], product)
        block -= product
    at += count * start
    upper = chains.rows[at : at + count * count].reshape(count, count)
    for row in range(count):
        scale = np.float32(1.0) / upper[row, row]
        for j in range(k):
            block[row, j] *= scale
        for below in range(row + 1, count):
            part = upper[row, below]
            for j in range(k):
                block[below, j] -= part * block[row, j]


@inner_kernel
def _cross(info: Information, other: int, staged: int) -> None:
    """Compute the covariances of an earlier edge's points with the current edge's."""
    chains, stack = info.chains, info.stack
    if info.tally[CROSSES] == len(chains.cross):
        info.tally[CROSSES] = 0
        info.tally[STAMP] += 1
    slot = info.tally[CROSSES]
    info.tally[CROSSES] += 1
    chains.cross_slot[other] = slot
    chains.cross_stamp[other] = info.tally[STAMP]
    begin, end = stack.begin[staged], stack.begin[staged + 1]
    count, k = info.samples[other], end - begin
    cross = chains.cross[slot][: count * k].reshape(count, k)
    fill_block(info.covariance, info.place[other], 0, stack.place, begin, info.distance, cross)
    if info.white.shape[2] > 0:
        product = chains.work[2][: count * k].reshape(count, k)
        np.dot(info.white[other][:count], stack.white[begin:end].T, product)
        cross -= product
