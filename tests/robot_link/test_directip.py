"""DirectIP: the layout of its messages, the listener for robots' messages, and the sender."""

import asyncio
import struct
from contextlib import asynccontextmanager, suppress
from datetime import UTC, datetime
from itertools import permutations
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.clock import SystemClock
from robot_link.gateway.directip import DirectIpGateway, Listener, ListenerTiming, read_message
from robot_link.gateway.directip_wire import (
    DirectIpMessage,
    Disposition,
    Location,
    MoHeader,
    MtConfirmation,
    MtHeader,
    WireError,
    encode,
    length_of,
    parse,
)
from robot_link.gateway.gateway import (
    GatewayFault,
    GatewayRefusal,
    GatewayUnreachableError,
    Taken,
)

NOW = datetime(2026, 11, 21, 10, 2, 5, tzinfo=UTC)
IMEI = "300234010753370"
CAPTURE = bytes.fromhex(
    "01 005e"
    "01 001c 7bf6dc11 333031343334303631373939343830 00 0007 0000 68c75020"
    "03 000b 02 2b 7a26 ac 8dc4 00000002"
    "02 002e"
) + (b"Thanks for your amazing sbd-rs repo @gadomski!")
"""A message of September 2025, 97 bytes, its location before its payload."""
OVERLONG = bytes.fromhex(
    "01004C01001CF99DD263333030323334303634303730383330000018000059282DBC03000B0036A2B8193D12000000"
    "0302001C59282BA391F5ABCDBFDD0180000059282BA891F5ABCDBFDD0180000059282BA391F5AB"
)
"""A published message that announces 76 bytes and goes on after them."""


def elements_of(data):
    found, at = [], 3
    while at < len(data):
        length = int.from_bytes(data[at + 1 : at + 3], "big")
        found.append(data[at : at + 3 + length])
        at += 3 + length
    return found


def framed(elements):
    body = b"".join(elements)
    return struct.pack(">BH", 1, len(body)) + body


def test_a_captured_message_decodes_to_what_is_known_of_it():
    assert len(CAPTURE) == 97
    message = parse(CAPTURE)
    assert message.mo_header == MoHeader(2079775761, "301434061799480", 0, 7, 0, 0x68C75020)
    found = read_message(CAPTURE, NOW)
    assert (found.carrier, found.imei, found.momsn, found.mtmsn) == (
        "directip",
        "301434061799480",
        7,
        None,
    )
    assert found.session_at == datetime(2025, 9, 14, 23, 30, 40, tzinfo=UTC)
    assert found.latitude_deg == pytest.approx(-43.521167, abs=1e-6)
    assert found.longitude_deg == pytest.approx(172.604867, abs=1e-6)
    assert (found.cep_km, found.session_status) == (2, 0)
    assert found.data == b"Thanks for your amazing sbd-rs repo @gadomski!"


def test_a_message_that_goes_on_after_its_length_is_refused_and_decodes_without_its_tail():
    with pytest.raises(WireError, match="announced"):
        parse(OVERLONG)
    found = read_message(OVERLONG[: 3 + 76], NOW)
    assert found.imei == "300234064070830"
    assert found.latitude_deg == pytest.approx(54 + 41.656 / 60)
    assert found.longitude_deg == pytest.approx(25 + 15.634 / 60)
    assert (found.momsn, len(found.data)) == (24, 28)


def test_a_decoded_capture_encodes_to_the_same_bytes():
    assert encode(parse(CAPTURE)) == CAPTURE


def test_the_order_of_elements_is_free_and_unknown_ones_are_skipped():
    expected = parse(CAPTURE)
    unknown = b"\x7f\x00\x03abc"
    for order in permutations([*elements_of(CAPTURE), unknown]):
        assert parse(framed([*order, unknown])) == expected


def test_a_message_cut_at_any_byte_is_refused():
    for size in range(len(CAPTURE)):
        with pytest.raises(WireError):
            parse(CAPTURE[:size])
    for more in (b"\0", b"\x01\x00\x00"):
        with pytest.raises(WireError):
            parse(CAPTURE + more)


def test_a_body_cut_within_an_element_is_refused_whatever_its_length_field_says():
    ends = {sum(map(len, elements_of(CAPTURE)[:count])) for count in range(4)}
    for size in set(range(len(CAPTURE) - 3)) - ends:
        with pytest.raises(WireError, match=r"cut|head"):
            parse(framed([CAPTURE[3 : 3 + size]]))


@pytest.mark.parametrize(
    ("element", "what"),
    [
        (b"\x01\x00\x1b" + bytes(27), "27 bytes"),
        (b"\x03\x00\x14" + bytes(20), "20 bytes"),
        (b"\x03\x00\x0b\x04" + bytes(10), "format"),
        (b"\x03\x00\x0b\x00\x00" + b"\xea\x60" + bytes(7), "60 minutes"),
        (b"\x03\x00\x0b\x00\x5b" + bytes(9), "not on Earth"),
        (b"\x05\x00\x02\x01\x01", "2 bytes"),
        (b"\x46\x00\x01\x01", "1 bytes"),
    ],
)
def test_an_element_of_a_wrong_length_or_content_is_refused(element, what):
    with pytest.raises(WireError, match=what):
        parse(framed([element]))


def test_an_element_that_stands_twice_another_revision_and_giants_are_refused():
    with pytest.raises(WireError, match="twice"):
        parse(framed(elements_of(CAPTURE) * 2))
    with pytest.raises(WireError, match="revision"):
        parse(b"\x02" + CAPTURE[1:])
    with pytest.raises(WireError, match="longer"):
        length_of(b"\x01\xff\xff")


def test_a_message_without_a_header_or_with_a_broken_imei_is_nobodys():
    with pytest.raises(WireError, match="header"):
        read_message(framed(elements_of(CAPTURE)[1:]), NOW)
    with pytest.raises(WireError, match="IMEI"):
        read_message(CAPTURE.replace(b"301434061799480", b"30143406179948\xe9"), NOW)


def test_a_session_that_failed_has_no_payload():
    header = MoHeader(5, IMEI, 10, 8, 3, 1_790_000_000)
    found = read_message(encode(DirectIpMessage(mo_header=header)), NOW)
    assert (found.session_status, found.data, found.mtmsn) == (10, b"", 3)
    assert (found.latitude_deg, found.cep_km) == (None, None)


def test_a_payload_that_no_robots_modem_sends_is_kept_and_flagged():
    header = MoHeader(5, IMEI, 0, 8, 0, 1_790_000_000)
    for size, is_flagged in ((340, False), (341, True), (1960, True)):
        found = read_message(encode(DirectIpMessage(header, bytes(size))), NOW)
        assert (len(found.data), bool(found.fault)) == (size, is_flagged)


messages = st.builds(
    DirectIpMessage,
    mo_header=st.none()
    | st.builds(
        MoHeader,
        st.integers(0, 2**32 - 1),
        st.text("0123456789", min_size=15, max_size=15),
        st.integers(0, 255),
        st.integers(0, 65535),
        st.integers(0, 65535),
        st.integers(0, 2**32 - 1),
    ),
    mo_payload=st.none() | st.binary(min_size=1, max_size=340),
    mo_confirmation=st.none() | st.integers(0, 1),
    mt_header=st.none()
    | st.builds(
        MtHeader,
        st.binary(min_size=4, max_size=4),
        st.text("0123456789", min_size=15, max_size=15),
        st.integers(0, 65535),
    ),
    mt_payload=st.none() | st.binary(min_size=1, max_size=270),
    mt_confirmation=st.none()
    | st.builds(
        MtConfirmation,
        st.binary(min_size=4, max_size=4),
        st.text("0123456789", min_size=15, max_size=15),
        st.integers(0, 2**32 - 1),
        st.integers(-11, 50),
    ),
    mt_priority=st.none() | st.integers(1, 5),
)


@given(messages)
def test_every_message_survives_the_wire(message):
    assert parse(encode(message)) == message


@given(
    st.integers(-90 * 60_000, 90 * 60_000),
    st.integers(-180 * 60_000, 180 * 60_000),
    st.integers(0, 2**32 - 1),
)
def test_every_place_survives_the_wire(latitude, longitude, cep_km):
    place = Location(latitude / 60_000, longitude / 60_000, cep_km)
    found = parse(encode(DirectIpMessage(mo_location=place))).mo_location
    assert found.latitude_deg == pytest.approx(place.latitude_deg, abs=1e-9)
    assert found.longitude_deg == pytest.approx(place.longitude_deg, abs=1e-9)
    assert found.cep_km == cep_km


def test_values_that_fit_no_field_are_refused_by_the_encoder():
    for message in (
        DirectIpMessage(mt_priority=70_000),
        DirectIpMessage(mt_header=MtHeader(b"abc", IMEI, 0)),
        DirectIpMessage(mt_header=MtHeader(b"abcd", "12", 0)),
        DirectIpMessage(mo_payload=bytes(70_000)),
    ):
        with pytest.raises(ValueError, match=r"field|bytes|characters"):
            encode(message)


def test_garbage_and_flipped_bits_never_do_more_than_be_refused():
    random = Random(17)
    read = 0
    for _ in range(20_000):
        data = bytearray(CAPTURE)
        for _ in range(random.randrange(1, 4)):
            data[random.randrange(len(data))] ^= 1 << random.randrange(8)
        for candidate in (bytes(data), random.randbytes(random.randrange(120))):
            with suppress(WireError):
                read_message(candidate, NOW)
                read += 1
    assert 0 < read < 20_000  # flips within a payload or a place make another message


# The listener.


class Inbox:
    def __init__(self, fault=None):
        self.messages = []
        self.fault = fault

    async def take(self, message):
        if self.fault is not None:
            raise self.fault
        self.messages.append(message)


@asynccontextmanager
async def listening(inbox, *, message_s=15.0, connections=32, **options):
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
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        writer.write(data)
        if hang_up:
            writer.write_eof()
        async with asyncio.timeout(60):
            return await reader.read()
    except ConnectionError:
        return b""
    finally:
        writer.close()


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
        _, silent = await asyncio.open_connection("127.0.0.1", listener.port)
        silent.write(b"\x01")
        await served(listener)
        assert await deliver(listener.port, CAPTURE) == b""
        silent.close()
        assert listener.refused["too_often"] == 1
    async with listening(inbox, allowed=("192.0.2.0/24",)) as listener:
        assert await deliver(listener.port, CAPTURE) == b""
        assert listener.refused == {"address": 1}
    async with listening(inbox, allowed=("192.0.2.0/24", "127.0.0.0/8")) as listener:
        assert await deliver(listener.port, CAPTURE) == b""
    assert len(inbox.messages) == 1


async def test_stopping_with_a_connection_open_leaves_nothing_behind():
    before = asyncio.all_tasks()
    async with listening(Inbox()) as listener:
        _, writer = await asyncio.open_connection("127.0.0.1", listener.port)
        writer.write(b"\x01")
        await served(listener)
    writer.close()
    assert asyncio.all_tasks() == before


# The sender.


@asynccontextmanager
async def gateway_saying(answer_of, answer_s=10.0):
    """Serve as a gateway that answers a parsed message with bytes; None lets it wait."""
    seen = []

    serving = set()

    async def serve(reader, writer):
        serving.add(asyncio.current_task())
        try:
            head = await reader.readexactly(3)
            message = parse(head + await reader.readexactly(length_of(head)))
            seen.append(message)
            answer = answer_of(message)
            if answer is None:
                await reader.read()
            else:
                writer.write(answer)
        except ConnectionError:
            pass
        finally:
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    try:
        yield DirectIpGateway("127.0.0.1", port, answer_s), seen
    finally:
        server.close()
        await asyncio.gather(*serving)


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
    with pytest.raises(GatewayUnreachableError, match="cannot be reached"):
        await gateway.send(IMEI, b"x", client_id=1)
