"""How a simulated robot is itself, and what it says of a leak."""

from dataclasses import replace
from datetime import UTC, datetime

import pytest

from autonomy.channel import CHANNELS
from onboard.flight.hardware import SetPoints
from onboard.program import PERIOD_S
from simulator.fault import RobotFaults
from simulator.fleet import MINI_1
from simulator.robot import SimulatedRobot

LEAK_S = 7.0


def lived(robot, seconds):
    """Return when the robot would report its condition, and what, while it idles."""
    told = []
    for _ in range(round(seconds / PERIOD_S)):
        robot.body.advance(PERIOD_S)
        robot.program._steps += 1
        condition = robot.program.due_condition()
        if condition is not None:
            told.append((robot.program.time_s, dict(condition)))
    return told


def robot(**faults):
    definition = replace(MINI_1, faults=RobotFaults(**faults))
    return SimulatedRobot(definition, 1, datetime(2026, 11, 23, tzinfo=UTC))


def test_a_sound_robot_says_now_and_then_what_can_be():
    told = lived(robot(), 65.0)
    assert [at for at, _ in told] == pytest.approx([0.1, 30.1, 60.1], abs=0.15)
    for _, condition in told:
        assert condition["leak"] == 0.0
        assert all(CHANNELS[key].fault(value) is None for key, value in condition.items())


def test_a_leak_is_told_at_once_and_what_follows_shows_it():
    told = lived(robot(leak_s=LEAK_S), 65.0)
    first = next(at for at, condition in told if condition["leak"])
    assert first == pytest.approx(LEAK_S, abs=0.3)
    last = told[-1][1]
    assert last["internal_pressure"] > told[0][1]["internal_pressure"] + 20.0
    assert last["humidity"] > told[0][1]["humidity"] + 10.0
    assert all(CHANNELS[key].fault(value) is None for key, value in last.items())


def test_a_sound_robot_raises_no_alarm_and_its_inside_is_warmer_than_the_water():
    one = robot()
    one.body.actuate(SetPoints(MINI_1.vehicle.limits.m0_max_kg, 0.0))
    for _ in range(round(300.0 / PERIOD_S)):
        one.body.advance(PERIOD_S)
        condition = one.body.condition()
        assert not any(CHANNELS[key].crossed(value) for key, value in condition.items())
    assert 20.0 < condition["internal_temperature"] < 30.0
    assert set(condition) == {
        "leak",
        "internal_pressure",
        "humidity",
        "internal_temperature",
        "battery_current",
        "pump_current",
        "mass_current",
        "processor_load",
        "free_disk",
    }


def test_a_pump_that_runs_takes_its_current_and_one_that_stands_takes_none():
    one = robot().body
    one.advance(PERIOD_S)
    one.actuate(SetPoints(MINI_1.vehicle.limits.m0_max_kg, 0.0))
    one.advance(PERIOD_S)
    running = one.condition()
    assert 0.0 < running["pump_current"] < running["battery_current"]
    one.cause("pump")
    one.advance(PERIOD_S)
    assert one.condition()["pump_current"] == 0.0
