"""Damped Gauss-Newton descent in the parameters, the initial states projected out."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.identification.normal_equations import (
    Information,
    NormalEquations,
    normal_equations,
)
from autonomy.identification.nuisance import refined, segment_costs
from autonomy.identification.problem import Problem, Workers
from autonomy.identification.progress import IdentificationError

_ANCHOR_STD = 1.0
"""Standard deviation of the prior that keeps what the data cannot tell at its present value, as a
part of a parameter's scale; the data outweigh it by far in whatever they can tell."""
_FIRST_DAMPING = 1e-2
_TRIES = 8
_ENOUGH = 1e-6


class DivergedError(IdentificationError):
    """The model leaves all bounds at the values where the descent should start."""


@dataclass(frozen=True, slots=True)
class Descent:
    """A point of the descent; enough to go on from."""

    u: FloatArray
    """Unknowns in units of their scales, shape ``(n,)``."""
    initial: FloatArray
    """Initial states, shape ``(segments, 12)``."""
    cost: float
    """Mean squared weighted residual."""
    damping: float
    steps: int = 0
    is_done: bool = False

    def document(self) -> dict[str, Any]:
        """Return it in JSON's types; nothing is rounded."""
        return {
            "u": self.u.tolist(),
            "initial": self.initial.tolist(),
            "cost": self.cost,
            "damping": self.damping,
            "steps": self.steps,
            "is_done": self.is_done,
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> "Descent":
        """Read what ``document`` wrote."""
        return cls(
            np.array(document["u"], dtype=np.float64),
            np.array(document["initial"], dtype=np.float64),
            float(document["cost"]),
            float(document["damping"]),
            int(document["steps"]),
            bool(document["is_done"]),
        )


def begin(problem: Problem, u: FloatArray, workers: Workers) -> Descent:
    """Prepare a descent: find the initial states that fit the start best.

    Args:
        problem: The fit.
        u: Where to start, shape ``(n,)``.
        workers: Threads.

    Raises:
        DivergedError: If the model leaves all bounds there.
    """
    initial = settled(problem, u, problem.guess, workers)
    if initial is None:
        raise DivergedError(
            "the model cannot follow the recording from the present parameters; try the swarm, a"
            " smaller step, or check the vehicle"
        )
    return at(problem, u, initial, workers)


def settled(
    problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers
) -> FloatArray | None:
    """Return the initial states that fit best, first by the beginnings, then by whole segments.

    Args:
        problem: The fit.
        u: Unknowns in units of their scales, shape ``(n,)``.
        initial: Where to begin, shape ``(segments, 12)``.
        workers: Threads.

    Returns:
        Shape ``(segments, 12)``, or None if the model diverges.
    """
    early = refined(problem, u, initial, workers, whole=False)
    if early is None:
        return None
    whole = refined(problem, u, early, workers, whole=True)
    return early if whole is None else whole


def at(
    problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers, steps: int = 0
) -> Descent:
    """Return the point of a descent with given unknowns and initial states.

    Args:
        problem: The fit.
        u: Unknowns in units of their scales, shape ``(n,)``.
        initial: Initial states, shape ``(segments, 12)``.
        workers: Threads.
        steps: Steps that were done before.
    """
    cost = _cost(problem, u, initial, workers)
    return Descent(u.copy(), initial.copy(), cost, _FIRST_DAMPING, steps)


def descend(
    problem: Problem,
    start: Descent,
    workers: Workers,
    after_step: Callable[[Descent], None] = lambda _: None,
) -> Descent:
    """Go down until nothing is gained or ``config.descents`` steps are done.

    Args:
        problem: The fit.
        start: From ``begin`` or a checkpoint.
        workers: Threads.
        after_step: Called with each new point; may raise to stop.
    """
    point = start
    while not point.is_done and point.steps < problem.config.descents:
        point = stepped(problem, point, workers)
        after_step(point)
    return point


def stepped(problem: Problem, point: Descent, workers: Workers) -> Descent:
    """Return the next point; it is done where nothing helps, not even other initial states."""
    found = _step(problem, point, workers)
    return _resettled(problem, found, workers) if found.is_done else found


def decrement(problem: Problem, u: FloatArray, data: Information, cost: float) -> float:
    """Return how far a point is from the minimum, in standard deviations of the noise.

    It is the root of Newton's decrement, over the unknowns that do not press against the box: what
    the next step would gain in the sum of squares if that were a parabola.

    Args:
        problem: The fit.
        u: The point, shape ``(n,)``.
        data: What the data say there.
        cost: Mean squared weighted residual there.
    """
    anchor = _ANCHOR_STD**-2
    pull = data.gradient + anchor * u
    pressed = ((u <= problem.low + 1e-9) & (pull > 0.0)) | (
        (u >= problem.high - 1e-9) & (pull < 0.0)
    )
    free = np.flatnonzero(~pressed)
    hessian = data.fisher[np.ix_(free, free)] + anchor * np.eye(free.size)
    squared = float(pull[free] @ np.linalg.solve(hessian, pull[free]))
    return math.sqrt(max(squared, 0.0) / max(cost, 1.0))


def best_settled(
    problem: Problem, u: FloatArray, starts: Sequence[FloatArray], workers: Workers
) -> FloatArray | None:
    """Return the best initial states that are reached from several starts, segment by segment.

    Args:
        problem: The fit.
        u: Unknowns in units of their scales, shape ``(n,)``.
        starts: Initial states to begin with, each of shape ``(segments, 12)``.
        workers: Threads.

    Returns:
        Shape ``(segments, 12)``, or None if the model diverges from each start.
    """
    best: FloatArray | None = None
    least = np.zeros(0)
    for start in starts:
        found = settled(problem, u, start, workers)
        if found is None:
            continue
        predicted, _ = problem.simulate(u[None], found[None], workers)
        total = segment_costs(problem, problem.residual(predicted[0]), found)
        if best is None:
            best, least = found, total
        else:
            better = total < least
            best, least = np.where(better[:, None], found, best), np.minimum(total, least)
    return best


def _resettled(problem: Problem, point: Descent, workers: Workers) -> Descent:
    """Look whether a segment follows better from another start; if so, the descent goes on."""
    initial = best_settled(problem, point.u, (point.initial, problem.guess), workers)
    if initial is None:
        return point
    cost = _cost(problem, point.u, initial, workers)
    if point.cost - cost < _ENOUGH * point.cost:
        return point
    return Descent(point.u, initial, cost, _FIRST_DAMPING, point.steps)


def _step(problem: Problem, point: Descent, workers: Workers) -> Descent:
    """Return the next point; ``is_done`` where no damping helps or hardly anything is gained."""
    done = replace(point, steps=point.steps + 1, is_done=True)
    equations = normal_equations(problem, point.u, point.initial, workers)
    if equations is None:
        return done
    before = point.cost + _anchor_cost(problem, point.u)
    damping = point.damping
    for _ in range(_TRIES):
        du, dx = _damped_step(problem, point.u, equations, damping)
        u, initial = point.u + du, point.initial + dx
        cost = _cost(problem, u, initial, workers)
        gained = before - cost - _anchor_cost(problem, u)
        if gained > 0.0:
            is_done = gained < _ENOUGH * point.cost
            return Descent(u, initial, cost, max(damping * 0.1, 1e-9), point.steps + 1, is_done)
        damping *= 10.0
    return done


def _damped_step(
    problem: Problem, u: FloatArray, equations: Sequence[NormalEquations], damping: float
) -> tuple[FloatArray, FloatArray]:
    """Return a Levenberg-Marquardt step of the unknowns and the initial states."""
    eliminated = [segment.eliminated(damping) for segment in equations]
    anchor = np.full(u.size, _ANCHOR_STD**-2)
    hessian = np.sum([part[0] for part in eliminated], axis=0) + np.diag(anchor)
    hessian[np.diag_indices(u.size)] *= 1.0 + damping
    gradient = np.sum([part[1] for part in eliminated], axis=0) + anchor * u
    du = _within_box(hessian, gradient, problem.low - u, problem.high - u)
    return du, np.array([-(part[2][:, 0] + part[2][:, 1:] @ du) for part in eliminated])


def _within_box(
    hessian: FloatArray, gradient: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """Return the Newton step; what would leave the box stops at its wall."""
    free = np.ones(gradient.size, dtype=np.bool_)
    du = np.zeros(gradient.size)
    while free.any():
        pull = gradient[free] + hessian[np.ix_(free, ~free)] @ du[~free]
        du[free] = -np.linalg.solve(hessian[np.ix_(free, free)], pull)
        outside = free & ((du < low - 1e-12) | (du > high + 1e-12))
        if not outside.any():
            break
        du[outside] = np.clip(du, low, high)[outside]
        free &= ~outside
    return np.clip(du, low, high)


def _cost(problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers) -> float:
    predicted, _ = problem.simulate(u[None], initial[None], workers)
    total = segment_costs(problem, problem.residual(predicted[0]), initial).sum()
    return float(total) / problem.degrees if math.isfinite(total) else math.inf


def _anchor_cost(problem: Problem, u: FloatArray) -> float:
    return float(np.sum((u / _ANCHOR_STD) ** 2)) / problem.degrees
