"""The layout of a MAVLink 2 frame, and finding frames in a stream; without input or output.

A frame on the wire is ``FD | length | incompatible flags | compatible flags | sequence | system |
component | message id u24 | payload | CRC-16 u16 | signature 13``, integers little endian; the
signature is there where bit 0 of the incompatible flags is set. The checksum is that of MAVLink
(CRC-16/MCRF4XX) over everything between FD and itself and one byte more, which each message
definition has for itself. The checksum of a message that the dialect does not know therefore
cannot be tested: its frame counts as one where another frame, or nothing, follows it.
"""

from typing import Final

from robot_link.mavlink.wire import grace

MAGIC: Final = 0xFD
_OLD_MAGIC: Final = 0xFE
_HEADER_BYTES: Final = 10
_CHECKSUM_BYTES: Final = 2
SIGNATURE_BYTES: Final = 13
INCOMPATIBLE: Final = 2
"""Where a frame's incompatible flags stand."""
SIGNED: Final = 0x01
"""The flag of a frame that ends with a signature."""
LONGEST_FRAME_BYTES: Final = _HEADER_BYTES + 255 + _CHECKSUM_BYTES + SIGNATURE_BYTES
_KEPT_BYTES: Final = 1024


def frame_bytes(data: bytes | bytearray, at: int) -> int | None:
    """Return the size of the frame whose FD stands at a place.

    Returns:
        Bytes from FD to the frame's end, which may lie beyond the data; 0 if no frame can begin
        here, None if too little of its head is there to tell.
    """
    head = data[at : at + _HEADER_BYTES]
    if len(head) > INCOMPATIBLE and head[INCOMPATIBLE] & ~SIGNED:
        return 0
    if len(head) < _HEADER_BYTES:
        return None
    signature = SIGNATURE_BYTES if head[INCOMPATIBLE] & SIGNED else 0
    return _HEADER_BYTES + head[1] + _CHECKSUM_BYTES + signature


class MavlinkFrameReader:
    """Cuts frames out of a stream that may begin anywhere, be cut anywhere, and hold garbage."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._dropped = bytearray()
        self._is_lost = False
        self.bad = 0
        """Stretches of bytes dropped because they were no frame."""

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes and return the frames that they complete."""
        self._buffer += data
        return self._frames(is_end=False)

    def flush(self) -> list[bytes]:
        """Return what is whole in a stream that has fallen silent, and drop the rest.

        A false beginning in garbage would otherwise hold back the frames behind it until as many
        bytes as it promises have come.
        """
        return self._frames(is_end=True)

    @property
    def unfinished(self) -> bytes:
        """The beginning of a frame whose end has not come."""
        return bytes(self._buffer)

    def take_dropped(self) -> bytes:
        """Return the first bytes that were dropped since the last call."""
        dropped = bytes(self._dropped)
        self._dropped.clear()
        return dropped

    def _frames(self, *, is_end: bool) -> list[bytes]:
        frames: list[bytes] = []
        at = 0
        while at < len(self._buffer):
            if self._buffer[at] != MAGIC:
                found = self._buffer.find(MAGIC, at)
                end = len(self._buffer) if found < 0 else found
                self._drop(at, end)
                at = end
                continue
            size = frame_bytes(self._buffer, at)
            if size is None and not is_end:
                break
            if size is not None and self._is_frame(at, size, is_end=is_end):
                frames.append(bytes(self._buffer[at : at + size]))
                self._is_lost = False
                at += size
            elif size is not None and at + size > len(self._buffer) and not is_end:
                break
            else:
                self._drop(at, at + 1)
                at += 1
        del self._buffer[:at]
        return frames

    def _drop(self, start: int, end: int) -> None:
        """Search on behind bytes that are no frame; a stretch counts once."""
        self._dropped += self._buffer[start : min(end, start + _KEPT_BYTES - len(self._dropped))]
        self.bad += not self._is_lost
        self._is_lost = True

    def _is_frame(self, at: int, size: int, *, is_end: bool) -> bool:
        if not size or at + size > len(self._buffer):
            return False
        identifier = int.from_bytes(self._buffer[at + 7 : at + 10], "little")
        known = grace.mavlink_map.get(identifier)
        if known is None:
            behind = self._buffer[at + size : at + size + 1]
            return not behind or behind[0] in (MAGIC, _OLD_MAGIC)
        body = at + _HEADER_BYTES + self._buffer[at + 1]
        checksum = grace.x25crc(bytes(self._buffer[at + 1 : body]))
        checksum.accumulate(bytes((known.crc_extra,)))
        return int(checksum.crc) == int.from_bytes(self._buffer[body : body + 2], "little")
