"""A command on its way by satellite as a row; the robot acts once however often it hears it."""

from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Final

from sqlalchemy.orm import Session

from db.query.mission.commands import CommandRecord
from db.query.satellite import outbox as query
from db.query.satellite.outbox import OutboxRecord
from db.query.satellite.satellite_messages import SatelliteMessage
from robot_link.messages import CommandKind, CommandLevel, CommandNumber, PlanHash
from robot_link.robot_program import CommandOutcome
from robot_link.satellite.order import pack_order
from robot_link.station.ground import next_counter
from server.command import state
from server.satellite import repeating
from server.satellite.emergency import EmergencyMessage
from server.satellite.ending import end_row, told
from server.satellite.modem import Modem
from server.satellite.row_kind import FIRST_PRIORITY, Means, RobotSession, RowKind

_PRIORITY: Final = 3
_LEAVES_SURFACE: Final = (CommandKind.HOLD, CommandKind.QUIET, CommandKind.PING)
_OVERTAKEN: Final = "a later order took its place"
_REFUSALS: Final = {
    CommandOutcome.NOT_NOW: "the robot cannot do this now",
    CommandOutcome.WRONG_PLAN: "the robot holds another plan",
    CommandOutcome.UNSUPPORTED: "the robot does not know this command",
}


def add_rows(
    session: Session, command: CommandRecord, modems: Sequence[Modem], *, is_only: bool
) -> None:
    """Add the rows of a command with the command itself; nothing is sent yet.

    Args:
        session: The transaction of the command.
        command: The command; to surface goes to every modem.
        modems: Of the robot, the preferred one first.
        is_only: Whether no other link carries it.
    """
    for modem in modems if command.kind is CommandKind.SURFACE else modems[:1]:
        add_row(session, command, modem, is_only=is_only)


def add_row(
    session: Session, command: CommandRecord, modem: Modem, *, is_only: bool
) -> OutboxRecord:
    """Return the row of a command to one modem, added if it has none."""
    known = query.outbox_of_command(session, command.id, modem.imei)
    if known is not None:
        return known
    at = command.created_at
    row = query.add_outbox(
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
    return told(session, row)


def emergency_message(
    command: CommandRecord, modem: Modem, key: bytes, on_taken: Callable[[], None]
) -> EmergencyMessage:
    """Return a command to surface that could not be written down: storage must not stop it."""
    counter = next_counter(0, command.created_at)
    kind, number = command.kind, command.number
    data = pack_order(kind, number, command.expires_at, None, key, modem.system, counter)
    return EmergencyMessage(modem, number, data, "surface order", on_taken)


def is_surface(row: OutboxRecord) -> bool:
    """Tell whether a row is a command to surface, which no budget stops."""
    return row.kind == "order" and row.document["kind"] == CommandKind.SURFACE.value


class CommandRows(RowKind):
    """Rows of commands, which have one part."""

    name = "order"

    def due(self, session: Session, row: OutboxRecord, now: datetime) -> tuple[int, ...]:
        """Return the one part if it is to be sent now."""
        del session, now
        is_due = not row.document["is_given_up"] and repeating.is_due(row.document)
        return (0,) if is_due else ()

    def pack(self, session: Session, row: OutboxRecord, means: Means) -> Sequence[bytes]:
        """Return the message that carries the command."""
        del session
        document = row.document
        data = pack_order(
            CommandKind(document["kind"]),
            CommandNumber(document["number"]),
            row.expires_at,
            None if document["plan"] is None else PlanHash(document["plan"]),
            means.key,
            means.modem.system,
            row.counter,
            ack_seen=means.ack_seen,
        )
        return (data,)

    def title(self, row: OutboxRecord, part: int) -> str:
        """Return what the message is."""
        del part
        return f"the {row.document['kind']} order"

    def taken(
        self, session: Session, row: OutboxRecord, message: SatelliteMessage, at: datetime
    ) -> OutboxRecord:
        """Note that a gateway took a command."""
        del message
        level = "queued" if row.level == query.CREATED else row.level
        _note(session, row, CommandLevel.QUEUED, at)
        document = repeating.sent(row.document)
        return query.change_outbox(session, row.id, document=document, level=level)

    def thrown_away(self, session: Session, row: OutboxRecord) -> None:
        """Have a command sent again that may have gone ahead into a queue that was emptied."""
        if row.document["sends"]:
            query.change_outbox(session, row.id, document=repeating.lost(row.document))

    def fetched(self, session: Session, row: OutboxRecord, at: datetime) -> OutboxRecord:
        """Note that the robot's modem fetched a command."""
        if row.level not in (query.CREATED, "queued"):
            return row
        _note(session, row, CommandLevel.RADIO, at)
        return query.change_outbox(session, row.id, level="radio")

    def expired(self, session: Session, row: OutboxRecord, at: datetime) -> OutboxRecord:
        """Give a command up whose time has passed."""
        reason = "it was not answered in time"
        row = end_row(session, row.id, "expired", reason, at)
        _note(session, row, CommandLevel.EXPIRED, at, f"{reason}.")
        return row

    def refused(
        self, session: Session, row: OutboxRecord, reason: str, at: datetime
    ) -> OutboxRecord:
        """End a command that the gateway will never take; by radio it may still reach the robot.

        One that the gateway took before may still be answered, until it expires.
        """
        if row.document["sends"]:
            document = {**row.document, "is_given_up": True}
            return query.change_outbox(session, row.id, document=document, reason=reason)
        row = end_row(session, row.id, "refused", reason, at)
        if row.document["is_only"]:
            _note(session, row, CommandLevel.EXPIRED, at, reason)
        return row

    def heard(self, session: Session, row: OutboxRecord, said: RobotSession) -> OutboxRecord:
        """Note a session of the robot, and its answer if it gives one."""
        if said.session_at < row.created_at:
            return row
        for answer in said.answers:
            if answer.number == row.document["number"]:
                return _answered(session, row, answer.outcome, said)
        document = repeating.surfaced(row.document, said.session_at)
        if document == row.document:
            return row
        return query.change_outbox(session, row.id, document=document)

    def priority(self, row: OutboxRecord) -> int:
        """Return the priority at the gateway; a robot is told to surface first."""
        return FIRST_PRIORITY if is_surface(row) else _PRIORITY

    def is_urgent(self, row: OutboxRecord) -> bool:
        """Tell whether it is to surface."""
        return is_surface(row)

    def fault_of(self, row: OutboxRecord) -> str:
        """Return what the operator calls it; an order to surface has an alarm of its own."""
        return "" if is_surface(row) else f"The {row.document['kind']} order"


def _answered(
    session: Session, row: OutboxRecord, outcome: CommandOutcome, said: RobotSession
) -> OutboxRecord:
    """End a row by the robot's answer, which proves that its modem fetched the order."""
    at = said.session_at
    if outcome is CommandOutcome.DONE:
        row = end_row(session, row.id, "applied", "", at, level="applied")
        _note(session, row, CommandLevel.APPLIED, at)
        return row
    if outcome is CommandOutcome.NOT_NOW and _is_overtaken(session, row, said):
        row = end_row(session, row.id, "superseded", _OVERTAKEN, at, level="radio")
        _note(session, row, CommandLevel.EXPIRED, at, _OVERTAKEN)
        return row
    reason = _REFUSALS.get(outcome, "the robot failed to do this")
    row = end_row(session, row.id, "refused", reason, at, level="radio")
    _note(session, row, CommandLevel.REFUSED, at, reason)
    return row


def _is_overtaken(session: Session, row: OutboxRecord, said: RobotSession) -> bool:
    """Tell whether the robot obeyed an order that was given later.

    One to surface stays wanted after a later order that left the robot on its course.
    """
    obeyed = {one.number for one in said.answers if one.outcome is CommandOutcome.DONE}
    return any(
        one.counter > row.counter
        and (not is_surface(row) or one.document["kind"] not in _LEAVES_SURFACE)
        and (one.level == "applied" or one.document["number"] in obeyed)
        for one in query.newest_outboxes(session, row.robot, row.kind, row.created_at)
    )


def _note(
    session: Session, row: OutboxRecord, level: CommandLevel, at: datetime, reason: str = ""
) -> None:
    """Write the level down with the command too, in the same transaction."""
    if row.command is not None:
        state.apply(session, row.command, level, at=at, carrier=row.carrier, reason=reason)
