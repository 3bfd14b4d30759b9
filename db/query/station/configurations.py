"""Versions of tunable models; a version is never changed, only followed by another."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import func, or_, select
from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.fault import UnknownIdError
from db.identity import key_of, public_id
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import Configuration, Robot


@dataclass(frozen=True, slots=True)
class ConfigurationRecord:
    """One version of one tunable model."""

    id: str
    kind: str
    robot: str | None
    """The robot that it is for, or ``None`` for every robot without a version of its own."""
    value: Mapping[str, Any]
    changed_at: datetime
    changed_by: str


def add_configuration(
    session: Session,
    kind: str,
    robot: str | None,
    value: Mapping[str, Any],
    *,
    at: datetime,
    by: str,
) -> ConfigurationRecord:
    """Add a version.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = Configuration(
        kind=kind,
        robot_key=None if robot is None else robot_key(session, robot),
        value=dict(value),
        changed_at=at,
        changed_by=by,
    )
    session.add(row)
    session.flush()
    return _record(row, robot)


def newest_configuration(
    session: Session, kind: str, robot: str | None
) -> ConfigurationRecord | None:
    """Return the newest version for exactly this robot, or exactly for all where ``None``.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = None if robot is None else robot_key(session, robot)
    row = session.scalar(
        select(Configuration)
        .where(Configuration.kind == kind, Configuration.robot_key.is_not_distinct_from(key))
        .order_by(Configuration.key.desc())
        .limit(1)
    )
    return None if row is None else _record(row, robot)


def robots_with_own(session: Session, kind: str) -> frozenset[str]:
    """Return the robots for which a version of a kind was saved."""
    found = session.scalars(
        select(Robot.id)
        .join(Configuration, Configuration.robot_key == Robot.key)
        .where(Configuration.kind == kind)
        .distinct()
    )
    return frozenset(found)


def get_configuration(session: Session, configuration: str) -> ConfigurationRecord:
    """Return one version, however old.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    found = session.execute(
        select(Configuration, Robot.id)
        .outerjoin(Robot, Configuration.robot_key == Robot.key)
        .where(Configuration.key == key_of("config", configuration))
    ).one_or_none()
    if found is None:
        raise UnknownIdError("configuration", configuration)
    return _record(*found)


def configuration_history(
    session: Session, kind: str, robot: str | None, limit: int = 100
) -> list[ConfigurationRecord]:
    """Return the versions for exactly this robot, the newest first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = None if robot is None else robot_key(session, robot)
    rows = session.scalars(
        select(Configuration)
        .where(Configuration.kind == kind, Configuration.robot_key.is_not_distinct_from(key))
        .order_by(Configuration.key.desc())
        .limit(limit)
    )
    return [_record(row, robot) for row in rows]


def configuration_at(
    session: Session, kind: str, robot: str, at: datetime
) -> ConfigurationRecord | None:
    """Return the version that held for a robot at a moment: its own, else that for all.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    for key, name in ((robot_key(session, robot), robot), (None, None)):
        row = session.scalar(
            select(Configuration)
            .where(
                Configuration.kind == kind,
                Configuration.robot_key.is_not_distinct_from(key),
                Configuration.changed_at <= at,
            )
            .order_by(Configuration.key.desc())
            .limit(1)
        )
        if row is not None:
            return _record(row, name)
    return None


def configurations_in_force(
    session: Session, robot: str, period: Period
) -> list[ConfigurationRecord]:
    """Return each version that held in a time for a robot or for all, the oldest first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    is_about = or_(Configuration.robot_key == key, Configuration.robot_key.is_(None))
    before = (
        select(func.max(Configuration.key))
        .where(is_about, Configuration.changed_at < period.first)
        .group_by(Configuration.kind, Configuration.robot_key)
    )
    rows = session.scalars(
        select(Configuration)
        .where(
            is_about,
            or_(period.holds(Configuration.changed_at), Configuration.key.in_(before)),
        )
        .order_by(Configuration.key)
    )
    return [_record(row, None if row.robot_key is None else robot) for row in rows]


def _record(row: Configuration, robot: str | None) -> ConfigurationRecord:
    return same(ConfigurationRecord, row, id=public_id("config", row.key), robot=robot)
