"""Turns the point where a search ended into a result, with no more certainty than there is."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.identification import least_squares
from autonomy.identification.identifiability import (
    FEWEST_SEGMENTS,
    Direction,
    Judgement,
    judge,
    listed,
    lower_title,
    unjudged,
)
from autonomy.identification.least_squares import Descent, DivergedError
from autonomy.identification.normal_equations import Information, normal_equations
from autonomy.identification.problem import Problem, Workers
from autonomy.identification.result import (
    ActuatorOffsets,
    CostPoint,
    Fit,
    FitChannels,
    IdentificationResult,
    ParameterEstimate,
    UsedSegment,
)
from autonomy.identification.unknown import (
    ALWAYS_FIXED,
    GROUPS,
    MASS_POSITION_OFFSET,
    NET_BUOYANCY_OFFSET,
    offset_unknowns,
    parameter_title,
)
from autonomy.vehicle.config import Vehicle, VehicleParameters

_MOST_POINTS = 2000
_SHOWN = {"depth_m": 2, "roll_rad": 3, "pitch_rad": 4, "heading_rad": 5}
"""Channels of a fit that are shown, and their columns among ``problem.CHANNELS``."""
_AT_MINIMUM = 0.3
"""A point this many standard deviations from the minimum is at it."""
_CLEARLY = 5.0
_UNEXPLAINED = 1.25
"""The model does not explain a recording whose cost is beyond this, and beyond what chance gives
once in a million times."""
_OFFSET_STEPS = 20


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
        method=problem.config.method,
        vehicle=_identified_vehicle(problem, point.u, point.cost),
        cost_as_is=before.cost_as_is,
        cost_before=before.cost,
        cost_after=point.cost,
        is_converged=is_converged,
        convergence=[CostPoint(iteration=k, cost=cost) for k, cost in convergence],
        parameters=_estimates(problem, point.u, judged),
        offsets=_offsets_of(problem, point.u, judged),
        findings=[
            *_doubts(problem, point, is_converged=is_converged),
            *_held_back(problem, judged),
            *_widened(problem, point.u),
            *(direction.message for direction in directions),
        ],
        fit=_fit_of(problem, before.predicted, after[0]),
        segments=[
            UsedSegment(start_s=part.start_s, end_s=part.end_s, rows=part.rows.size)
            for part in problem.report.segments
        ],
        left_out=list(problem.report.left_out),
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


def _held_back(problem: Problem, judged: Sequence[Judgement]) -> list[str]:
    """Return what stands at the border of the box, and what that makes of the others, in words."""
    said: list[str] = []
    for place, mine in enumerate(judged):
        if place not in mine.held_by:
            continue
        along = [
            lower_title(problem.sought[k].title)
            for k, other in enumerate(judged)
            if k != place and place in other.held_by
        ]
        title = lower_title(problem.sought[place].title)
        sentence = f"the {title} stands at the border of the box"
        if along:
            sentence += f", so what goes along with it counts as weak: {listed(along)}"
        said.append(f"{sentence}; check the vehicle and the recording, or hold it fixed")
    return said


def _widened(problem: Problem, u: FloatArray) -> list[str]:
    """Return what was found beyond the box of before, in words."""
    share = problem.config.bounds_share
    moved = [
        f"{lower_title(unknown.title)} ({float(value) * 100.0:+.0f} %)"
        for unknown, value in zip(problem.sought, u, strict=True)
        if unknown.nominal != 0.0 and abs(float(value)) > share + 1e-9
    ]
    if not moved:
        return []
    return [
        f"the box of ±{share * 100.0:.0f} % was widened: beyond it, from the present values, lie"
        f" {listed(moved)}"
    ]


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


def _identified_vehicle(problem: Problem, u: FloatArray, cost: float) -> Vehicle:
    """Return the vehicle with the values of a candidate ``u``, shape ``(n,)``."""
    found = {
        unknown.name: unknown.value(float(value))
        for unknown, value in zip(problem.sought, u, strict=True)
        if unknown.index >= 0
    }
    values = problem.vehicle.parameters.model_dump() | found
    report = problem.report
    note = (
        f"identified from {report.duration_s:.0f} s of flight in {len(report.segments)} segments,"
        f" cost {cost:.2f}"
    )
    if problem.config.fits_offsets:
        offset_kg, offset_m = _offset_values(problem, u)
        note += (
            f"; belongs with a trim of {offset_kg * 1e3:+.2f} g and {offset_m * 1e3:+.2f} mm, which"
            " were found with it"
        )
    return replace(problem.vehicle, parameters=VehicleParameters(**values), note=note)


def _offset_values(problem: Problem, u: FloatArray) -> tuple[float, float]:
    found = {
        unknown.name: unknown.value(float(value))
        for unknown, value in zip(problem.sought, u, strict=True)
    }
    return found.get(NET_BUOYANCY_OFFSET, 0.0), found.get(MASS_POSITION_OFFSET, 0.0)


def _offsets_of(
    problem: Problem, u: FloatArray, judged: tuple[Judgement, ...]
) -> ActuatorOffsets | None:
    """Return the actuators' offsets of a candidate ``u``, shape ``(n,)``, if they were sought."""
    std = {
        unknown.name: judgement.std * unknown.scale if math.isfinite(judgement.std) else None
        for unknown, judgement in zip(problem.sought, judged, strict=True)
    }
    if NET_BUOYANCY_OFFSET not in std:
        return None
    offset_kg, offset_m = _offset_values(problem, u)
    return ActuatorOffsets(
        net_buoyancy_offset_kg=offset_kg,
        net_buoyancy_std_kg=std[NET_BUOYANCY_OFFSET],
        mass_position_offset_m=offset_m,
        mass_position_std_m=std[MASS_POSITION_OFFSET],
    )


def _estimates(
    problem: Problem, u: FloatArray, judged: tuple[Judgement, ...]
) -> list[ParameterEstimate]:
    """Return one estimate for each parameter of the table and each offset, in the table's order.

    ``u`` is the candidate, shape ``(n,)``.
    """
    found = {
        unknown.name: ParameterEstimate(
            name=unknown.name,
            title=unknown.title,
            unit=unknown.unit,
            before=unknown.nominal,
            after=unknown.value(float(value)),
            std=judgement.std * unknown.scale if math.isfinite(judgement.std) else None,
            verdict=judgement.verdict,
            reason=judgement.reason,
        )
        for unknown, value, judgement in zip(problem.sought, u, judged, strict=True)
    }
    table = {name for names in GROUPS.values() for name in names} | ALWAYS_FIXED.keys()
    rows: list[ParameterEstimate] = []
    for name, value in problem.vehicle.parameters.model_dump().items():
        if name in found:
            rows.append(found[name])
        elif name in table:
            title, unit = parameter_title(name)
            kept = "is 0: no range to search" if value == 0.0 else "held fixed by the settings"
            reason = ALWAYS_FIXED.get(name, kept)
            rows.append(
                ParameterEstimate(
                    name=name,
                    title=title,
                    unit=unit,
                    before=value,
                    after=value,
                    std=None,
                    verdict="fixed",
                    reason=reason,
                )
            )
    offsets = (NET_BUOYANCY_OFFSET, MASS_POSITION_OFFSET)
    return [*rows, *(found[name] for name in offsets if name in found)]


def _fit_of(problem: Problem, before: FloatArray | None, after: FloatArray) -> Fit:
    """Thin measured and predicted rows to what a plot shows.

    Args:
        problem: The fit.
        before: Predicted by the parameters of before, shape ``(rows, 6)``, or None.
        after: Predicted by those that were found, shape ``(rows, 6)``.
    """
    layout = problem.layout
    every = max(math.ceil(layout.time_s.size / _MOST_POINTS), 1)
    part = np.arange(0, layout.time_s.size, every)
    segment = np.searchsorted(layout.segment_row, part, side="right") - 1
    return Fit(
        time_s=layout.time_s[part].tolist(),
        segment=segment.tolist(),
        measured=_channels(layout.measured[part]),
        before=None if before is None else _channels(before[part]),
        after=_channels(after[part]),
    )


def _channels(table: FloatArray) -> FitChannels:
    return FitChannels.model_validate(
        {name: table[:, column].tolist() for name, column in _SHOWN.items()}
    )
