"""Rules of alarm that people changed, version by version, and those that are out of service."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import AlarmOutOfService, AlarmRuleVersion, Robot


@dataclass(frozen=True, slots=True)
class RuleVersionRecord:
    """What a rule was from a moment on."""

    key: int
    rule: str
    document: Mapping[str, Any] | None
    """``None``: as delivered, or gone where it was the team's own."""
    changed_at: datetime
    changed_by: str


@dataclass(frozen=True, slots=True)
class OutOfServiceRecord:
    """A rule that asks nobody for some time."""

    key: int
    rule: str
    robot: str | None
    """``None`` for every robot."""
    reason: str
    begun_at: datetime
    begun_by: str


def add_version(
    session: Session, rule: str, document: Mapping[str, Any] | None, at: datetime, by: str
) -> RuleVersionRecord:
    """Keep what a rule is from now on."""
    kept = None if document is None else dict(document)
    row = AlarmRuleVersion(rule=rule, document=kept, changed_at=at, changed_by=by)
    session.add(row)
    session.flush()
    return same(RuleVersionRecord, row)


def newest_versions(session: Session) -> list[RuleVersionRecord]:
    """Return the newest version of each rule that was ever changed."""
    newest = select(func.max(AlarmRuleVersion.key)).group_by(AlarmRuleVersion.rule)
    rows = session.scalars(select(AlarmRuleVersion).where(AlarmRuleVersion.key.in_(newest)))
    return [same(RuleVersionRecord, row) for row in rows]


def list_versions(session: Session, rule: str) -> list[RuleVersionRecord]:
    """Return every version of a rule, the newest first."""
    statement = (
        select(AlarmRuleVersion)
        .where(AlarmRuleVersion.rule == rule)
        .order_by(AlarmRuleVersion.key.desc())
    )
    return [same(RuleVersionRecord, row) for row in session.scalars(statement)]


def begin_out_of_service(
    session: Session, rule: str, robot: str | None, reason: str, at: datetime, by: str
) -> OutOfServiceRecord:
    """Keep that a rule is out of service.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = None if robot is None else robot_key(session, robot)
    row = AlarmOutOfService(rule=rule, robot_key=key, reason=reason, begun_at=at, begun_by=by)
    session.add(row)
    session.flush()
    return OutOfServiceRecord(row.key, rule, robot, reason, at, by)


def end_out_of_service(session: Session, key: int, at: datetime, by: str) -> None:
    """Keep that a rule is in service again."""
    row = session.get_one(AlarmOutOfService, key)
    row.ended_at, row.ended_by = at, by


def list_out_of_service(session: Session) -> list[OutOfServiceRecord]:
    """Return what is out of service now, the oldest first."""
    statement = (
        select(AlarmOutOfService, Robot.id)
        .outerjoin(Robot, AlarmOutOfService.robot_key == Robot.key)
        .where(AlarmOutOfService.ended_at.is_(None))
        .order_by(AlarmOutOfService.key)
    )
    return [same(OutOfServiceRecord, row, robot=robot) for row, robot in session.execute(statement)]
