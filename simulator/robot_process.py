"""The onboard program alone, in a process of its own, against nodes over sockets.

This is what a robot's computer runs: the nodes own the hardware, or stand for it, and the program
knows their addresses and its radio's line, nothing else. It steps whenever the body node publishes
readings, and its clock counts what their counter says, set by the pulses of the clock node.
"""

import asyncio
import logging
from collections.abc import Mapping
from contextlib import AsyncExitStack
from datetime import UTC, datetime
from pathlib import Path

from pydantic import Field, field_validator

from autonomy.configuration import Configuration
from onboard.clock import OnboardClock, RunningClock
from onboard.computer import Computer
from onboard.node.body import RemoteBody
from onboard.node.client import NodeClient
from onboard.node.gps_clock import discipline
from onboard.node.wire import NodeAddress, NodeError, NodeGoneError, NodeSilentError
from onboard.program import PERIOD_S
from robot_link.messages import RobotId
from robot_link.transport.opening import open_transport
from simulator.aboard import computer_of, program_of
from simulator.background import alongside
from simulator.fleet import FLEET, robots_named
from simulator.until_told import run_until_told

_FIRST_PULSE_S = 3.0
"""Wall time that a robot waits for the time before it begins without."""
_CATCH_UP_MAX = 20
"""Steps for one set of readings, after others were missed."""
_REPORT_S = 0.1
"""Wall time between two state reports."""

_log = logging.getLogger(__name__)


class RobotSettings(Configuration):
    """Which robot this is, and where its hardware is."""

    robot: RobotId
    """Its name."""
    nodes: Mapping[str, str]
    """Addresses of its nodes by name; body is needed, gps_clock, satellite, acoustic,
    tag_receiver and camera are used where there are any."""
    radio: str
    """URI of its radio's line."""
    memory: Path
    """Folder of what it remembers while it is switched off, with its key."""
    speed: float = Field(default=1.0, ge=0.1, le=50.0)
    """Seconds of the robot per second of the wall, where its nodes are simulated."""

    @field_validator("robot")
    @classmethod
    def _is_known(cls, robot: RobotId) -> RobotId:
        return robots_named((robot,))[0]

    @field_validator("nodes")
    @classmethod
    def _has_a_body(cls, nodes: Mapping[str, str]) -> Mapping[str, str]:
        if "body" not in nodes:
            raise ValueError("a robot needs a body node")
        for address in nodes.values():
            NodeAddress.of(address)
        return nodes

    @field_validator("radio")
    @classmethod
    def _is_a_radio(cls, radio: str) -> str:
        open_transport(radio)
        return radio


def run(settings: RobotSettings) -> None:
    """Fly the robot until SIGTERM or SIGINT.

    Raises:
        ExceptionGroup: If a part of the program failed.
        KeyUnreadableError: If the robot's key is none.
    """
    run_until_told(lambda stopped: serve(settings, stopped))


async def serve(settings: RobotSettings, stopped: asyncio.Event) -> None:
    """Fly the robot on this event loop until ``stopped`` is set.

    Raises:
        ExceptionGroup: If a part of the program failed.
        KeyUnreadableError: If the robot's key is none.
    """
    async with asyncio.TaskGroup() as group:
        life = group.create_task(_live(settings), name=f"{settings.robot} life")
        await stopped.wait()
        life.cancel()
    _log.info("%s ended", settings.robot)


async def _live(settings: RobotSettings) -> None:
    async with AsyncExitStack() as stack:

        async def client(name: str) -> NodeClient | None:
            node = _client(settings, name)
            if node is None:
                return None
            await stack.enter_async_context(alongside(node.run(), f"{name} node"))
            return node

        body_node = NodeClient(NodeAddress.of(settings.nodes["body"]))
        body = RemoteBody(body_node)
        await stack.enter_async_context(alongside(body_node.run(), "body node"))
        await body.wait()
        onboard = OnboardClock(datetime.now(UTC), body.count_s)
        gps = await client("gps_clock")
        if gps is not None:
            await stack.enter_async_context(alongside(discipline(onboard, gps), "clock"))
            await _first_pulse(onboard)
        clock = RunningClock(onboard, lambda: body.count_s, settings.speed)
        definition = FLEET[settings.robot]
        camera = _client(settings, "camera")
        computer = computer_of(
            definition,
            program_of(definition, body, clock.now(), clock.now),
            radio=open_transport(settings.radio),
            clock=clock,
            memory=settings.memory,
            satellite=_client(settings, "satellite"),
            acoustic=_client(settings, "acoustic"),
            tag_receiver=_client(settings, "tag_receiver"),
            camera=None if camera is None else (camera, onboard.at),
        )
        _log.info("%s is awake; its clock shows %s", settings.robot, f"{clock.now():%Y-%m-%d %X}")
        async with asyncio.TaskGroup() as group:
            group.create_task(computer.run(), name=f"{settings.robot} computer")
            await _fly(computer, body, settings.speed)


def _client(settings: RobotSettings, name: str) -> NodeClient | None:
    """Return a client that nobody runs yet; None where there is no such node."""
    address = settings.nodes.get(name)
    return None if address is None else NodeClient(NodeAddress.of(address))


async def _first_pulse(onboard: OnboardClock) -> None:
    """Wait for the time, but not for ever: a robot that starts under water has no GPS."""
    for _ in range(100):
        if onboard.last_step_s is not None:
            return
        await asyncio.sleep(_FIRST_PULSE_S / 100)
    _log.warning("no GPS pulse: the robot begins with its computer's time")


async def _fly(computer: Computer, body: RemoteBody, speed: float) -> None:
    """Step the program by the body's readings until cancelled."""
    program = computer.program
    began_s = body.count_s - program.time_s
    reported_s = program.time_s
    while True:
        await body.wait()
        behind = round((body.count_s - began_s - program.time_s) / PERIOD_S)
        for _ in range(min(max(behind, 1), _CATCH_UP_MAX)):
            computer.step()
        if behind > _CATCH_UP_MAX:
            began_s = body.count_s - program.time_s
        try:
            await body.push()
        except (NodeError, NodeGoneError, NodeSilentError) as error:
            _log.warning("the body did not take its set points: %s", error)
        if program.time_s - reported_s >= _REPORT_S * speed:
            reported_s = program.time_s
            computer.report_state()
