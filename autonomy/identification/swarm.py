"""Particle swarm in the parameter box (thesis Appendix B)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.identification.kernel import DIVERGED
from autonomy.identification.nuisance import Profile, costs, profile_of, refined
from autonomy.identification.problem import Problem, Workers

_REFRESH = 10
"""Moves between two looks at the initial states from the best point so far."""
_ARRAYS = (
    "position",
    "velocity",
    "best",
    "best_cost",
    "anchor",
    "initial",
    "earlier",
    "earlier_initial",
)


@dataclass(frozen=True, slots=True)
class Swarm:
    """All that the next move depends on; arrays are replaced, never changed."""

    seed: int
    """Each move draws from a generator of its own, made of this, the run and the iteration."""
    run: int
    iteration: int
    """Moves done in this run."""
    position: FloatArray
    """In units of the scales, shape ``(particles, n)``."""
    velocity: FloatArray
    """Shape ``(particles, n)``."""
    best: FloatArray
    """Best point that each particle has seen, shape ``(particles, n)``."""
    best_cost: FloatArray
    """Shape ``(particles,)``."""
    anchor: FloatArray
    """Candidate at which it was found how the initial states act, shape ``(n,)``."""
    initial: FloatArray
    """Its initial states, from which all particles start, shape ``(segments, 12)``."""
    earlier: FloatArray
    """Best point of all earlier runs, shape ``(n,)``."""
    earlier_initial: FloatArray
    """Its initial states, shape ``(segments, 12)``."""
    earlier_cost: float

    @property
    def leader(self) -> FloatArray:
        """Best point of this run, shape ``(n,)``."""
        return self.best[int(np.argmin(self.best_cost))]

    @property
    def cost(self) -> float:
        """Least cost of all runs."""
        return min(float(self.best_cost.min()), self.earlier_cost)

    @property
    def u(self) -> FloatArray:
        """Best point of all runs, shape ``(n,)``."""
        return self.leader if float(self.best_cost.min()) <= self.earlier_cost else self.earlier

    @property
    def u_initial(self) -> FloatArray:
        """Initial states that go with ``u``, shape ``(segments, 12)``."""
        is_mine = float(self.best_cost.min()) <= self.earlier_cost
        return self.initial if is_mine else self.earlier_initial

    def spread(self, problem: Problem) -> float:
        """Return the mean standard deviation of the positions as a part of the box's width."""
        return float(np.mean(np.std(self.position, axis=0) / (problem.high - problem.low)))

    def document(self) -> dict[str, Any]:
        """Return it in JSON's types; nothing is rounded."""
        arrays = {name: getattr(self, name).tolist() for name in _ARRAYS}
        return arrays | {
            "seed": self.seed,
            "run": self.run,
            "iteration": self.iteration,
            "earlier_cost": self.earlier_cost,
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> "Swarm":
        """Read what ``document`` wrote."""
        arrays = {name: np.array(document[name], dtype=np.float64) for name in _ARRAYS}
        return cls(
            seed=int(document["seed"]),
            run=int(document["run"]),
            iteration=int(document["iteration"]),
            earlier_cost=float(document["earlier_cost"]),
            **arrays,
        )


def begin(problem: Problem, seed: int, workers: Workers) -> Swarm:
    """Scatter the particles of the first run evenly over the box.

    Args:
        problem: The fit.
        seed: Start of all randomness.
        workers: Threads.
    """
    present = np.zeros(len(problem.sought))
    found = refined(problem, present, problem.guess, workers, whole=False)
    initial = problem.guess if found is None else found
    place = (present, initial)
    return _scattered(problem, seed, 0, place, (*place, DIVERGED), workers)


def search(
    problem: Problem,
    start: Swarm,
    workers: Workers,
    after_move: Callable[[Swarm], None] = lambda _: None,
) -> Swarm:
    """Move the swarm until all runs are done.

    Args:
        problem: The fit.
        start: From ``begin`` or a checkpoint.
        workers: Threads.
        after_move: Called after each move; may raise to stop.

    Source:
        Coleman, thesis, Appendix B; velocities are clamped to ``velocity_share`` of the box, and a
        particle that would leave the box stops at its wall.
    """
    config = problem.config
    swarm = start
    profile = _profile(problem, swarm, workers)
    while swarm.run + 1 < config.runs or swarm.iteration < config.iterations:
        if swarm.iteration >= config.iterations:
            swarm = _next_run(problem, swarm, workers)
            profile = _profile(problem, swarm, workers)
        swarm = _moved(problem, swarm, profile, workers)
        if swarm.iteration % _REFRESH == 0 or swarm.iteration == config.iterations:
            swarm = _refreshed(problem, swarm, workers)
            profile = _profile(problem, swarm, workers)
        after_move(swarm)
    return swarm


def _scattered(
    problem: Problem,
    seed: int,
    run: int,
    anchored: tuple[FloatArray, FloatArray],
    earlier: tuple[FloatArray, FloatArray, float],
    workers: Workers,
) -> Swarm:
    """Return a run's first positions with their costs."""
    config = problem.config
    generator = np.random.default_rng([seed, run, 0])
    shape = (config.particles, len(problem.sought))
    low, high = problem.low, problem.high
    position = generator.uniform(low, high, shape)
    fastest = config.velocity_share * (high - low)
    velocity = generator.uniform(-fastest, fastest, shape)
    if config.starts_at_present:
        position[0] = 0.0
    swarm = Swarm(
        seed,
        run,
        0,
        position,
        velocity,
        position,
        np.full(config.particles, DIVERGED),
        *anchored,
        *earlier,
    )
    profile = _profile(problem, swarm, workers)
    return replace(swarm, best_cost=costs(problem, position, profile, workers))


def _moved(problem: Problem, swarm: Swarm, profile: Profile, workers: Workers) -> Swarm:
    """Return the swarm after one move of every particle."""
    config = problem.config
    low, high = problem.low, problem.high
    generator = np.random.default_rng([swarm.seed, swarm.run, swarm.iteration + 1])
    own, shared = generator.random((2, *swarm.position.shape))
    velocity = (
        config.inertia * swarm.velocity
        + config.own_pull * own * (swarm.best - swarm.position)
        + config.shared_pull * shared * (swarm.leader - swarm.position)
    )
    fastest = config.velocity_share * (high - low)
    velocity = np.clip(velocity, -fastest, fastest)
    wanted = swarm.position + velocity
    position = np.clip(wanted, low, high)
    velocity = np.where(position == wanted, velocity, 0.0)
    cost = costs(problem, position, profile, workers)
    better = cost < swarm.best_cost
    return replace(
        swarm,
        iteration=swarm.iteration + 1,
        position=position,
        velocity=velocity,
        best=np.where(better[:, None], position, swarm.best),
        best_cost=np.where(better, cost, swarm.best_cost),
    )


def _refreshed(problem: Problem, swarm: Swarm, workers: Workers) -> Swarm:
    """Look at the initial states again, from the leader, and cost all best points anew."""
    initial = refined(problem, swarm.leader, swarm.initial, workers, whole=False)
    if initial is None:
        return swarm
    moved = replace(swarm, anchor=swarm.leader, initial=initial)
    profile = _profile(problem, moved, workers)
    return replace(moved, best_cost=costs(problem, swarm.best, profile, workers))


def _next_run(problem: Problem, swarm: Swarm, workers: Workers) -> Swarm:
    """Scatter anew; the best point so far is kept beside the swarm."""
    return _scattered(
        problem,
        swarm.seed,
        swarm.run + 1,
        (swarm.u, swarm.u_initial),
        (swarm.u, swarm.u_initial, swarm.cost),
        workers,
    )


def _profile(problem: Problem, swarm: Swarm, workers: Workers) -> Profile:
    """Return how the initial states act; it depends on nothing but what a checkpoint holds."""
    return profile_of(problem, swarm.anchor, swarm.initial, workers)
