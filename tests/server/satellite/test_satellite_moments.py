"""Moments of a robot that is heard by satellite: told once, and those between two calls too."""

import asyncio

from robot_link.messages import OnboardPlanState, RobotMode
from server.link.moments import DIVE_ENDED, SURFACED
from tests.robot_link.rig import mission
from tests.server.conftest import GRACE, until
from tests.server.far import settled
from tests.server.link.test_moments import moments, word

RUNNING = OnboardPlanState.RUNNING


async def test_satellite_and_radio_tell_one_surfacing_once(far, sky, robot, world):
    station, client = far
    at = sky.clock.now()
    word(world, at, RobotMode.GLIDING, 2.0, GRACE)
    sky.clock.advance(minutes=3)
    robot.mode = RobotMode.SURFACED
    await robot.call()

    async def told():
        found = await moments(client, GRACE)
        return found if len(found) == 3 else None

    found = await until(told)
    assert found[2]["data"]["by"] == "satellite"
    word(world, sky.clock.now(), RobotMode.SURFACED, 0.0, GRACE)
    await robot.call()
    await asyncio.sleep(0.2)
    assert len(await moments(client, GRACE)) == 3
    assert station


async def test_dive_between_two_calls_is_told_by_the_leg(far, sky, robot):
    station, client = far
    robot.mode, robot.plan, robot.plan_state = RobotMode.SURFACED, mission(), RUNNING
    await robot.call()
    await settled(station)
    before = len(await moments(client, GRACE))
    for leg in (0, 4, 4):
        robot.leg = leg
        sky.clock.advance(minutes=20)
        await robot.call()
        await settled(station)

    async def told():
        found = await moments(client, GRACE)
        return found if len(found) >= before + 2 else None

    found = await until(told)
    assert [one["kind"] for one in found[before:]] == [DIVE_ENDED, SURFACED]
