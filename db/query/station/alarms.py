"""Alarms as the database keeps them; their life cycle is ``server.base.alarm_board``'s."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import ColumnElement, func, or_, select
from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.identity import key_of, public_id
from db.query.change import row_of
from db.query.fleet.robots import robot_key
from db.record import same, values
from db.tables import Alarm, Robot


@dataclass(frozen=True, slots=True)
class AlarmRecord:
    """One alarm and where it stands in its life cycle (ISA-18.2)."""

    id: str
    cause: str
    """What raised it, such as ``storage``; at most one open alarm for each robot and cause."""
    robot: str | None
    level: str
    """One of ``autonomy.channel.ALARM_LEVELS``."""
    text: str
    state: str
    """``unacknowledged``; ``acknowledged``: still so, but seen; ``returned``: normal again, but
    not seen; ``shelved``, ``suppressed`` or ``out_of_service``: it stands aside; ``closed``:
    normal again and seen."""
    raised_at: datetime
    acknowledged_at: datetime | None = None
    acknowledged_by: str | None = None
    cleared_at: datetime | None = None
    rule: str | None = None
    """The rule that raised it; ``None`` of an alarm that is raised where its cause is found."""
    action: str = ""
    """What a person may do about it."""
    count: int = 1
    """How often it was raised since ``first_raised_at``."""
    first_raised_at: datetime | None = None
    """``None``: since ``raised_at``."""
    note: str = ""
    """The newest note; the earlier ones are events."""
    noted_by: str | None = None
    assigned_to: str | None = None
    """Who looks after it."""
    assigned_by: str | None = None
    """Who said so last, also that nobody does any more."""
    shelved_until: datetime | None = None
    shelved_by: str | None = None


def save_alarm(session: Session, alarm: AlarmRecord) -> None:
    """Insert or replace an alarm; its id was given by its owner.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    save_alarms(session, [alarm])


def save_alarms(session: Session, alarms: Sequence[AlarmRecord]) -> None:
    """Insert or replace alarms, none of them twice; see ``save_alarm``."""
    keys = [key_of("alarm", alarm.id) for alarm in alarms]
    known = {row.key: row for row in session.scalars(select(Alarm).where(Alarm.key.in_(keys)))}
    robots = {one: robot_key(session, one) for one in {alarm.robot for alarm in alarms} if one}
    for key, alarm in zip(keys, alarms, strict=True):
        told = values(alarm, but=["id", "robot"])
        told["robot_key"] = None if alarm.robot is None else robots[alarm.robot]
        if key not in known:
            session.add(Alarm(key=key, **told))
            continue
        for name, value in told.items():
            setattr(known[key], name, value)


def open_alarms(session: Session) -> list[AlarmRecord]:
    """Return every alarm that is not closed, the oldest first."""
    statement = (
        select(Alarm, Robot.id)
        .outerjoin(Robot, Alarm.robot_key == Robot.key)
        .where(Alarm.state != "closed")
        .order_by(Alarm.key)
    )
    return [_record(row, robot) for row, robot in session.execute(statement)]


def closed_alarms(
    session: Session, limit: int, robots: Collection[str] | None = None
) -> list[AlarmRecord]:
    """Return the last closed alarms, of these robots where they are given, the newest first."""
    of_them = () if robots is None else (Robot.id.in_(robots),)
    return _newest(session, limit, Alarm.state == "closed", *of_them)


def get_alarm(session: Session, alarm: str) -> AlarmRecord:
    """Return an alarm, open or closed.

    Raises:
        UnknownIdError: If there is none.
    """
    row = row_of(session, Alarm, "alarm", alarm)
    robot = session.scalar(select(Robot.id).where(Robot.key == row.robot_key))
    return _record(row, robot)


def alarms_of(session: Session, robot: str, period: Period, limit: int) -> list[AlarmRecord]:
    """Return the alarms of a robot that were raised in a period, the newest first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    of_robot = Alarm.robot_key == robot_key(session, robot)
    return _newest(session, limit, of_robot, period.holds(Alarm.raised_at))


def alarms_standing_at(session: Session, robot: str, at: datetime, limit: int) -> list[AlarmRecord]:
    """Return the alarms of a robot and of the station that stood at a moment, the newest first.

    They had been raised last before it, and became normal after it or not yet. Of one that was
    raised several times only the last time is known here.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    return _newest(
        session,
        limit,
        or_(Alarm.robot_key == robot_key(session, robot), Alarm.robot_key.is_(None)),
        Alarm.raised_at <= at,
        or_(Alarm.cleared_at.is_(None), Alarm.cleared_at > at),
    )


def _newest(session: Session, limit: int, *conditions: ColumnElement[bool]) -> list[AlarmRecord]:
    statement = (
        select(Alarm, Robot.id)
        .outerjoin(Robot, Alarm.robot_key == Robot.key)
        .where(*conditions)
        .order_by(Alarm.key.desc())
        .limit(limit)
    )
    return [_record(row, robot) for row, robot in session.execute(statement)]


def last_alarm_number(session: Session) -> int:
    """Return the number in the newest alarm's id, 0 before the first."""
    return session.scalar(select(func.max(Alarm.key))) or 0


def _record(row: Alarm, robot: str | None) -> AlarmRecord:
    return same(AlarmRecord, row, id=public_id("alarm", row.key), robot=robot)
