"""The devices of one simulated robot, each behind its node, and where the nodes are found."""

import asyncio
import json
from collections.abc import AsyncGenerator, Coroutine, Mapping
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np

from onboard.clock import ClockModel, OnboardClock, Oscillator, RunningClock
from onboard.node.camera import CameraNode
from onboard.node.client import NodeClient
from onboard.node.gps_clock import GpsClockNode, discipline
from onboard.node.satellite import SatelliteNode
from onboard.node.satellite_9602 import Driver9602
from onboard.node.server import NodeServer
from onboard.node.tag_receiver import TagReceiverNode
from onboard.node.wire import NodeAddress
from robot_link.clock import Clock
from robot_link.whole_file import replace_file
from simulator.acoustics import acoustic_modems, acoustic_node
from simulator.background import alongside
from simulator.fleet import RobotDefinition
from simulator.iridium.modem_9602 import Modem9602
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.session import Place
from simulator.own_camera import SimulatedEye, pose_of_state, write_files
from simulator.robot import SimulatedBody
from simulator.settings import SimulatorSettings
from simulator.tag_receiver import TagReceiver

_CLOCK_SEED = 3
"""Tells the randomness of a robot's counter from that of its water and its sensors."""
_EYE_SEED = 4
"""Likewise that of its own camera."""


@dataclass(frozen=True, slots=True)
class Timekeeping:
    """What one robot tells the time by."""

    started_at: datetime
    """True time at which it was switched on."""
    truth: Clock
    oscillator: Oscillator
    onboard: OnboardClock

    @classmethod
    def of(cls, definition: RobotDefinition, seed: int, truth: Clock) -> "Timekeeping":
        """Switch a robot's counter on; of a robot that is given the time it is exact."""
        model = definition.clock or ClockModel(0.0, 0.0)
        generator = np.random.default_rng([seed, definition.system_id, _CLOCK_SEED])
        started_at = truth.now()
        return cls(started_at, truth, Oscillator(model, generator), OnboardClock(started_at))

    def at(self, true_s: float) -> datetime:
        """Return what the robot's clock showed so long after it was switched on."""
        return self.onboard.at(self.oscillator.count_s(true_s))

    def count_s(self) -> float:
        """Return what the counter shows now."""
        elapsed_s = (self.truth.now() - self.started_at).total_seconds()
        return self.oscillator.count_s(elapsed_s)

    def clock(self) -> Clock:
        """Return the robot's clock."""
        return RunningClock(self.onboard, self.count_s, self.truth.speed)


@dataclass(frozen=True, slots=True)
class Equipment:
    """Where the nodes of a robot listen, by their names."""

    addresses: Mapping[str, NodeAddress]

    def client(self, node: str) -> NodeClient | None:
        """Return a client of a node that its user runs; None where there is no such node."""
        address = self.addresses.get(node)
        return None if address is None else NodeClient(address)


@asynccontextmanager
async def equipped(
    settings: SimulatorSettings,
    definition: RobotDefinition,
    body: SimulatedBody,
    time: Timekeeping,
    network: IridiumNetwork,
    more: tuple[NodeServer, ...] = (),
) -> AsyncGenerator[Equipment]:
    """Switch the devices of a robot on, and off again when the context is left.

    Args:
        settings: Those of the process: where the lines to devices appear, and the seed.
        definition: The robot.
        body: Where it is.
        time: Its counter.
        network: The satellite network that knows its modem.
        more: Further nodes to serve.
    """

    def device_path(device: str) -> Path:
        return settings.device_path(definition.robot, device)

    async with AsyncExitStack() as stack:
        addresses: dict[str, NodeAddress] = {}

        async def serve(server: NodeServer, work: Coroutine[None, None, None] | None) -> None:
            addresses[server.name] = await stack.enter_async_context(server.serve())
            if work is not None:
                name = f"{definition.robot} {server.name} node"
                await stack.enter_async_context(alongside(work, name))

        if definition.imei:
            line = device_path("satellite")
            if not settings.has_modems_elsewhere:
                modem = Modem9602(definition.imei, network, lambda: Place(*body.place_deg))
                await stack.enter_async_context(modem.pty(line))
            satellite = SatelliteNode(Driver9602.at(line))
            await serve(satellite.server, satellite.run())
        if definition.clock is not None:
            gps = GpsClockNode(time.oscillator, time.truth, time.started_at, lambda: body.has_gps)
            await serve(gps.server, gps.run())
        if definition.acoustic_address is not None:
            await stack.enter_async_context(acoustic_modems(settings, definition, body, time.truth))
            node = acoustic_node(settings, definition, time.clock())
            await serve(node.server, node.run())
            events = alongside(node.drain(), f"{definition.robot} acoustic events")
            await stack.enter_async_context(events)
        if definition.tag_receiver is not None:
            line = device_path("tag-receiver")
            heard_in = TagReceiver.of(definition, settings.seed, body, time.truth)
            await stack.enter_async_context(heard_in.pty(line))
            tags = TagReceiverNode(line)
            await serve(tags.server, tags.run())
        if definition.has_own_camera and (memory := settings.memory(definition.robot)) is not None:
            await asyncio.to_thread(write_files, memory)
            camera = CameraNode(_eye(settings, definition, body, time))
            await serve(camera.server, camera.run())
        for server in more:
            await serve(server, None)
        directory = device_path("nodes.json")
        await asyncio.to_thread(_write, directory, addresses)
        try:
            yield Equipment(addresses)
        finally:
            directory.unlink(missing_ok=True)


def _eye(
    settings: SimulatorSettings, definition: RobotDefinition, body: SimulatedBody, time: Timekeeping
) -> SimulatedEye:
    """Return what a robot's own camera sees."""
    return SimulatedEye(
        lambda: pose_of_state(body.plant.state),
        lambda: time.oscillator.count_s(body.plant.time_s),
        time.truth,
        np.random.default_rng([settings.seed, definition.system_id, _EYE_SEED]),
    )


@asynccontextmanager
async def disciplined(onboard: OnboardClock, equipment: Equipment) -> AsyncGenerator[None]:
    """Set a clock by the robot's GPS, where it has one, as long as the context lasts."""
    node = equipment.client("gps_clock")
    if node is None:
        yield
        return
    async with alongside(node.run(), "clock node"), alongside(discipline(onboard, node), "clock"):
        yield


def _write(path: Path, addresses: Mapping[str, NodeAddress]) -> None:
    replace_file(path, json.dumps({name: str(at) for name, at in addresses.items()}).encode())
