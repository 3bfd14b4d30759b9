"""A robot knows its actuators: slow, late, stuck or swinging, and flies as they allow."""

import math
from dataclasses import replace

import numpy as np
import pytest

from onboard.flight.actuator_watch import Actuator, ActuatorWatch, SwingCount
from onboard.flight.hardware import Readings, SetPoints
from robot_link.messages import OnboardPlanState
from simulator.fault import RobotFaults
from simulator.fleet import GRACE_1, MINI_1
from tests.simulator.flight import LAKE_PLANNER, Life, mission, two_dives, vee

TO_AND_FRO = two_dives()


def life_with(faults: RobotFaults, definition=MINI_1) -> Life:
    return Life(replace(definition, faults=faults), seed=1)


def flown_pitch_error(life: Life, legs) -> np.ndarray:
    """Fly legs; return pitch error against what the robot holds, with the number of the leg."""
    life.start(mission(*legs))
    rows = []
    while life.executive.plan_state is OnboardPlanState.RUNNING and len(rows) < 20_000:
        life.robot.step(life.notebook)
        held = life.pitch_held_rad
        if held is not None:
            pitch = float(life.robot.body.plant.state[4])
            rows.append((pitch - held, life.executive.leg))
    return np.array(rows)


def test_nominal_robot_believes_in_its_actuators_and_flies_as_planned():
    life = life_with(RobotFaults())
    flown_pitch_error(life, TO_AND_FRO)
    watch = life.executive.actuators
    for follower in (watch.mass, watch.pump):
        assert not follower.belief.is_off
        assert follower.belief.rate_share == 1.0
        assert follower.belief.delay_s == 0.0
    assert not watch.stuck
    assert not watch.is_swinging
    assert life.executive.gait.speed_share == 1.0
    assert life.executive.plan_state is OnboardPlanState.DONE


def test_slow_late_mass_is_known_after_a_dive_and_does_not_swing():
    life = life_with(RobotFaults(mass_rate_share=0.25, mass_delay_s=0.6))
    error = flown_pitch_error(life, TO_AND_FRO)
    mass = life.executive.actuators.mass.belief
    assert mass.is_off
    assert mass.rate_share == pytest.approx(0.25, rel=0.15)
    assert mass.delay_s == pytest.approx(0.6, abs=0.25)
    after = error[error[:, 1] >= 2.0, 0]
    assert math.sqrt(np.mean(after**2)) <= 0.1
    assert life.executive.gait.speed_share < 1.0
    assert life.executive.plan_state is OnboardPlanState.DONE


@pytest.mark.parametrize(
    ("faults", "name"),
    [
        (RobotFaults(mass_sticks_s=30.0), "sliding mass"),
        (RobotFaults(pump_sticks_s=30.0), "pump"),
        (RobotFaults(tail_sticks_s=0.0), "tail"),
    ],
)
def test_stuck_actuator_ends_the_mission_with_a_sentence(faults, name):
    life = life_with(faults)
    life.start(mission(*TO_AND_FRO))
    watch = life.executive.actuators
    assert life.live_until(lambda: bool(watch.stuck), 600.0)
    assert watch.stuck == (Actuator(name),)
    if name != "pump":  # with a stuck pump it may not come up, and says so while it tries
        assert life.live_until(lambda: life.executive.plan_state is OnboardPlanState.FAILED, 600.0)
        assert f"the {name} is stuck" in life.executive.reason
        assert len(life.executive.reason) <= 100
        life.live(5.0)
        life.start(mission(*TO_AND_FRO))
        assert life.executive.plan_state is OnboardPlanState.FAILED
        assert f"the {name} is stuck" in life.executive.reason


def test_actuator_that_moves_again_is_not_stuck_any_more():
    watch = ActuatorWatch(MINI_1.vehicle, 0.1)
    was_stuck = {}
    for k in range(330):
        watch.mass.step(0.03, 0.0 if k < 300 else 0.001 * (k - 300))
        was_stuck[k] = watch.mass.is_stuck
    assert not was_stuck[140]
    assert was_stuck[200]
    assert was_stuck[300]
    assert not was_stuck[329]


def test_mass_at_rest_where_it_should_be_is_not_stuck():
    watch = ActuatorWatch(MINI_1.vehicle, 0.1)
    at_rest = replace(life_with(RobotFaults()).estimate.readings, mass_position_m=0.005)
    for _ in range(600):
        watch.step(SetPoints(at_rest.net_buoyancy_kg, 0.006), at_rest, None)
    assert not watch.stuck


def test_swings_are_counted_by_size_and_time():
    fast, slow, small = (SwingCount(0.25) for _ in range(3))
    for k in range(600):
        t = 0.1 * k
        fast.step(0.3 * math.sin(2.0 * math.pi * t / 6.0), t)
        slow.step(0.3 * math.sin(2.0 * math.pi * t / 25.0), t)
        small.step(0.05 * math.sin(2.0 * math.pi * t / 6.0), t)
    assert fast.swings(60.0)
    assert not slow.swings(60.0)
    assert not small.swings(60.0)
    assert not fast.swings(200.0)


def swinging_readings(readings: Readings, k: int) -> tuple[SetPoints, Readings]:
    swing = math.sin(2.0 * math.pi * 0.1 * k / 6.0)
    seen = replace(readings, pitch_rad=0.4 * swing, mass_position_m=0.02 * swing)
    return SetPoints(readings.net_buoyancy_kg, 0.02 * swing), seen


def test_limit_cycle_ends_in_the_gentlest_gait():
    life = life_with(RobotFaults())
    executive = life.executive
    life.start(mission(*TO_AND_FRO))
    assert life.live_until(lambda: executive.is_sampling, 300.0)
    for k in range(300):
        executive.actuators.step(*swinging_readings(life.estimate.readings, k), 0.0)
    assert executive.actuators.is_swinging
    life.live(2.5)
    assert executive.gait.speed_share == pytest.approx(0.4)
    assert life.executive._flight.pilot._robust is not None


def test_lake_robot_believes_in_its_actuators():
    life = life_with(RobotFaults(), GRACE_1)
    life.start(mission(*vee((0.0, 0.0), 0.4, 6.0, math.radians(40.0), LAKE_PLANNER)))
    life.live(240.0)
    assert not life.executive.actuators.stuck
    assert not life.executive.actuators.mass.belief.is_off
    assert not life.executive.actuators.is_swinging
