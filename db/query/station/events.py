"""Everything that happened, in order, with a cursor that survives a restart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.query.fleet.robots import robot_key
from db.tables import Event, Robot


@dataclass(frozen=True, slots=True)
class EventRecord:
    """One thing that happened."""

    cursor: int
    at: datetime
    kind: str
    """Dotted name for scripts, such as ``plan.on_board``."""
    level: str
    """``info``, ``watch``, ``warning`` or ``critical``."""
    robot: str | None
    text: str
    """One sentence for a person."""
    data: Mapping[str, Any]


def add_event(
    session: Session,
    at: datetime,
    kind: str,
    text: str,
    *,
    level: str = "info",
    robot: str | None = None,
    data: Mapping[str, Any] | None = None,
) -> int:
    """Add an event in the transaction that also holds what it tells of; return its cursor."""
    row = Event(
        at=at,
        kind=kind,
        level=level,
        robot_key=None if robot is None else robot_key(session, robot),
        text=text,
        data=dict(data or {}),
    )
    session.add(row)
    session.flush()
    return row.cursor


def newest_of_kinds(session: Session, robot: str, kinds: Sequence[str]) -> EventRecord | None:
    """Return the newest event of a robot that is of one of these kinds."""
    found = session.execute(
        select(Event, Robot.id)
        .join(Robot, Event.robot_key == Robot.key)
        .where(Robot.id == robot, Event.kind.in_(kinds))
        .order_by(Event.cursor.desc())
        .limit(1)
    ).one_or_none()
    return None if found is None else _record(*found)


def events_after(
    session: Session,
    cursor: int,
    *,
    robot: str | None = None,
    kinds: Sequence[str] = (),
    limit: int = 500,
) -> list[EventRecord]:
    """Return the events that follow a cursor, the oldest first; of these kinds, if any."""
    statement = (
        select(Event, Robot.id)
        .outerjoin(Robot, Event.robot_key == Robot.key)
        .where(Event.cursor > cursor)
        .order_by(Event.cursor)
        .limit(limit)
    )
    if robot is not None:
        statement = statement.where(Event.robot_key == robot_key(session, robot))
    if kinds:
        statement = statement.where(Event.kind.in_(kinds))
    return [_record(row, name) for row, name in session.execute(statement)]


def newest_events(
    session: Session,
    *,
    robot: str | None = None,
    period: Period | None = None,
    kinds: Sequence[str] = (),
    limit: int = 100,
) -> list[EventRecord]:
    """Return the last events, the oldest of them first."""
    statement = (
        select(Event, Robot.id)
        .outerjoin(Robot, Event.robot_key == Robot.key)
        .order_by(Event.cursor.desc())
        .limit(limit)
    )
    if robot is not None:
        statement = statement.where(Event.robot_key == robot_key(session, robot))
    if period is not None:
        statement = statement.where(period.holds(Event.at))
    if kinds:
        statement = statement.where(Event.kind.in_(kinds))
    return [_record(row, name) for row, name in session.execute(statement)][::-1]


def last_cursor(session: Session) -> int:
    """Return the cursor of the newest event, 0 before the first."""
    return session.scalar(select(func.max(Event.cursor))) or 0


def _record(row: Event, robot: str | None) -> EventRecord:
    return EventRecord(row.cursor, row.at, row.kind, row.level, robot, row.text, row.data)
