"""What robots said of their battery, beside what they did then."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.query.fleet.robots import robot_key
from db.tables import STATE_CHANNELS, StateRow
from robot_link.messages import RobotMode


@dataclass(frozen=True, slots=True)
class BatteryReading:
    """One word of a robot on its battery."""

    measured_at: datetime
    mode: RobotMode
    fraction: float
    """Of the full battery."""


def battery_readings(
    session: Session, robot: str, after: datetime | None, limit: int
) -> list[BatteryReading]:
    """Return what a robot said of its battery after a moment, in order of time.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    fraction = STATE_CHANNELS["battery_fraction"]
    statement = (
        select(StateRow.measured_at, StateRow.mode, fraction)
        .where(
            StateRow.robot_key == robot_key(session, robot),
            StateRow.mode.is_not(None),
            fraction.is_not(None),
        )
        .order_by(StateRow.measured_at)
        .limit(limit)
    )
    if after is not None:
        statement = statement.where(StateRow.measured_at > after)
    return [
        BatteryReading(at, RobotMode(mode), value)
        for at, mode, value in session.execute(statement)
        if mode is not None
    ]


def first_place(session: Session, robot: str, since: datetime) -> tuple[float, float] | None:
    """Return where a robot was at its first fix from a moment on, north and east, m."""
    row = session.execute(
        select(StateRow.north_m, StateRow.east_m)
        .where(
            StateRow.robot_key == robot_key(session, robot),
            StateRow.measured_at >= since,
            StateRow.has_fix.is_(True),
            StateRow.north_m.is_not(None),
            StateRow.east_m.is_not(None),
        )
        .order_by(StateRow.measured_at)
        .limit(1)
    ).first()
    if row is None or row.north_m is None or row.east_m is None:
        return None
    return row.north_m, row.east_m
