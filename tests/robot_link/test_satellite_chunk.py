"""Messages to a robot: what fits them, what they cost, and that no other bytes pass for one."""

import itertools
import math
from datetime import timedelta

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_link.messages import CommandKind, CommandNumber, PlanHash
from robot_link.satellite.blob import Blob, BlobCodec, TransferId, mission_of
from robot_link.satellite.chunk import MOST_CHUNKS, Chunk, cut, read_mobile_terminated, sizes
from robot_link.satellite.config import Tariff
from robot_link.satellite.cost import credits, quote
from robot_link.satellite.frame import MAC_BYTES, WireError, sealed_down, sealed_up
from robot_link.satellite.order import Order, pack_order
from robot_link.satellite.withdrawal import Withdrawal, pack_withdrawal
from tests.robot_link.satellite_case import (
    KEY,
    NOW,
    OTHER_KEY,
    OTHER_SYSTEM,
    SURVEY,
    SYSTEM,
    short_mission,
)

BLOB = Blob.of(SURVEY)
PLAN = PlanHash("ab" * 32)
WITHDRAWAL = pack_withdrawal(9, KEY, SYSTEM)


def blob_of(size: int) -> Blob:
    return Blob(bytes(size), BlobCodec.PLAIN, "", TransferId(1), PLAN)


def chunks(**changes: bool) -> tuple[bytes, ...]:
    flags = {"start": True, "ack_seen": False} | changes
    return cut(BLOB, KEY, SYSTEM, 5, **flags)


def order(kind: CommandKind = CommandKind.SURFACE) -> bytes:
    plan = PLAN if kind is CommandKind.START else None
    expires = NOW + timedelta(hours=1)
    return pack_order(kind, CommandNumber(2**24 - 1), expires, plan, KEY, SYSTEM, 9)


def read(data: bytes) -> Chunk | Order | Withdrawal:
    return read_mobile_terminated(data, KEY, SYSTEM)


def test_chunks_together_are_the_mission():
    parts = [read(message) for message in chunks()]
    assert all(isinstance(part, Chunk) for part in parts)
    packed = b"".join(part.data for part in parts)
    assert mission_of(packed, parts[0].codec) == SURVEY
    assert [(part.index, part.count, part.is_last) for part in parts] == [
        (0, 2, False),
        (1, 2, True),
    ]
    assert {(part.transfer_id, part.counter, part.start, part.ack_seen) for part in parts} == {
        (BLOB.transfer_id, 5, True, False)
    }
    assert read(chunks(start=False, ack_seen=True)[0]).ack_seen
    assert not read(chunks(start=False, ack_seen=True)[0]).start


def test_chunk_is_laid_out_as_documented():
    first = chunks()[0]
    header = bytes([0x11, BLOB.codec | 8]) + BLOB.transfer_id.to_bytes(4, "big") + bytes([0, 2])
    assert first[:12] == header + (5).to_bytes(4, "big")
    assert first[12:-MAC_BYTES] == BLOB.packed[: len(first) - 20]


@pytest.mark.parametrize("size", [1, 230, 231, 250, 251, 303, 460, 461, 480, 499, 500, 501, 1900])
def test_chunks_are_the_fewest_and_of_these_the_cheapest(size):
    found = sizes(blob_of(size))
    fewest = math.ceil(size / 250)
    assert (len(found), sum(found)) == (fewest, size + 20 * fewest)
    assert max(found) <= 270
    if fewest <= 3:
        possible = range(1, 7)
        cheapest = min(
            sum(each)
            for each in itertools.product(possible, repeat=fewest)
            if sum(min(50 * one, 270) - 20 for one in each) >= size
        )
        assert quote(found).credits == cheapest


def test_quote_is_of_the_bytes_that_are_sent():
    assert sizes(BLOB) == tuple(map(len, chunks()))
    tariff = Tariff(bytes_per_credit=100, price_per_credit=0.5)
    fare = quote((270, 101, 1), tariff)
    assert (fare.messages, fare.bytes, fare.credits, fare.price) == (3, 372, 6, 3.0)
    assert [credits(size) for size in (0, 1, 50, 51, 270)] == [1, 1, 1, 2, 6]


def test_mission_of_more_chunks_than_a_gateway_queues_is_refused():
    assert len(sizes(blob_of(250 * MOST_CHUNKS))) == MOST_CHUNKS
    with pytest.raises(ValueError, match="41 satellite messages; at most 40"):
        sizes(blob_of(250 * MOST_CHUNKS + 1))


@pytest.mark.parametrize(
    "kind",
    sorted(set(CommandKind) - {CommandKind.ARM, CommandKind.DISARM, CommandKind.ZERO_DEPTH}),
)
def test_every_order_fits_one_credit_and_arrives(kind):
    message = order(kind)
    assert credits(len(message)) == 1
    found = read(message)
    assert isinstance(found, Order)
    command = found.command
    assert (command.kind, command.number, found.counter) == (kind, 2**24 - 1, 9)
    assert command.expiry_s == int((NOW + timedelta(hours=1)).timestamp())
    assert command.plan_digits == ("ab" * 6 if kind is CommandKind.START else "")


def test_order_to_start_names_a_plan_and_no_other_does():
    for kind, plan in ((CommandKind.START, None), (CommandKind.HOLD, PLAN)):
        with pytest.raises(ValueError, match="START names a plan"):
            pack_order(kind, CommandNumber(1), NOW, plan, KEY, SYSTEM, 9)


@pytest.mark.parametrize("number", [0, 2**24])
def test_command_whose_number_does_not_fit_is_refused(number):
    with pytest.raises(ValueError, match="cannot travel"):
        pack_order(CommandKind.HOLD, CommandNumber(number), NOW, None, KEY, SYSTEM, 9)


@pytest.mark.parametrize("message", [*chunks(), order(), order(CommandKind.START), WITHDRAWAL])
def test_every_single_flipped_bit_is_refused(message):
    for bit in range(8 * len(message)):
        damaged = bytearray(message)
        damaged[bit // 8] ^= 1 << bit % 8
        with pytest.raises(WireError):
            read(bytes(damaged))


@pytest.mark.parametrize("message", [chunks()[0], order(), WITHDRAWAL])
def test_message_is_for_one_robot_one_key_and_one_direction(message):
    assert read(message)
    for key, system in ((KEY, OTHER_SYSTEM), (OTHER_KEY, SYSTEM)):
        with pytest.raises(WireError, match="the code is wrong"):
            read_mobile_terminated(message, key, system)
    with pytest.raises(WireError, match="the code is wrong"):
        read(sealed_up(message[:-MAC_BYTES], KEY, SYSTEM))


@pytest.mark.parametrize("message", [chunks()[0], order(), WITHDRAWAL])
def test_message_cut_at_any_byte_is_refused(message):
    for size in range(len(message)):
        with pytest.raises(WireError):
            read(message[:size])
    with pytest.raises(WireError):
        read(message + b"\0")


@settings(max_examples=200)
@given(st.binary(min_size=1, max_size=262))
def test_any_body_under_a_right_code_is_a_message_or_a_wire_error(body):
    sealed = sealed_down(body, KEY, SYSTEM)
    for data in (body, sealed, sealed_down((b"\x11" + body)[:262], KEY, SYSTEM)):
        try:
            read(data)
        except WireError:
            continue


def test_key_of_a_wrong_length_is_the_callers_mistake():
    with pytest.raises(ValueError, match="32 bytes, not 5"):
        cut(Blob.of(short_mission()), b"short", SYSTEM, 1, start=False, ack_seen=False)


@pytest.mark.parametrize(
    ("index", "value"), [(1, 1), (6, 0), (6, 9), (14, 1)], ids=["flags", "kind", "kind", "digits"]
)
def test_order_that_no_station_writes_is_refused_though_its_code_is_right(index, value):
    body = bytearray(order()[:-MAC_BYTES])
    body[index] = value
    with pytest.raises(WireError, match="order"):
        read(sealed_down(bytes(body), KEY, SYSTEM))


@pytest.mark.parametrize(
    ("index", "value"), [(0, 0x21), (0, 0x1F), (0, 0x13), (1, 64), (1, 3), (1, 12), (6, 2), (7, 41)]
)
def test_chunk_that_no_station_writes_is_refused_though_its_code_is_right(index, value):
    body = bytearray(chunks()[0][:-MAC_BYTES])
    body[index] = value
    with pytest.raises(WireError):
        read(sealed_down(bytes(body), KEY, SYSTEM))


@pytest.mark.parametrize("counter", [-1, 2**32])
def test_counter_that_does_not_fit_is_the_callers_mistake(counter):
    with pytest.raises(ValueError, match="cannot travel"):
        cut(BLOB, KEY, SYSTEM, counter, start=True, ack_seen=False)
    with pytest.raises(ValueError, match="cannot travel"):
        pack_order(CommandKind.HOLD, CommandNumber(1), NOW, None, KEY, SYSTEM, counter)
    with pytest.raises(ValueError, match="cannot travel"):
        pack_withdrawal(counter, KEY, SYSTEM)


def test_withdrawal_costs_one_credit_and_arrives():
    assert credits(len(WITHDRAWAL)) == 1
    assert read(WITHDRAWAL) == Withdrawal(9, ack_seen=False)
    assert read(pack_withdrawal(9, KEY, SYSTEM, ack_seen=True)) == Withdrawal(9, ack_seen=True)
    for body in (b"\x14\x01\0\0\0\x09", b"\x14\0\0\0\0\x09\0"):
        with pytest.raises(WireError, match="withdrawal"):
            read(sealed_down(body, KEY, SYSTEM))
