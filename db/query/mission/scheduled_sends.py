"""Plans that wait at the station to be sent."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db.identity import key_of, public_id
from db.query.change import row_and_robot, row_of, set_fields
from db.query.fleet.robots import robot_key
from db.query.station.events import last_cursor
from db.record import same
from db.schedule_tables import ScheduledSendRow
from db.tables import Robot

_KIND = "schedule"
_CHANGEABLE = frozenset({"state", "due_at", "sent_at", "ended_at", "reason"})


@dataclass(frozen=True, slots=True)
class ScheduledSend:
    """One plan that waits at the station to be sent."""

    id: str
    robot: str
    plan: str
    state: str
    """``waiting, sent, done, expired, cancelled, withdrawn, failed``."""
    condition: Mapping[str, Any]
    cursor: int
    route: str
    start: bool
    confirmed: bool
    created_at: datetime
    created_by: str
    expires_at: datetime
    due_at: datetime | None
    sent_at: datetime | None
    ended_at: datetime | None
    reason: str


def add_scheduled_send(
    session: Session,
    plan: str,
    robot: str,
    *,
    condition: Mapping[str, Any],
    route: str,
    start: bool,
    confirmed: bool,
    at: datetime,
    by: str,
    expires_at: datetime,
) -> ScheduledSend:
    """Add a plan that waits from now on.

    Raises:
        UnknownIdError: If there is no such robot or plan.
    """
    row = ScheduledSendRow(
        robot_key=robot_key(session, robot),
        plan_key=key_of("plan", plan),
        state="waiting",
        condition=dict(condition),
        cursor=last_cursor(session),
        route=route,
        start=start,
        confirmed=confirmed,
        created_at=at,
        created_by=by,
        expires_at=expires_at,
        reason="",
    )
    session.add(row)
    session.flush()
    return get_scheduled_send(session, public_id(_KIND, row.key))


def change_scheduled_send(session: Session, schedule: str, **changes: object) -> ScheduledSend:
    """Change ``state, due_at, sent_at, ended_at`` or ``reason``.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = row_of(session, ScheduledSendRow, _KIND, schedule)
    set_fields(row, "a scheduled send", changes, _CHANGEABLE)
    session.flush()
    return get_scheduled_send(session, schedule)


def get_scheduled_send(session: Session, schedule: str) -> ScheduledSend:
    """Return one.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(*row_and_robot(session, ScheduledSendRow, _KIND, schedule))


def open_scheduled_sends(session: Session, robot: str | None = None) -> list[ScheduledSend]:
    """Return those that have not ended, the oldest first."""
    statement = (
        select(ScheduledSendRow, Robot.id)
        .join(Robot, ScheduledSendRow.robot_key == Robot.key)
        .where(ScheduledSendRow.ended_at.is_(None))
        .order_by(ScheduledSendRow.key)
    )
    if robot is not None:
        statement = statement.where(Robot.id == robot)
    return [_record(row, name) for row, name in session.execute(statement)]


def newest_scheduled_sends(session: Session, robot: str, limit: int = 20) -> list[ScheduledSend]:
    """Return those of a robot, the newest first."""
    statement = (
        select(ScheduledSendRow, Robot.id)
        .join(Robot, ScheduledSendRow.robot_key == Robot.key)
        .where(Robot.id == robot)
        .order_by(ScheduledSendRow.key.desc())
        .limit(limit)
    )
    return [_record(row, name) for row, name in session.execute(statement)]


def sent_times(session: Session, robot: str, since: datetime) -> list[datetime]:
    """Return when plans were sent to a robot by themselves since a moment, the oldest first."""
    statement = (
        select(ScheduledSendRow.sent_at)
        .where(
            ScheduledSendRow.robot_key == robot_key(session, robot),
            ScheduledSendRow.sent_at > since,
        )
        .order_by(ScheduledSendRow.sent_at)
    )
    return [one for one in session.scalars(statement) if one is not None]


def waits_for_plan(session: Session, plan: str) -> int:
    """Return how many open ones would send a plan."""
    statement = (
        select(func.count())
        .select_from(ScheduledSendRow)
        .where(
            ScheduledSendRow.plan_key == key_of("plan", plan),
            ScheduledSendRow.ended_at.is_(None),
        )
    )
    return session.scalar(statement) or 0


def _record(row: ScheduledSendRow, robot: str) -> ScheduledSend:
    return same(
        ScheduledSend,
        row,
        id=public_id(_KIND, row.key),
        robot=robot,
        plan=public_id("plan", row.plan_key),
    )
