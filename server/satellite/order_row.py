"""An order on its way by satellite as a row; the robot acts once however often it hears it."""

from collections.abc import Iterable
from datetime import datetime
from typing import Final

from sqlalchemy.orm import Session

from db.query import outbox as query
from db.query.commands import CommandRecord
from db.query.outbox import OutboxRecord
from robot_link.messages import CommandKind, CommandLevel, CommandNumber, PlanHash
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.content import CommandAnswer
from robot_link.satellite.order import pack_order
from robot_link.station.ground import next_counter
from server.command.row import note_level
from server.satellite import repeating
from server.satellite.ending import end_row
from server.satellite.modem import Modem

SURFACE_PRIORITY: Final = 1
ORDER_PRIORITY: Final = 3
_REFUSALS: Final = {
    CommandOutcome.NOT_NOW: "the robot cannot do this now",
    CommandOutcome.WRONG_PLAN: "the robot holds another plan",
    CommandOutcome.UNSUPPORTED: "the robot does not know this command",
}


def begin_order(
    session: Session, command: CommandRecord, modem: Modem, at: datetime, *, is_only: bool
) -> OutboxRecord:
    """Return the row of a command to one modem, added if it has none; nothing is sent yet."""
    known = query.outbox_of_command(session, command.id, modem.imei)
    if known is not None:
        return known
    return query.add_outbox(
        session,
        command.robot,
        "order",
        carrier=modem.carrier,
        imei=modem.imei,
        counter=next_counter(query.newest_counter(session, command.robot), at),
        document={
            "kind": command.kind.value,
            "number": command.number,
            "plan": command.plan_sha256,
            "is_only": is_only,
            "is_given_up": False,
            **repeating.not_sent(),
        },
        at=at,
        expires_at=command.expires_at,
        command=command.id,
    )


def is_surface(row: OutboxRecord) -> bool:
    """Tell whether a row is an order to surface, which no budget stops."""
    return row.kind == "order" and row.document["kind"] == CommandKind.SURFACE.value


def order_bytes(row: OutboxRecord, key: bytes, modem: Modem, *, ack_seen: bool) -> bytes:
    """Return the message that carries an order."""
    document = row.document
    return pack_order(
        CommandKind(document["kind"]),
        CommandNumber(document["number"]),
        row.expires_at,
        None if document["plan"] is None else PlanHash(document["plan"]),
        key,
        modem.system,
        row.counter,
        ack_seen=ack_seen,
    )


def is_due(row: OutboxRecord) -> bool:
    """Tell whether an order is to be sent now."""
    return not row.document["is_given_up"] and repeating.is_due(row.document)


def sent(session: Session, row: OutboxRecord, at: datetime) -> OutboxRecord:
    """Note that a gateway took an order."""
    level = "queued" if row.level == query.CREATED else row.level
    _note(session, row, CommandLevel.QUEUED, at)
    document = repeating.sent(row.document)
    return query.change_outbox(session, row.id, document=document, level=level)


def thrown_away(session: Session, row: OutboxRecord) -> OutboxRecord:
    """Note that the gateway's queue was emptied while the order may have been in it."""
    if not row.document["sends"]:
        return row
    return query.change_outbox(session, row.id, document=repeating.lost(row.document))


def reached(session: Session, row: OutboxRecord, at: datetime) -> OutboxRecord:
    """Note that the robot's modem fetched an order."""
    if row.level not in (query.CREATED, "queued"):
        return row
    _note(session, row, CommandLevel.RADIO, at)
    return query.change_outbox(session, row.id, level="radio")


def expired(session: Session, row: OutboxRecord, at: datetime) -> OutboxRecord:
    """Give an order up whose time has passed."""
    reason = "it was not answered in time"
    row = end_row(session, row.id, "expired", reason, at)
    _note(session, row, CommandLevel.EXPIRED, at, f"{reason}.")
    return row


def refused(session: Session, row: OutboxRecord, reason: str, at: datetime) -> OutboxRecord:
    """End an order that the gateway will never take; by radio it may still reach the robot.

    One that the gateway took before may still be answered, until it expires.
    """
    if row.document["sends"]:
        document = {**row.document, "is_given_up": True}
        return query.change_outbox(session, row.id, document=document, reason=reason)
    row = end_row(session, row.id, "refused", reason, at)
    if row.document["is_only"]:
        _note(session, row, CommandLevel.EXPIRED, at, reason)
    return row


def hear(
    session: Session, row: OutboxRecord, answers: Iterable[CommandAnswer], session_at: datetime
) -> OutboxRecord:
    """Note a session of the robot, and its answer if it gives one."""
    if session_at < row.created_at:
        return row
    for answer in answers:
        if answer.number == row.document["number"]:
            return _answered(session, row, answer.outcome, session_at)
    document = repeating.surfaced(row.document, session_at)
    if document == row.document:
        return row
    return query.change_outbox(session, row.id, document=document)


def _answered(
    session: Session, row: OutboxRecord, outcome: CommandOutcome, at: datetime
) -> OutboxRecord:
    if outcome is CommandOutcome.DONE:
        row = end_row(session, row.id, "applied", "", at, level="applied")
        _note(session, row, CommandLevel.APPLIED, at)
        return row
    reason = _REFUSALS.get(outcome, "the robot failed to do this")
    row = end_row(session, row.id, "refused", reason, at)
    _note(session, row, CommandLevel.REFUSED, at, reason)
    return row


def _note(
    session: Session, row: OutboxRecord, level: CommandLevel, at: datetime, reason: str = ""
) -> None:
    """Write the level down with the command too, in the same transaction."""
    if row.command is not None:
        note_level(session, row.command, level, at=at, carrier=row.carrier, reason=reason)
