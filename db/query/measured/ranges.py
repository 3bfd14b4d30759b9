"""Acoustic ranges, good and bad."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.link_tables import RangeRow
from db.query.fleet.robots import robot_key
from db.record import same, values


@dataclass(frozen=True, slots=True)
class RangeRecord:
    """One range between a robot's acoustic modem and another."""

    robot: str
    peer: int
    at: datetime
    travel_time_s: float | None
    range_m: float | None
    is_valid: bool
    reason: str
    """Why it is not valid; empty when it is."""


def add_range(session: Session, measured: RangeRecord) -> None:
    """Keep a range.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, measured.robot)
    session.add(RangeRow(robot_key=key, **values(measured, but=["robot"])))


def list_ranges(session: Session, robot: str, limit: int = 1000) -> list[RangeRecord]:
    """Return the newest ranges of a robot, the newest first."""
    statement = (
        select(RangeRow)
        .where(RangeRow.robot_key == robot_key(session, robot))
        .order_by(RangeRow.key.desc())
        .limit(limit)
    )
    return [same(RangeRecord, row, robot=robot) for row in session.scalars(statement)]
