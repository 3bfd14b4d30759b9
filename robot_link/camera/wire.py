"""Messages between the station and a camera's process, on its standard input and output.

``u32 length | u8 kind | body``, little-endian; the length counts the body alone. All bodies are
JSON (``robot_link.camera.sighting``), but the preview's, which is a JPEG. The station's first
message is the settings.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum

import msgspec

from robot_link.camera.sighting import (
    BoardView,
    Order,
    Sighting,
    SourceReport,
    SourceSettings,
)

HEAD = struct.Struct("<IB")
BODY_MAX = 8 << 20
"""Bytes of a body; whoever announces more is not believed."""


class Kind(IntEnum):
    """What a message is."""

    SIGHTING = 1
    PREVIEW = 2
    REPORT = 3
    BOARD = 4
    SETTINGS = 16
    ORDER = 17


FromCamera = Sighting | SourceReport | BoardView | bytes
"""What a camera's process says; bytes are a preview."""
ToCamera = SourceSettings | Order
_KINDS: dict[type, Kind] = {
    Sighting: Kind.SIGHTING,
    bytes: Kind.PREVIEW,
    SourceReport: Kind.REPORT,
    BoardView: Kind.BOARD,
    SourceSettings: Kind.SETTINGS,
    Order: Kind.ORDER,
}
_TYPES = {kind: of for of, kind in _KINDS.items()}


class CameraWireError(ValueError):
    """Bytes that are no message."""


def framed(message: FromCamera | ToCamera) -> bytes:
    """Return a message as it crosses the pipe.

    Raises:
        CameraWireError: If its body is longer than ``BODY_MAX``.
    """
    body = message if isinstance(message, bytes) else msgspec.json.encode(message)
    if len(body) > BODY_MAX:
        raise CameraWireError(f"a body of {len(body)} bytes is longer than {BODY_MAX}")
    return HEAD.pack(len(body), _KINDS[type(message)]) + body


@dataclass(slots=True)
class CameraReader:
    """Takes messages out of a stream of bytes, however it is cut."""

    _rest: bytes = b""

    def take(self, data: bytes) -> list[FromCamera | ToCamera]:
        """Return the messages that are complete with these bytes.

        Raises:
            CameraWireError: If what came is none; the stream cannot be read any further.
        """
        self._rest += data
        messages: list[FromCamera | ToCamera] = []
        begin = 0
        while len(self._rest) - begin >= HEAD.size:
            length, number = HEAD.unpack_from(self._rest, begin)
            if length > BODY_MAX:
                raise CameraWireError(f"a body of {length} bytes is longer than {BODY_MAX}")
            end = begin + HEAD.size + length
            if len(self._rest) < end:
                break
            messages.append(_read(number, self._rest[begin + HEAD.size : end]))
            begin = end
        self._rest = self._rest[begin:]
        return messages


def _read(number: int, body: bytes) -> FromCamera | ToCamera:
    if number not in set(Kind):
        raise CameraWireError(f"no message is of kind {number}")
    of = _TYPES[Kind(number)]
    if of is bytes:
        return body
    try:
        return msgspec.json.decode(body, type=of)
    except (msgspec.DecodeError, msgspec.ValidationError, UnicodeDecodeError) as error:
        raise CameraWireError(f"{Kind(number).name.lower()}: {error}") from None
