"""The content of a FILE_TRANSFER_PROTOCOL message: MAVLink FTP's own frame, without I/O.

Little endian: ``u16 sequence | u8 session | u8 opcode | u8 size | u8 requested opcode |
u8 burst complete | u8 - | u32 offset | data``. An answer's sequence is that of the question plus 1.
"""

import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robot_link.mavlink.wire import grace
from robot_link.service.file_store import FileEntry

MAX_DATA = 200
"""Bytes of data in one message: a signed frame of it fits an XBee packet of 256 bytes."""
PAYLOAD_BYTES = 251

_HEADER = struct.Struct("<HBBBBBxI")
_SEQUENCES = 2**16


@dataclass(frozen=True, slots=True)
class FileRequest:
    """One question or answer of the file protocol."""

    sequence: int
    opcode: int
    session: int = 0
    offset: int = 0
    data: bytes = b""
    size: int = 0
    """Bytes of data; in a ReadFile question the bytes that are asked for."""
    about: int = 0
    """In an answer: the opcode that is answered."""
    burst_complete: bool = False

    def octets(self) -> bytes:
        """Return the payload of the message.

        Raises:
            ValueError: If there is more data than a message holds.
        """
        if len(self.data) > PAYLOAD_BYTES - _HEADER.size:
            raise ValueError(f"{len(self.data)} bytes of data do not fit one message")
        header = _HEADER.pack(
            self.sequence % _SEQUENCES,
            self.session,
            self.opcode,
            len(self.data) or self.size,
            self.about,
            self.burst_complete,
            self.offset,
        )
        return (header + self.data).ljust(PAYLOAD_BYTES, b"\0")

    @property
    def next_sequence(self) -> int:
        """Sequence of the answer."""
        return (self.sequence + 1) % _SEQUENCES


def read_file_request(payload: Sequence[int]) -> FileRequest:
    """Decode the payload of a message.

    Raises:
        ValueError: If it is cut short, or says that it holds more than it does.
    """
    octets = bytes(payload)
    if len(octets) < _HEADER.size:
        raise ValueError(f"{len(octets)} bytes are no file request")
    sequence, session, opcode, size, about, complete, offset = _HEADER.unpack_from(octets)
    asks = opcode in (grace.MAV_FTP_OPCODE_READFILE, grace.MAV_FTP_OPCODE_BURSTREADFILE)
    data = octets[_HEADER.size : _HEADER.size + (0 if asks else size)]
    if not asks and len(data) < size:
        raise ValueError(f"a file request of {size} bytes holds {len(data)}")
    return FileRequest(sequence, opcode, session, offset, data, size, about, bool(complete))


def listing(entries: Iterable[FileEntry], limit: int = MAX_DATA) -> tuple[bytes, int]:
    """Return as many entries as fit, as a listing's data, and how many they are."""
    data, count = b"", 0
    for entry in entries:
        name = entry.name.encode("utf-8", errors="replace")
        line = b"D" + name + b"\0" if entry.is_folder else b"F%s\t%d\0" % (name, entry.size)
        if len(data) + len(line) > limit:
            break
        data, count = data + line, count + 1
    return data, count


def read_listing(data: bytes) -> tuple[list[FileEntry], int]:
    """Return the entries of a listing's data, and how many places they took, skipped ones too."""
    lines = [line for line in data.split(b"\0") if line]
    entries: list[FileEntry] = []
    for line in lines:
        name, _, size = line[1:].decode("utf-8", errors="replace").partition("\t")
        if line[:1] == b"D":
            entries.append(FileEntry(name, 0, is_folder=True))
        elif line[:1] == b"F":
            entries.append(FileEntry(name, int(size) if size.isdecimal() else 0))
    return entries, len(lines)


def file_crc32(chunks: Iterable[bytes | bytearray]) -> int:
    """Return MAVLink FTP's checksum: the usual polynomial, begun at 0 and not inverted."""
    value = 0xFFFFFFFF
    for chunk in chunks:
        value = zlib.crc32(chunk, value)
    return value ^ 0xFFFFFFFF
