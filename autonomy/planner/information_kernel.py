"""Information gain of many trajectories, compiled.

The gain of a path is ``1/2 [logdet(C_pp|D + N) - logdet(C_pp|D,f* + N)]`` (see
``autonomy.planner.objective.MutualInformation``). Every edge keeps its whitened columns
``L^-1 k(known, points)``; every path keeps the rows that its last edge adds to the two Cholesky
factors, so one more edge costs one block row. A path is left out when
``gain(path) <= gain(prefix) + gain(last edge)`` already rules it out.
"""

import numpy as np

from autonomy.compiled import kernel
from autonomy.planner.cholesky import factorize
from autonomy.planner.elite import elite_edge, elite_place, fill_gap, rank, write_elite
from autonomy.planner.graph import (
    CANDIDATES,
    DEPTH_MAX,
    NODES,
    PATHS,
    PROPOSALS,
    RESERVOIR_FULL,
    STAGED,
    TABLES_FULL,
    Graph,
    add_path,
    chain_of,
    find_slot,
    first_staged,
    keep_edge,
    settle_node,
    slot_worth,
)
from autonomy.planner.information import CROSSES, STAMP, USED, Float32Array, Information
from autonomy.planner.information_columns import covariance, whiten


@kernel
def grow_by_information(graph: Graph, info: Information) -> None:
    """ExtendPaths for every staged edge of a new node, then lines 12 to 15 of Algorithm 1."""
    whiten(graph, info)
    for staged in range(graph.tally[STAGED]):
        _extend(graph, info, first_staged(graph) + staged, graph.staged_source[staged])
    settle_node(graph)


@kernel
def refine_by_information(graph: Graph, info: Information) -> None:
    """Fill the gap in an elite trajectory with the best staged proposal, if that is better."""
    whiten(graph, info)
    elite, first, taken = graph.gap
    depth = 0
    rest, spent = 0.0, 0.0
    info.chain[0, 1] = info.spare
    info.chain[0, 2] = 0
    for i in range(graph.elite_length[elite]):
        if i < first or i >= first + taken:
            edge = elite_edge(graph, elite, i)
            spent += graph.edge_energy[edge]
            rest += _append(info, depth, edge)
            depth += 1
    best, chosen, chosen_energy = float(graph.elite_worth[elite]), -1, 0.0
    for proposal in range(graph.tally[PROPOSALS]):
        begin = first_staged(graph) + graph.proposal[proposal]
        end = first_staged(graph) + graph.proposal[proposal + 1]
        energy = spent + float(graph.edge_energy[begin:end].sum())
        bound = rest + float(graph.edge_worth[begin:end].sum())
        if energy > graph.least_spent:
            graph.tally[CANDIDATES] += 1
        if rank(graph, energy, bound) <= best:
            continue
        worth = rest
        for edge in range(begin, end):
            worth += _append(info, depth + edge - begin, edge)
        ranked = rank(graph, energy, worth)
        if ranked > best:
            best, chosen, chosen_energy = ranked, proposal, energy
    if chosen >= 0:
        length = fill_gap(graph, chosen, info.edges)
        if elite_place(graph, info.edges, length, best, elite) == elite:
            write_elite(graph, elite, info.edges, length, chosen_energy, best)
            _copy_written(graph, info, length)


@kernel
def _extend(graph: Graph, info: Information, edge: int, source: int) -> None:
    """Append one edge to the paths at its source, as far as that may be worth something."""
    node = graph.tally[NODES]
    info.tally[STAMP] += 1
    info.tally[CROSSES] = 0
    kept = -1
    for path in graph.slot[source]:
        if path < 0:
            continue
        energy = graph.path_energy[path] + graph.edge_energy[edge]
        if energy > graph.limits.budget:
            continue
        bound = graph.path_worth[path] + graph.edge_worth[edge]
        if energy > graph.least_spent:
            graph.tally[CANDIDATES] += 1
        place = -1
        if energy + graph.least_energy <= graph.limits.budget:
            place = find_slot(graph, node, energy)
            if bound <= slot_worth(graph, node, place):
                graph.tally[RESERVOIR_FULL] = 1
                place = -1
        best = graph.elite_worth.max()
        if place < 0 and rank(graph, energy, bound) <= best:
            continue
        depth = _load_chain(graph, info, path)
        if depth + 1 >= DEPTH_MAX:
            continue
        worth = float(graph.path_worth[path]) + _condition(info, depth, edge)
        _offer(graph, info, depth, edge, energy, worth)
        if place >= 0 and worth > slot_worth(graph, node, place):
            if kept < 0:
                kept = keep_edge(graph, edge)
            if kept < 0 or not _has_room(graph, info, depth, edge):
                graph.tally[TABLES_FULL] = 1
                return
            _copy_columns(info, edge, kept)
            new = add_path(graph, node, place, path, kept, energy, worth)
            info.row_at[new] = info.tally[USED]
            info.tally[USED] = _store_rows(info, depth, edge, info.tally[USED])


@kernel
def _offer(
    graph: Graph, info: Information, depth: int, edge: int, energy: float, worth: float
) -> None:
    """Make the current chain and one more edge an elite trajectory, if it is good enough."""
    ranked = rank(graph, energy, worth)
    if ranked <= graph.elite_worth.min():
        return
    for i in range(depth):
        info.edges[i] = info.chain[i, 0]
    info.edges[depth] = edge
    elite = elite_place(graph, info.edges, depth + 1, ranked, -1)
    if elite >= 0:
        write_elite(graph, elite, info.edges, depth + 1, energy, ranked)
        _copy_written(graph, info, depth + 1)


@kernel
def _copy_written(graph: Graph, info: Information, length: int) -> None:
    for i in range(length):
        _copy_columns(info, graph.copied[i, 0], graph.copied[i, 1])


@kernel
def _copy_columns(info: Information, source: int, target: int) -> None:
    info.samples[target] = info.samples[source]
    info.place[target] = info.place[source]
    info.white_past[target] = info.white_past[source]
    info.white_test[target] = info.white_test[source]
    info.own[target] = info.own[source]


@kernel
def _load_chain(graph: Graph, info: Information, path: int) -> int:
    """Write a path's edges and where their rows are to ``chain``; return how many there are."""
    depth = chain_of(graph, path, info.edges)
    points = 0
    for i in range(depth):
        link = info.edges[i]
        edge = graph.path_edge[link]
        info.chain[i, 0] = edge
        info.chain[i, 1] = info.row_at[link]
        info.chain[i, 2] = points
        points += info.samples[edge]
    info.chain[depth, 2] = points
    return depth


@kernel
def _has_room(graph: Graph, info: Information, depth: int, edge: int) -> bool:
    k = info.samples[edge]
    needed = 2 * k * (info.chain[depth, 2] + k)
    return info.tally[USED] + needed <= info.spare and graph.tally[PATHS] < len(graph.path_energy)


@kernel
def _append(info: Information, depth: int, edge: int) -> float:
    """Append an edge to the chain in the spare part of ``rows``; return its gain."""
    info.tally[STAMP] += 1
    info.tally[CROSSES] = 0
    gain = _condition(info, depth, edge)
    info.chain[depth, 0] = edge
    info.chain[depth + 1, 1] = _store_rows(info, depth, edge, info.chain[depth, 1])
    info.chain[depth + 1, 2] = info.chain[depth, 2] + info.samples[edge]
    return gain


@kernel
def _condition(info: Information, depth: int, edge: int) -> float:
    """Return the gain of an edge given those of the chain; leave its rows in work and factor."""
    k = info.samples[edge]
    points = info.chain[depth, 2]
    gain = 0.0
    for given in range(2):
        solved = info.work[given][: points * k].reshape(points, k)
        for i in range(depth):
            _solve_block(info, i, edge, given, solved)
        explained = info.work[2][: k * k].reshape(k, k)
        explained[:, :] = np.float32(0.0)
        if points > 0:
            np.dot(solved.T, solved, explained)
        factor = info.factor[given]
        for i in range(k):
            for j in range(i + 1):
                factor[i, j] = info.own[edge, given, i, j] - explained[i, j]
        half_log_determinant = factorize(factor, k)
        gain += half_log_determinant if given == 0 else -half_log_determinant
    return gain


@kernel
def _solve_block(info: Information, i: int, edge: int, given: int, solved: Float32Array) -> None:
    """Solve ``lower x = cross - off solved`` for the rows of one earlier edge."""
    other, at, start = info.chain[i]
    count, k = info.samples[other], info.samples[edge]
    if info.cross_stamp[other] != info.tally[STAMP]:
        _cross(info, other, edge)
    block = solved[start : start + count]
    block[:, :] = info.cross[info.cross_slot[other], given][: count * k].reshape(count, k)
    at += given * count * (start + count)
    if start > 0:
        off = info.rows[at : at + count * start].reshape(count, start)
        product = info.work[2][: count * k].reshape(count, k)
        np.dot(off, solved[:start], product)
        block -= product
    at += count * start
    lower = info.rows[at : at + count * count].reshape(count, count)
    for row in range(count):
        for column in range(row):
            part = lower[row, column]
            for j in range(k):
                block[row, j] -= part * block[column, j]
        scale = np.float32(1.0) / lower[row, row]
        for j in range(k):
            block[row, j] *= scale


@kernel
def _cross(info: Information, other: int, edge: int) -> None:
    """Compute the covariances of an earlier edge's points with the current edge's."""
    if info.tally[CROSSES] == len(info.cross):
        info.tally[CROSSES] = 0
        info.tally[STAMP] += 1
    slot = info.tally[CROSSES]
    info.tally[CROSSES] += 1
    info.cross_slot[other] = slot
    info.cross_stamp[other] = info.tally[STAMP]
    count, k = info.samples[other], info.samples[edge]
    given_past = info.cross[slot, 0][: count * k].reshape(count, k)
    given_both = info.cross[slot, 1][: count * k].reshape(count, k)
    given_past[:, :] = np.float32(0.0)
    if info.past > 0:
        np.dot(info.white_past[other][:count], info.white_past[edge][:k].T, given_past)
    np.dot(info.white_test[other][:count], info.white_test[edge][:k].T, given_both)
    for i in range(count):
        for j in range(k):
            prior = covariance(info.signal_variance, info.place[other, i], info.place[edge, j])
            given_past[i, j] = prior - given_past[i, j]
            given_both[i, j] = given_past[i, j] - given_both[i, j]


@kernel
def _store_rows(info: Information, depth: int, edge: int, at: int) -> int:
    """Write the rows that ``_condition`` left to ``rows``; return where they end."""
    k = info.samples[edge]
    points = info.chain[depth, 2]
    for given in range(2):
        off = info.rows[at : at + k * points].reshape(k, points)
        off[:, :] = info.work[given][: points * k].reshape(points, k).T
        at += k * points
        lower = info.rows[at : at + k * k].reshape(k, k)
        lower[:, :] = info.factor[given, :k, :k]
        at += k * k
    return at
