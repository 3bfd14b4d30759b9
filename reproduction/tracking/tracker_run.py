"""Runs of range-only tracking with the tracker that a robot carries: bank, phases, search."""

import math

import numpy as np

from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.phase import TargetPhase
from autonomy.tracking.reference.barrier import ControlStatus
from autonomy.tracking.reference.observability import inverse_condition
from autonomy.tracking.target_path import place
from autonomy.tracking.tracker import (
    RangeHeard,
    Tracker,
    TrackerReading,
    TrackerStart,
    TrackerStep,
)
from reproduction.tracking import metrics, unicycle
from reproduction.tracking.run import Case, Outcome, first_estimate, settings
from reproduction.tracking.scenario import Draws, Scenario, draws


def run_tracker(scenario: Scenario, case: Case, seed: int) -> Outcome:
    """Run the closed loop with the tracker, with the random numbers of ``run.run``.

    Args:
        scenario: Start, target, noise and settings; how many hypotheses, too.
        case: With or without the barrier, and whether the target's velocity is known.
        seed: Of the noise and the first estimate's error.

    Raises:
        ValueError: If the case is one of state feedback: the tracker sees what was measured alone.
    """
    if not case.is_output_feedback:
        raise ValueError(f"the tracker has no state feedback, as {case} asks for")
    random, path = draws(scenario, seed), scenario.config.target
    config = _mission(scenario, case, random)
    pose, dt_s = scenario.start, scenario.step_s
    tracker = Tracker(config, TrackerStart((pose[0], pose[1]), pose[2], pose[3]))
    rows: list[tuple[float, ...]] = []
    for k in range(scenario.steps):
        north, east, heading, speed = pose
        target = place(path, k * dt_s)
        velocity = (target.north_m_s, target.east_m_s)
        true = (north - target.north_m, east - target.east_m, heading, speed)
        # No instrument tells a negative distance, as the noise would near the target.
        heard = max(math.hypot(true[0], true[1]) + float(random.noise[k, 0]), 0.0)
        reading = TrackerReading(
            own_ne_m=(north, east),
            heading_rad=heading + float(random.noise[k, 1]),
            speed_m_s=speed + float(random.noise[k, 2]),
            ranges=(RangeHeard(heard),) if random.has_range[k] else (),
            target_velocity_ne_m_s=None if case.is_velocity_estimated else velocity,
        )
        step = tracker.step(reading, dt_s if k > 0 else 0.0)
        rows.append(
            (
                *(k * dt_s, *pose, target.north_m, target.east_m),
                *_believed(step, (north, east), config),
                *(*step.command, *step.nominal, step.determinant_m2_s, _status(step)),
                inverse_condition(true, velocity),
                step.hypotheses[0].weight if step.hypotheses else 1.0,
            )
        )
        pose = unicycle.advance(pose, *step.command, dt_s)
    record = np.array(rows)
    return Outcome(metrics.score(record, dt_s), record)


def _mission(scenario: Scenario, case: Case, random: Draws) -> TrackingConfig:
    """Return the settings with the first guess that the run starts with."""
    config = settings(scenario, case)
    guess = first_estimate(scenario, random)
    target = config.target.model_copy(
        update={
            "north_m": scenario.start[0] - float(guess[0]),
            "east_m": scenario.start[1] - float(guess[1]),
            "guess_std_m": math.sqrt(scenario.believed_variance_m2),
        }
    )
    known = "estimated" if case.is_velocity_estimated else "known"
    chosen = config.filter.model_copy(update={"target_velocity": known})
    return config.model_copy(update={"target": target, "filter": chosen})


def _believed(
    step: TrackerStep, own_ne_m: tuple[float, float], config: TrackingConfig
) -> tuple[float, float]:
    """Return the relative position by the followed hypothesis, or by the first guess."""
    at = (config.target.north_m, config.target.east_m)
    if step.hypotheses:
        at = step.hypotheses[0].position_ne_m
    return own_ne_m[0] - at[0], own_ne_m[1] - at[1]


def _status(step: TrackerStep) -> float:
    """Return the controller's status; a step that searches or has ended keeps no barrier either."""
    is_kept = step.is_feasible and step.phase in {TargetPhase.TRACKING, TargetPhase.COASTING}
    return float(ControlStatus.ACTIVE if is_kept else ControlStatus.INFEASIBLE)
