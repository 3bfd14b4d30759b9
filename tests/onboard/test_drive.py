"""A robot driven by hand: what the stick moves, and what happens without one."""

import math

import pytest

from onboard.link.robot_link import CommandOutcome
from robot_link.drive import RELEASE_S, SILENCE_S, Stick
from robot_link.messages import CommandKind, OnboardPlanState, RobotMode
from simulator.fleet import GRACE_1
from tests.simulator.flight import Life, mission, vee

AHEAD = Stick(forward=1.0)


def begun(**arguments) -> Life:
    life = Life(**arguments)
    assert life.robot.program.begin_drive() is CommandOutcome.DONE
    return life


def drive(life: Life, stick: Stick, seconds: float) -> None:
    """Hold the stick, and say so five times a second."""
    for _ in range(round(5 * seconds)):
        life.robot.program.steer(stick)
        life.live(0.2)


def tail(life: Life):
    """Amplitude and bias of the tail as it was told last."""
    sent = life.robot.program._sent  # pyright: ignore[reportPrivateUsage]
    return sent.tail_amplitude_rad, sent.tail_rad


def heading(life: Life) -> float:
    return life.estimate.course_heading_rad


def test_stick_moves_nothing_before_the_drive_was_begun():
    life = Life()
    drive(life, AHEAD, 3.0)
    assert life.executive.mode is RobotMode.IDLE
    assert tail(life)[0] == 0.0


def test_stick_ahead_swims():
    life = begun()
    began = life.robot.body.plant.position_ned
    drive(life, AHEAD, 8.0)
    assert life.executive.mode is RobotMode.DRIVEN
    assert math.dist(began, life.robot.body.plant.position_ned) > 0.2


@pytest.mark.parametrize("turn", [1.0, -1.0])
@pytest.mark.parametrize("forward", [0.0, 0.7])
def test_stick_aside_turns_to_its_side(turn, forward):
    life = begun()
    before = heading(life)
    drive(life, Stick(forward, turn), 12.0)
    assert math.remainder(heading(life) - before, math.tau) * turn > 0.3


def test_half_a_stick_beats_with_half_the_amplitude_and_backwards_is_not_swum():
    life = begun()
    full = life.executive._flight.vehicle.swim.amplitude_rad  # pyright: ignore[reportPrivateUsage]
    drive(life, Stick(forward=0.5), 0.2)
    assert tail(life)[0] == pytest.approx(0.5 * full)
    drive(life, Stick(forward=-1.0), 0.2)
    assert tail(life) == (0.0, 0.0)


def test_silence_stops_the_tail_in_time_and_a_new_stick_goes_on():
    life = begun()
    drive(life, AHEAD, 2.0)
    assert tail(life)[0] > 0.0
    assert life.live_until(lambda: tail(life) == (0.0, 0.0), SILENCE_S + 0.01)
    assert life.robot.program.drive_report(0).is_silent
    assert life.executive.mode is RobotMode.DRIVEN
    drive(life, AHEAD, 0.2)
    assert tail(life)[0] > 0.0


def test_sticks_that_keep_coming_are_no_silence():
    life = begun()
    for _ in range(10):
        life.robot.program.steer(AHEAD)
        life.live(SILENCE_S - 0.1)
        assert tail(life)[0] > 0.0


def test_nobody_drives_any_more_after_a_long_silence():
    life = begun()
    drive(life, AHEAD, 1.0)
    assert life.live_until(lambda: life.executive.mode is RobotMode.IDLE, RELEASE_S + 0.3)
    life.robot.program.steer(AHEAD)
    life.live(0.3)
    assert tail(life)[0] == 0.0


def test_robot_goes_down_where_radio_passes_and_comes_up_in_silence():
    life = begun()
    drive(life, Stick(up=-1.0), 30.0)
    deepest = life.track[:, 7].max()
    site = life.robot.definition.site
    assert 0.2 < deepest < site.water.depth_max_m - 0.1
    assert life.live_until(lambda: life.executive.mode is RobotMode.IDLE, 60.0)
    assert life.estimate.depth_m < 0.05


def test_robot_stays_up_where_radio_ends_at_the_surface():
    life = begun(definition=GRACE_1)
    assert not GRACE_1.site.radio_under_water
    drive(life, Stick(forward=0.5, up=-1.0), 20.0)
    assert life.track[:, 7].max() < 0.3


@pytest.mark.parametrize("turn", [0.0, 0.2, -0.4])
def test_driven_robot_keeps_off_the_walls(turn):
    life = begun(seed=3)
    is_kept = False
    for _ in range(60):
        drive(life, Stick(forward=1.0, turn=turn), 1.0)
        is_kept |= life.robot.program.drive_report(0).is_kept_off
    site = life.robot.definition.site
    nearest = min(site.clearance_m(north, east) for north, east in life.track[:, 5:7])
    assert nearest > 0.05
    assert is_kept


def test_nobody_drives_while_a_mission_runs_and_no_mission_starts_while_driven():
    life = begun()
    plan = mission(*vee())
    program = life.robot.program
    program.take_plan(plan)
    assert program.obey(CommandKind.START, plan.sha256()[:12]) is CommandOutcome.NOT_NOW
    program.end_drive()
    assert life.live_until(lambda: life.executive.mode is RobotMode.IDLE, 5.0)
    assert program.obey(CommandKind.START, plan.sha256()[:12]) is CommandOutcome.DONE
    assert life.executive.plan_state is OnboardPlanState.RUNNING
    assert program.begin_drive() is CommandOutcome.NOT_NOW


def test_order_to_surface_ends_a_drive():
    life = begun()
    drive(life, Stick(forward=0.3, up=-1.0), 10.0)
    assert life.robot.program.obey(CommandKind.SURFACE, "") is CommandOutcome.DONE
    drive(life, AHEAD, 0.4)
    assert tail(life)[0] == 0.0
    assert life.live_until(lambda: life.executive.mode is RobotMode.IDLE, 60.0)


def test_empty_battery_ends_a_drive_and_lets_none_begin():
    life = begun()
    life.robot.body.battery.fraction = 0.02
    drive(life, AHEAD, 1.0)
    assert tail(life)[0] == 0.0
    assert life.live_until(lambda: life.executive.mode is RobotMode.IDLE, 10.0)
    assert life.robot.program.begin_drive() is CommandOutcome.NOT_NOW
