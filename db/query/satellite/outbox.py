"""What robots are told by satellite: one row a plan or order, and its messages in ``messages``."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import Select, func, select
from sqlalchemy.orm import Session

from db.identity import key_of, public_id
from db.link_tables import OutboxRow
from db.query.change import row_and_robot, set_fields
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import Robot

CREATED = "created"
"""Level of what no gateway has taken yet."""
_CHANGEABLE = {"state", "level", "document", "ended_at", "reason", "expires_at"}


@dataclass(frozen=True, slots=True)
class OutboxRecord:
    """One thing that a robot is told by satellite."""

    id: str
    robot: str
    kind: str
    """``plan``, ``order`` or ``withdrawal``."""
    transfer: str | None
    command: str | None
    carrier: str
    imei: str
    state: str
    """``open``, ``held`` (something faster is tried), or how it ended: ``applied``, ``refused``,
    ``expired``, ``superseded``, ``withdrawn``, ``sent`` (as often as it was to be; the robot gave
    no answer)."""
    level: str
    """``created, queued, radio, applied``: the highest that was proved."""
    counter: int
    """Strictly increasing per robot; by it the robot tells new from old."""
    document: Mapping[str, Any]
    """How far it is, as whoever sends it keeps it."""
    created_at: datetime
    expires_at: datetime
    ended_at: datetime | None
    reason: str


def add_outbox(
    session: Session,
    robot: str,
    kind: str,
    *,
    carrier: str,
    imei: str,
    counter: int,
    document: Mapping[str, Any],
    at: datetime,
    expires_at: datetime,
    transfer: str | None = None,
    command: str | None = None,
) -> OutboxRecord:
    """Add a row before the first byte leaves.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = OutboxRow(
        robot_key=robot_key(session, robot),
        kind=kind,
        transfer_key=None if transfer is None else key_of("transfer", transfer),
        command_key=None if command is None else key_of("command", command),
        carrier=carrier,
        imei=imei,
        state="open",
        level=CREATED,
        counter=counter,
        document=dict(document),
        created_at=at,
        expires_at=expires_at,
        reason="",
    )
    session.add(row)
    session.flush()
    return _record(row, robot)


def change_outbox(session: Session, outbox: str, **changes: Any) -> OutboxRecord:  # noqa: ANN401 - the fields differ in type
    """Change ``state, level, document, expires_at, ended_at`` or ``reason``.

    Raises:
        UnknownIdError: If there is no such row.
    """
    row, robot = row_and_robot(session, OutboxRow, "outbox", outbox)
    set_fields(row, "an outbox row", changes, _CHANGEABLE)
    session.flush()
    return _record(row, robot)


def get_outbox(session: Session, outbox: str) -> OutboxRecord:
    """Return one row.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(*row_and_robot(session, OutboxRow, "outbox", outbox))


def open_outbox(session: Session, robot: str | None = None) -> list[OutboxRecord]:
    """Return the rows that have not ended, the oldest first."""
    statement = _rows().where(OutboxRow.ended_at.is_(None)).order_by(OutboxRow.key)
    if robot is not None:
        statement = statement.where(Robot.id == robot)
    return [_record(row, name) for row, name in session.execute(statement)]


def outbox_of_transfer(session: Session, transfer: str) -> OutboxRecord | None:
    """Return the row of a transfer, if it was ever to go by satellite."""
    found = session.execute(
        _rows().where(OutboxRow.transfer_key == key_of("transfer", transfer))
    ).one_or_none()
    return None if found is None else _record(*found)


def outbox_of_command(session: Session, command: str, imei: str) -> OutboxRecord | None:
    """Return the row of a command to one modem."""
    found = session.execute(
        _rows().where(OutboxRow.command_key == key_of("command", command), OutboxRow.imei == imei)
    ).one_or_none()
    return None if found is None else _record(*found)


def newest_outbox(session: Session, robot: str, kind: str) -> OutboxRecord | None:
    """Return the newest row of a kind for a robot."""
    found = session.execute(
        _rows()
        .where(Robot.id == robot, OutboxRow.kind == kind)
        .order_by(OutboxRow.key.desc())
        .limit(1)
    ).one_or_none()
    return None if found is None else _record(*found)


def newest_outboxes(session: Session, robot: str, kind: str, since: datetime) -> list[OutboxRecord]:
    """Return the rows of a kind for a robot that were added since a moment, the newest first."""
    found = session.execute(
        _rows()
        .where(Robot.id == robot, OutboxRow.kind == kind, OutboxRow.created_at >= since)
        .order_by(OutboxRow.key.desc())
    )
    return [_record(row, name) for row, name in found]


def outboxes_before(session: Session, row: OutboxRecord, since: datetime) -> list[OutboxRecord]:
    """Return the rows of the same robot that were added before one and since a moment."""
    found = session.execute(
        _rows().where(
            Robot.id == row.robot,
            OutboxRow.key < key_of("outbox", row.id),
            OutboxRow.created_at > since,
        )
    )
    return [_record(row, name) for row, name in found]


def newest_counter(session: Session, robot: str) -> int:
    """Return the greatest counter that a robot was told, 0 before the first."""
    statement = select(func.max(OutboxRow.counter)).where(
        OutboxRow.robot_key == robot_key(session, robot)
    )
    return session.scalar(statement) or 0


def _rows() -> Select[OutboxRow, str]:
    return select(OutboxRow, Robot.id).join(Robot, OutboxRow.robot_key == Robot.key)


def _record(row: OutboxRow, robot: str) -> OutboxRecord:
    return same(
        OutboxRecord,
        row,
        id=public_id("outbox", row.key),
        robot=robot,
        transfer=None if row.transfer_key is None else public_id("transfer", row.transfer_key),
        command=None if row.command_key is None else public_id("command", row.command_key),
    )
