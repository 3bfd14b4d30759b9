"""Chunks: a mission cut into messages of at most 270 bytes."""

from dataclasses import dataclass

from robot_link.mavlink.command import ReceivedCommand
from robot_link.messages import SystemId
from robot_link.satellite.blob import Blob, BlobCodec, TransferId

MOST_CHUNKS = 40
"""A gateway queues 50 messages for one robot; more would push each other out."""


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


@dataclass(frozen=True, slots=True)
class Order:
    """A command, with the counter that keeps an old one from being said again."""

    command: ReceivedCommand
    counter: int
    ack_seen: bool


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
        ValueError: If the mission needs more than ``MOST_CHUNKS``.
    """
    raise NotImplementedError


def sizes(blob: Blob) -> tuple[int, ...]:
    """Return the bytes of each message that ``cut`` makes, for a quote."""
    raise NotImplementedError


def read_mobile_terminated(data: bytes, key: bytes, system: SystemId) -> Chunk | Order:
    """Read a message to a robot.

    Raises:
        WireError: If it is none for this robot.
    """
    raise NotImplementedError
