"""What a recording was spoiled by is left out, and what it cannot tell is not claimed."""

import json
from dataclasses import replace

import numpy as np
import pytest

from autonomy.identification.conclusion import moved_at_once
from autonomy.identification.config import (
    IDENTIFICATION_PRESETS,
    FreeParameters,
    IdentificationConfig,
    NoiseLevels,
)
from autonomy.identification.problem import problem_from
from autonomy.identification.recording import Recording
from autonomy.identification.result import IdentificationResult
from autonomy.identification.run import identify
from autonomy.vehicle.config import MINIGLIDER
from robot_link.messages import OnboardPlanState
from simulator.fleet import MINI_1
from tests.autonomy.identification_flight import open_loop_recording
from tests.simulator.flight import Life, mission, vee

TRUTH = MINIGLIDER.parameters.model_dump()
FEW = FreeParameters(
    masses=False,
    inertias=False,
    sliding_mass=False,
    offset_mass=False,
    side_force=False,
    roll_moment=False,
    yaw_moment=False,
)
LEAST_SQUARES = IdentificationConfig(
    method="least_squares", step_s=0.2, free=FEW, noise=NoiseLevels(fix_hold_s=0.0)
)


def run(recording: Recording, config: IdentificationConfig) -> IdentificationResult:
    return identify(
        problem_from(MINIGLIDER, recording, config),
        config,
        np.random.default_rng(config.seed),
        report=lambda _: None,
        is_cancelled=lambda: False,
    )


def short_flights(bias_kg: float = 0.0) -> Recording:
    return open_loop_recording(
        MINIGLIDER,
        np.random.default_rng(5),
        runs=8,
        duration_s=30.0,
        period_s=0.5,
        extended=True,
        net_buoyancy_bias_kg=bias_kg,
    )


def flown(seed: int, legs) -> tuple[Recording, dict[str, float]]:
    """Fly a tank robot and keep one report a second; return the truth of its offsets as well."""
    life = Life(MINI_1, seed)
    life.start(mission(*legs))
    rows = []
    while life.executive.plan_state is OnboardPlanState.RUNNING and len(rows) < 900:
        for _ in range(10):
            life.robot.step(life.notebook)
        said = life.robot.program.state_report()
        rows.append(
            [
                life.robot.program.time_s,
                *said.position_ned,
                said.position_std_m,
                said.has_fix,
                *(said.roll_rad, said.pitch_rad, said.heading_rad),
                *(said.net_buoyancy_kg, said.mass_position_m, said.tail_rad),
            ]
        )
    t = np.array(rows)
    sensors = life.robot.body.sensors
    recording = Recording(
        *(t[:, 0], t[:, 1:4], t[:, 4], t[:, 5] > 0.0, t[:, 6:9], t[:, 9], t[:, 10], t[:, 11])
    )
    return recording, TRUTH | {
        "net_buoyancy_offset_kg": sensors.buoyancy_bias_kg,
        "mass_position_offset_m": sensors.mass_position_bias_m,
    }


def test_kick_between_two_reports_is_left_out():
    recording = short_flights()
    kicked = recording.attitude_rad.copy()
    kicked[(recording.time_s > 90.0) & (recording.time_s < 95.0), 1] += 0.3
    result = run(replace(recording, attitude_rad=kicked), LEAST_SQUARES)
    reasons = [reason for reason in result.left_out if reason.kind == "unexplained"]
    assert len(reasons) == 1
    assert reasons[0].start_s < 95.0
    assert reasons[0].end_s > 90.0
    assert result.cost_after == pytest.approx(1.0, abs=0.1)


def test_model_that_does_not_explain_is_said():
    recording = short_flights()
    generator = np.random.default_rng(1)
    rough = recording.attitude_rad + 0.02 * generator.standard_normal(recording.attitude_rad.shape)
    result = run(replace(recording, attitude_rad=rough), LEAST_SQUARES)
    assert result.cost_after > 1.5
    assert result.findings[0].startswith(
        "the model does not explain this recording within its noise"
    )


def test_offsets_come_with_the_result_and_the_vehicle():
    result = run(short_flights(0.0007), LEAST_SQUARES)
    offsets = json.loads(result.model_dump_json())["offsets"]
    assert offsets["net_buoyancy_offset_kg"] == pytest.approx(0.0007, abs=1e-4)
    assert offsets["net_buoyancy_std_kg"] < 1e-4
    assert "trim of +0.7" in result.vehicle.note


def test_offsets_alone_are_no_gain_of_the_parameters():
    result = run(short_flights(0.0007), LEAST_SQUARES)
    assert result.cost_as_is is not None
    assert result.cost_before is not None
    assert result.cost_as_is > result.cost_before + 0.1
    assert result.cost_before == pytest.approx(result.cost_after, abs=0.05)


def test_only_the_first_report_of_a_held_fix_is_a_fix():
    recording = short_flights()
    held = LEAST_SQUARES.model_copy(update={"noise": NoiseLevels(fix_hold_s=2.0)})
    weight = problem_from(MINIGLIDER, recording, held).layout.weight
    every = problem_from(MINIGLIDER, recording, LEAST_SQUARES).layout.weight
    assert np.all(every[:, 0] > 0.0)
    at = problem_from(MINIGLIDER, recording, held).layout.time_s[weight[:, 0] > 0.0]
    assert np.diff(at).min() >= 2.0
    assert np.all(weight[:, 2:] == every[:, 2:])


def test_actuators_move_within_their_rates_between_two_reports():
    problem = problem_from(MINIGLIDER, short_flights(), LEAST_SQUARES)
    even = problem.layout.node_inputs
    early = moved_at_once(problem, early=True).layout.node_inputs
    late = moved_at_once(problem, early=False).layout.node_inputs
    reported = problem.layout.node_row >= 0
    assert early[reported] == pytest.approx(even[reported], abs=1e-12)
    assert late[reported] == pytest.approx(even[reported], abs=1e-12)
    rising = np.diff(even, axis=0, append=even[-1:]) > 1e-9
    assert np.all((early - even)[rising] >= -1e-9)
    assert np.all((late - even)[rising] <= 1e-9)
    rate = MINIGLIDER.limits.delta_rate_rad_s
    inside = problem.layout.node_step_s[:-1] > 0.0
    moved = np.abs(np.diff(early[:, 2]))[inside]
    most = np.maximum(rate * problem.layout.node_step_s[:-1], np.abs(np.diff(even[:, 2])))[inside]
    assert np.all(moved <= most + 1e-9)


def test_flight_with_a_report_a_second_claims_nothing_false():
    legs = vee()
    for dive in range(1, 7):
        legs = (*legs, *vee(legs[-1].end_ned[:2], 3.5 if dive % 2 else 0.4))
    config = IDENTIFICATION_PRESETS["miniglider"].model_copy(
        update={"method": "least_squares", "free": FEW}
    )
    claimed = set[str]()
    for seed in (3, 5):
        recording, truth = flown(seed, legs)
        result = run(recording, config)
        assert result.is_converged
        for estimate in result.parameters:
            if estimate.verdict == "identified":
                assert estimate.std is not None
                assert abs(estimate.after - truth[estimate.name]) < 3.0 * estimate.std, estimate
                claimed.add(estimate.name)
    assert "net_buoyancy_offset_kg" in claimed
