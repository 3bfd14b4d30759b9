"""Everything that happened, in order, with a cursor that survives a restart."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import ColumnElement, Select, func, select
from sqlalchemy.orm import Session

from db.actor import actor_of
from db.deployment_span import Period
from db.query.fleet.robots import robot_key
from db.query.station.event_chain import link
from db.tables import Event, Robot


@dataclass(frozen=True, slots=True)
class EventRecord:
    """One thing that happened."""

    cursor: int
    at: datetime
    kind: str
    """Dotted name for scripts, such as ``plan.on_board``."""
    level: str
    """One of ``autonomy.channel.ALARM_LEVELS``."""
    robot: str | None
    text: str
    """One sentence for a person."""
    data: Mapping[str, Any]
    by: str | None
    """Who caused it; ``None`` where the station or a robot did."""
    by_kind: str | None
    """``person``, ``script`` or ``command line``."""


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
    """Add an event in the transaction that also holds what it tells of; return its cursor.

    Who caused it is whoever the transaction is for (``db.actor``).
    """
    actor = actor_of(session)
    row = Event(
        at=at,
        kind=kind,
        level=level,
        robot_key=None if robot is None else robot_key(session, robot),
        text=text,
        data=dict(data or {}),
        actor=None if actor is None else actor.name,
        actor_kind=None if actor is None else actor.kind,
    )
    link(session, row)
    if actor is not None:
        actor.events += 1
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


@dataclass(frozen=True, slots=True)
class EventFilter:
    """Which events are wanted; what is not given takes all."""

    robot: str | None = None
    kinds: Sequence[str] = ()
    period: Period | None = None
    by: str | None = None
    """Only what this person, script or command line caused."""
    by_anybody: bool = False
    """Only what a person, a script or a command line caused."""
    text: str = ""
    """A part of the sentence or of the kind, in any case."""
    before: int | None = None
    """Only what is older than this cursor."""
    robots: frozenset[str] | None = None
    """Only what belongs to one of these robots."""


ALL_EVENTS = EventFilter()


def events_after(
    session: Session, cursor: int, wanted: EventFilter = ALL_EVENTS, limit: int = 500
) -> list[EventRecord]:
    """Return the events that follow a cursor, the oldest first."""
    statement = _wanted(session, wanted).where(Event.cursor > cursor).order_by(Event.cursor)
    return [_record(row, name) for row, name in session.execute(statement.limit(limit))]


def newest_events(
    session: Session, wanted: EventFilter = ALL_EVENTS, limit: int = 100
) -> list[EventRecord]:
    """Return the last events, the oldest of them first."""
    statement = _wanted(session, wanted).order_by(Event.cursor.desc()).limit(limit)
    return [_record(row, name) for row, name in session.execute(statement)][::-1]


def events_by_time(
    session: Session, wanted: EventFilter, limit: int, *conditions: ColumnElement[bool]
) -> list[EventRecord]:
    """Return the last moments' events, the newest moment first: what was told late stands before.

    ``conditions`` are about the columns of ``db.tables.Event``.
    """
    statement = _wanted(session, wanted).where(*conditions)
    newest_first = (Event.at.desc(), Event.cursor.desc())
    rows = session.execute(statement.order_by(*newest_first).limit(limit))
    return [_record(row, name) for row, name in rows]


def actors(session: Session, robots: Collection[str] | None = None) -> list[str]:
    """Return everybody who caused an event, of these robots where they are given, by name."""
    names: list[str] = []
    # From name to name: one look into the index for each, however many events each caused.
    while (name := session.scalar(_first_actor(names, robots))) is not None:
        names.append(name)
    return names


def _first_actor(after: Sequence[str], robots: Collection[str] | None) -> Select[str | None]:
    statement = select(Event.actor).where(Event.actor.is_not(None))
    if after:
        statement = statement.where(Event.actor > after[-1])
    if robots is not None:
        of_robots = select(Robot.key).where(Robot.id.in_(robots))
        statement = statement.where(Event.robot_key.in_(of_robots))
    return statement.order_by(Event.actor).limit(1)


def _wanted(session: Session, wanted: EventFilter) -> Select[Event, str]:
    """Return a query for the events that a filter lets through, with the names of their robots."""
    statement = select(Event, Robot.id).outerjoin(Robot, Event.robot_key == Robot.key)
    if wanted.robot is not None:
        statement = statement.where(Event.robot_key == robot_key(session, wanted.robot))
    if wanted.kinds:
        statement = statement.where(Event.kind.in_(wanted.kinds))
    if wanted.period is not None:
        statement = statement.where(wanted.period.holds(Event.at))
    if wanted.by is not None:
        statement = statement.where(Event.actor == wanted.by)
    if wanted.by_anybody:
        statement = statement.where(Event.actor.is_not(None))
    if wanted.text:
        sought = wanted.text.lower()
        said = func.lower(Event.text).contains(sought, autoescape=True)
        statement = statement.where(said | func.lower(Event.kind).contains(sought, autoescape=True))
    if wanted.robots is not None:
        statement = statement.where(Robot.id.in_(wanted.robots))
    if wanted.before is not None:
        statement = statement.where(Event.cursor < wanted.before)
    return statement


def last_cursor(session: Session) -> int:
    """Return the cursor of the newest event, 0 before the first."""
    return session.scalar(select(func.max(Event.cursor))) or 0


def _record(row: Event, robot: str | None) -> EventRecord:
    return EventRecord(
        row.cursor,
        row.at,
        row.kind,
        row.level,
        robot,
        row.text,
        row.data,
        row.actor,
        row.actor_kind,
    )
