"""A simulated robot that is driven over its emulated radio, from the stick to the water."""

import asyncio
import math
from contextlib import asynccontextmanager
from datetime import UTC, datetime

from robot_link.drive import Stick
from robot_link.messages import (
    CommandKind,
    CommandNumber,
    OnboardPlanState,
    RobotMode,
    StateReport,
)
from simulator.fleet import MINI_1
from simulator.settings import SimulatorSettings
from tests.robot_link.rig import soon, until
from tests.simulator.flight import mission, vee
from tests.simulator.test_process import simulation, station

ROBOT = MINI_1.robot
AHEAD = Stick(forward=1.0)


@asynccontextmanager
async def pilot(folder):
    """A robot in contact at the speed of a person's clock, and what drives it."""
    now = datetime.now(UTC)
    chosen = SimulatorSettings(link_folder=folder, wall_anchor=now, time_anchor=now, speed=1.0)
    async with simulation(chosen), station(chosen) as (link, heard):
        await until(lambda: any(one.robot == ROBOT for one in heard.of(StateReport)))
        client, answers = link.drive(ROBOT), []
        client.on_answer = answers.append
        yield link, heard, client, answers


def states(heard):
    return [one for one in heard.of(StateReport) if one.robot == ROBOT]


def beaten_rad(heard):
    """The largest angle of the tail so far."""
    return max(abs(one.tail_rad) for one in states(heard))


async def hold(client, stick, until_true):
    """Hold the stick, twenty times a second, until something is true."""
    for number in range(2000):
        if until_true():
            return
        await client.steer(stick, number)
        await asyncio.sleep(0.05)
    raise AssertionError("it never became true")


async def test_robot_in_the_tank_swims_where_the_stick_points_and_stops_in_silence(tmp_path):
    async with pilot(tmp_path) as (_, heard, client, answers):
        await client.begin()
        began = states(heard)[-1].position_ned
        await hold(client, AHEAD, lambda: math.dist(states(heard)[-1].position_ned, began) > 0.1)
        assert states(heard)[-1].mode is RobotMode.DRIVEN
        assert answers[-1].report.acts_on == AHEAD
        # nothing but silence: the tail must come to rest by the robot's own doing
        silent_from = len(states(heard))
        await until(lambda: len(states(heard)) > silent_from + 30)
        assert max(abs(one.tail_rad) for one in states(heard)[-15:]) < 0.1 < beaten_rad(heard)
        await hold(client, Stick(turn=1.0), lambda: answers[-1].report.acts_on.turn == 1.0)
        await client.end()
        await until(lambda: states(heard)[-1].mode is RobotMode.IDLE)


async def test_order_to_surface_takes_the_stick_away(tmp_path):
    async with pilot(tmp_path) as (link, heard, client, answers):
        await client.begin()
        await hold(client, AHEAD, lambda: answers)
        link.send_command(ROBOT, CommandKind.SURFACE, CommandNumber(1), soon(3600.0))
        await hold(client, AHEAD, lambda: not answers[-1].report.is_driven)
        await until(lambda: states(heard)[-1].mode is RobotMode.IDLE)


async def test_plan_that_comes_while_it_is_driven_waits_on_board(tmp_path):
    async with pilot(tmp_path) as (link, heard, client, answers):
        await client.begin()
        plan = mission(*vee())
        report = await link.upload(ROBOT, plan)
        assert report.state is OnboardPlanState.ON_BOARD
        link.send_command(ROBOT, CommandKind.START, CommandNumber(1), soon(3600.0), plan.sha256())
        await hold(client, AHEAD, lambda: len(answers) > 20)
        assert answers[-1].report.is_driven
        assert {one.mode for one in states(heard)[-5:]} == {RobotMode.DRIVEN}
