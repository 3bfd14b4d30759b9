"""What becomes of one message to a robot, written down together with what it was part of."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from db.ingest import append_telemetry
from db.query.satellite import outbox as outbox_query
from db.query.satellite import satellite_messages as query
from db.query.satellite.outbox import OutboxRecord
from db.query.satellite.satellite_messages import SENDING, SatelliteMessage
from db.query.station.events import add_event
from robot_link.messages import RawFrame, RobotId
from robot_link.station.gateway.gateway import Taken
from server.fleet.words import carrier_title
from server.satellite.row_kind import RowKinds


@dataclass(frozen=True, slots=True)
class Call:
    """One call of a gateway that is about to be made."""

    message: SatelliteMessage
    flush: bool
    """Whether what waits for the robot is thrown away first."""


def begin_call(session: Session, message: str) -> Call | None:
    """Write down that a gateway is about to be called; ``None`` if that shall not be any more.

    Nothing is thrown away that is still wanted, such as a command that was urgent and went ahead.
    """
    before = query.get_message(session, message)
    row = outbox_query.get_outbox(session, before.outbox)
    if before.state != SENDING or row.state != "open":
        return None
    called = query.change_message(session, message, attempts=before.attempts + 1, retry_at=None)
    return Call(called, flush=before.flush and not query.has_wanted(session, called))


def taken(
    session: Session, kinds: RowKinds, call: Call, answer: Taken, at: datetime
) -> OutboxRecord:
    """Write down that the gateway has a message, and what was sent in the raw journal.

    A repetition of the answer changes nothing.
    """
    message = call.message.id
    before = query.get_message(session, message)
    row = outbox_query.get_outbox(session, before.outbox)
    if before.queued_at is not None:
        return row
    has = query.change_message(
        session,
        message,
        state="taken",
        message_id=answer.message_id,
        mtmsn=answer.mtmsn,
        queued_at=at,
        retry_at=None,
        text="" if answer.position is None else f"Place {answer.position} in the queue.",
    )
    sent = RawFrame(RobotId(row.robot), before.carrier, True, before.data, at)
    append_telemetry(session, [sent])
    if row.ended_at is None:
        row = kinds.of(row).taken(session, row, has, at)
    if before.flush and (call.flush or call.message.attempts > 1):
        for one in outbox_query.open_outbox(session, row.robot):
            if one.imei == row.imei:
                kinds.of(one).thrown_away(session, one)
    subject = f"{title(kinds, row, before)} for {row.robot}"
    add_event(
        session,
        at,
        "satellite.queued",
        f"{carrier_title(row.carrier)} took {subject}; the robot has not fetched it yet.",
        robot=row.robot,
        data={
            "outbox": row.id,
            "message": answer.message_id,
            "mtmsn": answer.mtmsn,
            "bytes": before.data.hex(),
        },
    )
    return row


def postponed(
    session: Session,
    kinds: RowKinds,
    message: str,
    sentence: str,
    at: datetime,
    retry_at: datetime,
) -> OutboxRecord:
    """Write down that a message is to be handed over again, the same bytes, and why."""
    before = query.get_message(session, message)
    row = outbox_query.get_outbox(session, before.outbox)
    if before.state == SENDING:
        query.change_message(session, message, retry_at=retry_at, text=sentence)
        if before.text != sentence:
            subject = title(kinds, row, before)
            text = f"{carrier_title(row.carrier)} did not take {subject}: {sentence}"
            _tell(session, row, "satellite.waits", f"{text} It is tried again.", at)
    return row


def refused(
    session: Session, kinds: RowKinds, message: str, sentence: str, at: datetime
) -> OutboxRecord:
    """Write down that the gateway will never take a message, which ends what it was part of.

    It may have taken it before, when its answer was lost.
    """
    before = query.get_message(session, message)
    row = outbox_query.get_outbox(session, before.outbox)
    if before.state != SENDING:
        return row
    may_have_it = before.attempts > 1
    earlier = " Nobody knows whether it took it before, when it gave no answer."
    query.change_message(
        session,
        message,
        state="unknown" if may_have_it else "refused",
        retry_at=None,
        text=f"{sentence}{earlier}" if may_have_it else sentence,
    )
    reason = f"{carrier_title(row.carrier)} did not take it: {sentence}"
    subject = title(kinds, row, before)
    text = f"{subject[0].upper()}{subject[1:]}: {reason}"
    _tell(session, row, "satellite.refused", text, at)
    if row.ended_at is None:
        row = kinds.of(row).refused(session, row, reason, at)
    return row


def fetched(session: Session, message: SatelliteMessage, at: datetime) -> None:
    """Write down that the robot's modem has a message, as the network says by its number."""
    if message.state in ("taken", "unknown"):
        query.change_message(session, message.id, state="radio", radio_at=at)


def title(kinds: RowKinds, row: OutboxRecord, message: SatelliteMessage) -> str:
    """Return what a message is, for a sentence."""
    return kinds.of(row).title(row, message.part)


def _tell(session: Session, row: OutboxRecord, kind: str, text: str, at: datetime) -> None:
    add_event(session, at, kind, text, level="watch", robot=row.robot, data={"outbox": row.id})
