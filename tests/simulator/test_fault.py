"""Faults that somebody causes: what is read, what the robot meets, and what is told of it."""

import asyncio
import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from pydantic import ValidationError

from onboard.node.body import BodyNode
from robot_link.messages import CommandKind, OnboardPlanState
from robot_link.robot_program import CommandOutcome
from simulator.fault import (
    CAUSED_FAULTS,
    DEPTH_OFF_M,
    CausedFault,
    RobotFaults,
    begin_of,
    caused_at,
    drifted_share,
)
from simulator.fleet import GRACE_1, MINI_1
from simulator.process import serve
from simulator.robot import SimulatedBody
from simulator.settings import SimulatorSettings
from tests.simulator.flight import Life, mission, vee


def settings(folder, **changes):
    moment = datetime.now(UTC)
    said = {"link_folder": folder, "wall_anchor": moment, "time_anchor": moment}
    return SimulatorSettings.model_validate({**said, **changes})


def body(definition, **faults):
    return SimulatedBody(replace(definition, faults=RobotFaults(**faults)), 0)


def test_a_fault_is_read_as_a_robot_a_name_and_a_time():
    assert CausedFault.of("leak@60") == CausedFault("leak", 60.0)
    assert CausedFault.of("grace-1:gps@1.5") == CausedFault("gps", 1.5, "grace-1")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("hole@60", "leak, pump, sensor, optode, battery, depth, gps"),
        ("leak", "leak@SECONDS"),
        ("leak@soon", "leak@SECONDS"),
        ("leak@-1", "leak@SECONDS"),
        ("leak@nan", "leak@SECONDS"),
        ("leak@inf", "leak@SECONDS"),
    ],
)
def test_what_is_no_fault_is_refused_with_what_there_is(text, sentence):
    with pytest.raises(ValueError, match=sentence):
        CausedFault.of(text)


def test_a_fault_meets_one_robot_or_all_and_one_that_is_not_there_is_refused(tmp_path):
    chosen = settings(tmp_path, faults=("leak@60", "mini-1:pump@5", "leak@20"))
    assert chosen.definition("mini-1").faults == RobotFaults(leak_s=20.0, pump_sticks_s=5.0)
    assert chosen.definition("grace-1").faults == RobotFaults(leak_s=20.0)
    with pytest.raises(ValidationError, match="no robot mini-2 for the fault leak"):
        settings(tmp_path, faults=("mini-2:leak@60",))


def test_every_fault_has_its_time_among_the_robots_faults():
    for number, name in enumerate(CAUSED_FAULTS):
        faults = CausedFault(name, float(number)).added(RobotFaults())
        assert begin_of(faults, name) == float(number)
        assert caused_at(faults, name, math.inf) == RobotFaults()


def test_a_dead_sensor_says_nothing_and_the_others_go_on():
    life = Life(replace(MINI_1, faults=RobotFaults(sensor_dies_s=20.0)))
    life.fly(mission(*vee()))
    notebook = life.notebook
    assert notebook.plans[-1][0] is OnboardPlanState.DONE
    assert max(at for *_, at in notebook.samples) < min(
        at for *_, at in notebook.others["temperature"][-5:]
    )


async def test_a_dead_sensor_is_told_as_such_to_a_program_elsewhere():
    dead = body(MINI_1, sensor_dies_s=0.0)
    node = BodyNode(dead, lambda: 0.0)
    node.publish()
    assert (await node._read({}))["field"] is None


def test_an_optode_drifts_down_and_nothing_else_does():
    sound, drifting = body(GRACE_1), body(GRACE_1, optode_drifts_s=0.0)
    for one in (sound, drifting):
        one.plant.time_s = 900.0
    good, bad = (one.measure(one.instruments) for one in (sound, drifting))
    assert bad.pop("dissolved_oxygen") < 0.7 * good.pop("dissolved_oxygen")
    assert bad == good
    assert drifted_share(-5.0) == 1.0
    assert drifted_share(1e9) == 0.4


def test_a_flat_battery_ends_the_mission():
    life = Life(replace(MINI_1, faults=RobotFaults(battery_flat_s=30.0)))
    life.start(mission(*vee()))
    state = life.executive
    assert life.live_until(lambda: state.plan_state is OnboardPlanState.FAILED, 400.0)
    assert "battery" in state.reason


def test_a_lost_receiver_brings_no_fix_and_hears_no_satellites():
    lost = body(GRACE_1, gps_lost_s=1.0)
    assert lost.read().fix_ne_m is not None
    assert lost.has_gps
    lost.advance(2.0)
    assert lost.read().fix_ne_m is None
    assert lost.has_sky
    assert not lost.has_gps
    assert lost.condition()["gps_satellites"] == 0.0


def test_a_depth_sensor_that_reads_above_the_surface_is_told_so_and_misleads_no_filter():
    life = Life(MINI_1)
    life.robot.body.cause("depth")
    life.live(3.0)
    assert life.robot.program.obey(CommandKind.ZERO_DEPTH, "") is CommandOutcome.DONE
    life.live(10.0)
    assert life.robot.program.state_report().position_ned[2] == pytest.approx(0.0, abs=0.02)
    life.robot.body.mend("depth")
    life.live(10.0)
    assert life.robot.program.state_report().position_ned[2] == pytest.approx(-0.2, abs=0.02)
    assert np.abs(life.estimate.velocity_ned).max() < 0.1
    assert life.estimate.depth_m == pytest.approx(0.0, abs=0.02)


def test_no_word_of_a_robot_without_antennas_leaves_it_though_it_lies_at_the_surface():
    lost = body(GRACE_1, antenna_lost_s=1.0)
    assert lost.is_in_reach
    assert lost.has_satellite
    lost.advance(2.0)
    assert lost.has_gps
    assert not lost.is_in_reach
    assert not lost.has_satellite
    lost.mend("antenna")
    assert lost.is_in_reach
    assert lost.has_satellite


async def test_each_fault_is_told_as_it_comes_and_as_caused(tmp_path):
    chosen = settings(tmp_path, robots=("mini-1",), faults=("leak@0.5", "pump@0.1"), speed=5.0)
    told, stopped, both = [], asyncio.Event(), asyncio.Event()

    async def tell(news):
        told.append(news)
        if len(told) == 2:
            both.set()

    async with asyncio.TaskGroup() as group:
        group.create_task(serve(chosen, stopped, tell))
        await both.wait()
        stopped.set()
    assert [news.robot for news in told] == ["mini-1", "mini-1"]
    assert "pump" in told[0].text
    assert "leak" in told[1].text
    assert all(news.text.startswith("Caused in the simulator") for news in told)


def test_a_depth_sensor_off_its_zero_is_zeroed_at_the_surface_and_says_so():
    life = Life(replace(MINI_1, faults=RobotFaults(depth_off_s=0.0)))
    program = life.robot.program
    assert program.state_report().position_ned[2] == pytest.approx(DEPTH_OFF_M, abs=0.05)
    assert program.obey(CommandKind.ZERO_DEPTH, "") is CommandOutcome.DONE
    life.live(5.0)
    assert program.state_report().position_ned[2] == pytest.approx(0.0, abs=0.05)
    told = program.due_condition() or program.newest_condition[0]
    assert told["depth_zero"] == pytest.approx(DEPTH_OFF_M, abs=0.05)


def test_depth_is_not_zeroed_while_a_plan_is_flown():
    life = Life(MINI_1)
    life.start(mission(*vee()))
    assert life.robot.program.obey(CommandKind.ZERO_DEPTH, "") is CommandOutcome.NOT_NOW
    assert life.robot.program.depth_zero.offset_m is None
