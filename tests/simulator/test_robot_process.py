"""The onboard program alone, against a body, a clock and radios that it reaches by sockets."""

import asyncio
import json
import math
from datetime import UTC, datetime, timedelta

import pytest

from robot_link.messages import (
    CommandKind,
    CommandNumber,
    OnboardPlanState,
    PlanReport,
    StateReport,
)
from robot_link.station.link import RadioPath, RobotEndpoint, StationLink
from robot_link.transport.opening import open_transport
from simulator.fleet import GRACE_1, MINI_1
from simulator.process import serve as serve_bodies
from simulator.robot_process import RobotSettings, serve
from simulator.settings import SimulatorSettings
from tests.robot_link.rig import Heard, running, until
from tests.simulator.flight import mission, vee

SPEED = 10.0
MANY_S = 3600.0
"""Of a robot's clock: longer than a busy machine is late with a state, far from being years off."""


def bodies(folder, robot, **changes) -> SimulatorSettings:
    now = datetime.now(UTC)
    return SimulatorSettings(
        link_folder=folder,
        wall_anchor=now,
        time_anchor=now + timedelta(days=1000),
        speed=SPEED,
        robots=(robot,),
        has_programs=False,
        **changes,
    )


def robot_settings(chosen: SimulatorSettings, robot, memory) -> RobotSettings:
    return RobotSettings(
        robot=robot,
        nodes=json.loads(chosen.device_path(robot, "nodes.json").read_text()),
        radio=f"xbee://{chosen.device_path(robot, 'radio')}",
        memory=memory,
        speed=SPEED,
    )


def station_of(chosen: SimulatorSettings, definition) -> tuple[StationLink, Heard]:
    uri = f"xbee://{chosen.link_path(definition.robot)}"
    endpoint = RobotEndpoint(definition.system_id, (RadioPath(uri, definition.radio_address),))
    heard = Heard()
    link = StationLink(
        {uri: open_transport(uri)}, {definition.robot: endpoint}, chosen.clock(), heard
    )
    heard.station = link
    return link, heard


async def with_program(chosen, definition, memory, work) -> None:
    """Run bodies, the robot's program and a station; then what is to be done with them."""
    bodies_end, robot_end = asyncio.Event(), asyncio.Event()
    async with asyncio.TaskGroup() as group:
        task = group.create_task(serve_bodies(chosen, bodies_end))
        nodes = chosen.device_path(definition.robot, "nodes.json")
        await until(lambda: task.done() or nodes.exists())
        group.create_task(serve(robot_settings(chosen, definition.robot, memory), robot_end))
        link, heard = station_of(chosen, definition)
        try:
            async with running(link.run):
                await work(link, heard)
        finally:
            robot_end.set()
            bodies_end.set()


async def test_program_flies_a_body_that_it_reaches_by_its_node_alone(tmp_path):
    chosen = bodies(tmp_path / "links", MINI_1.robot)
    chosen.link_folder.mkdir()
    plan = mission(*vee())

    async def work(link: StationLink, heard: Heard) -> None:
        await until(lambda: bool(heard.of(StateReport)))
        report = await link.upload(MINI_1.robot, plan)
        assert report.state is OnboardPlanState.ON_BOARD
        expires = chosen.clock().now() + timedelta(hours=1)
        link.send_command(MINI_1.robot, CommandKind.START, CommandNumber(1), expires, plan.sha256())
        await until(lambda: any(state.position_ned[2] > 0.2 for state in heard.of(StateReport)))
        await until(
            lambda: any(said.state is OnboardPlanState.RUNNING for said in heard.of(PlanReport))
        )

    await with_program(chosen, MINI_1, tmp_path / "memory", work)


async def test_clock_of_a_program_that_began_years_off_is_set_by_gps(tmp_path):
    chosen = bodies(tmp_path / "links", GRACE_1.robot)
    chosen.link_folder.mkdir()

    async def work(_link: StationLink, heard: Heard) -> None:
        await until(lambda: len(heard.of(StateReport)) > 5)
        state = heard.of(StateReport)[-1]
        off_s = (state.measured_at - state.received_at).total_seconds()
        assert abs(off_s) < MANY_S
        north, east = GRACE_1.start_ne_m
        assert math.hypot(state.position_ned[0] - north, state.position_ned[1] - east) < 20.0

    await with_program(chosen, GRACE_1, tmp_path / "memory", work)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"robot": "nobody"}, "no robot nobody"),
        ({"nodes": {"satellite": "tcp://127.0.0.1:1"}}, "needs a body node"),
        ({"nodes": {"body": "tcp://example.org:1"}}, "listens on this machine only"),
        ({"radio": "pigeon://loft"}, "pigeon"),
    ],
)
def test_settings_that_no_robot_can_fly_with_are_refused_by_field(change, sentence, tmp_path):
    good = {
        "robot": "mini-1",
        "nodes": {"body": "tcp://127.0.0.1:4567"},
        "radio": "xbee:///dev/ttyUSB0",
        "memory": tmp_path,
    }
    with pytest.raises(ValueError, match=sentence) as error:
        RobotSettings.model_validate({**good, **change})
    assert next(iter(change)) in str(error.value)
