"""ExtendPaths of Algorithm 1, compiled, for either objective and their weighted sum.

An objective that does not count is None, which numba resolves when it compiles.
"""

import math

from autonomy.compiled import inner_kernel, kernel
from autonomy.planner.graph import (
    CANDIDATES,
    DEPTH_MAX,
    FULL_SHARE,
    NODES,
    PATHS,
    RESERVOIR_FULL,
    STAGED,
    TABLES_FULL,
    Graph,
    Int32Array,
    add_path,
    add_shares,
    can_go_on,
    chain_of,
    find_slot,
    first_staged,
    keep_edge,
    settle_node,
    slot_worth,
)
from autonomy.planner.information.columns import copy_columns, find_own_gains, whiten
from autonomy.planner.information.growth import (
    begin_edge,
    gain_after,
    has_room,
    keep_rows,
    load_chain,
)
from autonomy.planner.information.information import Information
from autonomy.planner.search.elite import elite_place, group_worth, rank, write_elite
from autonomy.planner.search.ergodic_kernel import Ergodic, spread, visit_after
from autonomy.planner.search.weighted import Worth


@kernel
def grow(
    graph: Graph,
    info: Information | None,
    ergodic: Ergodic | None,
    worth: Worth,
    edges: Int32Array,
) -> None:
    """Extend paths by every staged edge to a new node, then lines 12 to 15 of Algorithm 1."""
    if info is not None:
        whiten(graph, info)
        find_own_gains(graph, info)
    if ergodic is not None:
        spread(graph, ergodic)
    for staged in range(graph.tally[STAGED]):
        _extend(graph, info, ergodic, worth, edges, first_staged(graph) + staged)
    settle_node(graph)


@kernel
def adopt(
    graph: Graph,
    info: Information | None,
    ergodic: Ergodic | None,
    elite: int,
    edges: Int32Array,
) -> None:
    """Make what is staged an elite trajectory; its worth is found by ``refinement.revalue``."""
    if info is not None:
        whiten(graph, info)
    if ergodic is not None:
        spread(graph, ergodic)
    length = graph.tally[STAGED]
    for i in range(length):
        edges[i] = first_staged(graph) + i
    write_elite(graph, elite, edges, length, -math.inf)
    copy_written(graph, info, ergodic, length)


@inner_kernel
def _extend(
    graph: Graph,
    info: Information | None,
    ergodic: Ergodic | None,
    worth: Worth,
    edges: Int32Array,
    edge: int,
) -> None:
    """Append one edge to the paths at its source, as far as that may be worth something."""
    node, staged = graph.tally[NODES], edge - first_staged(graph)
    kept = -1
    gain = 0.0
    if info is not None:
        begin_edge(info)
    for path in graph.slot[graph.staged_source[staged]]:
        if path < 0:
            continue
        spent = add_shares(graph, graph.path_share[path], graph.edge_share[edge])
        if spent > FULL_SHARE:
            continue
        if spent > graph.least_spent:
            graph.tally[CANDIDATES] += 1
        place = find_slot(graph, node, spent) if can_go_on(graph, graph.total) else -1
        value = worth.constant
        if ergodic is not None:
            value += worth.measure_weight * visit_after(graph, ergodic, path, edge)
        bound = value
        if info is not None:
            bound += worth.gain_weight * float(info.chains.gain[path] + info.stack.gain[staged])
        if place >= 0 and bound <= slot_worth(graph, node, place):
            graph.tally[RESERVOIR_FULL] = 1
            place = -1
        if place < 0 and rank(graph, spent, bound) <= _bar(graph, info is not None):
            continue
        depth = _load(graph, info, path, edges)
        if depth + 1 >= DEPTH_MAX:
            continue
        if info is not None:
            gain = float(info.chains.gain[path]) + gain_after(graph, info, depth, edge)
            value += worth.gain_weight * gain
        ranked = rank(graph, spent, value)
        if ranked > group_worth(graph).min():
            edges[depth] = edge
            _offer(graph, info, ergodic, edges, depth + 1, ranked)
        if place >= 0 and value > slot_worth(graph, node, place):
            if kept < 0:
                kept = keep_edge(graph, edge)
            if kept < 0 or not _has_room(graph, info, depth, edge):
                graph.tally[TABLES_FULL] = 1
                return
            new = add_path(graph, node, place, path, kept, value)
            if info is not None:
                keep_rows(graph, info, depth, edge, kept, new, gain)
            if ergodic is not None:
                ergodic.edge_visit[kept] = ergodic.edge_visit[edge]
                ergodic.path_visit[new] = ergodic.visit


@inner_kernel
def _bar(graph: Graph, is_bound: bool) -> float:
    """Return what a trajectory must rank above to be looked at more closely.

    Where its rank is known already that is the worst elite trajectory; a mere bound must pass the
    best one.
    """
    worth = group_worth(graph)
    return float(worth.max() if is_bound else worth.min())


@inner_kernel
def _load(graph: Graph, info: Information | None, path: int, edges: Int32Array) -> int:
    """Write the edges of a path; return how many there are."""
    if info is not None:
        return load_chain(graph, info, path, edges)
    depth = chain_of(graph, path, edges)
    for i in range(depth):
        edges[i] = graph.path_edge[edges[i]]
    return depth


@inner_kernel
def _has_room(graph: Graph, info: Information | None, depth: int, edge: int) -> bool:
    if info is not None:
        return has_room(graph, info, depth, edge)
    return graph.tally[PATHS] < len(graph.path_worth)


@inner_kernel
def _offer(
    graph: Graph,
    info: Information | None,
    ergodic: Ergodic | None,
    edges: Int32Array,
    length: int,
    ranked: float,
) -> None:
    """Make edges an elite trajectory, if they are good enough."""
    elite = elite_place(graph, edges, length, ranked, -1)
    if elite >= 0:
        write_elite(graph, elite, edges, length, ranked)
        copy_written(graph, info, ergodic, length)


@inner_kernel
def copy_written(
    graph: Graph, info: Information | None, ergodic: Ergodic | None, length: int
) -> None:
    """Copy what the objectives keep of the edges of an elite trajectory just written."""
    for i in range(length):
        source, target = graph.copied[i]
        if info is not None:
            copy_columns(graph, info, source, target)
        if ergodic is not None:
            ergodic.edge_visit[target] = ergodic.edge_visit[source]
