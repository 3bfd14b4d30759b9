"""Algorithm 1 of the thesis to the letter: the reference of ``planner.search``.

Every path is kept and every objective computed the plain way, so it is slow and its memory grows
with time. Corrections to the printed pseudocode: line 5 samples the surface; lines 18 to 20 extend
each near node, not the nearest one again, and since the near radius does not exceed the step,
Steer returns the new node itself, so that lines 19 to 26 add edges to it and to no other.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from autonomy.planner import outcome
from autonomy.planner.belief import FieldBelief
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg.edge import Edge, propose_edge, random_shape
from autonomy.planner.leg.waterway import waterway_of
from autonomy.planner.objective import Objective, objective
from autonomy.planner.outcome import Spending, spending
from autonomy.planner.plan import Leg, ObjectivePoint, PlanResult
from autonomy.site import Site

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """Edges from the start to one node, and the budget that they spend."""

    edges: tuple[Edge, ...]
    spent: Spending
    share: float
    """Greatest part of a budget that it spends."""


@dataclass(slots=True, eq=False)
class Node:
    """A surfacing, and every path that reaches it."""

    xy: Point
    paths: list[Path] = field(default_factory=list)


def plan(
    config: PlannerConfig,
    belief: FieldBelief,
    start_xy: Point,
    *,
    rng: np.random.Generator,
    budget: float,
    on_progress: Callable[[ObjectivePoint], None],
    is_cancelled: Callable[[], bool],
    elapsed_s: Callable[[], float],
    site: Site | None = None,
    warm: Sequence[Sequence[Leg]] = (),
) -> PlanResult:
    """Search as ``autonomy.planner.search.search.plan`` does, with the same arguments and result.

    The algorithm has no place for trajectories to begin with, so ``warm`` is not heeded.
    """
    del warm
    blocked = outcome.obstacle(config, start_xy, budget, site)
    if blocked is not None:
        return blocked
    progress = outcome.Progress(elapsed_s, is_cancelled, on_progress, config.planning_time_s)
    worth = objective(config, belief, start_xy)
    search = _Literal(config, worth, start_xy, rng, budget, progress, site)
    iterations = config.search.iterations_max or math.inf
    done = 0
    while done < iterations and not progress.must_end() and search.open:
        search.iterate()
        done += 1
    best = search.best or search.best_shorter()
    if best is None:
        return outcome.dead_end(config, start_xy, progress)
    value, path = best
    return outcome.offered(
        config,
        budget,
        [outcome.as_candidate(config, path.edges, value)],
        progress,
        reservoir_full=False,
    )


class _Literal:
    """The graph (V, E) of Algorithm 1 while it grows."""

    def __init__(
        self,
        config: PlannerConfig,
        worth: Objective,
        start_xy: Point,
        rng: np.random.Generator,
        budget: float,
        progress: outcome.Progress,
        site: Site | None,
    ) -> None:
        self._config = config
        self._waterway = waterway_of(config, site)
        self._worth = worth
        self._rng = rng
        self._budget = budget
        self._progress = progress
        self._cheapest = outcome.least_spending(config)
        self._all_paths: list[Path] = []
        self.open = [Node(start_xy, [Path((), Spending(0.0, 0.0, 0.0), 0.0)])]
        self.best: tuple[float, Path] | None = None

    def iterate(self) -> None:
        """Run lines 4 to 26 once."""
        x_s = self._sample()
        nearest = self._nearest(x_s)
        new = Node(self._steer(nearest, x_s))
        self._extend(nearest, new)
        for near in self.open:
            if math.dist(near.xy, new.xy) <= self._config.search.near_radius_m:
                self._extend(near, new)
        if not self._is_closed(new):
            self.open.append(new)

    def best_shorter(self) -> tuple[float, Path] | None:
        """Return the best of the paths that spend most, for when none spends enough."""
        longest = sorted(self._all_paths, key=lambda path: -path.share)[:10]
        valued = [(self._value(path), path) for path in longest]
        return max(valued, key=lambda pair: pair[0], default=None)

    def _sample(self) -> Point:
        domain = self._config.domain
        return (
            float(self._rng.uniform(domain.x_min_m, domain.x_max_m)),
            float(self._rng.uniform(domain.y_min_m, domain.y_max_m)),
        )

    def _nearest(self, x_s: Point) -> Node:
        ring = self._config.search.nearest_radius_m
        return min(self.open, key=lambda node: abs(ring - math.dist(node.xy, x_s)))

    def _steer(self, node: Node, x_s: Point) -> Point:
        distance = math.dist(node.xy, x_s)
        part = min(1.0, self._config.search.step_m / distance) if distance > 0.0 else 1.0
        return (
            node.xy[0] + part * (x_s[0] - node.xy[0]),
            node.xy[1] + part * (x_s[1] - node.xy[1]),
        )

    def _extend(self, source: Node, new: Node) -> None:
        """PlanEdges and ExtendPaths: lines 10 and 11."""
        for _ in range(self._config.search.edges_per_call):
            shape = random_shape(self._config, self._rng)
            edge = propose_edge(
                self._config, source.xy, new.xy, self._budget, shape, self._waterway
            )
            if edge is None:
                continue
            added = spending(self._config, edge.legs)
            for path in source.paths:
                spent = path.spent + added
                self._keep(new, Path((*path.edges, edge), spent, self._share(spent)))
                if self._progress.must_end():
                    return

    def _share(self, spent: Spending) -> float:
        return spent.greatest_share(self._config, self._budget)

    def _keep(self, node: Node, path: Path) -> None:
        if path.share > 1.0:
            return
        node.paths.append(path)
        self._all_paths.append(path)
        if path.share > self._config.search.min_budget_fraction:
            self._progress.candidates += 1
            value = self._value(path)
            if self.best is None or value > self.best[0]:
                self.best = (value, path)
                self._progress.improve(value)

    def _value(self, path: Path) -> float:
        return self._worth(np.concatenate([edge.points for edge in path.edges]))

    def _is_closed(self, node: Node) -> bool:
        return all(self._share(path.spent + self._cheapest) > 1.0 for path in node.paths)
