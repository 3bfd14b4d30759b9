"""A robot's own radio in the simulator."""

import random

import pytest

from robot_link.transport.datagram import Address, Fate, PortChanged, PortClosedError, Received
from robot_link.transport.keeper import DISABLED
from simulator.xbee_network import MAX_PAYLOAD, AirConditions, XBeeNetwork
from tests.robot_link.far_end import next_event

FIRST, SECOND = Address(1), Address(2)


async def test_an_unplugged_radio_neither_speaks_nor_hears():
    air = XBeeNetwork(random.Random(1), AirConditions(delay_s=0.0, jitter_s=0.0))
    first, second = air.robot_radio(FIRST), air.robot_radio(SECOND)
    assert (await next_event(second, PortChanged)).is_open
    second.set_enabled(False)
    assert second.max_payload == 0
    assert (await next_event(second, PortChanged)).reason == DISABLED
    with pytest.raises(PortClosedError):
        await second.send(FIRST, b"x")
    await (await first.send(SECOND, b"lost"))
    second.set_enabled(True)
    second.set_enabled(True)
    assert second.max_payload == MAX_PAYLOAD
    assert (await next_event(second, PortChanged)).is_open
    await first.send(SECOND, b"heard")
    assert (await next_event(second, Received)).data == b"heard"


async def test_a_packet_of_all_that_fits_is_taken_and_one_byte_more_is_not():
    air = XBeeNetwork(random.Random(1), AirConditions(delay_s=0.0, jitter_s=0.0))
    first, second = air.robot_radio(FIRST), air.robot_radio(SECOND)
    fits = await (await first.send(SECOND, bytes(MAX_PAYLOAD)))
    too_large = await (await first.send(SECOND, bytes(MAX_PAYLOAD + 1)))
    assert (fits.fate, too_large.fate) == (Fate.DELIVERED, Fate.TOO_LARGE)
    assert (await next_event(second, Received)).data == bytes(MAX_PAYLOAD)
