"""A long mission over slow and lossy air: whole or not at all."""

import asyncio
import random

import pytest

from benchmarks.link.radio import BIT_RATE, ITEMS, RETRIES, long_mission, upload
from robot_link.messages import OnboardPlanState
from robot_link.transport.datagram import Address, Fate, Received
from simulator.xbee_network import MAX_PAYLOAD, AirConditions, XBeeNetwork
from tests.robot_link.far_end import next_event

HASTE = 8.0
"""Everything runs so many times as fast: the air and the time-outs of both ends alike."""


async def test_two_hundred_items_arrive_whole_over_ten_kilobits_with_a_fifth_lost():
    sent = long_mission(ITEMS)
    done = await upload(sent, seed=3, haste=HASTE)
    assert done.items >= ITEMS
    assert done.report.state is OnboardPlanState.ON_BOARD
    assert done.report.sha256 == sent.sha256()
    assert done.kept == [sent], "nothing but the whole mission was ever on board"
    assert done.attempts <= RETRIES


async def test_radios_share_the_air_one_packet_after_another():
    air = XBeeNetwork(
        random.Random(1), AirConditions(delay_s=0.0, jitter_s=0.0, bit_rate=10 * BIT_RATE)
    )
    first, second = (air.robot_radio(Address(n)) for n in (1, 2))
    conditions = air.conditions
    payload = bytes(MAX_PAYLOAD)
    loop = asyncio.get_running_loop()
    began_s = loop.time()
    fates = [await first.send(Address(2), payload) for _ in range(2)]
    fates += [await second.send(Address(1), payload) for _ in range(2)]
    for fate in fates:
        assert (await fate).fate is Fate.DELIVERED
    air_s = 4 * conditions.air_s(MAX_PAYLOAD, is_confirmed=True)
    assert loop.time() - began_s >= air_s
    assert air_s > 4 * 8 * MAX_PAYLOAD / conditions.bit_rate, "packets have more than their data"
    assert (await next_event(second, Received)).data == payload


@pytest.mark.parametrize(("bit_rate", "expected"), [(0.0, 6000.0), (10_000.0, 300.0)])
async def test_a_robots_radio_knows_what_its_air_carries(bit_rate: float, expected: float):
    air = XBeeNetwork(random.Random(1), AirConditions(bit_rate=bit_rate))
    assert air.robot_radio(Address(1)).bytes_per_s == expected
    assert AirConditions().air_s(100, is_confirmed=True) == 0.0
