"""The station's end of a mission transfer: which chunks are due, and what is proved of them.

Counters: ``cut`` and ``pack_order`` take numbers that grow strictly per robot, of plans and orders
together; ``next_counter`` makes them. A transfer keeps its counter for every chunk and repetition.

For each message of the robot call ``surfaced``, then ``heard`` for each of its acks, then ``taken``
if the gateway says which message it delivered in that session: the robot composed its words before.

A chunk is not sent again while it may still wait at the gateway. A session fetches one message, in
order; so it was fetched, or lost, once the robot had as many sessions as there were chunks in the
queue, and the next message of the robot says which.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from enum import StrEnum
from typing import Any, Self

from robot_link.messages import PlanHash
from robot_link.satellite.blob import Blob, TransferId
from robot_link.satellite.chunk import sizes
from robot_link.satellite.content import TransferAck, TransferState, sending_of

SETTLE_S = 60.0
"""A session sooner than this after a chunk was handed over may not have met it at the gateway."""
_STATE_SENTENCES = {
    TransferState.BAD_HASH: "the chunks on board are together not the mission that was sent",
    TransferState.BAD_SCHEMA: "the robot's program does not understand this mission",
}


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


_UNDER_WAY = (GroundState.DRAFT, GroundState.QUEUED, GroundState.PARTIAL)


class PartLevel(StrEnum):
    """How far a chunk is proved to have come."""

    WAITING = "waiting"
    QUEUED = "queued"
    """A gateway took it."""
    RADIO = "radio"
    """The gateway reports it as fetched, or the robot says that it holds it."""


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
    is_held: bool = False
    """Whether the robot said that it holds it."""
    sessions: int = 0
    """Messages of the robot since the chunk was last handed over, or since it was fetched."""
    sessions_needed: int = 0
    """So many of them show that the chunk was lost."""


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
    heard_at: datetime | None = None
    """Session of the newest word of the robot on it."""
    ended_at: datetime | None = None
    is_told: bool = False
    """Whether the robot said its last word on it, so that it need not repeat it."""

    @classmethod
    def begin(
        cls, blob: Blob, counter: int, at: datetime, expires_at: datetime, *, start: bool
    ) -> Self:
        """Prepare the transfer of a mission; nothing is sent yet.

        Raises:
            ValueError: If the mission needs too many messages.
        """
        return cls(
            transfer_id=blob.transfer_id,
            plan=blob.plan,
            sha256=blob.sha256,
            counter=counter,
            start=start,
            created_at=at,
            expires_at=expires_at,
            parts=tuple(Part(index, size) for index, size in enumerate(sizes(blob))),
        )

    @property
    def is_over(self) -> bool:
        """Whether nothing more is to be sent."""
        return self.state not in _UNDER_WAY

    @property
    def sends(self) -> int:
        """Messages handed to gateways so far."""
        return sum(part.sends for part in self.parts)

    def due(self, now: datetime) -> tuple[int, ...]:
        """Return the chunks to send now."""
        if self.is_over or now >= self.expires_at:
            return ()
        return tuple(
            part.index
            for part in self.parts
            if not part.is_held and (not part.sends or part.sessions >= part.sessions_needed)
        )

    def sent(
        self, index: int, at: datetime, message_id: str | None = None, mtmsn: int | None = None
    ) -> Self:
        """Note that a gateway took a chunk.

        Args:
            index: Which chunk.
            at: When.
            message_id: The gateway's name of the message.
            mtmsn: Number that the robot's session will report, where the gateway says it.
        """
        others = sum(
            part.level is PartLevel.QUEUED and not part.is_held and part.index != index
            for part in self.parts
        )
        now_queued = replace(
            self.parts[index],
            sends=self.parts[index].sends + 1,
            level=PartLevel.QUEUED,
            mtmsn=mtmsn,
            message_id=message_id,
            queued_at=at,
            radio_at=None,
            sessions=0,
            sessions_needed=others + 2,
        )
        state = GroundState.QUEUED if self.state is GroundState.DRAFT else self.state
        return replace(self._with_part(now_queued), state=state)

    def taken(self, mtmsn: int, at: datetime) -> Self:
        """Note that a robot's session reports this message as delivered to it."""
        for part in self.parts:
            if part.mtmsn == mtmsn and part.level is PartLevel.QUEUED:
                fetched = replace(
                    part, level=PartLevel.RADIO, radio_at=at, sessions=0, sessions_needed=1
                )
                return self._with_part(fetched)
        return self

    def heard(self, ack: TransferAck, at: datetime) -> Self:
        """Note the robot's word; one that is older than another was does not take back anything.

        A last word that answers another sending of the same mission says nothing of this one.

        Args:
            ack: The word.
            at: When the session was that brought it.
        """
        if ack.transfer_id != self.transfer_id or self.is_told:
            return self
        if ack.sending is not None and ack.sending != sending_of(self.counter):
            return self
        if ack.state is TransferState.RECEIVING:
            return self._receiving(ack.received, at)
        if ack.state is TransferState.APPLIED:
            parts = tuple(_held(part, at) for part in self.parts)
            return replace(
                self,
                parts=parts,
                state=GroundState.APPLIED,
                reason="",
                heard_at=at,
                ended_at=at,
                is_told=True,
            )
        if self.is_over:  # given up ashore before: the robot agrees
            return replace(self, heard_at=at, is_told=True)
        return replace(
            self,
            state=GroundState.REFUSED,
            is_told=True,
            reason=_STATE_SENTENCES.get(ack.state, ack.reason.sentence),
            heard_at=at,
            ended_at=at,
        )

    def surfaced(self, at: datetime) -> Self:
        """Note that a message of the robot arrived.

        Args:
            at: When its session was.
        """
        settle = timedelta(seconds=SETTLE_S)
        parts = tuple(
            replace(part, sessions=part.sessions + 1)
            if part.queued_at is not None and at >= part.queued_at + settle
            else part
            for part in self.parts
        )
        return replace(self, parts=parts)

    def expired(self, now: datetime) -> Self:
        """Give up once its time has passed; else return the same."""
        return self if now < self.expires_at else self._over(GroundState.EXPIRED, now)

    def superseded(self, at: datetime) -> Self:
        """Give up because a newer transfer is under way."""
        return self._over(GroundState.SUPERSEDED, at)

    def withdrawn(self, at: datetime) -> Self:
        """Give up because the operator says so."""
        return self._over(GroundState.WITHDRAWN, at)

    def to_document(self) -> dict[str, Any]:
        """Return it as plain JSON values."""
        return {
            "transfer_id": self.transfer_id,
            "plan": self.plan,
            "sha256": self.sha256,
            "counter": self.counter,
            "start": self.start,
            "created_at": self.created_at.isoformat(),
            "expires_at": self.expires_at.isoformat(),
            "parts": [_part_document(part) for part in self.parts],
            "state": self.state.value,
            "reason": self.reason,
            "heard_at": _text(self.heard_at),
            "ended_at": _text(self.ended_at),
            "is_told": self.is_told,
        }

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Self:
        """Rebuild it from ``to_document``.

        Raises:
            ValueError: If the document is none.
        """
        try:
            return cls(
                transfer_id=TransferId(int(document["transfer_id"])),
                plan=PlanHash(document["plan"]),
                sha256=document["sha256"],
                counter=int(document["counter"]),
                start=bool(document["start"]),
                created_at=datetime.fromisoformat(document["created_at"]),
                expires_at=datetime.fromisoformat(document["expires_at"]),
                parts=tuple(_part(one) for one in document["parts"]),
                state=GroundState(document["state"]),
                reason=document["reason"],
                heard_at=_moment(document["heard_at"]),
                ended_at=_moment(document["ended_at"]),
                is_told=bool(document["is_told"]),
            )
        except (KeyError, TypeError) as error:
            raise ValueError("the document is no satellite transfer") from error

    def _receiving(self, received: frozenset[int], at: datetime) -> Self:
        is_newest = self.heard_at is None or at >= self.heard_at
        parts: list[Part] = []
        for part in self.parts:
            if part.index in received:
                parts.append(_held(part, at))
            elif part.is_held and is_newest:  # the robot has lost its memory
                parts.append(
                    replace(part, is_held=False, level=PartLevel.WAITING, sessions_needed=0)
                )
            else:
                parts.append(part)
        is_partial = not self.is_over and any(part.is_held for part in parts)
        return replace(
            self,
            parts=tuple(parts),
            state=GroundState.PARTIAL if is_partial else self.state,
            heard_at=at if is_newest else self.heard_at,
        )

    def _over(self, state: GroundState, at: datetime) -> Self:
        return self if self.is_over else replace(self, state=state, ended_at=at)

    def _with_part(self, part: Part) -> Self:
        parts = (*self.parts[: part.index], part, *self.parts[part.index + 1 :])
        return replace(self, parts=parts)


def next_counter(last: int, now: datetime) -> int:
    """Return a counter newer than the last one, and than any that a lost database knew.

    Args:
        last: The last counter of the robot's plans and orders, 0 at first.
        now: The station's clock; its second since 1970 is the least counter.
    """
    return max(last + 1, int(now.timestamp()))


def _held(part: Part, at: datetime) -> Part:
    radio_at = part.radio_at if part.radio_at is not None else at
    return replace(part, level=PartLevel.RADIO, is_held=True, radio_at=radio_at)


def _part_document(part: Part) -> dict[str, Any]:
    return {
        "index": part.index,
        "size": part.size,
        "sends": part.sends,
        "level": part.level.value,
        "mtmsn": part.mtmsn,
        "message_id": part.message_id,
        "queued_at": _text(part.queued_at),
        "radio_at": _text(part.radio_at),
        "is_held": part.is_held,
        "sessions": part.sessions,
        "sessions_needed": part.sessions_needed,
    }


def _part(document: Mapping[str, Any]) -> Part:
    return Part(
        index=int(document["index"]),
        size=int(document["size"]),
        sends=int(document["sends"]),
        level=PartLevel(document["level"]),
        mtmsn=document["mtmsn"],
        message_id=document["message_id"],
        queued_at=_moment(document["queued_at"]),
        radio_at=_moment(document["radio_at"]),
        is_held=bool(document["is_held"]),
        sessions=int(document["sessions"]),
        sessions_needed=int(document["sessions_needed"]),
    )


def _text(at: datetime | None) -> str | None:
    return None if at is None else at.isoformat()


def _moment(text: str | None) -> datetime | None:
    return None if text is None else datetime.fromisoformat(text)
