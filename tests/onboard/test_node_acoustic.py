"""The acoustic node of a robot: ranges and words through the water, as programs see them."""

import asyncio
import math
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path

import pytest

from onboard.node.client import NodeClient
from onboard.node.wire import NodeError, NodeFault
from robot_link.acoustic.micromodem import open_modem
from robot_link.clock import ScaledClock
from simulator.background import alongside
from simulator.equipment import Timekeeping, equipped
from simulator.fleet import GRACE_1, STATION_ACOUSTIC, STATION_ADDRESS
from simulator.iridium.network import IridiumNetwork
from simulator.process import satellites
from simulator.robot import SimulatedBody
from simulator.settings import SimulatorSettings
from tests.robot_link.rig import until


@asynccontextmanager
async def robot_in_water(folder: Path):
    """The lake robot with its devices; nothing moves."""
    now = datetime.now(UTC)
    settings = SimulatorSettings(
        link_folder=folder, wall_anchor=now, time_anchor=now, speed=20.0, robots=(GRACE_1.robot,)
    )
    network: IridiumNetwork = satellites(settings, lambda _imei: True)
    body = SimulatedBody(GRACE_1, 0)
    time = Timekeeping.of(GRACE_1, 0, ScaledClock(now, now, 20.0))
    async with equipped(settings, GRACE_1, body, time, network) as equipment:
        client = equipment.client("acoustic")
        async with alongside(client.run(), "client"):
            await client.connected()
            yield body, client


async def ping(client: NodeClient) -> dict:
    """Ping the station until the modem at the line is ready for it."""
    for _ in range(200):
        answer = await client.ask("ping", peer=STATION_ADDRESS, timeout_s=20.0)
        if answer["is_valid"]:
            return answer
        await asyncio.sleep(0.05)
    raise AssertionError(f"no range: {answer}")


async def test_range_to_the_station_is_that_between_antenna_and_robot(tmp_path):
    async with robot_in_water(tmp_path) as (body, client):
        ranges = client.subscribe("range")
        answer = await ping(client)
        north, east, depth = body.plant.position_ned
        there = (*GRACE_1.antenna_ne_m, 1.0)
        assert answer["range_m"] == pytest.approx(math.dist((north, east, depth), there), abs=8.0)
        assert (await ranges.get())["peer"] == STATION_ADDRESS


async def test_word_of_the_station_reaches_the_robots_programs(tmp_path):
    async with robot_in_water(tmp_path) as (_, client):
        words = client.subscribe("mini")
        await ping(client)
        line = tmp_path / f"{GRACE_1.robot}-{STATION_ACOUSTIC}"
        peer = GRACE_1.acoustic_address
        links = {GRACE_1.robot: f"micromodem://{line}?us={STATION_ADDRESS}&peer={peer}"}
        station = open_modem(links, ScaledClock(datetime.now(UTC), datetime.now(UTC), 1.0))
        async with alongside(station.run(), "station's modem"):
            await until(lambda: station.is_ready)
            await station.mini(peer, 0x0ABC)
            assert await words.get() == {"peer": STATION_ADDRESS, "word": 0x0ABC}


async def test_address_that_nobody_has_is_refused(tmp_path):
    async with robot_in_water(tmp_path) as (_, client):
        with pytest.raises(NodeError) as error:
            await client.ask("ping", peer=9)
        assert error.value.fault is NodeFault.BAD
