"""Advice on the trim of robots, and who took it."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.identity import key_of, public_id
from db.query.robots import robot_key
from db.study_tables import TrimAdvice
from db.tables import Robot


@dataclass(frozen=True, slots=True)
class TrimAdviceRecord:
    """What the last dives say of a robot's trim."""

    id: str
    robot: str
    deployment: str
    trim_version: str
    """The version of the trim that it was worked out for, as an ``ETag``."""
    document: Mapping[str, Any]
    created_at: datetime
    created_by: str
    accepted_at: datetime | None
    accepted_by: str | None
    accepted_share: float | None


def add_advice(
    session: Session,
    robot: str,
    deployment: str,
    *,
    trim_version: str,
    document: Mapping[str, Any],
    at: datetime,
    by: str,
) -> TrimAdviceRecord:
    """Add an advice that nobody has taken yet.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = TrimAdvice(
        robot_key=robot_key(session, robot),
        deployment_key=key_of("deployment", deployment),
        trim_version=trim_version,
        document=dict(document),
        created_at=at,
        created_by=by,
    )
    session.add(row)
    session.flush()
    return _record(row, robot)


def get_advice(session: Session, advice: str) -> TrimAdviceRecord:
    """Return one advice.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = _row(session, advice)
    robot = session.scalars(select(Robot.id).where(Robot.key == row.robot_key)).one()
    return _record(row, robot)


def accept_advice(session: Session, advice: str, share: float, *, at: datetime, by: str) -> None:
    """Note that someone took an advice.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = _row(session, advice)
    row.accepted_at, row.accepted_by, row.accepted_share = at, by, share


def _row(session: Session, advice: str) -> TrimAdvice:
    row = session.get(TrimAdvice, key_of("advice", advice))
    if row is None:
        raise UnknownIdError("advice", advice)
    return row


def _record(row: TrimAdvice, robot: str) -> TrimAdviceRecord:
    return TrimAdviceRecord(
        id=public_id("advice", row.key),
        robot=robot,
        deployment=public_id("deployment", row.deployment_key),
        trim_version=row.trim_version,
        document=row.document,
        created_at=row.created_at,
        created_by=row.created_by,
        accepted_at=row.accepted_at,
        accepted_by=row.accepted_by,
        accepted_share=row.accepted_share,
    )
