"""A simulated robot that is driven over its emulated radio, from the stick to the water."""

import asyncio
import itertools
import math
from contextlib import asynccontextmanager
from datetime import UTC, datetime

from robot_link.drive import Stick
from robot_link.messages import (
    CommandKind,
    CommandLevel,
    CommandNumber,
    CommandReport,
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


async def hold(client, answers, stick, until_true, *, begins=True):
    """Hold the stick, twenty times a second, until something is true.

    A machine that stood still was silent for so long that nobody drives any more: it begins again.
    """
    async with asyncio.timeout(120.0):
        for number in itertools.count():
            if until_true():
                return
            if begins and answers and not answers[-1].report.is_driven:
                answers.clear()
                await client.begin()
            await client.steer(stick, number)
            await asyncio.sleep(0.05)


async def test_robot_in_the_tank_swims_where_the_stick_points_and_stops_in_silence(tmp_path):
    async with pilot(tmp_path) as (_, heard, client, answers):
        await client.begin()
        began = states(heard)[-1].position_ned

        def swims():
            newest = states(heard)[-1]
            is_away = math.dist(newest.position_ned, began) > 0.1
            return is_away and newest.mode is RobotMode.DRIVEN and beaten_rad(heard) > 0.1

        await hold(client, answers, AHEAD, swims)
        assert answers[-1].report.acts_on == AHEAD
        # nothing but silence: the tail must come to rest by the robot's own doing
        silent_from = len(states(heard))
        await until(lambda: len(states(heard)) > silent_from + 30)
        assert max(abs(one.tail_rad) for one in states(heard)[-15:]) < 0.1

        def turns():
            return answers and answers[-1].report.acts_on.turn == 1.0

        await hold(client, answers, Stick(turn=1.0), turns)
        await client.end()
        await until(lambda: states(heard)[-1].mode is RobotMode.IDLE)


async def test_order_to_surface_takes_the_stick_away(tmp_path):
    async with pilot(tmp_path) as (link, heard, client, answers):
        await client.begin()
        await hold(client, answers, AHEAD, lambda: answers and answers[-1].report.is_driven)
        link.send_command(ROBOT, CommandKind.SURFACE, CommandNumber(1), soon(3600.0))

        def is_taken_away():
            return not answers[-1].report.is_driven

        await hold(client, answers, AHEAD, is_taken_away, begins=False)
        await until(lambda: states(heard)[-1].mode is RobotMode.IDLE)


async def test_plan_that_comes_while_it_is_driven_waits_on_board(tmp_path):
    async with pilot(tmp_path) as (link, heard, client, answers):
        await client.begin()
        plan = mission(*vee())
        coming = asyncio.create_task(link.upload(ROBOT, plan))
        await hold(client, answers, Stick(), coming.done)
        assert coming.result().state is OnboardPlanState.ON_BOARD
        link.send_command(ROBOT, CommandKind.START, CommandNumber(1), soon(3600.0), plan.sha256())

        def is_refused():
            levels = [one.level for one in heard.of(CommandReport) if one.number == 1]
            return CommandLevel.REFUSED in levels

        await hold(client, answers, AHEAD, is_refused)
        known = len(states(heard))
        await hold(client, answers, AHEAD, lambda: len(states(heard)) > known + 5)
        assert {one.mode for one in states(heard)[known:]} == {RobotMode.DRIVEN}
