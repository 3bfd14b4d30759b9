"""The satellite node: two devices, one way to use them."""

import asyncio

import pytest

from onboard.node.at_dialogue import Block, Dialogue, checksum
from onboard.node.client import NodeClient
from onboard.node.satellite import SatelliteClient
from onboard.node.satellite_9602 import Driver9602
from onboard.node.wire import NodeError, NodeFault
from simulator.background import alongside
from simulator.iridium.modem_9602 import Modem9602
from tests.robot_link.rig import until
from tests.simulator.satellite_rig import (
    FAST,
    IMEI,
    cellular,
    heard,
    iridium,
    network,
    ready,
    used,
)

KINDS = pytest.mark.parametrize("kind", [iridium, cellular])


@KINDS
async def test_record_goes_up_and_another_comes_down_whatever_the_device_is(kind, tmp_path):
    sky = network()
    ashore = heard(sky)
    awkward = bytes(range(256)) + b"\r\nOK\r\nSBDRING\r\n"[:14]
    async with kind(sky, tmp_path) as node:
        client = SatelliteClient(node)
        rings = client.rings()
        await node.ask("describe")
        sky.accept(IMEI, awkward)
        await rings.get()
        outcome = await client.session(b"record \r\n\x00\xff", for_ring=True)
        assert outcome.is_sent
        assert outcome.received == awkward
        assert outcome.text == ""
        await until(lambda: ashore == [b"record \r\n\x00\xff"])


@KINDS
async def test_waiting_records_come_one_a_session_and_are_counted(kind, tmp_path):
    sky = network()
    async with kind(sky, tmp_path) as node:
        client = SatelliteClient(node)
        for n in range(3):
            sky.accept(IMEI, bytes([n]) * 5)
        await asyncio.sleep(5.0 / FAST)
        outcomes = [await client.session(None) for _ in range(4)]
        assert [outcome.received for outcome in outcomes] == [b"\0" * 5, b"\1" * 5, b"\2" * 5, None]
        assert [outcome.queued for outcome in outcomes] == [2, 1, 0, 0]


@KINDS
async def test_session_without_sky_fails_with_a_sentence(kind, tmp_path):
    is_up = [True]
    sky = network(in_view=lambda _imei: is_up[0])
    async with kind(sky, tmp_path) as node:
        is_up[0] = False
        outcome = await SatelliteClient(node).session(b"hello")
        assert not outcome.is_sent
        assert outcome.received is None
        assert outcome.text


async def test_two_programs_share_the_modem_and_each_gets_its_own_session(tmp_path):
    sky = network()
    ashore = heard(sky)
    async with iridium(sky, tmp_path) as first:
        second = NodeClient(first.address)
        async with alongside(second.run(), "second"):
            await second.connected()
            outcomes = await asyncio.gather(
                *(SatelliteClient(node).session(f"{n}".encode()) for n, node in
                  enumerate((first, second, first, second)))
            )  # fmt: skip
        assert all(outcome.is_sent for outcome in outcomes)
        assert len({outcome.sent_number for outcome in outcomes}) == 4
        await until(lambda: sorted(ashore) == [b"0", b"1", b"2", b"3"])


async def test_record_that_no_modem_takes_is_refused_before_the_line(tmp_path):
    async with iridium(network(), tmp_path) as node:
        for record in ("", "00" * 341):
            with pytest.raises(NodeError, match="1 to 340 bytes") as error:
                await node.ask("session", record=record)
            assert error.value.fault is NodeFault.BAD


async def test_modem_that_is_pulled_and_plugged_in_again_works_on(tmp_path):
    sky = network()
    line = tmp_path / "satellite"
    modem = Modem9602(IMEI, sky)
    async with used(Driver9602.at(line)) as node:
        client = SatelliteClient(node)
        assert "no modem" in (await client.session(b"a")).text
        for _ in range(2):
            async with modem.pty(line):
                await ready(node)
                assert (await client.session(b"a")).is_sent
                assert (await node.ask("identity"))["name"] == IMEI
        await ready(node, has_signal=False)


async def test_record_is_not_sent_again_by_the_next_session(tmp_path):
    sky = network()
    ashore = heard(sky)
    async with iridium(sky, tmp_path) as node:
        client = SatelliteClient(node)
        assert (await client.session(b"once")).is_sent
        assert (await client.session(None)).is_sent
        await until(lambda: b"once" in ashore)
        await asyncio.sleep(20.0 / FAST)
        assert [data for data in ashore if data] == [b"once"]


def test_dialogue_takes_blocks_by_length_and_rings_anywhere():
    data = b"\r\nOK\r\n\x00"
    block = len(data).to_bytes(2, "big") + data + checksum(data)
    stream = b"\r\nREADY\r\n\r\nSBDRING\r\n" + block + b"\r\nOK\r\nSBDRING\r\n"
    for size in (1, 3, 11):
        dialogue = Dialogue()
        parts = []
        for at in range(0, len(stream), size):
            parts += dialogue.feed(stream[at : at + size])
            if parts == ["READY"]:
                dialogue.expect_block()
        assert parts == ["READY", data, "OK"]
        assert dialogue.rings == 2


def test_damaged_block_is_told():
    dialogue = Dialogue()
    dialogue.expect_block()
    assert dialogue.feed(b"\x00\x01a\x00\x00") == [Block.BAD_SUM]


def test_dialogue_keeps_a_bounded_part_of_noise():
    dialogue = Dialogue()
    for _ in range(100):
        assert dialogue.feed(b"\x00" * 1000) == []
    assert dialogue.feed(b"\nOK\r\n")[-1] == "OK"
