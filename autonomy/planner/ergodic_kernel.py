"""The ergodic measure of many trajectories, compiled.

Every edge and every path keeps the sum of its points' Gaussians over the test points, so a path's
measure is one pass over the test points (see ``autonomy.planner.objective.ErgodicMeasure``).
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import xlogy

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.planner.belief import FieldBelief
from autonomy.planner.config import PlannerConfig
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
    Int32Array,
    add_path,
    chain_of,
    find_slot,
    first_staged,
    keep_edge,
    settle_node,
    slot_worth,
)
from autonomy.planner.objective import TINY_DENSITY, TINY_PROBABILITY, target_distribution

_NEGLIGIBLE = 40.0


class Ergodic(NamedTuple):
    """Arrays of the ergodic objective, beside those of the graph."""

    scale: FloatArray
    """One over the reach along each axis, ``(3,)``."""
    test: FloatArray
    """Scaled test points, ``(q, 3)``."""
    target: FloatArray
    """Where time should be spent, ``(q,)``."""
    negative_entropy: float
    """Sum of ``p log p`` of the target."""
    edge_visit: npt.NDArray[np.float32]
    """Sum of Gaussians of each edge, ``(edges, q)``."""
    path_visit: npt.NDArray[np.float32]
    """Sum of Gaussians of each path, ``(paths, q)``."""
    visit: npt.NDArray[np.float32]
    """Room for two sums, ``(2, q)``."""
    edges: Int32Array
    """Room for the edges of one trajectory."""


def ergodic_of(config: PlannerConfig, belief: FieldBelief, graph: Graph) -> Ergodic:
    """Lay out the arrays for a graph."""
    ergodic = config.ergodic
    scale = 1.0 / np.array([ergodic.reach_north_m, ergodic.reach_east_m, ergodic.reach_depth_m])
    target = target_distribution(belief, ergodic.exploitation)
    q = len(target)
    path_visit = np.empty((len(graph.path_energy), q), dtype=np.float32)
    path_visit[0] = 0.0
    return Ergodic(
        scale=scale,
        test=belief.test_points * scale,
        target=target,
        negative_entropy=float(xlogy(target, target).sum()),
        edge_visit=np.empty((len(graph.edge_energy), q), dtype=np.float32),
        path_visit=path_visit,
        visit=np.empty((2, q), dtype=np.float32),
        edges=np.empty(DEPTH_MAX + 1, dtype=np.int32),
    )


@kernel
def grow_by_ergodicity(graph: Graph, ergodic: Ergodic) -> None:
    """ExtendPaths for every staged edge of a new node, then lines 12 to 15 of Algorithm 1."""
    _spread(graph, ergodic)
    for staged in range(graph.tally[STAGED]):
        _extend(graph, ergodic, first_staged(graph) + staged, graph.staged_source[staged])
    settle_node(graph)


@kernel
def refine_by_ergodicity(graph: Graph, ergodic: Ergodic) -> None:
    """Fill the gap in an elite trajectory with the best staged proposal, if that is better."""
    _spread(graph, ergodic)
    elite, first, taken = graph.gap
    rest, whole = ergodic.visit[0], ergodic.visit[1]
    rest[:] = np.float32(0.0)
    spent = 0.0
    for i in range(graph.elite_length[elite]):
        if i < first or i >= first + taken:
            edge = elite_edge(graph, elite, i)
            spent += graph.edge_energy[edge]
            rest += ergodic.edge_visit[edge]
    best, chosen, chosen_energy = float(graph.elite_worth[elite]), -1, 0.0
    for proposal in range(graph.tally[PROPOSALS]):
        begin = first_staged(graph) + graph.proposal[proposal]
        end = first_staged(graph) + graph.proposal[proposal + 1]
        energy = spent + float(graph.edge_energy[begin:end].sum())
        whole[:] = rest
        for edge in range(begin, end):
            whole += ergodic.edge_visit[edge]
        if energy > graph.least_spent:
            graph.tally[CANDIDATES] += 1
        ranked = rank(graph, energy, _measure(ergodic, whole))
        if ranked > best:
            best, chosen, chosen_energy = ranked, proposal, energy
    if chosen >= 0:
        length = fill_gap(graph, chosen, ergodic.edges)
        if elite_place(graph, ergodic.edges, length, best, elite) == elite:
            write_elite(graph, elite, ergodic.edges, length, chosen_energy, best)
            _copy_written(graph, ergodic, length)


@kernel
def _extend(graph: Graph, ergodic: Ergodic, edge: int, source: int) -> None:
    """Append one edge to the paths at its source."""
    node = graph.tally[NODES]
    whole = ergodic.visit[0]
    kept = -1
    for path in graph.slot[source]:
        if path < 0:
            continue
        energy = graph.path_energy[path] + graph.edge_energy[edge]
        if energy > graph.limits.budget:
            continue
        if energy > graph.least_spent:
            graph.tally[CANDIDATES] += 1
        whole[:] = ergodic.path_visit[path]
        whole += ergodic.edge_visit[edge]
        worth = _measure(ergodic, whole)
        _offer(graph, ergodic, path, edge, energy, worth)
        if energy + graph.least_energy > graph.limits.budget:
            continue
        place = find_slot(graph, node, energy)
        if worth <= slot_worth(graph, node, place):
            graph.tally[RESERVOIR_FULL] = 1
            continue
        if kept < 0:
            kept = keep_edge(graph, edge)
        if kept < 0 or graph.tally[PATHS] == len(graph.path_energy):
            graph.tally[TABLES_FULL] = 1
            return
        ergodic.edge_visit[kept] = ergodic.edge_visit[edge]
        new = add_path(graph, node, place, path, kept, energy, worth)
        ergodic.path_visit[new] = whole


@kernel
def _offer(
    graph: Graph, ergodic: Ergodic, path: int, edge: int, energy: float, worth: float
) -> None:
    """Make a path and one more edge an elite trajectory, if it is good enough."""
    ranked = rank(graph, energy, worth)
    if ranked <= graph.elite_worth.min():
        return
    depth = chain_of(graph, path, ergodic.edges)
    if depth + 1 >= DEPTH_MAX:
        return
    for i in range(depth):
        ergodic.edges[i] = graph.path_edge[ergodic.edges[i]]
    ergodic.edges[depth] = edge
    elite = elite_place(graph, ergodic.edges, depth + 1, ranked, -1)
    if elite >= 0:
        write_elite(graph, elite, ergodic.edges, depth + 1, energy, ranked)
        _copy_written(graph, ergodic, depth + 1)


@kernel
def _copy_written(graph: Graph, ergodic: Ergodic, length: int) -> None:
    for i in range(length):
        ergodic.edge_visit[graph.copied[i, 1]] = ergodic.edge_visit[graph.copied[i, 0]]


@kernel
def _spread(graph: Graph, ergodic: Ergodic) -> None:
    """Sum the Gaussians of every staged edge over the test points."""
    for staged in range(graph.tally[STAGED]):
        visit = ergodic.edge_visit[first_staged(graph) + staged]
        visit[:] = np.float32(0.0)
        for i in range(graph.staged_point_count[staged]):
            point = graph.staged_points[staged, i, 1:4] * ergodic.scale
            for j in range(len(visit)):
                x = point[0] - ergodic.test[j, 0]
                y = point[1] - ergodic.test[j, 1]
                z = point[2] - ergodic.test[j, 2]
                exponent = 0.5 * (x * x + y * y + z * z)
                if exponent < _NEGLIGIBLE:
                    visit[j] += math.exp(-exponent)


@kernel
def _measure(ergodic: Ergodic, visit: npt.NDArray[np.float32]) -> float:
    """Return the negative divergence of the target from the normalized visit."""
    total = 0.0
    for value in visit:
        total += value
    scale = 1.0 / max(total, TINY_DENSITY)
    cross = 0.0
    for j in range(len(visit)):
        cross += ergodic.target[j] * math.log(visit[j] * scale + TINY_PROBABILITY)
    return cross - ergodic.negative_entropy
