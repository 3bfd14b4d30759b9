"""The planner that the station runs: Algorithm 1 of the thesis, made fast, and refined.

Four things are different from ``autonomy.planner.reference.literal``. The objective of a trajectory
follows from that of the trajectory that it extends, and a bound rules out most before that. Every
surfacing keeps a limited number of paths, the best of each slice of the budget. The graph's best
distinct trajectories are refined in turn: edges are taken out of one at two places, and random
ones that fit the budgets tried in their place, in every combination. A search may begin with
transects, and with trajectories of earlier plans. And it starts several times: the better half of
the starts goes on twice as long, until one is left.

What it maximizes has no test points that it could learn (``information.information``). The best of
what every start found are compared on points that no part of the search knew, and offered with
their worth there.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.mask import water_mask
from autonomy.planner import outcome
from autonomy.planner.belief import FieldBelief, sample_noise
from autonomy.planner.config import PlannerConfig
from autonomy.planner.graph import (
    CANDIDATES,
    DEPTH_MAX,
    GROUP_BEGIN,
    GROUP_END,
    PROPOSALS,
    RESERVOIR_FULL,
    SHORT,
    STAGED,
    Graph,
    first_staged,
    graph_of,
    plant,
)
from autonomy.planner.information.information import (
    USED,
    Information,
    bytes_per_edge,
    information_of,
)
from autonomy.planner.leg.edge import Edge, expected_points, legs_energy, refitted
from autonomy.planner.leg.leg_kernel import (
    DURATION,
    ENERGY,
    HEADING,
    KIND,
    KINDS,
    LEG_COLUMNS,
    RADIUS,
    SPEED,
    TURN,
    X0,
    X1,
    Z0,
    Z1,
    leg_of,
)
from autonomy.planner.limits import legs_max
from autonomy.planner.objective import (
    ErgodicMeasure,
    MutualInformation,
    Objective,
    weighted_sum,
)
from autonomy.planner.outcome import spending
from autonomy.planner.plan import Candidate, Leg, ObjectivePoint, Pace, PlanResult
from autonomy.planner.resolution import drawn_points, fine_part
from autonomy.planner.search import warm as warm_start
from autonomy.planner.search.elite import elite_edge
from autonomy.planner.search.ergodic_kernel import Ergodic, ergodic_of
from autonomy.planner.search.growth import adopt, grow
from autonomy.planner.search.refinement import refine, revalue
from autonomy.planner.search.staging import GAP_MAX, note_shares, stage_growth, stage_refinement
from autonomy.planner.search.warm import shape_of
from autonomy.planner.search.weighted import worth_of
from autonomy.planner.transect import transects
from autonomy.site import Site


def stage_trajectory(graph: Graph, config: PlannerConfig, edges: Sequence[Edge]) -> bool:
    """Stage the edges of a trajectory; tell whether there was room for them."""
    graph.tally[STAGED] = 0
    longest = min(DEPTH_MAX, len(graph.staged_point_count))
    legs_room, points_room = graph.edge_legs.shape[1], graph.staged_points.shape[1]
    if len(edges) > longest:
        return False
    begin = edges[0].legs[0].start_ned[:2]
    for staged, edge in enumerate(edges):
        if len(edge.legs) > legs_room or len(edge.points) > points_room:
            return False
        number = first_staged(graph) + staged
        for row, leg in zip(graph.edge_legs[number], edge.legs, strict=False):
            _write(row, leg)
        graph.edge_leg_count[number] = len(edge.legs)
        graph.edge_shape[number] = shape_of(config, edge)
        graph.edge_start[number] = begin
        graph.edge_end[number] = begin = (edge.points[-1, 1], edge.points[-1, 2])
        graph.staged_points[staged, : len(edge.points)] = edge.points
        graph.staged_point_count[staged] = len(edge.points)
        note_shares(graph, number)
    graph.tally[STAGED] = len(edges)
    return True


def _write(row: FloatArray, leg: Leg) -> None:
    """Write a leg as compiled code reads it (``leg_kernel.leg_of``)."""
    row[KIND] = KINDS.index(leg.kind)
    row[X0 : Z0 + 1] = leg.start_ned
    row[X1 : Z1 + 1] = leg.end_ned
    row[SPEED], row[DURATION], row[ENERGY] = leg.speed_m_s, leg.duration_s, leg.energy
    row[HEADING], row[RADIUS], row[TURN] = leg.heading_rad, leg.radius_m, leg.turn_rad


_GROWTH_SHARE = {"information_gain": 0.1, "ergodic": 0.25, "weighted": 0.1}
"""Part of the staged edges that grow the graph. Where proposals are dear to judge, more of them
refine; over eight seeds of the benchmark problem this is best after one second."""
_MEGABYTE = 2**20
_PATH_BYTES = 64
_STARTS_MAX = 4
_START_S = 0.5
_START_ITERATIONS = 60
"""Planning time and iterations that are spent for each start on average, or there are fewer."""
_FINALISTS = 6
"""Trajectories that are compared on points that the search did not know."""
_FINAL_SAMPLES_MAX = 600
"""Past samples that they are compared with; beyond, runs are averaged."""


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
    site: Site | None = None,
    warm: Sequence[Sequence[Leg]] = (),
    pace: Pace | None = None,
) -> PlanResult:
    """Search for the trajectory with the greatest objective that keeps every limit.

    It begins and ends at the surface, stays in the domain and the water, spends at most the
    budgets of energy, time and satellite bytes, and its position never becomes less certain than
    allowed. Call ``kernel.warm_up`` once before, or the first search of a process spends its first
    second loading compiled code.

    Args:
        config: Settings; ``planning_time_s`` or ``search.iterations_max`` ends the search.
        belief: The field map so far.
        start_xy: North and east of the robot at the surface, m, in the site's frame.
        rng: Source of chance; with ``iterations_max`` the same generator gives the same result.
        budget: Energy units of this round.
        on_progress: Told the best objective so far about five times a second.
        is_cancelled: Asked many times a second whether to stop.
        elapsed_s: Seconds since planning began.
        site: Shore and floor; None for water without end. Test points on land do not count.
        warm: Trajectories to begin with, such as those of a search that is continued or the rest
            of an earlier plan. They are joined to the start (``warm.rebased``); what cannot be
            flown is dropped. The result is never worse than the best of them that fits.
        pace: How far the same search came before: it ends there again, whatever the clock says.

    Returns:
        The best trajectory and a few distinct others with what they are worth, information gain
        on points that the search did not know; or the reason why there is none.
    """
    blocked = outcome.obstacle(config, start_xy, budget, site)
    if blocked is not None:
        return blocked
    if site is not None:
        belief = belief.within(water_mask(site, belief.test_points))
    if config.area is not None:
        north, east, _ = belief.test_points.T
        belief = belief.within(config.area.contains(north, east))
    if not len(belief.test_points):
        area = "" if config.area is None else " and in the survey area"
        return outcome.nothing_feasible(
            f"No trajectory: no point of the domain is in the water{area}."
        )
    limit_s = config.planning_time_s if pace is None else math.inf
    progress = outcome.Progress(elapsed_s, is_cancelled, on_progress, limit_s)
    unknown = independent_points(config, site, rng)
    if not len(unknown):
        unknown = belief.test_points
    search = Search(config, belief, start_xy, rng, budget, site)
    search.begin_with(warm)
    most = (config.search.iterations_max or math.inf) if pace is None else pace.iterations
    done, turns = 0, list[tuple[int, float]]()
    while not (progress.must_end() or search.is_exhausted or done == most):
        if pace is not None:
            part = pace.part(done)
        else:
            part = elapsed_s() / config.planning_time_s if math.isinf(most) else done / most
        if search.go_to(part):
            turns.append((done, part))
        search.iterate()
        progress.candidates = search.candidates
        if search.best > progress.best:
            progress.improve(search.best)
        done += 1
    trajectories = search.trajectories(unknown, in_haste=progress.cancelled)
    if not trajectories:
        found = outcome.dead_end(config, start_xy, progress)
    else:
        found = outcome.offered(config, budget, trajectories, progress, search.reservoir_full)
    return replace(found, pace=Pace(done, tuple(turns)))


def independent_points(
    config: PlannerConfig, site: Site | None, rng: np.random.Generator
) -> FloatArray:
    """Return the points that a search with this source of chance is judged on, ``(n, 3)``.

    All that it draws from that source is the seed of another, from which they are drawn.
    """
    own = np.random.default_rng(rng.integers(2**63, size=2))
    return drawn_points(config.domain, site, own, area=config.area)


def starts_of(config: PlannerConfig) -> int:
    """Return how often a search starts: a power of two, less for a short one."""
    iterations = config.search.iterations_max
    part = config.planning_time_s / _START_S
    if iterations:
        part = min(part, iterations / _START_ITERATIONS)
    starts = _STARTS_MAX
    while starts > max(part, 1.0):
        starts //= 2
    return starts


class Search:
    """One search: its graph, its objective's arrays, and the turns of growth and refinement.

    Both stage random edges, which cost about the same to judge; growth gets a fixed share of them.
    Every start has elite trajectories of its own. Rounds of equal length halve the number of the
    starts that are searched from.
    """

    def __init__(
        self,
        config: PlannerConfig,
        belief: FieldBelief,
        start_xy: tuple[float, float],
        rng: np.random.Generator,
        budget: float,
        site: Site | None = None,
    ) -> None:
        self._config = config
        self._belief = belief
        self._start_xy = start_xy
        self._rng = rng
        self._budget = budget
        self._site = site
        self._growth_share = _GROWTH_SHARE[config.objective]
        self._grows = True
        self._grown = 0
        self._refined = 0
        self._warm: list[tuple[Leg, ...]] = []
        self._starts = starts_of(config)
        self._left = list(range(self._starts))
        self._round = 0
        self._start = 0
        edges, paths, rows = _room(config, belief)
        self.graph = graph_of(config, start_xy, budget, edges, paths, site, starts=self._starts)
        self._edges = np.empty(DEPTH_MAX + 2 * GAP_MAX, dtype=np.int32)
        self.info: Information | None = None
        self.ergodic: Ergodic | None = None
        if config.objective != "ergodic":
            fine = fine_part(belief, config.domain, site, rng, config.area)
            self.info = information_of(config, belief, fine, self.graph, rows)
        if config.objective != "information_gain":
            self.ergodic = ergodic_of(config, belief, self.graph)
        self.worth = worth_of(config, belief, start_xy)
        water = self.graph.waterway
        self._transects = transects(config, start_xy, budget, water, DEPTH_MAX)

    @property
    def best(self) -> float:
        """Best objective of a trajectory that spends enough, in single precision."""
        best = float(self.graph.elite_worth.max())
        return best if best > -SHORT / 2 else -math.inf

    @property
    def candidates(self) -> int:
        """Trajectories that spend enough of a budget and were compared or ruled out."""
        return int(self.graph.tally[CANDIDATES])

    @property
    def reservoir_full(self) -> bool:
        """Whether some surfacing had more paths than it keeps."""
        return bool(self.graph.tally[RESERVOIR_FULL])

    @property
    def is_exhausted(self) -> bool:
        """Whether the graph cannot grow and there is nothing to refine."""
        return not self._grows and not self.graph.elite_length.any()

    def begin_with(self, trajectories: Sequence[Sequence[Leg]]) -> None:
        """Take transects and what can be flown of earlier trajectories for the first elite."""
        graph = self.graph
        self._lay_transects()
        for legs in trajectories:
            edges = warm_start.rebased(
                self._config,
                self._start_xy,
                self._budget,
                legs,
                rng=self._rng,
                waterway=graph.waterway,
                site=self._site,
            )
            if not edges:
                continue
            self._warm.append(tuple(leg for edge in edges for leg in edge.legs))
            self._take(edges)

    def go_to(self, part: float) -> bool:
        """Search from the start whose turn it is once this part (0..1) of the search is over.

        Returns:
            Whether that is another than before, or another round of them.
        """
        before = self._round, self._start
        rounds = self._starts.bit_length()
        now = min(int(part * rounds), rounds - 1)
        while self._round < now:
            self._round += 1
            best = [(-self._group(start).max(), start) for start in self._left]
            self._left = [start for _, start in sorted(best)[: (len(best) + 1) // 2]]
        within = min(max(part * rounds - now, 0.0), 1.0 - 1e-9)
        start = self._left[int(within * len(self._left))]
        if start != self._start:
            self._search_from(start)
        return before != (self._round, self._start)

    def _search_from(self, start: int) -> None:
        """Go on with the elite trajectories of a start; in the first round it is a new one."""
        graph, size = self.graph, len(self.graph.elite_worth) // self._starts
        self._start = start
        graph.tally[GROUP_BEGIN], graph.tally[GROUP_END] = start * size, (start + 1) * size
        if self._round == 0:
            plant(graph, *self._start_xy)
            if self.info is not None:
                self.info.tally[USED] = 0
            self._grows, self._grown, self._refined = True, 0, 0
            self._lay_transects()

    def _group(self, start: int) -> FloatArray:
        size = len(self.graph.elite_worth) // self._starts
        return self.graph.elite_worth[start * size : (start + 1) * size]

    def _lay_transects(self) -> None:
        for line in self._transects:
            self._take(line)

    def _take(self, edges: Sequence[Edge]) -> None:
        """Make a trajectory an elite one in place of the worst of them, whatever its own worth."""
        graph = self.graph
        elite = int(graph.tally[GROUP_BEGIN] + self._group(self._start).argmin())
        if stage_trajectory(graph, self._config, edges):
            adopt(graph, self.info, self.ergodic, elite, self._edges)
            revalue(graph, self.info, self.ergodic, self.worth, elite)

    def iterate(self) -> None:
        """Grow by one surfacing, or try one refinement."""
        graph, tally = self.graph, self.graph.tally
        its_turn = self._grown <= self._growth_share * (self._grown + self._refined)
        if self._grows and (its_turn or not self._has_elite):
            self._grows = stage_growth(graph, self._rng)
            if self._grows:
                grow(graph, self.info, self.ergodic, self.worth, self._edges)
                self._grown += max(int(tally[STAGED]), 1)
        elif self._has_elite:
            stage_refinement(graph, self._rng)
            if tally[PROPOSALS]:
                refine(graph, self.info, self.ergodic, self.worth, self._edges)
            self._refined += max(int(tally[STAGED]), 1)

    def trajectories(self, points: FloatArray, *, in_haste: bool = False) -> list[Candidate]:
        """Return the best distinct trajectories, best first, with what they are worth.

        Args:
            points: Test points that no part of the search knew, for the information gain.
            in_haste: Average past samples as the search does, which is faster.
        """
        limit = self._config.search.past_samples_max if in_haste else _FINAL_SAMPLES_MAX
        worth = self._final_objective(points, limit)
        found: list[tuple[bool, Candidate]] = []
        for found_legs, searched in self._finalists().items():
            legs = refitted(self._config, found_legs)
            edge = Edge(legs, expected_points(self._config, legs), legs_energy(self._config, legs))
            candidate = outcome.as_candidate(self._config, [edge], worth(edge.points), searched)
            spent = spending(self._config, legs).greatest_share(self._config, self._budget)
            found.append((spent > self.graph.least_spent, candidate))
        spends_enough = any(enough for enough, _ in found)
        offers = [candidate for enough, candidate in found if enough or not spends_enough]
        offers.sort(key=lambda candidate: -candidate.objective)
        return self._distinct(offers)[: self._config.search.runners_up + 1]

    def _finalists(self) -> dict[tuple[Leg, ...], float | None]:
        """Return the best trajectories and those to begin with, and what the search found in them.

        Of each start only what is not alike is here, of all together more than are offered.
        """
        graph = self.graph
        count = max(_FINALISTS, self._config.search.runners_up + 1)
        found: dict[tuple[Leg, ...], float | None] = {}
        for elite in np.argsort(-graph.elite_worth)[:count]:
            legs: list[Leg] = []
            for i in range(graph.elite_length[elite]):
                edge = elite_edge(graph, elite, i)
                legs += map(leg_of, graph.edge_legs[edge, : graph.edge_leg_count[edge]])
            if legs:
                worth = float(graph.elite_worth[elite])
                short = worth <= -SHORT / 2
                found[tuple(legs)] = None if self.info is None or short else worth
        return dict.fromkeys(self._warm) | found

    def _distinct(self, offers: list[Candidate]) -> list[Candidate]:
        """Leave out what is much like a better one (``elite.elite_place``)."""
        kept: list[Candidate] = []
        for offer in offers:
            if not any(outcome.are_alike(offer, other, self.graph.close) for other in kept):
                kept.append(offer)
        return kept

    def _final_objective(self, points: FloatArray, past_samples_max: int) -> Objective:
        config, belief = self._config, self._belief
        if config.objective == "ergodic":
            return ErgodicMeasure(belief, config.ergodic)
        noise = sample_noise(config, belief)
        gain = MutualInformation(belief.at(points), noise, past_samples_max)
        if config.objective == "information_gain":
            return gain
        return weighted_sum(config, belief, self._start_xy, gain)

    @property
    def _has_elite(self) -> bool:
        begin, end = self.graph.tally[GROUP_BEGIN], self.graph.tally[GROUP_END]
        return bool(self.graph.elite_length[begin:end].any())


def _room(config: PlannerConfig, belief: FieldBelief) -> tuple[int, int, int]:
    """Return how many edges, paths and numbers of factors fit the memory of a search."""
    memory = config.search.memory_mb * _MEGABYTE
    tests, k = len(belief.test_points), config.search.points_per_edge_max
    past = min(len(belief.sample_points), config.search.past_samples_max)
    edge_bytes = legs_max(config) * LEG_COLUMNS * 8 + 64
    path_bytes, rows = _PATH_BYTES, 0
    if config.objective != "ergodic":
        edge_bytes += bytes_per_edge(past, k)
        rows = memory // 2 // 4
    if config.objective != "information_gain":
        edge_bytes += 4 * tests
        path_bytes += 4 * tests
        rows //= 2
    share = 4 if config.objective != "information_gain" else 16
    return memory // 4 // edge_bytes, memory // share // path_bytes, rows
