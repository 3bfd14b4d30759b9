"""Chunks: a mission cut into messages of at most 270 bytes, and how the robot reads messages.

A chunk, big endian, before the code of ``frame``:

    u8   version << 4 | 1
    u8   flags: bits 0, 1 codec of the blob; 2 last chunk; 3 start; 4 acknowledgements seen
    u32  transfer id
    u8   index, from 0
    u8   number of chunks
    u32  counter of the transfer
    ...  data, 1..250 bytes
"""

import math
import struct
from dataclasses import dataclass

from robot_link.messages import SystemId
from robot_link.satellite.blob import Blob, BlobCodec, TransferId
from robot_link.satellite.frame import (
    ACK_SEEN,
    MAC_BYTES,
    MOBILE_TERMINATED_MAX,
    MessageType,
    WireError,
    check_counter,
    first_byte,
    opened_down,
    sealed_down,
)
from robot_link.satellite.order import Order, read_order
from robot_link.satellite.withdrawal import Withdrawal, read_withdrawal

MOST_CHUNKS = 40
"""A gateway queues 50 messages for one robot; more would push each other out."""
_HEADER = struct.Struct(">BBIBBI")
DATA_MAX = MOBILE_TERMINATED_MAX - _HEADER.size - MAC_BYTES
_CREDIT_BYTES = 50
_THRIFTY_MAX = MOBILE_TERMINATED_MAX // _CREDIT_BYTES * _CREDIT_BYTES - _HEADER.size - MAC_BYTES
"""Data of a message that fills its credits; more, up to ``DATA_MAX``, costs a credit more."""
_CODEC_MASK, _LAST, _START = 3, 4, 8
_FLAGS_MAX = 31


@dataclass(frozen=True, slots=True)
class Chunk:
    """One part of a mission."""

    transfer_id: TransferId
    counter: int
    """Newer for each transfer of a robot; the same for all chunks of one."""
    index: int
    count: int
    data: bytes
    codec: BlobCodec
    is_last: bool
    start: bool
    """Whether the mission is to be flown as soon as it is on board."""
    ack_seen: bool
    """Whether the station has seen the final word on every transfer and order before this one."""


def cut(
    blob: Blob,
    key: bytes,
    system: SystemId,
    counter: int,
    *,
    start: bool,
    ack_seen: bool,
) -> tuple[bytes, ...]:
    """Return the messages that carry a mission: as few as can be, and of as few credits.

    Args:
        blob: The mission.
        key: The robot's key.
        system: The robot's MAVLink system id.
        counter: Newer than of every transfer and order before (``ground.next_counter``).
        start: Fly it as soon as it is on board.
        ack_seen: The station has seen the final word on every transfer and order before.

    Raises:
        ValueError: If the mission needs more than ``MOST_CHUNKS``, or the counter does not fit.
    """
    check_counter(counter)
    parts = _parts(blob.packed)
    flags = blob.codec | _START * start | ACK_SEEN * ack_seen
    first = first_byte(MessageType.CHUNK)
    return tuple(
        sealed_down(
            _HEADER.pack(
                first,
                flags | _LAST * (index == len(parts) - 1),
                blob.transfer_id,
                index,
                len(parts),
                counter,
            )
            + part,
            key,
            system,
        )
        for index, part in enumerate(parts)
    )


def sizes(blob: Blob) -> tuple[int, ...]:
    """Return the bytes of each message that ``cut`` makes, for a quote.

    Raises:
        ValueError: If the mission needs more than ``MOST_CHUNKS``.
    """
    return tuple(_HEADER.size + len(part) + MAC_BYTES for part in _parts(blob.packed))


def read_mobile_terminated(data: bytes, key: bytes, system: SystemId) -> Chunk | Order | Withdrawal:
    """Read a message to a robot.

    Raises:
        WireError: If it is none for this robot.
    """
    kind, body = opened_down(data, key, system)
    if kind is MessageType.ORDER:
        return read_order(body)
    if kind is MessageType.WITHDRAWAL:
        return read_withdrawal(body)
    if kind is not MessageType.CHUNK or len(body) <= _HEADER.size:
        raise WireError("this is no message to a robot")
    _, flags, transfer_id, index, count, counter = _HEADER.unpack_from(body)
    codec = flags & _CODEC_MASK
    if flags > _FLAGS_MAX or codec not in tuple(BlobCodec):
        raise WireError(f"flags {flags:#x} of a chunk are unknown")
    if not index < count <= MOST_CHUNKS or bool(flags & _LAST) != (index == count - 1):
        raise WireError(f"chunk {index} of {count} cannot be")
    return Chunk(
        transfer_id=TransferId(transfer_id),
        counter=counter,
        index=index,
        count=count,
        data=body[_HEADER.size :],
        codec=BlobCodec(codec),
        is_last=bool(flags & _LAST),
        start=bool(flags & _START),
        ack_seen=bool(flags & ACK_SEEN),
    )


def _parts(packed: bytes) -> list[bytes]:
    """Cut bytes into as few parts as can be, and of these as few credits.

    Messages that fill their credits come first; where the parts would become too many, as many as
    needed are filled up at the price of one credit more each.
    """
    count = math.ceil(len(packed) / DATA_MAX)
    if count > MOST_CHUNKS:
        raise ValueError(f"the mission needs {count} satellite messages; at most {MOST_CHUNKS}")
    excess = len(packed) - count * _THRIFTY_MAX
    filled = max(0, math.ceil(excess / (DATA_MAX - _THRIFTY_MAX)))
    lengths = [DATA_MAX] * filled + [_THRIFTY_MAX] * (count - filled)
    parts: list[bytes] = []
    first = 0
    for length in lengths:
        parts.append(packed[first : first + length])
        first += length
    return parts
