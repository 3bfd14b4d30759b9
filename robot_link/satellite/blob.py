"""A mission as the bytes that travel by satellite."""

from dataclasses import dataclass
from enum import IntEnum
from typing import NewType, Self

from robot_link.messages import PlanHash
from robot_link.mission import Mission

TransferId = NewType("TransferId", int)
"""First four bytes of the SHA-256 of a blob; names a transfer to both ends."""


class BlobCodec(IntEnum):
    """How a blob is packed."""

    PLAIN = 0
    DEFLATE = 1


@dataclass(frozen=True, slots=True)
class Blob:
    """A mission, packed to travel."""

    packed: bytes
    codec: BlobCodec
    sha256: str
    """Of ``packed``, hexadecimal."""
    transfer_id: TransferId
    plan: PlanHash
    """Name of the mission, which the robot echoes."""

    @classmethod
    def of(cls, mission: Mission) -> Self:
        """Pack a mission; deflated only if that is smaller.

        Raises:
            ValueError: If the mission is longer than the wire allows.
        """
        raise NotImplementedError


def mission_of(packed: bytes, codec: int) -> Mission:
    """Unpack a mission.

    Raises:
        WireError: If the bytes are no mission, or more than a robot holds.
    """
    raise NotImplementedError
