"""Random edges for a search to judge: to a new node, or across gaps in a known trajectory."""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.planner.graph import (
    BEFORE,
    ELITE,
    FIRST_A,
    FIRST_B,
    FULL_SHARE,
    GROUP_BEGIN,
    NODES,
    PROPOSALS,
    SHARES,
    STAGED,
    TABLES_FULL,
    TAKEN_A,
    TAKEN_B,
    Graph,
    first_staged,
    open_node,
)
from autonomy.planner.leg.edge import SHAPE_BEARING, SHAPE_COLUMNS, SHAPE_KIND, SHAPE_SIDE
from autonomy.planner.leg.edge_kernel import energy_of, place_points, propose
from autonomy.planner.leg.leg_kernel import DURATION, Z0, Z1
from autonomy.planner.search.elite import elite_edge, end_of, group_worth, in_gap, start_of

_PROPOSALS_SHARE, _TRIES_SHARE = 0.15, 2.0
"""Proposals for one gap, and how often they are tried at most, as shares of the edges that can be
staged. Where a dive is long or the water shallow, few of the tries can be flown."""
_FIRST_CALLS = 20
"""Calls that may be made for a first edge from the start, without which there is no search."""
GAP_MAX = 3
"""Most edges taken out at once."""
_OTHER_ELITE = 0.5
"""Probability that a random elite trajectory is refined, not the best one."""
_NUDGE = 0.5
"""Greatest spread by which a number of a shape, or a surfacing in steps, is moved."""
_FAR_NUDGE = 0.4
"""Spread, in steps, of new surfacings."""


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
    for _ in range(_FIRST_CALLS if graph.tally[NODES] == 1 else 1):
        if graph.tally[STAGED] == 0:
            _stage_between(graph, nearest, goal, rng)
    if graph.tally[STAGED] > 0:
        took = duration_of(graph, first_staged(graph) + graph.tally[STAGED] - 1)
        graph.node_time[graph.tally[NODES]] = graph.node_time[nearest] + took
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


@inner_kernel
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


@inner_kernel
def _stage_between(
    graph: Graph, source: int, goal: tuple[float, float], rng: np.random.Generator
) -> None:
    start = (graph.node_xy[source, 0], graph.node_xy[source, 1])
    for _ in range(graph.edges_per_call):
        draw_shape(graph, rng)
        if stage_edge(graph, start, goal, graph.node_time[source]):
            graph.staged_source[graph.tally[STAGED] - 1] = source


@inner_kernel
def draw_shape(graph: Graph, rng: np.random.Generator) -> None:
    """Draw the shape of the next staged edge (``edge.random_shape``)."""
    shape = next_shape(graph)
    for i in range(len(shape)):
        is_bearing = (i - 1) % SHAPE_COLUMNS == SHAPE_BEARING
        shape[i] = rng.standard_normal() if is_bearing else rng.random()


@inner_kernel
def nudge_shape(graph: Graph, edge: int, rng: np.random.Generator) -> None:
    """Make the shape of the next staged edge like another edge's; kinds and their number stay."""
    shape = next_shape(graph)
    shape[:] = graph.edge_shape[edge]
    size = _NUDGE * rng.random()
    for i in range(1, len(shape)):
        column = (i - 1) % SHAPE_COLUMNS
        if column == SHAPE_BEARING:
            shape[i] += size * rng.standard_normal()
        elif column not in (SHAPE_KIND, SHAPE_SIDE):
            nudged = shape[i] + size * rng.standard_normal()
            shape[i] = min(max(nudged, 0.0), 1.0)


@inner_kernel
def next_shape(graph: Graph) -> FloatArray:
    """Return the shape of the next staged edge, to be written."""
    return graph.edge_shape[first_staged(graph) + graph.tally[STAGED]]


@inner_kernel
def stage_edge(
    graph: Graph, start: tuple[float, float], goal: tuple[float, float], begin_s: float
) -> bool:
    """Stage the edge of the shape just drawn if it is feasible and there is room.

    It begins so long after the plan.
    """
    staged = graph.tally[STAGED]
    if staged == len(graph.staged_point_count):
        return False
    edge = first_staged(graph) + staged
    legs = graph.edge_legs[edge]
    shape = graph.edge_shape[edge]
    count = propose(graph.limits, graph.waterway, start, goal, shape, legs, begin_s)
    if count == 0:
        return False
    points = place_points(graph.limits, legs, count, graph.staged_points[staged], begin_s)
    if points == 0:
        return False
    graph.edge_leg_count[edge] = count
    graph.edge_start[edge, 0], graph.edge_start[edge, 1] = start
    graph.edge_end[edge, 0], graph.edge_end[edge, 1] = goal
    note_shares(graph, edge)
    graph.staged_point_count[staged] = points
    graph.tally[STAGED] = staged + 1
    return True


@kernel
def note_shares(graph: Graph, edge: int) -> None:
    """Set what an edge spends of each budget."""
    count = graph.edge_leg_count[edge]
    legs = graph.edge_legs[edge]
    surfacings = 0
    for i in range(count):
        if legs[i, Z1] <= 0.0 < legs[i, Z0]:
            surfacings += 1
    duration = duration_of(graph, edge)
    per_unit, share = graph.share_per_unit, graph.edge_share[edge]
    share[0] = energy_of(graph.limits, legs, count) * per_unit[0]
    share[1] = duration * per_unit[1]
    share[2] = surfacings * graph.surfacing_bytes * per_unit[2]


@inner_kernel
def duration_of(graph: Graph, edge: int) -> float:
    """Return how long an edge takes, with the surfacings before its dives, s."""
    duration = 0.0
    for i in range(graph.edge_leg_count[edge]):
        duration += graph.edge_legs[edge, i, DURATION]
        if graph.edge_legs[edge, i, Z0] <= 0.0:
            duration += graph.surfacing_time
    return duration


@kernel
def stage_refinement(graph: Graph, rng: np.random.Generator) -> None:
    """Take edges out of an elite trajectory at two places and stage what may replace them.

    Half of the proposals are like what was there; the others are any one or two edges that lead
    across the gap. A gap at the end may lead elsewhere.
    """
    tally = graph.tally
    tally[STAGED], tally[PROPOSALS], tally[BEFORE] = 0, 0, 0
    begin, worth = tally[GROUP_BEGIN], group_worth(graph)
    elite = begin + int(np.argmax(worth))
    other = begin + int(rng.random() * len(worth))
    if rng.random() < _OTHER_ELITE and graph.elite_length[other] > 0:
        elite = other
    _choose_gaps(graph, elite, rng)
    rest = graph.total
    rest[:] = 0.0
    for i in range(graph.elite_length[elite]):
        if not in_gap(graph, i):
            rest += graph.edge_share[elite_edge(graph, elite, i)]
    graph.proposal[0] = 0
    _fill_gap(graph, graph.gap[FIRST_A], graph.gap[TAKEN_A], rng)
    tally[BEFORE] = tally[PROPOSALS]
    if graph.gap[TAKEN_B] > 0:
        _fill_gap(graph, graph.gap[FIRST_B], graph.gap[TAKEN_B], rng)


@inner_kernel
def _choose_gaps(graph: Graph, elite: int, rng: np.random.Generator) -> None:
    """Choose two runs of edges of an elite trajectory, the second without edges in a short one."""
    length = graph.elite_length[elite]
    first = int(rng.random() * length)
    taken = min(1 + int(rng.random() * GAP_MAX), length - first)
    second = int(rng.random() * length)
    until = first if second < first else length
    taken_there = min(1 + int(rng.random() * GAP_MAX), until - second)
    if first <= second < first + taken:
        second, taken_there = length, 0
    gap = graph.gap
    gap[ELITE] = elite
    gap[FIRST_A], gap[TAKEN_A], gap[FIRST_B], gap[TAKEN_B] = first, taken, second, taken_there


@inner_kernel
def _fill_gap(graph: Graph, first: int, taken: int, rng: np.random.Generator) -> None:
    """Stage proposals for one gap; ``total`` is what the rest of the trajectory spends."""
    elite = graph.gap[ELITE]
    begin = start_of(graph, elite_edge(graph, elite, first))
    end = end_of(graph, elite_edge(graph, elite, first + taken - 1))
    begin_s = 0.0
    for i in range(first):
        begin_s += duration_of(graph, elite_edge(graph, elite, i))
    tries = int(_TRIES_SHARE * len(graph.staged_point_count))
    wanted = graph.tally[PROPOSALS] + int(_PROPOSALS_SHARE * len(graph.staged_point_count))
    for _ in range(tries):
        if graph.tally[PROPOSALS] == wanted:
            break
        goal = end
        if first + taken == graph.elite_length[elite] and rng.random() < 0.5:
            goal = _around(graph, end, _FAR_NUDGE * graph.step, rng)
        if rng.random() < 0.5:
            stands = _stage_alike(graph, first, taken, begin, goal, begin_s, rng)
        else:
            stands = _stage_any(graph, begin, goal, begin_s, rng)
        _seal_proposal(graph, stands)


@inner_kernel
def _stage_alike(
    graph: Graph,
    first: int,
    taken: int,
    begin: tuple[float, float],
    goal: tuple[float, float],
    begin_s: float,
    rng: np.random.Generator,
) -> bool:
    """Stage edges like those of the gap, with surfacings near theirs; tell whether all stand."""
    here = begin
    spread = _NUDGE * graph.step * rng.random()
    for i in range(taken):
        edge = elite_edge(graph, graph.gap[ELITE], first + i)
        there = goal if i == taken - 1 else _around(graph, end_of(graph, edge), spread, rng)
        nudge_shape(graph, edge, rng)
        if not _is_near(graph, here, there) or not stage_edge(graph, here, there, begin_s):
            return False
        here = there
        begin_s += duration_of(graph, first_staged(graph) + graph.tally[STAGED] - 1)
    return True


@inner_kernel
def _stage_any(
    graph: Graph,
    begin: tuple[float, float],
    goal: tuple[float, float],
    begin_s: float,
    rng: np.random.Generator,
) -> bool:
    """Stage one or two edges of any shape from begin to goal; tell whether all stand."""
    here = begin
    if rng.random() < 0.5:
        middle = (0.5 * (begin[0] + goal[0]), 0.5 * (begin[1] + goal[1]))
        here = _around(graph, middle, _FAR_NUDGE * graph.step, rng)
        draw_shape(graph, rng)
        if not _is_near(graph, begin, here) or not stage_edge(graph, begin, here, begin_s):
            return False
        begin_s += duration_of(graph, first_staged(graph) + graph.tally[STAGED] - 1)
    draw_shape(graph, rng)
    return _is_near(graph, here, goal) and stage_edge(graph, here, goal, begin_s)


@inner_kernel
def _seal_proposal(graph: Graph, stands: bool) -> None:
    """Make the edges staged last a proposal, or drop them where they do not fit."""
    begin = graph.proposal[graph.tally[PROPOSALS]]
    first = first_staged(graph)
    fits = stands
    for i in range(SHARES):
        share = graph.total[i]
        for edge in range(first + begin, first + graph.tally[STAGED]):
            share += graph.edge_share[edge, i]
        fits = fits and share <= FULL_SHARE
    if fits:
        graph.tally[PROPOSALS] += 1
        graph.proposal[graph.tally[PROPOSALS]] = graph.tally[STAGED]
    else:
        graph.tally[STAGED] = begin


@inner_kernel
def _is_near(graph: Graph, a: tuple[float, float], b: tuple[float, float]) -> bool:
    return math.hypot(a[0] - b[0], a[1] - b[1]) <= graph.step


@inner_kernel
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
