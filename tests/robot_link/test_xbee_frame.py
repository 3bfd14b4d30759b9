"""XBee API frames: Digi's printed bytes, the digi-xbee library as oracle, and garbage."""

import pytest
from digi.xbee.models.address import XBee16BitAddress, XBee64BitAddress
from digi.xbee.models.mode import OperatingMode
from digi.xbee.packets.common import ATCommPacket, TransmitPacket
from digi.xbee.packets.common import ReceivePacket as DigiReceivePacket
from hypothesis import given
from hypothesis import strategies as st

from robot_link.transport.datagram import Address
from robot_link.transport.xbee_frame import (
    ApiMode,
    AtCommand,
    AtReply,
    FrameReader,
    ReceivePacket,
    TransmitRequest,
    TransmitStatus,
    encode,
    parse_content,
)

PRINTED_REQUEST = TransmitRequest(1, Address(0x0013A200400A0127), b"TxData0A")
PRINTED_PLAIN = bytes.fromhex("7E001610010013A200400A0127FFFE000054784461746130 4113")
PRINTED_ESCAPED = bytes.fromhex("7E00161001007D33A200400A0127FFFE0000547844617461 30417D33")

modes = st.sampled_from((1, 2))
octet = st.integers(0, 255)
addresses = st.integers(0, 2**64 - 1).map(Address)
frames = st.one_of(
    st.builds(
        AtCommand,
        octet,
        st.binary(min_size=2, max_size=2),
        st.binary(max_size=20),
        st.booleans(),
    ),
    st.builds(AtReply, octet, st.binary(min_size=2, max_size=2), octet, st.binary(max_size=20)),
    st.builds(TransmitRequest, octet, addresses, st.binary(max_size=256), octet, octet),
    st.builds(TransmitStatus, octet, octet, octet, octet),
    st.builds(ReceivePacket, addresses, st.binary(max_size=256), octet),
)


@pytest.mark.parametrize(("mode", "printed"), [(1, PRINTED_PLAIN), (2, PRINTED_ESCAPED)])
def test_frames_printed_in_the_manual_come_out_byte_for_byte(mode: ApiMode, printed: bytes):
    assert encode(PRINTED_REQUEST.content(), mode) == printed
    (content,) = FrameReader(mode).feed(printed)
    assert parse_content(content) == PRINTED_REQUEST


@given(octet.filter(bool), addresses, st.binary(max_size=256), modes)
def test_transmit_requests_equal_those_of_digis_library(
    frame_id: int, address: Address, data: bytes, mode: ApiMode
):
    theirs = TransmitPacket(
        frame_id,
        XBee64BitAddress(address.to_bytes(8, "big")),
        XBee16BitAddress.UNKNOWN_ADDRESS,
        0,
        0,
        rf_data=data,
    )
    assert encode(TransmitRequest(frame_id, address, data).content(), mode) == theirs.output(
        escaped=mode == 2
    )


@given(addresses, st.binary(min_size=1, max_size=256), octet, modes)
def test_digis_library_reads_our_received_packets(
    address: Address, data: bytes, options: int, mode: ApiMode
):
    raw = bytearray(encode(ReceivePacket(address, data, options).content(), 1))
    theirs = DigiReceivePacket.create_packet(raw, OperatingMode.API_MODE)
    assert int.from_bytes(bytes(theirs.x64bit_source_addr.address), "big") == address
    assert bytes(theirs.rf_data) == data
    (content,) = FrameReader(mode).feed(bytes(theirs.output(escaped=mode == 2)))
    assert parse_content(content) == ReceivePacket(address, data, options)


def test_at_command_equals_that_of_digis_library():
    theirs = ATCommPacket(7, "NP")
    assert encode(AtCommand(7, b"NP").content(), 1) == bytes(theirs.output())


@given(st.lists(frames, min_size=1, max_size=5), modes, st.data())
def test_a_stream_cut_anywhere_yields_every_frame(sent, mode: ApiMode, data: st.DataObject):
    stream = b"".join(encode(frame.content(), mode) for frame in sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    reader = FrameReader(mode)
    contents = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        contents += reader.feed(stream[start:end])
    assert [parse_content(content) for content in contents] == sent
    assert reader.bad == 0


@pytest.mark.parametrize("mode", [1, 2])
def test_a_frame_fed_byte_by_byte_is_complete_with_its_last_byte_only(mode: ApiMode):
    stream = encode(PRINTED_REQUEST.content(), mode)
    reader = FrameReader(mode)
    for octet in stream[:-1]:
        assert reader.feed(bytes((octet,))) == []
    assert reader.feed(stream[-1:]) == [PRINTED_REQUEST.content()]


@given(st.lists(st.binary(max_size=300), max_size=6), modes)
def test_garbage_never_raises(chunks: list[bytes], mode: ApiMode):
    reader = FrameReader(mode)
    for chunk in chunks:
        for content in reader.feed(chunk):
            parse_content(content)


@given(st.binary(max_size=60), frames, modes)
def test_reading_resumes_after_garbage(garbage: bytes, frame, mode: ApiMode):
    """A false start may claim up to 512 bytes, so as much traffic must pass before it shows."""
    follower = encode(TransmitRequest(1, Address(5), bytes(128)).content(), mode)
    reader = FrameReader(mode)
    contents = reader.feed(garbage + encode(frame.content(), mode) + follower * 8)
    assert contents[-1] == TransmitRequest(1, Address(5), bytes(128)).content()
    if 0x7E not in garbage and not garbage.endswith(b"\x7d"):
        assert contents[0] == frame.content()
        assert reader.bad == bool(garbage)


@given(frames, modes, st.data())
def test_a_flipped_byte_costs_its_frame_and_is_counted(frame, mode: ApiMode, data: st.DataObject):
    stream = bytearray(encode(frame.content(), mode))
    at = data.draw(st.integers(1, len(stream) - 1))
    stream[at] ^= data.draw(st.integers(1, 255))
    reader = FrameReader(mode)
    contents = reader.feed(bytes(stream) + b"\x00" * 600)
    assert frame.content() not in contents
    assert reader.bad >= 1


def test_a_false_start_inside_an_escaped_stream_gives_way_to_the_next():
    reader = FrameReader(2)
    assert reader.feed(PRINTED_ESCAPED[:9] + PRINTED_ESCAPED) == [PRINTED_REQUEST.content()]
    assert reader.bad == 1


@pytest.mark.parametrize("size", [0, 513])
def test_content_that_no_radio_takes_is_refused(size: int):
    with pytest.raises(ValueError, match="bytes is not of"):
        encode(bytes(size), 1)


@pytest.mark.parametrize(
    "content", [b"", b"\x90\x01", b"\x8b\x01", b"\x88", b"\x10", b"\x08", b"\xaa\x01"]
)
def test_short_and_foreign_contents_are_no_frames(content: bytes):
    assert parse_content(content) is None
