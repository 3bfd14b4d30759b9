"""A satellite network, and one robot's device behind its node: Iridium modem or cellular."""

import asyncio
import random
import struct
from collections.abc import AsyncGenerator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path

from onboard.node.client import NodeClient
from onboard.node.satellite import SatelliteDevice, SatelliteNode
from onboard.node.satellite_9602 import Driver9602
from robot_link.clock import ScaledClock
from simulator.background import alongside
from simulator.iridium.conditions import SatelliteConditions
from simulator.iridium.modem_9602 import Modem9602
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.subscriber import Account
from tests.simulator.cellular_device import CellularDevice
from tests.simulator.flight import EPOCH
from tests.tcp_peer import serving

IMEI = "300234000000020"
FAST = 100.0
CALM = SatelliteConditions(latency_s=0.1, jitter_s=0.0, session_s=1.0)


def fast_clock() -> ScaledClock:
    return ScaledClock(datetime.now(UTC), EPOCH, FAST)


def network(
    conditions: SatelliteConditions = CALM, in_view: Callable[[str], bool] = lambda _imei: True
) -> IridiumNetwork:
    made = IridiumNetwork(random.Random(1), conditions, fast_clock(), in_view)
    made.add_subscriber(IMEI, Account("demo", "word"))
    return made


@asynccontextmanager
async def used(device: SatelliteDevice) -> AsyncGenerator[NodeClient, None]:
    """A program's client of a node with this device."""
    node = SatelliteNode(device)
    async with AsyncExitStack() as stack:
        address = await stack.enter_async_context(node.server.serve())
        await stack.enter_async_context(alongside(node.run(), "satellite node"))
        client = NodeClient(address)
        await stack.enter_async_context(alongside(client.run(), "client"))
        await client.connected()
        yield client


@asynccontextmanager
async def iridium(sky: IridiumNetwork, folder: Path) -> AsyncGenerator[NodeClient, None]:
    line = folder / "satellite"
    async with Modem9602(IMEI, sky).pty(line), used(Driver9602.at(line)) as client:
        await ready(client)
        yield client


@asynccontextmanager
async def cellular(sky: IridiumNetwork, _folder: Path) -> AsyncGenerator[NodeClient, None]:
    """A host that hands what a cellular device says to the same network."""

    async def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        greeting = await reader.readline()
        imei = greeting[1:].strip().decode()
        if greeting[:1] == b"R":

            def ring() -> None:
                writer.write(b"!")

            stop = sky.on_ring(imei, ring)
            try:
                await reader.read()
            finally:
                stop()
        else:
            (size,) = struct.unpack(">H", await reader.readexactly(2))
            record = await reader.readexactly(size)
            result = await sky.session(imei, record or None)
            data = result.mt_data or b""
            writer.write(struct.pack(">BHH", result.is_ok, result.queued, len(data)) + data)

    async with (
        serving(meet) as port,
        used(CellularDevice(IMEI, port)) as client,
    ):
        await ready(client)
        yield client


async def ready(client: NodeClient, *, has_signal: bool = True) -> None:
    """Wait until the device has a signal, or none."""
    for _ in range(1000):
        if bool((await client.ask("signal"))["bars"]) is has_signal:
            return
        await asyncio.sleep(0.01)
    raise AssertionError("the signal did not change")


def heard(sky: IridiumNetwork) -> list[bytes]:
    """What the network took from the modem, filled as it comes."""
    messages: list[bytes] = []
    sky.on_message("rockblock", lambda message: messages.append(message.data))
    return messages
