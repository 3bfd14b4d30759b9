"""DirectIP: the listener for robots' messages, and the sender."""

import asyncio
from contextlib import AsyncExitStack, asynccontextmanager
from random import Random

import pytest

from robot_link.clock import SystemClock
from robot_link.station.gateway.directip import DirectIpGateway, Listener, ListenerTiming
from robot_link.station.gateway.directip_wire import (
    DirectIpMessage,
    Disposition,
    MtConfirmation,
    MtHeader,
    encode,
    length_of,
    parse,
)
from robot_link.station.gateway.gateway import (
    GatewayFault,
    GatewayRefusal,
    GatewayUnreachableError,
    Taken,
)
from tests.free_port import free_port
from tests.robot_link.test_directip_wire import CAPTURE, IMEI, OVERLONG
from tests.tcp_peer import connected, serving


class Inbox:
    def __init__(self, fault=None):
        self.messages = []
        self.fault = fault

    async def take(self, message):
        if self.fault is not None:
            raise self.fault
        self.messages.append(message)


@asynccontextmanager
async def listening(inbox, *, message_s=60.0, connections=32, **options):
    timing = ListenerTiming(message_s, rest_s=0.02, connections=connections)
    listener = Listener("127.0.0.1", 0, inbox.take, SystemClock(), timing=timing, **options)
    await listener.start()
    try:
        yield listener
    finally:
        await listener.stop()


async def served(listener):
    """Wait until a connection has come in."""
    async with asyncio.timeout(60):
        while True:
            if listener._serving:
                return
            await asyncio.sleep(0)


async def deliver(port, data, *, hang_up=False):
    """Deliver as a gateway does and return all that the station answers."""
    try:
        async with connected(port) as (reader, writer), asyncio.timeout(60):
            writer.write(data)
            if hang_up:
                writer.write_eof()
            return await reader.read()
    except ConnectionError:
        return b""


async def test_a_delivered_message_is_kept_and_confirmed_where_that_is_provisioned():
    inbox = Inbox()
    async with listening(inbox, confirms=True) as listener:
        assert await deliver(listener.port, CAPTURE) == bytes.fromhex("01 0004 05 0001 01")
    async with listening(inbox) as listener:
        assert await deliver(listener.port, CAPTURE) == b""
        assert await deliver(listener.port, CAPTURE, hang_up=True) == b""
    assert [message.momsn for message in inbox.messages] == [7, 7, 7]


async def test_what_is_no_message_is_refused_counted_and_never_stops_the_listener():
    inbox = Inbox()
    random = Random(3)
    async with listening(inbox, confirms=True) as listener:
        bad = [CAPTURE[:50], OVERLONG, b"\x02" + CAPTURE[1:], b"\x01\xff\xff" + bytes(80)]
        bad += [random.randbytes(random.randrange(1, 200)) for _ in range(8)]
        for data in bad:
            answer = await deliver(listener.port, data, hang_up=True)
            assert answer == bytes.fromhex("01 0004 05 0001 00")
        assert listener.refused["malformed"] == len(bad)
        assert await deliver(listener.port, CAPTURE) == bytes.fromhex("01 0004 05 0001 01")
    assert len(inbox.messages) == 1


async def test_a_message_that_could_not_be_kept_is_not_confirmed():
    inbox = Inbox(OSError("the disk is full"))
    async with listening(inbox, confirms=True) as listener:
        assert await deliver(listener.port, CAPTURE) == bytes.fromhex("01 0004 05 0001 00")
        inbox.fault = None
        assert await deliver(listener.port, CAPTURE) == bytes.fromhex("01 0004 05 0001 01")
        assert listener.refused == {"not_kept": 1}


async def test_a_message_cut_at_any_byte_never_reaches_the_inbox():
    inbox = Inbox()
    async with listening(inbox) as listener:
        await asyncio.gather(
            *(deliver(listener.port, CAPTURE[:size], hang_up=True) for size in range(0, 97, 4))
        )
        assert await deliver(listener.port, CAPTURE) == b""
    assert len(inbox.messages) == 1


async def test_a_peer_that_says_nothing_is_let_go():
    inbox = Inbox()
    async with listening(inbox, message_s=0.2) as listener:
        assert await deliver(listener.port, b"\x01") == b""
        assert listener.refused == {"malformed": 1}


async def test_too_many_connections_and_foreign_networks_are_turned_away():
    inbox = Inbox()
    async with listening(inbox, connections=1, confirms=True) as listener:
        async with connected(listener.port) as (_, silent):
            silent.write(b"\x01")
            await served(listener)
            assert await deliver(listener.port, CAPTURE) == b""
        assert listener.refused["too_often"] == 1
    async with listening(inbox, allowed=("192.0.2.0/24",)) as listener:
        assert await deliver(listener.port, CAPTURE) == b""
        assert listener.refused == {"address": 1}
    async with listening(inbox, allowed=("192.0.2.0/24", "127.0.0.0/8")) as listener:
        assert await deliver(listener.port, CAPTURE) == b""
    assert len(inbox.messages) == 1


async def test_stopping_with_a_connection_open_leaves_nothing_behind():
    before = asyncio.all_tasks()
    async with AsyncExitStack() as client:
        async with listening(Inbox()) as listener:
            _, writer = await client.enter_async_context(connected(listener.port))
            writer.write(b"\x01")
            await served(listener)
        assert asyncio.all_tasks() == before


# The sender.


@asynccontextmanager
async def gateway_saying(answer_of, answer_s=60.0):
    """Serve as a gateway that answers a parsed message with bytes; None lets it wait."""
    seen = []

    async def serve(reader, writer):
        head = await reader.readexactly(3)
        message = parse(head + await reader.readexactly(length_of(head)))
        seen.append(message)
        answer = answer_of(message)
        if answer is None:
            await reader.read()
        else:
            writer.write(answer)

    async with serving(serve) as port:
        yield DirectIpGateway("127.0.0.1", port, answer_s), seen


def confirmation(message, status, reference=99):
    answer = MtConfirmation(message.mt_header.client_id, message.mt_header.imei, reference, status)
    return encode(DirectIpMessage(mt_confirmation=answer))


async def test_a_message_is_handed_over_with_its_number_as_mtmsn():
    async with gateway_saying(lambda m: confirmation(m, 3)) as (gateway, seen):
        taken = await gateway.send(IMEI, b"x" * 270, client_id=513, flush=True, priority=2)
        await gateway.send(IMEI, b"y", client_id=514)
    assert taken == Taken("99", 513, 3)
    flags = Disposition.ASSIGN_MTMSN | Disposition.FLUSH
    assert seen[0].mt_header == MtHeader(b"\0\0\x02\x01", IMEI, flags)
    assert (seen[0].mt_payload, seen[0].mt_priority) == (b"x" * 270, 2)
    assert seen[1].mt_header.disposition == Disposition.ASSIGN_MTMSN


@pytest.mark.parametrize(
    ("status", "fault", "retry"),
    [
        (0, GatewayFault.EMPTY, "never"),
        (-1, GatewayFault.UNKNOWN_IMEI, "never"),
        (-2, GatewayFault.UNKNOWN_IMEI, "never"),
        (-3, GatewayFault.TOO_LONG, "never"),
        (-4, GatewayFault.EMPTY, "never"),
        (-5, GatewayFault.QUEUE_FULL, "later"),
        (-6, GatewayFault.BUSY, "later"),
        (-7, GatewayFault.PROTOCOL, "never"),
        (-8, GatewayFault.RING_DISABLED, "never"),
        (-9, GatewayFault.NOT_ATTACHED, "later"),
        (-10, GatewayFault.ADDRESS_REFUSED, "never"),
        (-11, GatewayFault.SEQUENCE, "never"),
        (-77, GatewayFault.OTHER, "never"),
    ],
)
async def test_each_status_is_a_typed_refusal_with_a_sentence(status, fault, retry):
    async with gateway_saying(lambda m: confirmation(m, status, 0)) as (gateway, _):
        with pytest.raises(GatewayRefusal) as found:
            await gateway.send(IMEI, b"x", client_id=1)
    assert (found.value.fault, found.value.retry) == (fault, retry)
    assert found.value.sentence.endswith(".")


async def test_a_refusal_of_what_was_not_understood_counts_though_it_names_no_message():
    answer = encode(DirectIpMessage(mt_confirmation=MtConfirmation(bytes(4), "0" * 15, 0, -7)))
    async with gateway_saying(lambda _: answer) as (gateway, _):
        with pytest.raises(GatewayRefusal) as found:
            await gateway.send(IMEI, b"x", client_id=1)
    assert (found.value.fault, found.value.retry) == (GatewayFault.PROTOCOL, "never")


@pytest.mark.parametrize(
    "answer_of",
    [
        lambda _: None,
        lambda _: b"",
        lambda _: b"\x01\x00",
        lambda _: b"\x09\x00\x01x",
        lambda _: CAPTURE,
        lambda m: confirmation(
            DirectIpMessage(mt_header=MtHeader(b"\0\0\0\x09", m.mt_header.imei, 0)), 1
        ),
    ],
)
async def test_silence_and_answers_that_confirm_nothing_are_to_be_tried_again(answer_of):
    async with gateway_saying(answer_of, answer_s=0.3) as (gateway, _):
        with pytest.raises(GatewayUnreachableError):
            await gateway.send(IMEI, b"x", client_id=1)


async def test_nobody_at_the_address_and_a_wrong_length_are_told_apart():
    async with gateway_saying(lambda _: None) as (gateway, seen):
        with pytest.raises(ValueError, match="270 bytes"):
            await gateway.send(IMEI, bytes(271), client_id=1)
    assert seen == []
    gateway = DirectIpGateway("127.0.0.1", free_port(), 10.0)
    with pytest.raises(GatewayUnreachableError, match="cannot be reached"):
        await gateway.send(IMEI, b"x", client_id=1)
