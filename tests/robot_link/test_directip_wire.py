"""DirectIP on the wire: captures, elements in any order, and what is refused."""

import struct
from contextlib import suppress
from datetime import UTC, datetime
from itertools import permutations
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_link.station.gateway.directip import read_message
from robot_link.station.gateway.directip_wire import (
    DirectIpMessage,
    Location,
    MoHeader,
    MtConfirmation,
    MtHeader,
    WireError,
    encode,
    length_of,
    parse,
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
