"""Bytes of a modem that answers AT commands, cut into lines and blocks; without any I/O.

With the echo off each line of a modem stands between two ends of line; after ``AT+SBDRB`` it sends
a binary block instead: a 16-bit length, the data, and a 16-bit sum, all big endian. A block must
be read by its length, for its data may look like lines. ``SBDRING`` may come between two answers.
"""

from enum import Enum, auto

_RING = b"SBDRING"
_LINE_MAX = 1024


class Block(Enum):
    """A block that did not arrive whole."""

    BAD_SUM = auto()


def checksum(data: bytes) -> bytes:
    """Return the low 16 bits of the bytes' sum, big endian, as blocks end."""
    return (sum(data) & 0xFFFF).to_bytes(2, "big")


class Dialogue:
    """Takes a modem's bytes; gives its lines, its blocks and its rings."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._expects_block = False
        self.rings = 0
        """Rings heard since the beginning."""

    def feed(self, data: bytes) -> list[str | bytes | Block]:
        """Take bytes; return what they complete: lines as text, the data of blocks as bytes."""
        self._bytes += data
        complete: list[str | bytes | Block] = []
        while True:
            part = self._block() if self._expects_block else self._line()
            if part is None:
                return complete
            if part != "":
                complete.append(part)

    def expect_block(self) -> None:
        """Say that the next answer is a binary block."""
        self._expects_block = True

    def forget(self) -> None:
        """Drop what is half read."""
        self._bytes.clear()
        self._expects_block = False

    def _line(self) -> str | None:
        end = self._bytes.find(b"\n")
        if end < 0:
            if len(self._bytes) > _LINE_MAX:
                self._bytes.clear()
            return None
        line = bytes(self._bytes[:end]).strip()
        del self._bytes[: end + 1]
        if line == _RING:
            self.rings += 1
            return ""
        return line.decode("ascii", "replace")

    def _block(self) -> bytes | Block | str | None:
        if self._bytes.startswith((b"\r", b"\n", b"S")):
            # no block is so long that its length begins so: a ring, or the rest of a line
            return self._line()
        if len(self._bytes) < 2:
            return None
        end = 2 + int.from_bytes(self._bytes[:2], "big")
        if len(self._bytes) < end + 2:
            return None
        data, said = bytes(self._bytes[2:end]), bytes(self._bytes[end : end + 2])
        del self._bytes[: end + 2]
        self._expects_block = False
        return data if said == checksum(data) else Block.BAD_SUM
