"""Turns the point where a search ended into a result, with no more certainty than there is."""

from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.identification import least_squares
from autonomy.identification.identifiability import (
    FEWEST_SEGMENTS,
    Direction,
    Judgement,
    judge,
    unjudged,
)
from autonomy.identification.least_squares import Descent, DivergedError
from autonomy.identification.normal_equations import Information, normal_equations
from autonomy.identification.problem import Problem, Workers
from autonomy.identification.result import (
    IdentificationResult,
    estimates,
    fit_of,
    identified_vehicle,
    offsets_of,
)
from autonomy.identification.unknown import offset_unknowns


def moved_at_once(problem: Problem, *, early: bool) -> Problem:
    """Return the fit with actuators that move at their full rate, as early or late as they may.

    The fit itself takes them to move evenly from one report to the next. The truth lies between
    the two extremes; how far they move the answer is how far it hangs on what was not reported.

    Args:
        problem: The fit.
        early: Whether each movement follows its first report at once or ends just at its second.
    """
    limits = problem.vehicle.limits
    rates = np.array([limits.m0_rate_kg_s, limits.rp1_rate_m_s, limits.delta_rate_rad_s])
    layout = problem.layout
    inputs = layout.node_inputs.copy()
    for s in range(layout.segments):
        part = slice(layout.segment_node[s], layout.segment_node[s + 1])
        at = np.concatenate([[0.0], np.cumsum(layout.node_step_s[part][:-1])])
        seen = np.flatnonzero(layout.node_row[part] >= 0)
        inputs[part] = _moved(at, seen, layout.node_inputs[part], rates, early=early)
    return replace(problem, layout=replace(layout, node_inputs=inputs))


def _moved(
    at: FloatArray, seen: IntArray, even: FloatArray, rates: FloatArray, *, early: bool
) -> FloatArray:
    """Return the inputs of one segment's nodes, shape ``(nodes, 3)``; ``seen`` are its reports."""
    nodes = np.arange(at.size)
    interval = np.clip(np.searchsorted(seen, nodes, side="right") - 1, 0, seen.size - 2)
    begin, end = seen[interval], seen[interval + 1]
    way = even[end] - even[begin]
    width = (at[end] - at[begin])[:, None]
    rate = np.maximum(rates, np.abs(way) / width)
    since, left = (at - at[begin])[:, None], (at[end] - at)[:, None]
    if early:
        return even[begin] + np.sign(way) * np.minimum(np.abs(way), rate * since)
    return even[end] - np.sign(way) * np.minimum(np.abs(way), rate * left)


_AT_MINIMUM = 0.3
"""A point this many standard deviations from the minimum is at it."""
_CLEARLY = 5.0
_UNEXPLAINED = 1.25
"""The model does not explain a recording whose cost is beyond this, and beyond what chance gives
once in a million times."""
_OFFSET_STEPS = 20


@dataclass(frozen=True, slots=True)
class Before:
    """What the present parameters say of the recording."""

    cost_as_is: float | None
    """None if the model of before could not follow the recording."""
    cost: float | None
    """With the actuators' offsets fitted, if they were sought: what parameters may be held
    against."""
    predicted: FloatArray | None
    """Shape ``(rows, 6)``, columns as ``problem.CHANNELS``; None as ``cost_as_is``."""


def concluded(
    problem: Problem, point: Descent, convergence: tuple[tuple[int, float], ...], workers: Workers
) -> IdentificationResult:
    """Judge the point where a search ended.

    Args:
        problem: The fit to what was used of the recording.
        point: Where the search ended.
        convergence: Iteration and least cost so far.
        workers: Threads.

    Raises:
        DivergedError: If the model cannot follow the recording there.
    """
    data = _information(problem, point, workers)
    is_converged = point.is_done and (
        least_squares.decrement(problem, point.u, data, point.cost) < _AT_MINIMUM
    )
    judged: tuple[Judgement, ...] = unjudged(problem.sought)
    directions: tuple[Direction, ...] = ()
    if is_converged:
        drift = _drift(problem, point, data, workers)
        judged, directions = judge(problem.sought, point.u, data, point.cost, drift)
    before = _before(problem, workers)
    after, _ = problem.simulate(point.u[None], point.initial[None], workers)
    return IdentificationResult(
        problem.config.method,
        identified_vehicle(problem, point.u, point.cost),
        before.cost_as_is,
        before.cost,
        point.cost,
        is_converged,
        convergence,
        estimates(problem, point.u, judged),
        offsets_of(problem, point.u, judged),
        (*_doubts(problem, point, is_converged=is_converged), *(d.message for d in directions)),
        fit_of(problem, before.predicted, after[0]),
        problem.report,
    )


def _information(problem: Problem, point: Descent, workers: Workers) -> Information:
    equations = normal_equations(problem, point.u, point.initial, workers)
    if equations is None:
        raise DivergedError("the model cannot follow the recording at the point that was found")
    return Information.of(equations)


def _drift(problem: Problem, point: Descent, data: Information, workers: Workers) -> FloatArray:
    """Return how half the gradient changes with what the actuators did unseen, shape ``(2, n)``.

    Infinite if the model cannot follow then: nothing is told.
    """
    found = np.empty((2, point.u.size))
    for k, early in enumerate((True, False)):
        moved = moved_at_once(problem, early=early)
        equations = normal_equations(moved, point.u, point.initial, workers)
        found[k] = np.inf
        if equations is not None:
            found[k] = Information.of(equations).gradient - data.gradient
    return found


def _doubts(problem: Problem, point: Descent, *, is_converged: bool) -> list[str]:
    """Return what speaks against the whole result, in words."""
    said: list[str] = []
    if not is_converged:
        said.append(
            "the search has not ended at a minimum, so there are no intervals: polish, take more"
            " steps of least squares, or free fewer parameters"
        )
    chance = 1.0 + _CLEARLY * float(np.sqrt(2.0 / problem.degrees))
    if point.cost > max(_UNEXPLAINED, chance):
        said.append(
            f"the model does not explain this recording within its noise (cost {point.cost:.2g});"
            " the intervals are widened by it"
        )
    count = problem.layout.segments
    if count < FEWEST_SEGMENTS:
        said.append(
            f"only {count} usable segment{'s' if count != 1 else ''}: it takes"
            f" {FEWEST_SEGMENTS} to see whether they agree, so nothing counts as identified"
        )
    return said


def _before(problem: Problem, workers: Workers) -> Before:
    """Return cost and prediction of the present parameters, as far as they can follow."""
    none = np.zeros(0)
    as_is = replace(problem, sought=())
    initial = least_squares.settled(as_is, none, as_is.guess, workers)
    if initial is None:
        return Before(None, None, None)
    point = least_squares.at(as_is, none, initial, workers)
    cost_as_is, fit = point.cost, as_is
    if problem.config.fits_offsets:
        steps = problem.config.model_copy(update={"descents": _OFFSET_STEPS})
        fit = replace(problem, sought=offset_unknowns(problem.vehicle), config=steps)
        start = least_squares.at(fit, np.zeros(2), initial, workers)
        point = least_squares.descend(fit, start, workers)
    predicted, _ = fit.simulate(point.u[None], point.initial[None], workers)
    return Before(cost_as_is, point.cost, predicted[0])
