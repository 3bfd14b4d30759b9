"""The multigraph of surfacings that a search grows, as arrays that compiled code shares.

Nodes are points of the surface; edges are trajectories between two of them; a path is its last
edge and the path before that. Edges are *staged* first, in a part of the edge tables behind the
kept ones, and kept only when a path uses them. The best distinct trajectories, the *elite*, own
copies of their edges in a third part between the two, so they outlive everything else.

What an edge or path spends is kept as its shares of the budgets of energy, time and satellite
bytes; a share of a budget that is not set is 0.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.planner import outcome
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.leg_kernel import LEG_COLUMNS
from autonomy.planner.leg.waterway import Waterway, waterway_of
from autonomy.planner.limits import Limits, legs_max, limits_of, points_max, shape_size
from autonomy.site import Site

Int32Array = npt.NDArray[np.int32]

(
    NODES,
    EDGES,
    PATHS,
    STAGED,
    PROPOSALS,
    BEFORE,
    CANDIDATES,
    RESERVOIR_FULL,
    TABLES_FULL,
    GROUP_BEGIN,
    GROUP_END,
) = range(11)
"""Places in ``Graph.tally``; ``BEFORE`` is the number of proposals for the first gap. The elite
trajectories of the start that is searched from are those from ``GROUP_BEGIN`` to ``GROUP_END``."""
ELITE, FIRST_A, TAKEN_A, FIRST_B, TAKEN_B = range(5)
"""Places in ``Graph.gap``."""
DEPTH_MAX = 48
"""Most edges of one path; a round's budget ends far earlier."""
BINS = 20
"""Slices of the budget; each node keeps its best paths of every slice."""
SHARES = 3
"""Budgets: energy, time, satellite bytes."""
FULL_SHARE = 1.0 + 1e-9
SHORT = 1e9
"""Subtracted from the worth of a trajectory that spends too little to be compared."""
_CLOSE = 0.15
STAGED_MIN = 480
"""Edges that can be staged at once. Proposals for two gaps are tried in every combination, so many
at once make many trajectories of few edges."""
_ELITES_MIN = 4
_NODES_MAX = 4096


class Graph(NamedTuple):
    """Arrays of a search; ``tally`` tells how much of each is in use."""

    limits: Limits
    waterway: Waterway
    """Where there is water enough."""
    step: float
    close: float
    """Two surfacings are alike within this distance, m."""
    near_radius: float
    nearest_radius: float
    edges_per_call: int
    near_max: int
    share_per_unit: FloatArray
    """One over each budget, 0 for one that is not set, ``(SHARES,)``."""
    surfacing_time: float
    surfacing_bytes: float
    least_share: FloatArray
    """Lower bound on the shares of any edge, ``(SHARES,)``."""
    least_spent: float
    """Only trajectories that spend more than this part of some budget are compared."""
    tally: IntArray
    node_xy: FloatArray
    node_time: FloatArray
    """About when a trajectory comes to each node, s since the plan began."""
    node_is_open: BoolArray
    slot: Int32Array
    """Path in each slot of each node, -1 where empty, ``(nodes, BINS * paths per bin)``."""
    edge_legs: FloatArray
    edge_leg_count: Int32Array
    edge_share: FloatArray
    edge_start: FloatArray
    """North and east where each edge begins, ``(edges, 2)``; in a current its legs, which are what
    the robot believes, end elsewhere than it does."""
    edge_end: FloatArray
    edge_shape: FloatArray
    """What each edge was made from (``edge.random_shape``); one row more than there are edges."""
    staged_points: FloatArray
    staged_point_count: Int32Array
    staged_source: Int32Array
    """Node that each staged edge leaves."""
    proposal: Int32Array
    """First staged edge of each proposal, and one behind the last; those for the first gap come
    before those for the second."""
    path_parent: Int32Array
    path_edge: Int32Array
    path_share: FloatArray
    path_worth: FloatArray
    elite_block: Int32Array
    """Block of ``DEPTH_MAX`` edges that each elite trajectory owns; the last one is free."""
    elite_length: Int32Array
    elite_share: FloatArray
    elite_worth: FloatArray
    """Worth of each elite trajectory, less ``SHORT`` if it spends too little."""
    copied: Int32Array
    """Source and target of the edges that an elite trajectory was last made of."""
    gap: IntArray
    """The elite trajectory being refined, and the first edge and the number of edges of the two
    gaps in it; the second may have none."""
    total: FloatArray
    """Room for the shares of a sum, ``(SHARES,)``."""


def graph_of(
    config: PlannerConfig,
    start_xy: tuple[float, float],
    budget: float,
    edges: int,
    paths: int,
    site: Site | None = None,
    *,
    starts: int = 1,
) -> Graph:
    """Lay out the arrays of a search that holds so many edges and paths, with its first node.

    It has elite trajectories for so many starts, beginning with those of the first.

    The arrays are large but untouched: the system gives memory to the part in use only.
    """
    search = config.search
    group = max(_ELITES_MIN, search.runners_up + 1)
    elites = starts * group
    staged = max(STAGED_MIN, (search.near_max + 1) * search.edges_per_call)
    all_edges = edges + (elites + 1) * DEPTH_MAX + staged
    slots = max(1, -(-search.paths_per_node // BINS)) * BINS
    budgets = np.array([budget, config.time_budget_s, config.satellite_bytes], dtype=np.float64)
    least = outcome.least_spending(config)
    per_unit = np.divide(1.0, budgets, out=np.zeros(SHARES), where=budgets > 0.0)
    graph = Graph(
        limits=limits_of(config, budget),
        waterway=waterway_of(config, site),
        step=search.step_m,
        close=_CLOSE * search.step_m,
        near_radius=search.near_radius_m,
        nearest_radius=search.nearest_radius_m,
        edges_per_call=search.edges_per_call,
        near_max=search.near_max,
        share_per_unit=per_unit,
        surfacing_time=config.mission.turn_time_s,
        surfacing_bytes=float(config.mission.surfacing_bytes),
        least_share=np.array([least.energy, least.duration_s, least.satellite_bytes]) * per_unit,
        least_spent=search.min_budget_fraction,
        tally=np.zeros(11, dtype=np.int64),
        node_xy=np.empty((_NODES_MAX, 2)),
        node_time=np.empty(_NODES_MAX),
        node_is_open=np.empty(_NODES_MAX, dtype=np.bool_),
        slot=np.empty((_NODES_MAX, slots), dtype=np.int32),
        edge_legs=np.empty((all_edges, legs_max(config), LEG_COLUMNS)),
        edge_leg_count=np.empty(all_edges, dtype=np.int32),
        edge_share=np.empty((all_edges, SHARES)),
        edge_start=np.empty((all_edges, 2)),
        edge_end=np.empty((all_edges, 2)),
        edge_shape=np.empty((all_edges + 1, shape_size(config))),
        staged_points=np.empty((staged, points_max(config), 5)),
        staged_point_count=np.empty(staged, dtype=np.int32),
        staged_source=np.empty(staged, dtype=np.int32),
        proposal=np.empty(staged + 1, dtype=np.int32),
        path_parent=np.empty(paths, dtype=np.int32),
        path_edge=np.empty(paths, dtype=np.int32),
        path_share=np.empty((paths, SHARES)),
        path_worth=np.empty(paths),
        elite_block=np.arange(elites + 1, dtype=np.int32),
        elite_length=np.zeros(elites, dtype=np.int32),
        elite_share=np.zeros((elites, SHARES)),
        elite_worth=np.full(elites, -np.inf),
        copied=np.empty((DEPTH_MAX, 2), dtype=np.int32),
        gap=np.zeros(5, dtype=np.int64),
        total=np.zeros(SHARES),
    )
    graph.tally[GROUP_END] = group
    plant(graph, start_xy[0], start_xy[1])
    return graph


@kernel
def plant(graph: Graph, x: float, y: float) -> None:
    """Begin anew with the first node and the empty path, number 0, which reaches it.

    The elite trajectories stay.
    """
    graph.tally[NODES] = graph.tally[EDGES] = graph.tally[TABLES_FULL] = 0
    open_node(graph, x, y)
    graph.path_parent[0] = -1
    graph.path_edge[0] = -1
    graph.path_share[0] = 0.0
    graph.path_worth[0] = 0.0
    graph.slot[0, 0] = 0
    graph.tally[NODES] = 1
    graph.tally[PATHS] = 1


@inner_kernel
def open_node(graph: Graph, x: float, y: float) -> None:
    """Prepare the node behind the last one; it counts once ``tally[NODES]`` says so."""
    node = graph.tally[NODES]
    graph.node_xy[node, 0] = x
    graph.node_xy[node, 1] = y
    graph.node_time[node] = 0.0
    graph.node_is_open[node] = True
    graph.slot[node, :] = -1


@inner_kernel
def add_shares(graph: Graph, one: FloatArray, other: FloatArray) -> float:
    """Set ``total`` to the sum of two lists of shares; return the greatest of them."""
    greatest = 0.0
    for i in range(SHARES):
        graph.total[i] = one[i] + other[i]
        greatest = max(greatest, graph.total[i])
    return greatest


@inner_kernel
def can_go_on(graph: Graph, share: FloatArray) -> bool:
    """Tell whether the cheapest edge may follow what spends these shares."""
    greatest = 0.0
    for i in range(SHARES):
        greatest = max(greatest, share[i] + graph.least_share[i])
    return greatest <= FULL_SHARE


@inner_kernel
def find_slot(graph: Graph, node: int, spent: float) -> int:
    """Return where a path that spends this greatest share would be kept at a node.

    That is an empty slot of its slice of the budget, or the slot of the slice's worst path.
    """
    per_bin = graph.slot.shape[1] // BINS
    bin_number = min(int(BINS * spent), BINS - 1)
    worst, place = math.inf, -1
    for i in range(bin_number * per_bin, (bin_number + 1) * per_bin):
        path = graph.slot[node, i]
        if path < 0:
            return i
        if graph.path_worth[path] < worst:
            worst, place = graph.path_worth[path], i
    return place


@inner_kernel
def slot_worth(graph: Graph, node: int, place: int) -> float:
    """Return the worth of the path in a slot, minus infinity if it is empty."""
    path = graph.slot[node, place]
    return float(graph.path_worth[path]) if path >= 0 else -math.inf


@inner_kernel
def add_path(graph: Graph, node: int, place: int, parent: int, edge: int, worth: float) -> int:
    """Keep a path that spends ``total`` in a slot of a node; return its number."""
    path = graph.tally[PATHS]
    if graph.slot[node, place] >= 0:
        graph.tally[RESERVOIR_FULL] = 1
    graph.path_parent[path] = parent
    graph.path_edge[path] = edge
    graph.path_share[path] = graph.total
    graph.path_worth[path] = worth
    graph.slot[node, place] = path
    graph.tally[PATHS] = path + 1
    return path


@inner_kernel
def chain_of(graph: Graph, path: int, chain: Int32Array) -> int:
    """Write the path and those before it, first one first, without the empty path."""
    depth = 0
    while path > 0:
        chain[depth] = path
        path = graph.path_parent[path]
        depth += 1
    for i in range(depth // 2):
        chain[i], chain[depth - 1 - i] = chain[depth - 1 - i], chain[i]
    return depth


@kernel
def first_staged(graph: Graph) -> int:
    """Return the number of the first staged edge."""
    return len(graph.edge_leg_count) - len(graph.staged_point_count)


@inner_kernel
def keep_edge(graph: Graph, edge: int) -> int:
    """Copy a staged edge to the kept ones; return its number, -1 if there is no room."""
    kept = graph.tally[EDGES]
    if kept == first_staged(graph) - len(graph.elite_block) * DEPTH_MAX:
        return -1
    copy_edge(graph, edge, kept)
    graph.tally[EDGES] = kept + 1
    return kept


@inner_kernel
def settle_node(graph: Graph) -> None:
    """Lines 12 to 15: count the new node if a path reaches it, and close it if none can go on."""
    node = graph.tally[NODES]
    is_reached, is_open = False, False
    for path in graph.slot[node]:
        if path >= 0:
            is_reached = True
            is_open = is_open or can_go_on(graph, graph.path_share[path])
    if is_reached:
        graph.node_is_open[node] = is_open
        graph.tally[NODES] = node + 1


@inner_kernel
def copy_edge(graph: Graph, source: int, target: int) -> None:
    """Copy one edge, as far as the graph knows it."""
    graph.edge_legs[target] = graph.edge_legs[source]
    graph.edge_leg_count[target] = graph.edge_leg_count[source]
    graph.edge_share[target] = graph.edge_share[source]
    graph.edge_start[target] = graph.edge_start[source]
    graph.edge_end[target] = graph.edge_end[source]
    graph.edge_shape[target] = graph.edge_shape[source]
