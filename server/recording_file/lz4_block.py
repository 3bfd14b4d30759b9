"""Unpacks files of Slocum gliders that are compressed (dcd, ecd, scd, ..., ccc): blocks of LZ4.

Such a file is a row of blocks, each behind its length in two octets, the high one first. A block
stands for itself: sequences of a token, literals, and a copy of what was unpacked before. The high
half of the token counts the literals, the low half the copied octets less four; 15 says that
octets follow that are added, up to the first that is not 255. The copy begins as many octets back
as the two octets after the literals say, the low one first. The last sequence has literals alone.

Source:
    "LZ4 Block Format Description" of the LZ4 project.
"""

from typing import Final

_LENGTH_OCTETS: Final = 2
_SHORT_MAX: Final = 15
_COPY_MIN: Final = 4


class PackedError(ValueError):
    """Octets that are no blocks of LZ4, or stand for more than is taken."""


def is_packed(head: bytes, begin: bytes) -> bool:
    """Tell whether a file's first octets are those of a block whose content begins so.

    Nothing was there before, so the content's first octets stand in the block as they are.
    """
    if len(head) <= _LENGTH_OCTETS:
        return False
    try:
        count, at = _count(head, _LENGTH_OCTETS + 1, head[_LENGTH_OCTETS] >> 4)
    except IndexError:
        return False
    return count >= len(begin) and head.startswith(begin, at)


def unpacked(data: bytes, octets_max: int) -> bytes:
    """Return what all blocks of a file stand for.

    Raises:
        PackedError: If a block is none, the last is not whole, or it would be too much.
    """
    found = bytearray()
    at = 0
    while at < len(data):
        size = int.from_bytes(data[at : at + _LENGTH_OCTETS], "big")
        block = data[at + _LENGTH_OCTETS : at + _LENGTH_OCTETS + size]
        if len(block) < size or at + _LENGTH_OCTETS > len(data):
            raise PackedError("its last block is not whole")
        found += unpacked_block(block, octets_max - len(found))
        at += _LENGTH_OCTETS + size
    return bytes(found)


def unpacked_block(block: bytes, octets_max: int) -> bytes:
    """Return what one block stands for.

    Raises:
        PackedError: If it is none, or stands for more than ``octets_max``.
    """
    found = bytearray()
    at = 0
    try:
        while at < len(block):
            token = block[at]
            count, at = _count(block, at + 1, token >> 4)
            if at + count > len(block):
                raise PackedError("a block ends among its literals")
            found += block[at : at + count]
            at += count
            if at < len(block):
                back = block[at] | block[at + 1] << 8
                count, at = _count(block, at + 2, token & _SHORT_MAX)
                _copy(found, back, count + _COPY_MIN)
            if len(found) > octets_max:
                raise PackedError("it would grow too large")
    except IndexError:
        raise PackedError("a block is not whole") from None
    return bytes(found)


def _count(block: bytes, at: int, short: int) -> tuple[int, int]:
    """Return a count, and where it ends."""
    count = short
    if short == _SHORT_MAX:
        while True:
            more = block[at]
            at += 1
            count += more
            if more != 0xFF:
                break
    return count, at


def _copy(found: bytearray, back: int, count: int) -> None:
    """Append octets from so far back; where they overlap the end, they repeat."""
    if not 0 < back <= len(found):
        raise PackedError("a block copies what is not there")
    begin = len(found) - back
    piece = found[begin : begin + count]
    if len(piece) < count:
        piece = (piece * (count // len(piece) + 1))[:count]
    found += piece
