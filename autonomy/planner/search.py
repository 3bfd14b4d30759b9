"""The planner that the station runs: Algorithm 1 of the thesis, made fast, and refined.

Three things are different from ``autonomy.planner.literal``. The objective of a trajectory follows
from that of the trajectory that it extends, and a bound rules out most before that (see
``information_kernel``). Every surfacing keeps a limited number of paths, the best of each slice of
the budget. And the graph's best distinct trajectories are refined in turn: a few edges are taken
out of one, and random ones that fit the budget tried in their place.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from autonomy.planner import outcome
from autonomy.planner.belief import FieldBelief
from autonomy.planner.config import PlannerConfig
from autonomy.planner.edge import Edge, planned_points
from autonomy.planner.edge_kernel import LEG_COLUMNS, leg_of
from autonomy.planner.elite import elite_edge
from autonomy.planner.ergodic_kernel import (
    ergodic_of,
    grow_by_ergodicity,
    refine_by_ergodicity,
)
from autonomy.planner.graph import (
    CANDIDATES,
    PROPOSALS,
    RESERVOIR_FULL,
    SHORT,
    STAGED,
    graph_of,
)
from autonomy.planner.information import information_of
from autonomy.planner.information_kernel import grow_by_information, refine_by_information
from autonomy.planner.limits import legs_max
from autonomy.planner.objective import ErgodicMeasure, MutualInformation, Objective
from autonomy.planner.plan import Candidate, ObjectivePoint, PlanResult
from autonomy.planner.staging import stage_growth, stage_refinement

_GROWTH_SHARE = 0.25
_MEGABYTE = 2**20
_PATH_BYTES = 40


def plan(
    config: PlannerConfig,
    belief: FieldBelief,
    start_xy: tuple[float, float],
    *,
    rng: np.random.Generator,
    budget: float,
    on_progress: Callable[[ObjectivePoint], None],
    is_cancelled: Callable[[], bool],
    elapsed_s: Callable[[], float],
) -> PlanResult:
    """Search for the trajectory with the greatest objective that keeps every limit.

    It begins and ends at the surface, stays in the domain, spends at most the budget, and its
    position never becomes less certain than allowed. Call ``kernel.warm_up`` once before, or the
    first search of a process spends its first second loading compiled code.

    Args:
        config: Settings; ``planning_time_s`` or ``search.iterations_max`` ends the search.
        belief: The field map so far.
        start_xy: North and east of the robot at the surface, m, in the site's frame.
        rng: Source of chance; with ``iterations_max`` the same generator gives the same result.
        budget: Energy units of this round.
        on_progress: Told the best objective so far about five times a second.
        is_cancelled: Asked many times a second whether to stop.
        elapsed_s: Seconds since planning began.

    Returns:
        The best trajectory and a few distinct others with their objectives in double precision,
        or the reason why there is none.
    """
    blocked = outcome.obstacle(config, start_xy, budget)
    if blocked is not None:
        return blocked
    progress = outcome.Progress(elapsed_s, is_cancelled, on_progress, config.planning_time_s)
    search = _Search(config, belief, start_xy, rng, budget)
    iterations = config.search.iterations_max
    done = 0
    while not (progress.must_end() or search.is_exhausted or (iterations and done == iterations)):
        search.iterate()
        progress.candidates = search.candidates
        if search.best > progress.best:
            progress.improve(search.best)
        done += 1
    trajectories = search.trajectories()
    if not trajectories:
        return outcome.dead_end(config, start_xy, progress)
    return outcome.offered(config, budget, trajectories, progress, search.reservoir_full)


class _Search:
    """One search: its graph, its objective's arrays, and the turns of growth and refinement.

    Both stage random edges, which cost about the same to judge; growth gets a fixed share of them.
    """

    def __init__(
        self,
        config: PlannerConfig,
        belief: FieldBelief,
        start_xy: tuple[float, float],
        rng: np.random.Generator,
        budget: float,
    ) -> None:
        self._config = config
        self._belief = belief
        self._rng = rng
        self._grows = True
        self._grown = 0
        self._refined = 0
        memory = config.search.memory_mb * _MEGABYTE
        known = len(belief.sample_points) + len(belief.test_points)
        if config.objective == "ergodic":
            edges = memory // 4 // (4 * len(belief.test_points) + _edge_bytes(config))
            paths = memory // 2 // (4 * len(belief.test_points) + _PATH_BYTES)
            self._graph = graph_of(config, start_xy, budget, edges, paths)
            ergodic = ergodic_of(config, belief, self._graph)
            self._extend = partial(grow_by_ergodicity, self._graph, ergodic)
            self._replace = partial(refine_by_ergodicity, self._graph, ergodic)
        else:
            k = config.search.points_per_edge_max
            edges = memory // 4 // (k * (4 * known + 16 * k + 32) + _edge_bytes(config))
            self._graph = graph_of(config, start_xy, budget, edges, memory // 16 // _PATH_BYTES)
            info = information_of(config, belief, self._graph, memory // 2 // 4)
            self._extend = partial(grow_by_information, self._graph, info)
            self._replace = partial(refine_by_information, self._graph, info)

    @property
    def best(self) -> float:
        """Best objective of a trajectory that spends enough, in single precision."""
        best = float(self._graph.elite_worth.max())
        return best if best > -SHORT / 2 else -math.inf

    @property
    def candidates(self) -> int:
        """Trajectories that spend enough of the budget and were compared or ruled out."""
        return int(self._graph.tally[CANDIDATES])

    @property
    def reservoir_full(self) -> bool:
        """Whether some surfacing had more paths than it keeps."""
        return bool(self._graph.tally[RESERVOIR_FULL])

    @property
    def is_exhausted(self) -> bool:
        """Whether the graph cannot grow and there is nothing to refine."""
        return not self._grows and not self._has_elite

    def iterate(self) -> None:
        """Grow by one surfacing, or try one refinement."""
        tally = self._graph.tally
        its_turn = self._grown <= _GROWTH_SHARE * (self._grown + self._refined)
        if self._grows and (its_turn or not self._has_elite):
            self._grows = stage_growth(self._graph, self._rng)
            if self._grows:
                self._extend()
                self._grown += max(int(tally[STAGED]), 1)
        elif self._has_elite:
            stage_refinement(self._graph, self._rng)
            if tally[PROPOSALS]:
                self._replace()
            self._refined += max(int(tally[STAGED]), 1)

    def trajectories(self) -> list[Candidate]:
        """Return the best distinct trajectories, best first, with their exact objectives."""
        graph = self._graph
        worth = self._exact_objective()
        floor = max(float(graph.elite_worth.max()) - SHORT / 2, -1e300)
        found: list[Candidate] = []
        for elite in range(len(graph.elite_worth)):
            if graph.elite_worth[elite] > floor:
                edges = [
                    self._edge(elite_edge(graph, elite, i))
                    for i in range(graph.elite_length[elite])
                ]
                value = worth(np.concatenate([edge.points for edge in edges]))
                found.append(outcome.as_candidate(self._config, edges, value))
        found.sort(key=lambda candidate: -candidate.objective)
        return found[: self._config.search.runners_up + 1]

    def _exact_objective(self) -> Objective:
        if self._config.objective == "ergodic":
            return ErgodicMeasure(self._belief, self._config.ergodic)
        return MutualInformation(self._belief, self._config.counted_thresholds_m())

    @property
    def _has_elite(self) -> bool:
        return bool(self._graph.elite_length.any())

    def _edge(self, number: int) -> Edge:
        graph = self._graph
        legs = tuple(leg_of(row) for row in graph.edge_legs[number, : graph.edge_leg_count[number]])
        return Edge(legs, planned_points(self._config, legs), float(graph.edge_energy[number]))


def _edge_bytes(config: PlannerConfig) -> int:
    """Return about how much memory the graph takes for one edge, whatever the objective."""
    return legs_max(config) * LEG_COLUMNS * 8 + 32
