"""Messages to robots as they are handed to satellite gateways; a row before each call."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Select, and_, func, or_, select
from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.identity import key_of, public_id
from db.link_tables import OutboxRow, SatelliteMessageRow
from db.query.change import row_of, set_fields
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import Robot

SENDING = "sending"
"""Nobody knows yet whether the gateway has it; it is handed over again with the same bytes."""
UNCHARGED = ("refused", "dropped")
"""States of messages that no gateway took."""
_CLIENT_IDS = 0xFFFF
_CHANGEABLE = {
    "state", "attempts", "message_id", "mtmsn", "retry_at", "queued_at", "radio_at", "text",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class SatelliteMessage:
    """One message to a robot."""

    id: str
    robot: str
    outbox: str
    kind: str
    """Of its outbox row: ``plan``, ``order`` or ``withdrawal``."""
    part: int
    carrier: str
    imei: str
    data: bytes
    credits: int
    flush: bool
    priority: int
    state: str
    """``sending``, ``taken``, ``radio``, ``refused``, ``dropped`` (no gateway was called) or
    ``unknown`` (nobody knows whether the gateway has it)."""
    attempts: int
    """How often its gateway was called, counted before the call."""
    message_id: str
    mtmsn: int | None
    created_at: datetime
    retry_at: datetime | None
    """When it is handed over again after a call that failed."""
    queued_at: datetime | None
    radio_at: datetime | None
    text: str

    @property
    def client_id(self) -> int:
        """Number by which a gateway knows it again when it is handed over twice."""
        return (key_of("message", self.id) - 1) % _CLIENT_IDS + 1


def add_message(
    session: Session,
    outbox: str,
    robot: str,
    *,
    part: int,
    carrier: str,
    imei: str,
    data: bytes,
    cost: int,
    at: datetime,
    flush: bool = False,
    priority: int = 5,
) -> SatelliteMessage:
    """Add a message that is about to be handed over."""
    row = SatelliteMessageRow(
        robot_key=robot_key(session, robot),
        outbox_key=key_of("outbox", outbox),
        part=part,
        carrier=carrier,
        imei=imei,
        data=data,
        credits=cost,
        flush=flush,
        priority=priority,
        state=SENDING,
        attempts=0,
        message_id="",
        created_at=at,
        retry_at=at,
        text="",
    )
    session.add(row)
    session.flush()
    return get_message(session, public_id("message", row.key))


def change_message(session: Session, message: str, **changes: Any) -> SatelliteMessage:  # noqa: ANN401 - the fields differ in type
    """Change what became of a message.

    Raises:
        UnknownIdError: If there is no such message.
    """
    row = row_of(session, SatelliteMessageRow, "message", message)
    set_fields(row, "a satellite message", changes, _CHANGEABLE)
    session.flush()
    return get_message(session, message)


def get_message(session: Session, message: str) -> SatelliteMessage:
    """Return one message.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    found = session.execute(
        _rows().where(SatelliteMessageRow.key == key_of("message", message))
    ).one_or_none()
    if found is None:
        raise UnknownIdError("message", message)
    return _record(*found)


def messages_in(session: Session, state: str) -> list[SatelliteMessage]:
    """Return the messages in a state, the oldest first."""
    statement = _rows().where(SatelliteMessageRow.state == state).order_by(SatelliteMessageRow.key)
    return [_record(*found) for found in session.execute(statement)]


def messages_of(session: Session, outbox: str) -> list[SatelliteMessage]:
    """Return the messages of an outbox row, the oldest first."""
    statement = (
        _rows()
        .where(SatelliteMessageRow.outbox_key == key_of("outbox", outbox))
        .order_by(SatelliteMessageRow.key)
    )
    return [_record(*found) for found in session.execute(statement)]


def messages_to(session: Session, robot: str, limit: int) -> list[SatelliteMessage]:
    """Return the newest messages to a robot, the newest first."""
    statement = (
        _rows()
        .where(SatelliteMessageRow.robot_key == robot_key(session, robot))
        .order_by(SatelliteMessageRow.key.desc())
        .limit(limit)
    )
    return [_record(*found) for found in session.execute(statement)]


def message_of_mtmsn(
    session: Session, imei: str, mtmsn: int, since: datetime
) -> SatelliteMessage | None:
    """Return the newest message of a modem that the network gave this number; numbers wrap."""
    found = session.execute(
        _rows()
        .where(
            SatelliteMessageRow.imei == imei,
            SatelliteMessageRow.mtmsn == mtmsn,
            SatelliteMessageRow.created_at >= since,
        )
        .order_by(SatelliteMessageRow.key.desc())
        .limit(1)
    ).one_or_none()
    return None if found is None else _record(*found)


def has_wanted(session: Session, message: SatelliteMessage) -> bool:
    """Tell whether its modem's queue may hold a message of another row that is still open."""
    statement = (
        select(SatelliteMessageRow.key)
        .join(OutboxRow, SatelliteMessageRow.outbox_key == OutboxRow.key)
        .where(
            SatelliteMessageRow.imei == message.imei,
            SatelliteMessageRow.outbox_key != key_of("outbox", message.outbox),
            SatelliteMessageRow.attempts > 0,
            SatelliteMessageRow.state.in_((SENDING, "taken", "unknown")),
            OutboxRow.ended_at.is_(None),
        )
        .limit(1)
    )
    return session.scalar(statement) is not None


def credits_spent(session: Session, robot: str, start: datetime, end: datetime) -> int:
    """Return the credits that messages to a robot cost from ``start`` to before ``end``.

    One that waits for its gateway counts on every day on which it waits, and one that a gateway
    took on that day. One whose fate is unknown counts; one that the gateway refused does not.
    """
    taken_at = func.coalesce(SatelliteMessageRow.queued_at, SatelliteMessageRow.created_at)
    statement = select(func.sum(SatelliteMessageRow.credits)).where(
        SatelliteMessageRow.robot_key == robot_key(session, robot),
        SatelliteMessageRow.created_at < end,
        or_(
            SatelliteMessageRow.state == SENDING,
            and_(
                taken_at >= start,
                taken_at < end,
                SatelliteMessageRow.state.not_in(UNCHARGED),
            ),
        ),
    )
    return session.scalar(statement) or 0


def credits_of(session: Session, outbox: str) -> int:
    """Return the credits that an outbox row has cost so far."""
    statement = select(func.sum(SatelliteMessageRow.credits)).where(
        SatelliteMessageRow.outbox_key == key_of("outbox", outbox),
        SatelliteMessageRow.state.not_in(UNCHARGED),
    )
    return session.scalar(statement) or 0


def _rows() -> Select[SatelliteMessageRow, str, str]:
    return (
        select(SatelliteMessageRow, Robot.id, OutboxRow.kind)
        .join(Robot, SatelliteMessageRow.robot_key == Robot.key)
        .join(OutboxRow, SatelliteMessageRow.outbox_key == OutboxRow.key)
    )


def _record(row: SatelliteMessageRow, robot: str, kind: str) -> SatelliteMessage:
    return same(
        SatelliteMessage,
        row,
        id=public_id("message", row.key),
        robot=robot,
        outbox=public_id("outbox", row.outbox_key),
        kind=kind,
    )
