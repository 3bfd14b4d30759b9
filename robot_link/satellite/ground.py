"""The station's end of a mission transfer: which chunks are due, and what is proved of them.

Counters: ``cut`` and ``pack_order`` take numbers that grow strictly per robot, of plans and orders
together; ``next_counter`` makes them. A transfer keeps its counter for every chunk and repetition.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any, Self

from robot_link.messages import PlanHash
from robot_link.satellite.blob import Blob, TransferId
from robot_link.satellite.record import TransferAck


class GroundState(StrEnum):
    """How far a transfer is proved to have come."""

    DRAFT = "draft"
    QUEUED = "queued"
    PARTIAL = "partial"
    APPLIED = "applied"
    REFUSED = "refused"
    EXPIRED = "expired"
    SUPERSEDED = "superseded"
    WITHDRAWN = "withdrawn"


class PartLevel(StrEnum):
    """How far a chunk is proved to have come."""

    WAITING = "waiting"
    QUEUED = "queued"
    RADIO = "radio"


@dataclass(frozen=True, slots=True)
class Part:
    """One chunk of a transfer."""

    index: int
    size: int
    """Bytes of its message."""
    sends: int = 0
    level: PartLevel = PartLevel.WAITING
    mtmsn: int | None = None
    message_id: str | None = None
    queued_at: datetime | None = None
    radio_at: datetime | None = None
    sent_surfacing: int | None = None
    """Surfacings that the station knew of when it was sent last."""


@dataclass(frozen=True, slots=True)
class GroundTransfer:
    """One mission on its way; every change returns a new value."""

    transfer_id: TransferId
    plan: PlanHash
    sha256: str
    """Of the blob."""
    counter: int
    start: bool
    created_at: datetime
    expires_at: datetime
    parts: tuple[Part, ...]
    state: GroundState = GroundState.DRAFT
    reason: str = ""
    """Why it was refused."""
    surfacings: int = 0
    surfaced_at: datetime | None = None
    ended_at: datetime | None = None

    @classmethod
    def begin(
        cls, blob: Blob, counter: int, at: datetime, expires_at: datetime, *, start: bool
    ) -> Self:
        """Prepare the transfer of a mission; nothing is sent yet."""
        raise NotImplementedError

    @property
    def is_over(self) -> bool:
        """Whether nothing more is to be sent."""
        raise NotImplementedError

    def due(self, now: datetime) -> tuple[int, ...]:
        """Return the chunks to send now."""
        raise NotImplementedError

    def sent(
        self, index: int, at: datetime, message_id: str | None = None, mtmsn: int | None = None
    ) -> Self:
        """Note that a gateway took a chunk."""
        raise NotImplementedError

    def taken(self, mtmsn: int, at: datetime) -> Self:
        """Note that a robot's session reports this message as delivered to it."""
        raise NotImplementedError

    def heard(self, ack: TransferAck, at: datetime) -> Self:
        """Note the robot's word."""
        raise NotImplementedError

    def surfaced(self, at: datetime) -> Self:
        """Note that a message of the robot arrived; those within one surfacing count once."""
        raise NotImplementedError

    def expired(self, now: datetime) -> Self:
        """Give up once its time has passed; else return the same."""
        raise NotImplementedError

    def superseded(self, at: datetime) -> Self:
        """Give up because a newer transfer is under way."""
        raise NotImplementedError

    def withdrawn(self, at: datetime) -> Self:
        """Give up because the operator says so."""
        raise NotImplementedError

    def to_document(self) -> dict[str, Any]:
        """Return it as plain JSON values."""
        raise NotImplementedError

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """Rebuild it from ``to_document``.

        Raises:
            ValueError: If the document is none.
        """
        raise NotImplementedError


def next_counter(last: int, now: datetime) -> int:
    """Return a counter newer than the last one, and than any that a lost database knew."""
    raise NotImplementedError
