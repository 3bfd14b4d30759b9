"""Envelope of every satellite message: kind of message, and the code that proves its sender.

All integers are big endian. The first byte of a message is ``VERSION << 4 | type``; the last eight
are the first of an HMAC-SHA-256 with the robot's key over the direction, the robot's system id and
everything before them. A message of another robot, of the other direction, or with a flipped bit
is refused.
"""

import hashlib
import hmac
from enum import IntEnum

from robot_link.messages import SystemId

VERSION = 1
KEY_BYTES = 32
MAC_BYTES = 8
COUNTER_MAX = 2**32 - 1
"""Greatest counter of a message to a robot; as seconds since 1970 it is a day of 2106."""
ACK_SEEN = 16
"""Flag of every message to a robot: what it said of all transfers and orders before was heard."""
MOBILE_TERMINATED_MAX = 270
"""Most bytes that a 9602 modem takes from the satellite in one message."""
MOBILE_ORIGINATED_MAX = 340
"""Most bytes that a 9602 modem sends in one message."""

_DOWN = b"GRACE-MT"
_UP = b"GRACE-MO"


class WireError(ValueError):
    """Bytes that are no message for this receiver; the sentence says why. Count and drop them."""


class MessageType(IntEnum):
    """Kind of message, in the low half of its first byte."""

    CHUNK = 1
    ORDER = 2
    RECORD = 3
    WITHDRAWAL = 4


def sealed_down(body: bytes, key: bytes, system: SystemId) -> bytes:
    """Return a message to a robot: the body and its code.

    Raises:
        ValueError: If the key has not ``KEY_BYTES``, or the message were too long to be sent.
    """
    return _sealed(body, _DOWN, key, system, MOBILE_TERMINATED_MAX)


def sealed_up(body: bytes, key: bytes, system: SystemId) -> bytes:
    """Return a message of a robot: the body and its code.

    Raises:
        ValueError: If the key has not ``KEY_BYTES``, or the message were too long to be sent.
    """
    return _sealed(body, _UP, key, system, MOBILE_ORIGINATED_MAX)


def opened_down(data: bytes, key: bytes, system: SystemId) -> tuple[MessageType, bytes]:
    """Return the type and the body of a message to this robot.

    Raises:
        WireError: If it is none.
    """
    return _opened(data, _DOWN, key, system, MOBILE_TERMINATED_MAX)


def opened_up(data: bytes, key: bytes, system: SystemId) -> tuple[MessageType, bytes]:
    """Return the type and the body of a message of this robot.

    Raises:
        WireError: If it is none.
    """
    return _opened(data, _UP, key, system, MOBILE_ORIGINATED_MAX)


def first_byte(kind: MessageType) -> int:
    """Return the first byte of a message."""
    return VERSION << 4 | kind


def check_counter(counter: int) -> None:
    """Refuse a counter that does not travel.

    Raises:
        ValueError: If it does not fit.
    """
    if not 0 <= counter <= COUNTER_MAX:
        raise ValueError(f"counter {counter} cannot travel")


def _sealed(body: bytes, direction: bytes, key: bytes, system: SystemId, most: int) -> bytes:
    if len(body) + MAC_BYTES > most:
        raise ValueError(f"a message of {len(body) + MAC_BYTES} bytes exceeds {most}")
    return body + _code(body, direction, key, system)


def _opened(
    data: bytes, direction: bytes, key: bytes, system: SystemId, most: int
) -> tuple[MessageType, bytes]:
    if not MAC_BYTES < len(data) <= most:
        raise WireError(f"{len(data)} bytes are no message")
    body, code = data[:-MAC_BYTES], data[-MAC_BYTES:]
    if not hmac.compare_digest(code, _code(body, direction, key, system)):
        raise WireError("the code is wrong: damaged, of another robot, or of another key")
    version, kind = body[0] >> 4, body[0] & 0xF
    if version != VERSION:
        raise WireError(f"version {version} of satellite messages is unknown")
    try:
        return MessageType(kind), body
    except ValueError as error:
        raise WireError(f"type {kind} of satellite messages is unknown") from error


def _code(body: bytes, direction: bytes, key: bytes, system: SystemId) -> bytes:
    if len(key) != KEY_BYTES:
        raise ValueError(f"a robot's key has {KEY_BYTES} bytes, not {len(key)}")
    covered = direction + bytes([system]) + body
    return hmac.new(key, covered, hashlib.sha256).digest()[:MAC_BYTES]
