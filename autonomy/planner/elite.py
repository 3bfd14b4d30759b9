"""The best distinct trajectories of a search, which own copies of their edges."""

from autonomy.compiled import kernel
from autonomy.planner.graph import (
    DEPTH_MAX,
    SHORT,
    Graph,
    Int32Array,
    copy_edge,
    first_staged,
)


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
def elite_place(graph: Graph, edges: Int32Array, length: int, ranked: float) -> int:
    """Return which elite trajectory a better one replaces, -1 if it is not good enough.

    Trajectories that share more than half of their edges are alike; only the better one stays.
    """
    worst = 0
    for elite in range(len(graph.elite_worth)):
        shared = 0
        for i in range(graph.elite_length[elite]):
            serial = graph.edge_serial[elite_edge(graph, elite, i)]
            for j in range(length):
                if serial == graph.edge_serial[edges[j]]:
                    shared += 1
        if 2 * shared > min(length, graph.elite_length[elite]) and shared > 0:
            return elite if ranked > graph.elite_worth[elite] else -1
        if graph.elite_worth[elite] < graph.elite_worth[worst]:
            worst = elite
    return worst if ranked > graph.elite_worth[worst] else -1


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
