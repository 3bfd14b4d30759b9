"""Blocks of LZ4 are unpacked as the format says, and what is none is refused with a sentence."""

import shutil
import struct
import subprocess
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.recording_file.lz4_block import PackedError, is_packed, unpacked, unpacked_block
from server.recording_file.raw import UnreadableError
from server.recording_file.slocum import read_slocum
from tests.server.recording_file.reading_of import read
from tests.server.recording_file.test_figures import BASE, CACHES, public, told

BLOCK = 32 * 1024


def length(count):
    """Return the octets that follow a half of a token that is 15."""
    return b"\xff" * ((count - 15) // 255) + bytes(((count - 15) % 255,)) if count >= 15 else b""


def packed_block(data):
    """Pack greedily, by the places of the newest four equal octets."""
    found, seen, begin, at = bytearray(), {}, 0, 0
    while at < len(data) - 12:
        key = bytes(data[at : at + 4])
        before = seen.get(key)
        seen[key] = at
        if before is None or at - before > 0xFFFF:
            at += 1
            continue
        count = 4
        while at + count < len(data) - 5 and data[before + count] == data[at + count]:
            count += 1
        literals = data[begin:at]
        token = min(15, len(literals)) << 4 | min(15, count - 4)
        found += bytes((token,)) + length(len(literals)) + literals
        found += struct.pack("<H", at - before) + length(count - 4)
        begin = at = at + count
    literals = data[begin:]
    return bytes(found + bytes((min(15, len(literals)) << 4,)) + length(len(literals)) + literals)


def packed(data):
    blocks = [packed_block(data[at : at + BLOCK]) for at in range(0, len(data), BLOCK)]
    return b"".join(struct.pack(">H", len(block)) + block for block in blocks)


@given(st.lists(st.sampled_from([b"a", b"abc", b"\x00" * 40, b"glider", bytes(range(9))])))
def test_what_was_packed_comes_back(parts):
    data = b"".join(parts)
    assert unpacked(packed(data), len(data)) == data


def test_long_counts_and_overlapping_copies_come_back():
    data = bytes(range(256)) * 3 + b"x" * 5000 + bytes(range(255, -1, -1)) * 2
    assert unpacked(packed(data), len(data)) == data


@given(st.binary(max_size=60))
def test_any_octets_are_unpacked_or_refused(data):
    with suppress(PackedError):
        assert len(unpacked(data, 1000)) <= 1000 + 60


@pytest.mark.parametrize(
    ("block", "reason"),
    [
        (b"\x50abc", "ends among its literals"),
        (b"\x10a\x05\x00", "copies what is not there"),
        (b"\x10a\x01", "is not whole"),
        (b"\x1fa\x01\x00" + b"\xff" * 9 + b"\x00", "too large"),
    ],
)
def test_a_block_that_is_none_is_refused(block, reason):
    with pytest.raises(PackedError, match=reason):
        unpacked_block(block, 1000)


def test_a_text_that_speaks_of_a_cache_is_no_packed_one():
    assert is_packed(packed(b"s: T 0 0 8 c_battpos in" * 9)[:16], b"s: T")
    assert not is_packed(b"# columns: Time,"[:16], b"s: T")


def test_blocks_of_the_formats_own_program_are_unpacked():
    """The program writes frames: a head of 7 octets, then blocks behind their lengths."""
    program = shutil.which("lz4")
    if program is None:
        pytest.skip("the program lz4 is not on this machine")
    data = b"".join(b"m_depth %d m\n" % (row * row) for row in range(4000))
    options = ["-9", "-B4", "-BI", "--no-frame-crc", "-c"]
    frame = subprocess.run([program, *options], input=data, capture_output=True, check=True).stdout
    (size,) = struct.unpack("<I", frame[7:11])
    assert size < 1 << 31
    assert unpacked_block(frame[11 : 11 + size], len(data)) == data[: 1 << 16]


def test_a_compressed_slocum_file_and_its_cache_say_what_the_others_say(tmp_path):
    files = public(f"{BASE}.dbd", f"{BASE}.ebd", *CACHES)
    small = []
    for path in files:
        ending = path.suffix.replace("bd", "cd").replace("cac", "ccc")
        small.append(tmp_path / f"{path.stem}{ending}")
        small[-1].write_bytes(packed(path.read_bytes()))
        assert small[-1].stat().st_size < path.stat().st_size
    raw, same = read(tmp_path / "whole", files), read(tmp_path / "small", small)
    assert (same.format, len(same)) == ("slocum", len(raw))
    for key, column in raw.columns.items():
        assert told(same.columns[key].values).tolist() == told(column.values).tolist()
    cut = tmp_path / "cut.dcd"
    cut.write_bytes(small[0].read_bytes()[:-10])
    with pytest.raises(UnreadableError, match=r"cut\.dcd is compressed, and its last block is not"):
        read_slocum(cut, cut.name, {}, [])
