"""Missions as the bytes that travel: the same mission comes out, and nothing else ever does."""

import dataclasses
import zlib

import cbor2
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.link.satellite_mission import usual_mission
from robot_link.satellite.blob import MOST_BYTES, Blob, BlobCodec, mission_of, transfer_id_of
from robot_link.satellite.cbor_reader import CborReader
from robot_link.satellite.chunk import sizes
from robot_link.satellite.cost import quote
from robot_link.satellite.frame import WireError
from tests.robot_link.satellite_case import SURVEY, missions, short_mission


def deflated(data: bytes) -> bytes:
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    return packer.compress(data) + packer.flush()


def plain_of(blob: Blob) -> bytes:
    if blob.codec is BlobCodec.PLAIN:
        return blob.packed
    return zlib.decompress(blob.packed, -15)


@settings(deadline=None)
@given(missions())
def test_any_mission_comes_out_as_it_went_in(mission):
    blob = Blob.of(mission)
    found = mission_of(blob.packed, blob.codec)
    assert (found, found.sha256()) == (mission, blob.plan)
    assert blob.transfer_id == transfer_id_of(blob.packed) == int(blob.sha256[:8], 16)


@pytest.mark.parametrize("seed", range(8))
def test_twenty_items_with_their_settings_fit_two_messages_and_ten_credits(seed):
    fare = quote(sizes(Blob.of(usual_mission(seed))))
    assert (fare.messages, fare.credits <= 10) == (2, True)


def test_blob_is_deflated_only_where_that_is_smaller():
    usual = dataclasses.replace(SURVEY, onboard=None, format=2)
    short, long = Blob.of(dataclasses.replace(usual, legs=usual.legs[:1])), Blob.of(SURVEY)
    assert (short.codec, long.codec) == (BlobCodec.PLAIN, BlobCodec.DEFLATE)
    assert len(long.packed) < len(plain_of(long))
    assert mission_of(plain_of(long), BlobCodec.PLAIN) == SURVEY


def test_blob_that_would_inflate_without_end_is_refused():
    bomb = deflated(bytes(100 * MOST_BYTES))
    assert len(bomb) < 2000
    with pytest.raises(WireError, match="inflates to more"):
        mission_of(bomb, BlobCodec.DEFLATE)


def test_mission_that_is_understood_otherwise_than_meant_is_refused():
    parts = cbor2.loads(plain_of(Blob.of(SURVEY)))
    parts[1][0] += 1  # the sample period, valid, but not what was hashed
    with pytest.raises(WireError, match="not the one that was meant"):
        mission_of(cbor2.dumps(parts), BlobCodec.PLAIN)


@pytest.mark.parametrize(
    ("index", "part"),
    [
        (0, 4),
        (0, 2),
        (1, [1, 2, 3]),
        (2, [9] * 70),
        (2, []),
        (3, [0] * 20_000),
        (3, [15, 1]),
        (3, [99]),
        (3, [0, 2**40, 0, 0]),
        (4, b""),
        (4, "text"),
        (3, {1: 2}),
    ],
)
def test_parts_that_no_mission_has_are_refused(index, part):
    parts = cbor2.loads(plain_of(Blob.of(SURVEY)))
    parts[index] = part
    with pytest.raises(WireError):
        mission_of(cbor2.dumps(parts), BlobCodec.PLAIN)


def test_nested_and_tagged_bytes_are_refused_without_being_built():
    with pytest.raises(WireError):
        mission_of(b"\x85" + b"\x81" * 5000, BlobCodec.PLAIN)
    with pytest.raises(WireError):
        mission_of(b"\x9b" + b"\xff" * 8, BlobCodec.PLAIN)
    with pytest.raises(WireError, match="unknown way"):
        mission_of(b"\x85", 2)


def test_mission_that_is_too_long_is_refused_before_it_is_sent():
    legs = tuple(
        dataclasses.replace(leg, start_ned=(0.0, 0.0, 0.0), end_ned=(0.0, 0.0, 0.0))
        for leg in short_mission().legs
    )
    endless = dataclasses.replace(short_mission(), legs=legs * 501)
    with pytest.raises(ValueError, match="1002 legs is too long for the satellite"):
        Blob.of(endless)


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=400), st.integers(0, 3))
def test_garbage_is_no_mission_and_raises_nothing_else(data, codec):
    with pytest.raises(WireError):
        mission_of(data, codec)


@settings(max_examples=300, deadline=None)
@given(st.data())
def test_mission_with_a_damaged_byte_is_refused(data):
    plain = bytearray(plain_of(Blob.of(SURVEY)))
    index = data.draw(st.integers(0, len(plain) - 1))
    plain[index] ^= data.draw(st.integers(1, 255))
    with pytest.raises(WireError):
        mission_of(bytes(plain), BlobCodec.PLAIN)


@given(st.lists(st.integers(-(2**63), 2**64 - 1)), st.binary())
def test_reader_understands_what_the_standard_decoder_understands(numbers, octets):
    reader = CborReader(cbor2.dumps(numbers) + cbor2.dumps(octets))
    assert (reader.integers(), reader.octets()) == (numbers, octets)
    reader.end()
