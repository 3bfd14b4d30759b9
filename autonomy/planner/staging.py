"""Random edges for a search to judge: to a new node, or across a gap in a known trajectory."""

import math

import numpy as np

from autonomy.compiled import kernel
from autonomy.planner.edge_kernel import ENERGY, X0, X1, Y0, Y1, place_points, propose
from autonomy.planner.elite import elite_edge
from autonomy.planner.graph import (
    DEPTH_MAX,
    NODES,
    PROPOSALS,
    SERIAL,
    STAGED,
    TABLES_FULL,
    Graph,
    first_staged,
    open_node,
)


@kernel
def stage_growth(graph: Graph, rng: np.random.Generator) -> bool:
    """Lines 4 to 10 and 15 to 20 of Algorithm 1: a new node, and edges to it from those near.

    Returns:
        False if no node is open any more, or the tables are full.
    """
    limits = graph.limits
    graph.tally[STAGED] = 0
    if graph.tally[NODES] == len(graph.node_is_open) or graph.tally[TABLES_FULL]:
        return False
    x_s = limits.x_min + (limits.x_max - limits.x_min) * rng.random()
    y_s = limits.y_min + (limits.y_max - limits.y_min) * rng.random()
    nearest = _nearest(graph, x_s, y_s)
    if nearest < 0:
        return False
    x0, y0 = graph.node_xy[nearest]
    distance = math.hypot(x_s - x0, y_s - y0)
    part = min(1.0, graph.step / max(distance, 1e-12))
    goal = (x0 + part * (x_s - x0), y0 + part * (y_s - y0))
    open_node(graph, goal[0], goal[1])
    _stage_between(graph, nearest, goal, rng)
    found = 0
    chosen = np.empty(graph.near_max, dtype=np.int32)
    for node in range(graph.tally[NODES]):
        if node == nearest or not graph.node_is_open[node]:
            continue
        x, y = graph.node_xy[node]
        if math.hypot(x - goal[0], y - goal[1]) <= graph.near_radius:
            place = found if found < graph.near_max else int(rng.random() * (found + 1))
            if place < graph.near_max:
                chosen[place] = node
            found += 1
    for i in range(min(found, graph.near_max)):
        _stage_between(graph, chosen[i], goal, rng)
    return True


@kernel
def _nearest(graph: Graph, x: float, y: float) -> int:
    """Return the open node whose distance is closest to the preferred one, -1 without any."""
    best, nearest = math.inf, -1
    for node in range(graph.tally[NODES]):
        if graph.node_is_open[node]:
            distance = math.hypot(graph.node_xy[node, 0] - x, graph.node_xy[node, 1] - y)
            off = abs(graph.nearest_radius - distance)
            if off < best:
                best, nearest = off, node
    return nearest


@kernel
def _stage_between(
    graph: Graph, source: int, goal: tuple[float, float], rng: np.random.Generator
) -> None:
    start = (graph.node_xy[source, 0], graph.node_xy[source, 1])
    for _ in range(graph.edges_per_call):
        if stage_edge(graph, start, goal, rng):
            graph.staged_source[graph.tally[STAGED] - 1] = source


@kernel
def stage_edge(
    graph: Graph, start: tuple[float, float], goal: tuple[float, float], rng: np.random.Generator
) -> bool:
    """Try one random edge; stage it if it is feasible and there is room."""
    staged = graph.tally[STAGED]
    if staged == len(graph.staged_point_count):
        return False
    edge = first_staged(graph) + staged
    legs = graph.edge_legs[edge]
    count = propose(graph.limits, start, goal, rng, legs)
    if count == 0:
        return False
    points = place_points(graph.limits, legs, count, graph.staged_points[staged])
    if points == 0:
        return False
    energy = 0.0
    for i in range(count):
        energy += legs[i, ENERGY]
    graph.edge_leg_count[edge] = count
    graph.edge_energy[edge] = energy
    graph.edge_serial[edge] = graph.tally[SERIAL]
    graph.tally[SERIAL] += 1
    graph.staged_point_count[staged] = points
    graph.tally[STAGED] = staged + 1
    return True


@kernel
def stage_refinement(graph: Graph, rng: np.random.Generator) -> bool:
    """Take some edges out of an elite trajectory and stage proposals of what may replace them.

    Returns:
        False if there is no trajectory to refine.
    """
    graph.tally[STAGED] = 0
    graph.tally[PROPOSALS] = 0
    elite = int(np.argmax(graph.elite_worth))
    if rng.random() < 0.5:
        elite = int(rng.random() * len(graph.elite_worth))
    length = graph.elite_length[elite]
    if length == 0:
        return False
    first = int(rng.random() * length)
    taken = min(1 + int(rng.random() * 3), length - first)
    graph.gap[0], graph.gap[1], graph.gap[2] = elite, first, taken
    begin = elite_edge(graph, elite, first)
    end = elite_edge(graph, elite, first + taken - 1)
    a = (graph.edge_legs[begin, 0, X0], graph.edge_legs[begin, 0, Y0])
    last = graph.edge_leg_count[end] - 1
    b = (graph.edge_legs[end, last, X1], graph.edge_legs[end, last, Y1])
    spent = graph.elite_energy[elite]
    for i in range(first, first + taken):
        spent -= graph.edge_energy[elite_edge(graph, elite, i)]
    is_tail = first + taken == length
    graph.proposal[0] = 0
    for _ in range(graph.near_max):
        goal = _around(graph, b, 0.3 * graph.step, rng) if is_tail and rng.random() < 0.5 else b
        pieces = min(1 + int(rng.random() * 2), DEPTH_MAX - length + taken)
        _stage_proposal(graph, a, goal, pieces, spent, rng)
    return True


@kernel
def _stage_proposal(
    graph: Graph,
    a: tuple[float, float],
    b: tuple[float, float],
    pieces: int,
    spent: float,
    rng: np.random.Generator,
) -> None:
    """Stage one or two edges from a to b that together keep to the budget."""
    first = graph.tally[STAGED]
    middle = (0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]))
    via = _around(graph, middle, 0.4 * graph.step, rng) if pieces > 1 else a
    energy = spent
    stop = a
    for i in range(pieces):
        target = b if i == pieces - 1 else via
        near = math.hypot(target[0] - stop[0], target[1] - stop[1]) <= graph.step
        if not near or not stage_edge(graph, stop, target, rng):
            graph.tally[STAGED] = first
            return
        energy += graph.edge_energy[first_staged(graph) + graph.tally[STAGED] - 1]
        stop = target
    if energy > graph.limits.budget or energy <= min(graph.least_spent, spent):
        graph.tally[STAGED] = first
        return
    graph.tally[PROPOSALS] += 1
    graph.proposal[graph.tally[PROPOSALS]] = graph.tally[STAGED]


@kernel
def _around(
    graph: Graph, centre: tuple[float, float], spread: float, rng: np.random.Generator
) -> tuple[float, float]:
    """Draw a point of the domain's surface about a centre."""
    limits = graph.limits
    x = centre[0] + spread * rng.standard_normal()
    y = centre[1] + spread * rng.standard_normal()
    return (
        min(max(x, limits.x_min), limits.x_max),
        min(max(y, limits.y_min), limits.y_max),
    )
