"""What the station says before it sends is what the emulated service charges afterwards."""

import asyncio
from dataclasses import replace

import pytest

from robot_link.messages import SystemId
from robot_link.satellite import chunk
from robot_link.satellite import cost as fare
from robot_link.satellite.blob import Blob, mission_of
from robot_link.station.gateway.rockblock import RockBlockGateway as StationGateway
from simulator.iridium.rockblock_gateway import RockBlockGateway
from tests.robot_link.rig import mission
from tests.robot_link.signed_push import private_key
from tests.simulator.iridium import IMEI, QUICK, network_of

KEY, SYSTEM = bytes(range(32)), SystemId(7)


@pytest.mark.parametrize("dives", [1, 4, 12])
async def test_mission_costs_what_was_quoted_and_arrives_byte_by_byte(dives: int):
    blob = Blob.of(mission(dives))
    messages = chunk.cut(blob, KEY, SYSTEM, counter=1, start=True, ack_seen=False)
    quoted = fare.quote(chunk.sizes(blob))
    network, _ = network_of(replace(QUICK, latency_s=0.0, jitter_s=0.0))
    async with RockBlockGateway(network, private_key(), None).serve() as url:
        client = StationGateway(url, "fleet", "word")
        for number, message in enumerate(messages, 1):
            await client.send(IMEI, message, client_id=number)
        await client.close()
    assert network.credits_charged[IMEI] == quoted.credits
    assert quoted.messages == len(messages)
    parts: dict[int, bytes] = {}
    for _ in messages:
        await asyncio.sleep(0)
        result = await network.session(IMEI, None)
        read = chunk.read_mobile_terminated(result.mt_data, KEY, SYSTEM)
        parts[read.index] = read.data
    packed = b"".join(parts[index] for index in sorted(parts))
    assert packed == blob.packed
    assert mission_of(packed, read.codec) == mission(dives)
