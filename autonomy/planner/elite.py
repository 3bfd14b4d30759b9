"""The best distinct trajectories of a search, which own copies of their edges."""

import math

from autonomy.compiled import kernel
from autonomy.planner.edge_kernel import X0, X1, Y0, Y1
from autonomy.planner.graph import (
    DEPTH_MAX,
    SHORT,
    Graph,
    Int32Array,
    copy_edge,
    first_staged,
)

_CLOSE = 0.15
"""Part of the step within which two surfacings are alike."""


@kernel
def rank(graph: Graph, energy: float, worth: float) -> float:
    """Return what trajectories are compared by: those that spend too little come last."""
    return worth if energy > graph.least_spent else worth - SHORT


@kernel
def elite_edge(graph: Graph, elite: int, place: int) -> int:
    """Return the edge at a place of an elite trajectory; elite ``len(elite_worth)`` is free."""
    first = first_staged(graph) - len(graph.elite_block) * DEPTH_MAX
    return first + graph.elite_block[elite] * DEPTH_MAX + place


@kernel
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
    worst = own if own >= 0 else 0
    for elite in range(len(graph.elite_worth)):
        if own < 0 and graph.elite_worth[elite] < graph.elite_worth[worst]:
            worst = elite
    if ranked <= graph.elite_worth[worst]:
        return -1
    place = worst
    for elite in range(len(graph.elite_worth)):
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


@kernel
def _are_alike(graph: Graph, edges: Int32Array, length: int, elite: int) -> bool:
    """Tell whether more than half of the surfacings of two trajectories are close together."""
    close = 0
    for i in range(length):
        x, y = end_of(graph, edges[i])
        for j in range(graph.elite_length[elite]):
            x1, y1 = end_of(graph, elite_edge(graph, elite, j))
            if math.hypot(x - x1, y - y1) < _CLOSE * graph.step:
                close += 1
                break
    return 2 * close > min(length, graph.elite_length[elite])


@kernel
def _drop(graph: Graph, elite: int) -> None:
    graph.elite_length[elite] = 0
    graph.elite_worth[elite] = -math.inf


@kernel
def start_of(graph: Graph, edge: int) -> tuple[float, float]:
    """Return north and east of the surfacing that an edge leaves."""
    return graph.edge_legs[edge, 0, X0], graph.edge_legs[edge, 0, Y0]


@kernel
def end_of(graph: Graph, edge: int) -> tuple[float, float]:
    """Return north and east of the surfacing that an edge reaches."""
    last = graph.edge_leg_count[edge] - 1
    return graph.edge_legs[edge, last, X1], graph.edge_legs[edge, last, Y1]


@kernel
def write_elite(
    graph: Graph, elite: int, edges: Int32Array, length: int, energy: float, ranked: float
) -> None:
    """Make edges an elite trajectory; ``copied`` tells the objective what to copy of its own."""
    free = len(graph.elite_worth)
    for i in range(length):
        target = elite_edge(graph, free, i)
        copy_edge(graph, edges[i], target)
        graph.copied[i, 0] = edges[i]
        graph.copied[i, 1] = target
    block = graph.elite_block[free]
    graph.elite_block[free] = graph.elite_block[elite]
    graph.elite_block[elite] = block
    graph.elite_length[elite] = length
    graph.elite_energy[elite] = energy
    graph.elite_worth[elite] = ranked


@kernel
def fill_gap(graph: Graph, proposal: int, edges: Int32Array) -> int:
    """Write the edges of the elite trajectory in question with a proposal in its gap.

    Returns:
        Number of edges.
    """
    elite, first, taken = graph.gap
    length = 0
    for i in range(first):
        edges[length] = elite_edge(graph, elite, i)
        length += 1
    for staged in range(graph.proposal[proposal], graph.proposal[proposal + 1]):
        edges[length] = first_staged(graph) + staged
        length += 1
    for i in range(first + taken, graph.elite_length[elite]):
        edges[length] = elite_edge(graph, elite, i)
        length += 1
    return length
