"""MAVLink frames are found in any stream, and nothing that a stream holds does harm."""

import random

from hypothesis import assume, given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.frame import LONGEST_FRAME_BYTES, MavlinkFrameReader
from robot_link.messages import SystemId
from tests.robot_link.far_end import heartbeat

garbage = st.binary(max_size=80)


def frames(count: int) -> list[bytes]:
    codec = Codec(SystemId(1), ROBOT_COMPONENT)
    return [heartbeat(number, codec) for number in range(count)]


def unknown_frame() -> bytes:
    """A frame whose message the dialect does not know, so that its checksum cannot be tested."""
    link = common.MAVLink(None, srcSystem=1, srcComponent=1)
    frame = bytearray(common.MAVLink_system_time_message(1, 2).pack(link))
    frame[7:10] = (60_001).to_bytes(3, "little")
    return bytes(frame)


@given(st.integers(1, 8), st.data())
def test_a_stream_cut_anywhere_yields_every_frame(count: int, data: st.DataObject):
    sent = frames(count)
    stream = b"".join(sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=8)))
    reader = MavlinkFrameReader()
    found: list[bytes] = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        found += reader.feed(stream[start:end])
    assert found == sent
    assert reader.bad == 0


@given(st.lists(garbage, min_size=1, max_size=5))
def test_frames_between_garbage_are_all_found_once_the_stream_falls_silent(pieces: list[bytes]):
    """Garbage cannot hold a frame with a right checksum but by a chance of one in 65,000.

    It may begin a frame of a message that the dialect does not know, which ends where another
    begins: nothing tells that one from a true frame.
    """
    sent = frames(len(pieces))
    reader = MavlinkFrameReader()
    found: list[bytes] = []
    for piece, frame in zip(pieces, sent, strict=True):
        found += reader.feed(piece + frame)
    found += reader.flush()
    assume(all(frame in sent for frame in found))
    assert [frame for frame in found if frame in sent] == sent
    assert reader.bad >= any(b"\xfd" not in piece and piece for piece in pieces)


def test_a_false_beginning_holds_frames_back_no_longer_than_it_promises():
    sent = frames(40)
    reader = MavlinkFrameReader()
    found = reader.feed(b"\xfd\xff\x00\x00" + b"".join(sent))
    assert found == sent
    assert reader.bad == 1
    assert reader.take_dropped().startswith(b"\xfd")
    assert reader.take_dropped() == b""


@given(st.integers(0, 20), st.integers(1, 255))
def test_a_flipped_byte_costs_its_frame_alone(at: int, flip: int):
    first, second, third = frames(3)
    broken = bytearray(second)
    broken[at] ^= flip
    reader = MavlinkFrameReader()
    found = reader.feed(first + bytes(broken) + third) + reader.flush()
    assert found[0] == first
    assert third in found
    assert second not in found
    assert reader.bad or at in (7, 8, 9), "another message, for all that the reader knows"


def test_a_message_that_the_dialect_does_not_know_is_a_frame_where_another_follows():
    unknown, known = unknown_frame(), frames(1)[0]
    assert MavlinkFrameReader().feed(unknown) == [unknown]
    assert MavlinkFrameReader().feed(unknown + known) == [unknown, known]
    assert MavlinkFrameReader().feed(unknown + b"\x00" + known)[-1] == known


def test_megabytes_of_garbage_are_read_in_bounded_memory():
    rng = random.Random(5)
    reader = MavlinkFrameReader()
    capture = b"".join(frames(50))
    for _ in range(300):
        reader.feed(rng.randbytes(4096))
        flipped = bytearray(capture)
        for _ in range(5):
            flipped[rng.randrange(len(flipped))] ^= 1 << rng.randrange(8)
        reader.feed(bytes(flipped))
        assert len(reader._buffer) < 2 * LONGEST_FRAME_BYTES
    assert len(reader.take_dropped()) <= 1024
    reader.flush()
    assert frames(1)[0] in reader.feed(frames(1)[0])


def test_beginnings_without_end_are_read_in_bounded_time():
    reader = MavlinkFrameReader()
    for _ in range(200):
        reader.feed(b"\xfd" * 4096)
    reader.feed(b"\xfd\xff\x00" * 20_000)
    reader.flush()
    assert reader.feed(frames(1)[0]) == frames(1)
