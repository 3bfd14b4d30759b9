"""Runs of range-only tracking from start to end: the readable closed loop, and the compiled one."""

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.control.pack_control import pack_control
from autonomy.tracking.filter import filter_kernel
from autonomy.tracking.reference import filter as single
from autonomy.tracking.reference.barrier import control
from autonomy.tracking.reference.filter import Estimate
from autonomy.tracking.reference.observability import inverse_condition
from autonomy.tracking.reference.velocity_filter import TargetMotion, step_motion
from autonomy.tracking.target_path import place
from reproduction.tracking import metrics, run_kernel, unicycle
from reproduction.tracking.metrics import Score
from reproduction.tracking.scenario import Draws, Scenario, draws
from reproduction.tracking.target_path_kernel import pack_path


class Case(StrEnum):
    """Who controls by what; the name is that of thesis Table 4.1."""

    SF = "SF"
    """State feedback without barrier."""
    OF = "OF"
    """Output feedback without barrier."""
    SF_CBF = "SF+CBF"
    """State feedback with barrier."""
    OF_CBF = "OF+CBF"
    """Output feedback with barrier, target velocity known."""
    OFETV_CBF = "OFETV+CBF"
    """Output feedback with barrier, target velocity estimated."""

    @property
    def is_output_feedback(self) -> bool:
        """Whether the controller sees the estimate rather than the true state."""
        return self not in {Case.SF, Case.SF_CBF}

    @property
    def has_barrier(self) -> bool:
        """Whether the barrier changes the pursuit law's command."""
        return self not in {Case.SF, Case.OF}

    @property
    def is_velocity_estimated(self) -> bool:
        """Whether the target's velocity is estimated rather than known."""
        return self is Case.OFETV_CBF


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """One run."""

    score: Score
    record: FloatArray
    """What happened, shape ``(n, metrics.RECORD_SIZE)``, columns as ``metrics`` names them."""


def run(scenario: Scenario, case: Case, seed: int) -> Outcome:
    """Run the compiled closed loop with the single filter.

    Args:
        scenario: Start, target, noise and settings.
        case: Which feedback, with or without the barrier.
        seed: Of the noise and the first estimate's error; the same numbers for every case.
    """
    random, config = draws(scenario, seed), settings(scenario, case)
    q = filter_kernel.pack_filter(config)
    record = np.empty((scenario.steps, metrics.RECORD_SIZE))
    run_kernel.run_into(
        np.array(scenario.start),
        pack_path(config.target),
        first_estimate(scenario, random),
        filter_kernel.start_covariance(scenario.believed_variance_m2, q),
        random.noise,
        random.has_range,
        case.is_output_feedback,
        case.is_velocity_estimated,
        pack_control(config),
        q,
        scenario.step_s,
        record,
    )
    return Outcome(metrics.score(record, scenario.step_s), record)


def run_readable(scenario: Scenario, case: Case, seed: int) -> Outcome:
    """Run the closed loop step by step, as section 1 of the specification says it.

    Measure, correct the estimate, estimate the target's velocity, control, note, let the plant
    move, predict the estimate.
    """
    random, config = draws(scenario, seed), settings(scenario, case)
    guess = first_estimate(scenario, random)
    estimate = single.start_estimate(
        (guess[0], guess[1]), guess[2], guess[3], scenario.believed_variance_m2, config
    )
    pose, dt_s = scenario.start, scenario.step_s
    own_ne_m = np.zeros(2)  # dead reckoned
    motion = first_motion(guess, scenario.believed_variance_m2, config)
    rows: list[tuple[float, ...]] = []
    for k in range(scenario.steps):
        north, east, heading, speed = pose
        target = place(config.target, k * dt_s)
        true = (north - target.north_m, east - target.east_m, heading, speed)
        velocity = (target.north_m_s, target.east_m_s)
        estimate = measured(estimate, true, random, k, config)
        seen = velocity
        if case.is_velocity_estimated:
            place_ne_m = own_ne_m - estimate.x[:2]
            motion = step_motion(
                motion,
                (float(place_ne_m[0]), float(place_ne_m[1])),
                dt_s if k > 0 else 0.0,
                config.filter,
            )
            seen = (float(motion.mean[1, 0]), float(motion.mean[1, 1]))
        z, z_velocity = (estimate.x, seen) if case.is_output_feedback else (true, velocity)
        step = control(z, z_velocity, (0.0, 0.0), config)
        command = (step.turn_rate_rad_s, step.acceleration_m_s2)
        rows.append(
            (
                *(k * dt_s, *pose, target.north_m, target.east_m),
                *(float(estimate.x[0]), float(estimate.x[1]), *command, *step.nominal),
                *(step.determinant_m2_s, float(step.status), inverse_condition(true, velocity)),
                1.0,
            )
        )
        pose = unicycle.advance(pose, *command, dt_s)
        if not case.is_velocity_estimated:
            middle = place(config.target, k * dt_s + 0.5 * dt_s)
            seen = (middle.north_m_s, middle.east_m_s)
        before = estimate.x[:2]
        estimate = single.predict(estimate, command, dt_s, seen, config)
        own_ne_m = own_ne_m + (estimate.x[:2] - before) + dt_s * np.array(seen)
    record = np.array(rows)
    return Outcome(metrics.score(record, dt_s), record)


def settings(scenario: Scenario, case: Case) -> TrackingConfig:
    """Return the scenario's settings with the case's controller."""
    controller = "barrier" if case.has_barrier else "nominal"
    barrier = scenario.config.barrier.model_copy(update={"controller": controller})
    return scenario.config.model_copy(update={"barrier": barrier})


def first_estimate(scenario: Scenario, random: Draws) -> FloatArray:
    """Return the estimate that a run starts with: heading and speed are known, shape ``(4,)``."""
    target = place(scenario.config.target, 0.0)
    guess = np.array(scenario.start)
    guess[:2] += random.offset_m - np.array([target.north_m, target.east_m])
    return guess


def measured(
    estimate: Estimate,
    true: tuple[float, float, float, float],
    random: Draws,
    step: int,
    config: TrackingConfig,
) -> Estimate:
    """Take in a step's measurements (Eq. 4.15) of the true relative state."""
    x_r, y_r, heading, speed = true
    noise = random.noise[step]
    range_m = math.hypot(x_r, y_r) + float(noise[0]) if random.has_range[step] else None
    return single.update(
        estimate, heading + float(noise[1]), speed + float(noise[2]), range_m, config
    )[0]


def first_motion(guess: FloatArray, variance_m2: float, config: TrackingConfig) -> TargetMotion:
    """Return a target that stays where the first estimate says, as uncertain as that is."""
    spread = np.diag([variance_m2, config.filter.target_speed_std_m_s**2])
    return TargetMotion(np.array([-guess[:2], np.zeros(2)]), spread)
