"""What dives and stays at the surface told of the current."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from db.current_tables import CurrentObservationRow
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import StateRow
from robot_link.messages import RobotId, RobotMode


@dataclass(frozen=True, slots=True)
class ObservationRecord:
    """One observation of the current."""

    robot: RobotId
    started_at: datetime
    ended_at: datetime
    is_surface: bool
    document: Mapping[str, Any]
    """Its numbers, what was predicted of it, and the ``water`` in whose frame they are."""


@dataclass(frozen=True, slots=True)
class ReportedFix:
    """What one state report says of where the robot was seen from outside."""

    measured_at: datetime
    north_m: float
    east_m: float
    position_std_m: float
    has_fix: bool
    mode: RobotMode | None


def add_observation(session: Session, record: ObservationRecord) -> bool:
    """Keep an observation; return whether it was not there yet.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, record.robot)
    known = select(CurrentObservationRow.key).where(
        CurrentObservationRow.robot_key == key,
        CurrentObservationRow.ended_at == record.ended_at,
        CurrentObservationRow.started_at == record.started_at,
    )
    if session.scalar(known) is not None:
        return False
    session.add(
        CurrentObservationRow(
            robot_key=key,
            started_at=record.started_at,
            ended_at=record.ended_at,
            is_surface=record.is_surface,
            document=dict(record.document),
        )
    )
    session.flush()
    return True


def newest_observations(
    session: Session, robots: Sequence[str], limit: int, water: str
) -> list[ObservationRecord]:
    """Return the newest observations of some robots in a water, in the order of their ends.

    Args:
        session: A reading session.
        robots: Their ids.
        limit: Most to return.
        water: What ``document["water"]`` is; an observation without it counts for any.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    names = {robot_key(session, one): RobotId(one) for one in robots}
    kept_water = CurrentObservationRow.document["water"].as_string()
    statement = (
        select(CurrentObservationRow)
        .where(CurrentObservationRow.robot_key.in_(names))
        .where(or_(kept_water.is_(None), kept_water == water))
        .order_by(CurrentObservationRow.ended_at.desc(), CurrentObservationRow.key.desc())
        .limit(limit)
    )
    rows = session.scalars(statement)
    return [same(ObservationRecord, row, robot=names[row.robot_key]) for row in rows][::-1]


def fixes_between(
    session: Session, robot: str, start: datetime | None, end: datetime, limit: int
) -> list[ReportedFix]:
    """Return what a robot's reports from ``start`` to ``end`` say of fixes, in order of time.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(
            StateRow.measured_at,
            StateRow.north_m,
            StateRow.east_m,
            StateRow.position_std_m,
            StateRow.has_fix,
            StateRow.mode,
        )
        .where(StateRow.robot_key == robot_key(session, robot), StateRow.measured_at <= end)
        .order_by(StateRow.measured_at)
        .limit(limit)
    )
    if start is not None:
        statement = statement.where(StateRow.measured_at >= start)
    return [
        ReportedFix(at, north, east, std, has_fix, None if mode is None else RobotMode(mode))
        for at, north, east, std, has_fix, mode in session.execute(statement)
        if north is not None and east is not None
    ]
