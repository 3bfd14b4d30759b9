"""Robots in several processes, one for each core, with one that is asked about all of them.

The first process, the head, starts the others and ends with them, and is what the rest of the
world sees: its satellite network, with the modem of every robot, and its fault desk. A shard is a
process with robots of its own, which live in it whole: body, program, radio and devices. All live
by the same clock. A shard that ends is started again; its robots are then switched on anew.

A shard tells the port of its fault desk by one line on its standard output. What it publishes there
beside faults is the topic ``sky``: by IMEI, whether a modem sees the sky, and where it is, deg.
"""

import asyncio
import logging
import math
import os
import pickle
import sys
import time
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncGenerator, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field
from typing import Final

from onboard.node.client import NodeClient
from onboard.node.server import NodeServer
from onboard.node.wire import NodeAddress
from robot_link.child_process import kill_child
from robot_link.messages import RobotId
from simulator.background import alongside
from simulator.fault_desk import FaultDesk
from simulator.fleet import FLEET, is_sub
from simulator.iridium.modem_9602 import Modem9602
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.session import Place
from simulator.robot import SimulatedBody
from simulator.settings import SimulatorSettings

SKY: Final = "sky"
ROBOTS_IN_ONE: Final = 8
"""So many robots one process flies alone; more are dealt out to as many as there are cores."""
_SKY_S: Final = 0.1
_STOP_LIMIT_S: Final = 10.0
_QUICK_DEATH_S: Final = 5.0
_QUICK_DEATHS_MAX: Final = 3
_NOWHERE: Final = Place(0.0, 0.0)

_log = logging.getLogger(__name__)


class ShardEndedError(Exception):
    """A shard ends again and again."""


@dataclass(frozen=True, slots=True)
class Sky:
    """What a satellite modem has to do with the world."""

    in_view: bool
    place: Place


def processes_of(settings: SimulatorSettings) -> int:
    """Return in how many processes robots are to live; 1 is this one alone."""
    if settings.processes is not None:
        return min(settings.processes, len(settings.robots))
    if len(settings.robots) <= ROBOTS_IN_ONE:
        return 1
    return min(os.cpu_count() or 1, math.ceil(len(settings.robots) / ROBOTS_IN_ONE))


def dealt(settings: SimulatorSettings) -> tuple[tuple[RobotId, ...], list[tuple[RobotId, ...]]]:
    """Return which robots live in the head, and which in each shard.

    What cameras see is drawn where it lives, so that robots of the tank stay in the head then.
    """
    count = processes_of(settings)
    if count == 1:
        return settings.robots, []
    here = tuple(
        robot
        for robot in settings.robots
        if settings.cameras and not is_sub(robot) and FLEET[robot].site.kind == "tank"
    )
    away = [robot for robot in settings.robots if robot not in here]
    return here, [tuple(away[first::count]) for first in range(min(count, len(away)))]


def sky_of(bodies: Mapping[str, SimulatedBody]) -> dict[str, Sky]:
    """Return what each modem of this process has to do with the world."""
    return {imei: Sky(body.has_satellite, Place(*body.place_deg)) for imei, body in bodies.items()}


async def publish_sky(server: NodeServer, bodies: Mapping[str, SimulatedBody]) -> None:
    """Tell what modems see again and again, until cancelled."""
    while True:
        told = {
            imei: [sky.in_view, sky.place.latitude_deg, sky.place.longitude_deg]
            for imei, sky in sky_of(bodies).items()
        }
        server.publish(SKY, told, is_state=True)
        await asyncio.sleep(_SKY_S)


@dataclass(eq=False)
class Shard:
    """The head's end of one process."""

    settings: SimulatorSettings
    sky: dict[str, Sky] = field(default_factory=dict[str, Sky])
    """By IMEI, as it said last; empty while it does not run."""

    async def live(self, desk: FaultDesk) -> None:
        """Let it live, and start it again when it ends, until cancelled.

        Raises:
            ShardEndedError: If it cannot be kept alive.
        """
        quick_deaths = 0
        while True:
            begun_s = time.monotonic()
            async with _started(self.settings) as process:
                await self._follow(process, desk)
            self.sky = {}
            quick = time.monotonic() - begun_s < _QUICK_DEATH_S
            quick_deaths = quick_deaths + 1 if quick else 0
            names = ", ".join(self.settings.robots)
            if quick_deaths == _QUICK_DEATHS_MAX:
                raise ShardEndedError(f"the process of {names} ends again and again")
            _log.warning("the process of %s ended; it is started again", names)

    async def _follow(self, process: Process, desk: FaultDesk) -> None:
        """Serve what a process says until it ends."""
        stdout = process.stdout
        assert stdout is not None  # noqa: S101 - a pipe was asked for
        line = await stdout.readline()
        if not line:
            await process.wait()
            return
        client = NodeClient(NodeAddress(port=int(line)))
        async with (
            alongside(desk.relay(client), "faults of a shard"),
            alongside(self._hear_sky(client), "sky over a shard"),
            alongside(client.run(), "words of a shard"),
        ):
            await process.wait()

    async def _hear_sky(self, client: NodeClient) -> None:
        async for value in client.subscribe(SKY):
            self.sky = {
                imei: Sky(bool(in_view), Place(float(latitude), float(longitude)))
                for imei, (in_view, latitude, longitude) in value.items()
            }


def shards_of(settings: SimulatorSettings, groups: Sequence[tuple[RobotId, ...]]) -> list[Shard]:
    """Return the shards of groups of robots; nobody lives yet."""
    alone = {
        "gateway": None,
        "satellite_memory": None,
        "cameras": 0,
        "camera_port": None,
        "desk_port": None,
        "processes": 1,
        "parent_pid": os.getpid(),
        "has_modems_elsewhere": True,
    }
    hanging = tuple(settings.fixed_by_cameras)
    return [
        Shard(
            settings.model_copy(
                update={
                    **alone,
                    "robots": robots,
                    "fixed_by_cameras": tuple(one for one in hanging if one in robots),
                }
            )
        )
        for robots in groups
    ]


@asynccontextmanager
async def modems(
    shards: Sequence[Shard], settings: SimulatorSettings, network: IridiumNetwork
) -> AsyncGenerator[None]:
    """Put the satellite modems of robots of other processes on their lines."""
    async with AsyncExitStack() as stack:
        for shard in shards:
            for robot in shard.settings.robots:
                imei = "" if is_sub(robot) else settings.definition(robot).imei
                if not imei:
                    continue

                def place(shard: Shard = shard, imei: str = imei) -> Place:
                    return shard.sky[imei].place if imei in shard.sky else _NOWHERE

                modem = Modem9602(imei, network, place)
                line = settings.device_path(robot, "satellite")
                await stack.enter_async_context(modem.pty(line))
        yield


@asynccontextmanager
async def _started(settings: SimulatorSettings) -> AsyncGenerator[Process]:
    """Run a process with robots of its own as long as the context lasts."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "simulator.shard_process", stdin=PIPE, stdout=PIPE
    )
    definitions = {robot: FLEET[robot] for robot in settings.robots if not is_sub(robot)}
    try:
        stdin = process.stdin
        assert stdin is not None  # noqa: S101 - a pipe was asked for
        with suppress(BrokenPipeError, ConnectionResetError):
            stdin.write(pickle.dumps((settings, definitions)))
            await stdin.drain()
        stdin.close()
        yield process
    finally:
        with suppress(ProcessLookupError):
            process.terminate()
        with suppress(TimeoutError):
            async with asyncio.timeout(_STOP_LIMIT_S):
                await process.wait()
        await kill_child(process)
