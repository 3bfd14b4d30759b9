"""The best distinct trajectories of a search, which own copies of their edges."""

import math

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.planner.graph import (
    DEPTH_MAX,
    ELITE,
    FIRST_A,
    FIRST_B,
    GROUP_BEGIN,
    GROUP_END,
    SHORT,
    TAKEN_A,
    TAKEN_B,
    Graph,
    Int32Array,
    copy_edge,
    first_staged,
)


@inner_kernel
def group_worth(graph: Graph) -> FloatArray:
    """Return the worth of each elite trajectory of the start that is searched from."""
    return graph.elite_worth[graph.tally[GROUP_BEGIN] : graph.tally[GROUP_END]]


@inner_kernel
def rank(graph: Graph, spent: float, worth: float) -> float:
    """Return what trajectories are compared by: those that spend too little come last."""
    return worth if spent > graph.least_spent else worth - SHORT


@kernel
def elite_edge(graph: Graph, elite: int, place: int) -> int:
    """Return the edge at a place of an elite trajectory; elite ``len(elite_worth)`` is free."""
    first = first_staged(graph) - len(graph.elite_block) * DEPTH_MAX
    return first + graph.elite_block[elite] * DEPTH_MAX + place


@inner_kernel
def elite_place(graph: Graph, edges: Int32Array, length: int, ranked: float, own: int) -> int:
    """Return which elite trajectory a new one replaces, -1 if it is not good enough.

    Of trajectories that are alike only the best one stays, so that those offered are distinct and
    refinement does not crowd about one of them.

    Args:
        graph: The search's graph.
        edges: Edges of the new trajectory.
        length: Number of its edges.
        ranked: Its rank.
        own: Elite trajectory that it was made from by refinement, -1 for none.
    """
    group = range(graph.tally[GROUP_BEGIN], graph.tally[GROUP_END])
    worst = own if own >= 0 else group.start
    for elite in group:
        if own < 0 and graph.elite_worth[elite] < graph.elite_worth[worst]:
            worst = elite
    if ranked <= graph.elite_worth[worst]:
        return -1
    place = worst
    for elite in group:
        if elite != own and _are_alike(graph, edges, length, elite):
            if ranked <= graph.elite_worth[elite]:
                if own >= 0:
                    _drop(graph, own)
                return -1
            if own < 0 and place == worst:
                place = elite
            else:
                _drop(graph, elite)
    return place


@inner_kernel
def _are_alike(graph: Graph, edges: Int32Array, length: int, elite: int) -> bool:
    """Tell whether more than half of the surfacings of two trajectories are close together."""
    close = 0
    for i in range(length):
        x, y = end_of(graph, edges[i])
        for j in range(graph.elite_length[elite]):
            x1, y1 = end_of(graph, elite_edge(graph, elite, j))
            if math.hypot(x - x1, y - y1) < graph.close:
                close += 1
                break
    return 2 * close > min(length, graph.elite_length[elite])


@inner_kernel
def _drop(graph: Graph, elite: int) -> None:
    graph.elite_length[elite] = 0
    graph.elite_worth[elite] = -math.inf


@inner_kernel
def start_of(graph: Graph, edge: int) -> tuple[float, float]:
    """Return north and east of the surfacing that an edge leaves."""
    return graph.edge_start[edge, 0], graph.edge_start[edge, 1]


@inner_kernel
def end_of(graph: Graph, edge: int) -> tuple[float, float]:
    """Return north and east of the surfacing that an edge reaches."""
    return graph.edge_end[edge, 0], graph.edge_end[edge, 1]


@inner_kernel
def write_elite(graph: Graph, elite: int, edges: Int32Array, length: int, ranked: float) -> None:
    """Make edges an elite trajectory; ``copied`` tells the objective what to copy of its own."""
    free = len(graph.elite_worth)
    graph.elite_share[elite] = 0.0
    for i in range(length):
        target = elite_edge(graph, free, i)
        copy_edge(graph, edges[i], target)
        graph.elite_share[elite] += graph.edge_share[target]
        graph.copied[i, 0] = edges[i]
        graph.copied[i, 1] = target
    block = graph.elite_block[free]
    graph.elite_block[free] = graph.elite_block[elite]
    graph.elite_block[elite] = block
    graph.elite_length[elite] = length
    graph.elite_worth[elite] = ranked


@inner_kernel
def in_gap(graph: Graph, place: int) -> bool:
    """Tell whether a place of the elite trajectory in question is in one of its gaps."""
    after_a, after_b = place - graph.gap[FIRST_A], place - graph.gap[FIRST_B]
    return 0 <= after_a < graph.gap[TAKEN_A] or 0 <= after_b < graph.gap[TAKEN_B]


@inner_kernel
def fill_gaps(graph: Graph, one: int, other: int, edges: Int32Array) -> int:
    """Write the edges of the elite trajectory in question with proposals in its gaps.

    Args:
        graph: The search's graph.
        one: Proposal for the first gap, -1 for what was there.
        other: Proposal for the second gap, -1 for what was there.
        edges: Receives the edges.

    Returns:
        Number of edges.
    """
    length = 0
    for i in range(graph.elite_length[graph.gap[ELITE]]):
        in_a = 0 <= i - graph.gap[FIRST_A] < graph.gap[TAKEN_A]
        chosen = one if in_a else other
        if chosen < 0 or not in_gap(graph, i):
            edges[length] = elite_edge(graph, graph.gap[ELITE], i)
            length += 1
        elif i == (graph.gap[FIRST_A] if in_a else graph.gap[FIRST_B]):
            for staged in range(graph.proposal[chosen], graph.proposal[chosen + 1]):
                edges[length] = first_staged(graph) + staged
                length += 1
    return length
