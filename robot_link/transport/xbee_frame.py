"""XBee API frames, without input or output: bytes in, frames out, and back.

A frame on the wire is ``7E | length u16 | content | checksum``; in API mode 2 the bytes 7E, 7D,
11 and 13 travel as 7D and their exclusive or with 20. The content's layouts are those of Digi's
XBee-PRO 900HP manual; integers are big endian.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Literal, TypeAlias

from robot_link.transport.datagram import Address

ApiMode: TypeAlias = Literal[1, 2]
"""The radio's AP parameter: 1 plain, 2 escaped."""

_START = 0x7E
_ESCAPE = 0x7D
_ESCAPED = frozenset((0x7E, 0x7D, 0x11, 0x13))
_FLIP = 0x20
_KEPT_BYTES = 1024
_LONGEST_CONTENT = 512
"""More than any frame of these radios; a greater length is not one."""
_ANY_NETWORK = 0xFFFE
"""Stands where other firmwares carry a 16-bit address."""

_AT_COMMAND = 0x08
_AT_COMMAND_QUEUED = 0x09
_TRANSMIT_REQUEST = 0x10
_AT_REPLY = 0x88
_TRANSMIT_STATUS = 0x8B
_RECEIVE = 0x90

_TRANSMIT = struct.Struct(">BBQHBB")
_STATUS = struct.Struct(">BBHBBB")
_PACKET = struct.Struct(">BQHB")


class TransmitCode(IntEnum):
    """Status of a 0x8B frame, as far as a sender reacts to it."""

    SUCCESS = 0x00
    MAC_ACK_FAILURE = 0x01
    NETWORK_ACK_FAILURE = 0x21
    ROUTE_NOT_FOUND = 0x25
    PAYLOAD_TOO_LARGE = 0x74


class AtStatus(IntEnum):
    """Status of a 0x88 frame."""

    OK = 0
    ERROR = 1
    BAD_COMMAND = 2
    BAD_PARAMETER = 3


@dataclass(frozen=True, slots=True)
class AtCommand:
    """0x08: read a parameter of the radio at the port, or set it where ``value`` is not empty."""

    frame_id: int
    command: bytes
    value: bytes = b""
    is_queued: bool = False
    """0x09 instead: a value that is set takes effect with the next 0x08 only."""

    def content(self) -> bytes:
        """Return the frame's content."""
        kind = _AT_COMMAND_QUEUED if self.is_queued else _AT_COMMAND
        return bytes((kind, self.frame_id)) + self.command + self.value


@dataclass(frozen=True, slots=True)
class AtReply:
    """0x88: answer to an ``AtCommand``."""

    frame_id: int
    command: bytes
    status: int
    value: bytes = b""

    def content(self) -> bytes:
        """Return the frame's content."""
        return bytes((_AT_REPLY, self.frame_id)) + self.command + bytes((self.status,)) + self.value


@dataclass(frozen=True, slots=True)
class TransmitRequest:
    """0x10: send data to a radio; answered by a ``TransmitStatus`` unless ``frame_id`` is 0."""

    frame_id: int
    address: Address
    data: bytes
    radius: int = 0
    options: int = 0

    def content(self) -> bytes:
        """Return the frame's content."""
        return (
            _TRANSMIT.pack(
                _TRANSMIT_REQUEST,
                self.frame_id,
                self.address,
                _ANY_NETWORK,
                self.radius,
                self.options,
            )
            + self.data
        )


@dataclass(frozen=True, slots=True)
class TransmitStatus:
    """0x8B: what became of a ``TransmitRequest``; ``status`` is a ``TransmitCode`` or other."""

    frame_id: int
    retries: int
    status: int
    discovery: int = 0

    def content(self) -> bytes:
        """Return the frame's content."""
        return _STATUS.pack(
            _TRANSMIT_STATUS,
            self.frame_id,
            _ANY_NETWORK,
            self.retries,
            self.status,
            self.discovery,
        )


@dataclass(frozen=True, slots=True)
class ReceivePacket:
    """0x90: data that a radio received."""

    address: Address
    data: bytes
    options: int = 0

    def content(self) -> bytes:
        """Return the frame's content."""
        return _PACKET.pack(_RECEIVE, self.address, _ANY_NETWORK, self.options) + self.data


Frame = AtCommand | AtReply | TransmitRequest | TransmitStatus | ReceivePacket


def parse_content(content: bytes) -> Frame | None:
    """Return the frame that a content holds; None for other types and for one cut short."""
    kind = content[0] if content else -1
    if kind == _RECEIVE and len(content) >= _PACKET.size:
        _, source, _, options = _PACKET.unpack_from(content)
        return ReceivePacket(Address(source), content[_PACKET.size :], options)
    if kind == _TRANSMIT_STATUS and len(content) == _STATUS.size:
        _, frame_id, _, retries, status, discovery = _STATUS.unpack(content)
        return TransmitStatus(frame_id, retries, status, discovery)
    if kind == _AT_REPLY and len(content) >= 5:
        return AtReply(content[1], content[2:4], content[4], content[5:])
    if kind == _TRANSMIT_REQUEST and len(content) >= _TRANSMIT.size:
        _, frame_id, target, _, radius, options = _TRANSMIT.unpack_from(content)
        return TransmitRequest(
            frame_id, Address(target), content[_TRANSMIT.size :], radius, options
        )
    if kind in (_AT_COMMAND, _AT_COMMAND_QUEUED) and len(content) >= 4:
        is_queued = kind == _AT_COMMAND_QUEUED
        return AtCommand(content[1], content[2:4], content[4:], is_queued)
    return None


def encode(content: bytes, mode: ApiMode) -> bytes:
    """Return the bytes on the wire of one frame's content.

    Raises:
        ValueError: If the content is empty or longer than any radio takes.
    """
    if not 1 <= len(content) <= _LONGEST_CONTENT:
        raise ValueError(f"a frame of {len(content)} bytes is not of 1..{_LONGEST_CONTENT}")
    body = struct.pack(">H", len(content)) + content + bytes((_checksum(content),))
    return bytes((_START,)) + (body if mode == 1 else _escape(body))


class FrameReader:
    """Finds frames in a stream that may begin anywhere, be cut anywhere, and hold garbage."""

    def __init__(self, mode: ApiMode) -> None:
        self._mode = mode
        self._buffer = bytearray()
        self._is_lost = False
        self._dropped = bytearray()
        self.bad = 0
        """Stretches of bytes dropped because they were no frame."""

    @property
    def unfinished(self) -> bytes:
        """The beginning of a frame whose end has not come."""
        return bytes(self._buffer)

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes and return the contents of the frames that they complete."""
        self._buffer += data
        contents: list[bytes] = []
        while self._buffer:
            start = self._buffer.find(_START)
            if start != 0:
                self._drop(len(self._buffer) if start < 0 else start)
                continue
            body, used = self._body()
            if body is None:
                break
            if body and sum(body[2:]) & 0xFF == 0xFF:
                contents.append(bytes(body[2:-1]))
                del self._buffer[:used]
                self._is_lost = False
            else:
                self._drop(1)
        return contents

    def flush(self) -> list[bytes]:
        """Give up the frame that is not complete; return those that it hid.

        Bytes that only look like the beginning of a long frame would otherwise swallow the frames
        that follow until its length is reached.
        """
        contents: list[bytes] = []
        while self._buffer:
            self._drop(1)
            contents += self.feed(b"")
        return contents

    def take_dropped(self) -> bytes:
        """Return the first bytes that were dropped since the last call."""
        dropped = bytes(self._dropped)
        self._dropped.clear()
        return dropped

    def _drop(self, count: int) -> None:
        """Search on behind bytes that are no frame; a stretch counts once."""
        self._dropped += self._buffer[: min(count, _KEPT_BYTES - len(self._dropped))]
        del self._buffer[:count]
        self.bad += not self._is_lost
        self._is_lost = True

    def _body(self) -> tuple[bytes | None, int]:
        """Return length, content and checksum of the frame at the start, and its bytes used.

        The body is None while bytes are missing, and empty where no frame can be.
        """
        plain, raw_sizes = self._plain(3)
        if plain is None or len(plain) < 2:
            return (b"" if plain is None else None), 0
        length = int.from_bytes(plain[:2], "big")
        if not 1 <= length <= _LONGEST_CONTENT:
            return b"", 0
        plain, raw_sizes = self._plain(length + 3)
        if plain is None:
            return b"", 0
        return (plain, raw_sizes) if len(plain) == length + 3 else (None, 0)

    def _plain(self, count: int) -> tuple[bytes | None, int]:
        """Return up to ``count`` plain bytes behind the start, and the raw bytes up to there.

        The bytes are None where a start follows before they are complete (mode 2 only).
        """
        if self._mode == 1:
            return bytes(self._buffer[1 : 1 + count]), 1 + count
        plain = bytearray()
        at = 1
        while len(plain) < count and at < len(self._buffer):
            byte = self._buffer[at]
            if byte == _ESCAPE:
                at += 1
                if at == len(self._buffer):
                    break
                byte = self._buffer[at] ^ _FLIP
                if self._buffer[at] == _START:
                    return None, at
            elif byte == _START:
                return None, at
            plain.append(byte)
            at += 1
        return bytes(plain), at


def _checksum(content: bytes) -> int:
    return 0xFF - (sum(content) & 0xFF)


def _escape(body: bytes) -> bytes:
    out = bytearray()
    for byte in body:
        if byte in _ESCAPED:
            out += bytes((_ESCAPE, byte ^ _FLIP))
        else:
            out.append(byte)
    return bytes(out)
