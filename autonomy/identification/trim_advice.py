"""Advice to the operator: buoyancy and mass offsets from the last dives."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.identification import least_squares
from autonomy.identification.config import (
    IDENTIFICATION_PRESETS,
    IdentificationConfig,
    SegmentRules,
)
from autonomy.identification.identifiability import jackknife
from autonomy.identification.least_squares import Descent
from autonomy.identification.normal_equations import Information, NormalEquations, normal_equations
from autonomy.identification.nuisance import refined
from autonomy.identification.problem import Problem, Workers, problem_from
from autonomy.identification.recording import Recording, Segment, segments
from autonomy.identification.screening import explained, segment_means
from autonomy.identification.unknown import offset_unknowns
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.trim import GlideError, TrimAdvice, TrimConfig

_SHORTEST_S = 6.0
_ENOUGH_S = 30.0
_RATE_WINDOW_S = 3.0
"""Depth rates are slopes of depth over this time."""
_SURE = 2.0
"""A change counts from so many standard deviations on."""
_WORTH = 0.95
"""A change is worth it if an error shrinks at least to this part."""
_ROUNDS = 5
_LONGEST_SHARE = 0.4
"""Shorter parts than an identification's: what disturbs one spoils less."""
_SIDEWAYS = 0.2
"""Weight of roll and heading: they only keep the motion honest."""


class NoAdviceError(ValueError):
    """The recording does not tell the trim; the message says why."""


def advise(
    vehicle: Vehicle,
    recording: Recording,
    present: TrimConfig,
    *,
    dives: int = 10,
    threads: int = 2,
) -> TrimAdvice:
    """Find the trim with which the model explains the last dives best.

    Pump and sliding mass obey their feedback, and the feedback is wrong by a constant: the robot
    is as heavy as the feedback less that constant. A robot that is to be as heavy as wanted must
    therefore be commanded that constant more, and the constant is the trim to set, whatever trim
    held during the dives. It is found by fitting the model's depth and attitude over the gliding
    parts, the starting velocity of each part being unknown too, so that a dive of a few seconds
    that never gets steady counts for what it tells.

    Args:
        vehicle: The model that the robot should obey.
        recording: Its dives; only parts under water with a quiet tail are used.
        present: The trim that holds now, against which the advice is given.
        dives: How many of the last dives to use.
        threads: How many candidates are simulated at once.

    Raises:
        NoAdviceError: If there is too little gliding, or it does not tell the trim.
    """
    problem = _gliding(vehicle, recording, dives)
    with Workers(threads) as workers:
        problem, found, equations = _fitted(problem, present, workers)
        now = _glide_error(problem, _scaled(problem, present), found.initial, workers)
        proposed = _glide_error(problem, found.u, found.initial, workers)
    std = _deviations(problem, found, equations)
    count = np.unique(_dive_numbers(recording, problem.report.segments, problem.config.rules)).size
    return _advice(problem, found.u, std, present, (now, proposed), count)


def _fitted(
    problem: Problem, present: TrimConfig, workers: Workers
) -> tuple[Problem, Descent, Sequence[NormalEquations]]:
    """Fit the offsets; parts that the model explains far worse than the best are left out.

    A kick of the tail or a touch of the wall is not in the model, and spoils its part alone.

    Raises:
        NoAdviceError: If the model cannot follow, or explains too few parts.
    """
    u = _scaled(problem, present)
    for _ in range(_ROUNDS):
        try:
            start = least_squares.begin(problem, u, workers)
        except least_squares.DivergedError as error:
            raise NoAdviceError(
                "the model cannot follow the dives at all: identify the vehicle first"
            ) from error
        found = least_squares.descend(problem, start, workers)
        good = np.array(explained(segment_means(problem, found, workers)))
        if good.all():
            equations = normal_equations(problem, found.u, found.initial, workers)
            if equations is not None:
                return problem, found, equations
            break
        problem, u = _without(problem, ~good), found.u
    raise NoAdviceError("the model does not explain the dives: identify the vehicle first")


def _without(problem: Problem, bad: BoolArray) -> Problem:
    """Return the fit without some of its segments."""
    parts = problem.report.segments
    return _quiet_problem(
        problem,
        tuple(part for part, is_bad in zip(parts, bad.tolist(), strict=True) if not is_bad),
    )


def _quiet_problem(problem: Problem, chosen: tuple[Segment, ...]) -> Problem:
    """Return the fit to some segments, depth and pitch leading.

    Raises:
        NoAdviceError: If they are too short together.
    """
    report = replace(problem.report, segments=chosen)
    if report.duration_s < _ENOUGH_S:
        raise NoAdviceError(
            f"only {report.duration_s:.0f} s of gliding with a quiet tail that the model explains;"
            f" at least {_ENOUGH_S:.0f} s are needed"
        )
    found = problem_from(
        problem.vehicle, problem.recording, problem.config, sought=problem.sought, report=report
    )
    weight = found.layout.weight * np.array([0.0, 0.0, 1.0, _SIDEWAYS, 1.0, _SIDEWAYS])
    return replace(found, layout=replace(found.layout, weight=weight))


def _gliding(vehicle: Vehicle, recording: Recording, dives: int) -> Problem:
    """Return the fit of the offsets to the last dives."""
    preset = IDENTIFICATION_PRESETS.get(vehicle.key, IdentificationConfig())
    longest_s = _LONGEST_SHARE * preset.rules.longest_segment_s
    rules = preset.rules.model_copy(
        update={"shortest_segment_s": _SHORTEST_S, "longest_segment_s": longest_s}
    )
    config = preset.model_copy(update={"rules": rules, "model": "extended"})
    report = segments(recording, rules)
    if not report.segments:
        raise NoAdviceError("there is no gliding with a quiet tail in the recording")
    numbers = _dive_numbers(recording, report.segments, rules)
    last = np.unique(numbers)[-dives:]
    chosen = tuple(
        segment for segment, number in zip(report.segments, numbers, strict=True) if number in last
    )
    whole = problem_from(vehicle, recording, config, sought=offset_unknowns(vehicle), report=report)
    return _quiet_problem(whole, chosen)


def _dive_numbers(recording: Recording, parts: Sequence[Segment], rules: SegmentRules) -> IntArray:
    """Number the dives of segments: between two dives the robot was at the surface."""
    shallow = np.cumsum(recording.position_ned[:, 2] < rules.surface_depth_m)
    seen = np.array([shallow[part.rows[0]] for part in parts])
    return np.concatenate([[0], np.cumsum(np.diff(seen) > 0)]).astype(np.int64)


def _scaled(problem: Problem, trim: TrimConfig) -> FloatArray:
    """Return a trim in units of the unknowns."""
    values = np.array([trim.net_buoyancy_offset_kg, trim.mass_position_offset_m])
    return values / np.array([unknown.scale for unknown in problem.sought])


def _glide_error(
    problem: Problem, u: FloatArray, initial: FloatArray, workers: Workers
) -> GlideError:
    """Return the errors of depth rate and pitch with a trim, from its best initial states."""
    best = refined(problem, u, initial, workers, whole=True)
    start = initial if best is None else best
    predicted, _ = problem.simulate(u[None], start[None], workers)
    layout = problem.layout
    rates: list[FloatArray] = []
    for s in range(layout.segments):
        part = slice(layout.segment_row[s], layout.segment_row[s + 1])
        missed = predicted[0, part, 2] - layout.measured[part, 2]
        rates.append(_slopes(layout.time_s[part], missed))
    pitch = predicted[0, :, 4] - layout.measured[:, 4]
    return GlideError(
        depth_rate_m_s=float(np.sqrt(np.mean(np.concatenate(rates) ** 2))),
        pitch_rad=float(np.sqrt(np.mean(pitch**2))),
    )


def _slopes(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return slopes of straight lines through windows that do not overlap, one for each window."""
    windows = max(int((time_s[-1] - time_s[0]) / _RATE_WINDOW_S), 1)
    number = np.minimum((time_s - time_s[0]) / _RATE_WINDOW_S, windows - 1).astype(np.int64)
    found: list[float] = []
    for k in range(windows):
        inside = number == k
        if np.count_nonzero(inside) >= 2:
            at = time_s[inside] - time_s[inside].mean()
            found.append(float(at @ values[inside] / (at @ at)))
    return np.array(found)


def _deviations(
    problem: Problem, found: Descent, equations: Sequence[NormalEquations]
) -> FloatArray:
    """Return standard deviations of both offsets in their own units, shape ``(2,)``.

    The greater of two: what the noise allows, and how much the answer moves when one segment is
    left out (jackknife), which also feels a model that is wrong.

    Raises:
        NoAdviceError: If the dives do not tell one of the offsets.
    """
    info = Information.of(equations)
    if np.linalg.cond(info.fisher) > 1e12:
        raise NoAdviceError("the dives do not tell buoyancy and mass position apart")
    noise = np.sqrt(np.diag(np.linalg.inv(info.fisher)) * max(found.cost, 1.0))
    scattered = jackknife(info, np.eye(2))
    scale = np.array([unknown.scale for unknown in problem.sought])
    return np.maximum(noise, scattered) * scale


def _advice(
    problem: Problem,
    u: FloatArray,
    std: FloatArray,
    present: TrimConfig,
    errors: tuple[GlideError, GlideError],
    dives: int,
) -> TrimAdvice:
    offset_kg, offset_m = (
        unknown.value(float(value)) for unknown, value in zip(problem.sought, u, strict=True)
    )
    for name, value, spread, unknown in (
        ("net buoyancy", offset_kg, std[0], problem.sought[0]),
        ("mass position", offset_m, std[1], problem.sought[1]),
    ):
        if spread > unknown.scale * 0.25:
            raise NoAdviceError(f"the dives do not tell the {name}'s offset: fly longer glides")
        if abs(value) > 0.499 * unknown.scale:
            raise NoAdviceError(
                f"the {name} is off by more than a trim should mend: check the ballast first, or"
                " identify the vehicle"
            )
    now, proposed = errors
    change_kg = offset_kg - present.net_buoyancy_offset_kg
    change_m = offset_m - present.mass_position_offset_m
    is_sure = abs(change_kg) > _SURE * std[0] or abs(change_m) > _SURE * std[1]
    gains = (
        proposed.depth_rate_m_s < _WORTH * now.depth_rate_m_s
        or proposed.pitch_rad < _WORTH * now.pitch_rad
    )
    is_worth_it = bool(is_sure and gains)
    return TrimAdvice(
        dives=dives,
        present=present,
        full_step=present.stepped(offset_kg, offset_m, 1.0),
        half_step=present.stepped(offset_kg, offset_m, 0.5),
        net_buoyancy_std_kg=float(std[0]),
        mass_position_std_m=float(std[1]),
        rmse_now=now,
        rmse_proposed=proposed,
        is_worth_it=is_worth_it,
        message=_message(dives, change_kg, change_m, std, is_worth_it=is_worth_it),
    )


def _message(
    dives: int, change_kg: float, change_m: float, std: FloatArray, *, is_worth_it: bool
) -> str:
    weight = "lighter" if change_kg > 0.0 else "heavier"
    place = "aft of" if change_m > 0.0 else "ahead of"
    # the dives may have been flown with an older trim, so nothing is said of what was wanted then
    said = (
        f"By {dives} dive{'s' if dives != 1 else ''}, with the present trim the robot is"
        f" {abs(change_kg) * 1e3:.2f} g (±{std[0] * 1e3:.2f}) {weight} than wanted, and its"
        f" sliding mass {abs(change_m) * 1e3:.1f} mm (±{std[1] * 1e3:.1f}) {place} where it is"
        " wanted."
    )
    if is_worth_it:
        return f"{said} A half step is recommended; fly and judge again."
    return f"{said} That is not worth a change of trim."
