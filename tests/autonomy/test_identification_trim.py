"""Trim advice finds how far a robot's feedback is off, with the right sign."""

import numpy as np
import pytest

from autonomy.identification.recording import Recording
from autonomy.identification.trim_advice import NoAdviceError, advise
from autonomy.vehicle.config import MINIGLIDER
from autonomy.vehicle.trim import TrimConfig
from robot_link.messages import OnboardPlanState
from simulator.fleet import GRACE_1, MINI_1, RobotDefinition
from tests.autonomy.identification_flight import open_loop_recording
from tests.simulator.flight import LAKE_PLANNER, Life, mission, vee


def synthetic(bias_kg: float, bias_m: float, runs: int = 4) -> Recording:
    return open_loop_recording(
        MINIGLIDER,
        np.random.default_rng(11),
        runs=runs,
        duration_s=40.0,
        period_s=0.2,
        extended=True,
        net_buoyancy_bias_kg=bias_kg,
        mass_position_bias_m=bias_m,
    )


def flown(definition: RobotDefinition, legs, seed: int, every: int) -> tuple[Life, Recording]:
    """Fly a mission and keep what the robot reports of itself."""
    life = Life(definition, seed)
    life.start(mission(*legs))
    rows = []
    while life.executive.plan_state is OnboardPlanState.RUNNING and len(rows) < 3000:
        for _ in range(every):
            life.robot.step(life.notebook)
        said = life.robot.program.state_report()
        rows.append(
            [
                life.robot.program.time_s,
                *said.position_ned,
                said.position_std_m,
                said.has_fix,
                said.roll_rad,
                said.pitch_rad,
                said.heading_rad,
                said.net_buoyancy_kg,
                said.mass_position_m,
                said.tail_rad,
            ]
        )
    table = np.array(rows)
    return life, Recording(
        table[:, 0],
        table[:, 1:4],
        table[:, 4],
        table[:, 5] > 0.0,
        table[:, 6:9],
        table[:, 9],
        table[:, 10],
        table[:, 11],
    )


def to_and_fro(dives: int):
    legs = vee()
    for dive in range(1, dives):
        legs = (*legs, *vee(legs[-1].end_ned[:2], 3.5 if dive % 2 else 0.4))
    return legs


def test_robot_that_reports_more_than_it_has_must_be_commanded_more():
    advice = advise(MINIGLIDER, synthetic(0.0005, 0.0), TrimConfig())
    assert advice.full_step.net_buoyancy_offset_kg == pytest.approx(0.0005, abs=1e-4)
    assert "lighter than wanted" in advice.message
    assert advice.is_worth_it


def test_offsets_are_found_with_their_signs():
    advice = advise(MINIGLIDER, synthetic(-0.0008, 0.0015), TrimConfig())
    assert advice.full_step.net_buoyancy_offset_kg == pytest.approx(-0.0008, abs=1e-4)
    assert advice.full_step.mass_position_offset_m == pytest.approx(0.0015, abs=2e-4)
    assert advice.rmse_proposed.depth_rate_m_s < advice.rmse_now.depth_rate_m_s
    assert advice.rmse_proposed.pitch_rad < advice.rmse_now.pitch_rad


def test_half_step_lies_between_present_and_proposed():
    present = TrimConfig(net_buoyancy_offset_kg=0.002, mass_position_offset_m=-0.001)
    advice = advise(MINIGLIDER, synthetic(0.0005, 0.001), present)
    full, half = advice.full_step, advice.half_step
    assert half.net_buoyancy_offset_kg == pytest.approx((0.002 + full.net_buoyancy_offset_kg) / 2.0)
    assert half.mass_position_offset_m == pytest.approx(
        (-0.001 + full.mass_position_offset_m) / 2.0
    )
    assert "heavier than wanted" in advice.message


def test_right_trim_is_left_alone():
    present = TrimConfig(net_buoyancy_offset_kg=0.0006, mass_position_offset_m=0.001)
    advice = advise(MINIGLIDER, synthetic(0.0006, 0.001), present)
    assert not advice.is_worth_it
    assert "not worth" in advice.message


def test_threads_do_not_change_the_advice():
    recording = synthetic(0.0005, 0.0, runs=2)
    documents = [
        advise(MINIGLIDER, recording, TrimConfig(), threads=threads).model_dump_json()
        for threads in (1, 2)
    ]
    assert documents[0] == documents[1]


def test_advice_uses_the_last_dives_only():
    early, late = synthetic(0.001, 0.0, runs=2), synthetic(-0.0005, 0.0, runs=2)
    shift = early.time_s[-1] + 20.0
    surfaced = np.zeros((1, 3))
    joined = Recording(
        np.concatenate([early.time_s, [shift - 10.0], late.time_s + shift]),
        np.concatenate([early.position_ned, surfaced, late.position_ned]),
        np.concatenate([early.position_std_m, [0.05], late.position_std_m]),
        np.concatenate([early.has_fix, [True], late.has_fix]),
        np.concatenate([early.attitude_rad, surfaced, late.attitude_rad]),
        np.concatenate([early.net_buoyancy_kg, [0.0], late.net_buoyancy_kg]),
        np.concatenate([early.mass_position_m, [0.0], late.mass_position_m]),
        np.concatenate([early.tail_rad, [0.0], late.tail_rad]),
    )
    advice = advise(MINIGLIDER, joined, TrimConfig(), dives=1)
    assert advice.dives == 1
    assert advice.full_step.net_buoyancy_offset_kg == pytest.approx(-0.0005, abs=1e-4)


def test_too_little_gliding_gives_no_advice():
    given = synthetic(0.0, 0.0, runs=1)
    with pytest.raises(NoAdviceError, match="of gliding"):
        advise(MINIGLIDER, given.taken(np.arange(100)), TrimConfig())


def test_recording_at_the_surface_gives_no_advice():
    given = synthetic(0.0, 0.0, runs=1)
    given.position_ned[:, 2] = 0.0
    with pytest.raises(NoAdviceError, match="no gliding"):
        advise(MINIGLIDER, given, TrimConfig())


def test_ballast_beyond_a_trim_is_said():
    with pytest.raises(NoAdviceError):
        advise(MINIGLIDER, synthetic(0.016, 0.0, runs=2), TrimConfig())


def test_flown_tank_robot_gets_its_bias_back():
    life, recording = flown(MINI_1, to_and_fro(4), 1, every=2)
    sensors = life.robot.body.sensors
    advice = advise(MINI_1.vehicle, recording, TrimConfig())
    assert advice.dives == 4
    assert advice.full_step.net_buoyancy_offset_kg == pytest.approx(
        sensors.buoyancy_bias_kg, rel=1.0 / 3.0
    )
    assert advice.is_worth_it


def test_flown_lake_robot_gets_its_biases_back():
    start, heading = (120.0, 120.0), 0.8
    legs = vee(start, heading, 6.0, np.radians(47.0), LAKE_PLANNER)
    life, recording = flown(GRACE_1, legs, 2, every=5)
    sensors = life.robot.body.sensors
    advice = advise(GRACE_1.vehicle, recording, TrimConfig())
    assert advice.full_step.net_buoyancy_offset_kg == pytest.approx(
        sensors.buoyancy_bias_kg, rel=1.0 / 3.0
    )
    assert advice.full_step.mass_position_offset_m == pytest.approx(
        sensors.mass_position_bias_m, rel=1.0 / 3.0
    )
