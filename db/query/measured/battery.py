"""What robots said of their battery, beside what they did then."""

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from sqlalchemy import BigInteger, select, type_coerce
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray, IntArray
from db.query.fleet.robots import robot_key
from db.tables import STATE_CHANNELS, StateRow
from robot_link.messages import RobotMode

_ROWS_AT_ONCE = 8192


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


def charge_told(
    session: Session, robot: str, start: datetime, end: datetime | None
) -> tuple[IntArray, FloatArray]:
    """Return when a robot told its charge, us, and the share of it, shape ``(n,)`` each.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    at, fraction = StateRow.measured_at, STATE_CHANNELS["battery_fraction"]
    statement = select(type_coerce(at, BigInteger), fraction).where(
        StateRow.robot_key == robot_key(session, robot), at >= start, fraction.is_not(None)
    )
    if end is not None:
        statement = statement.where(at <= end)
    found = session.execute(statement.order_by(at).execution_options(yield_per=_ROWS_AT_ONCE))
    parts = [
        np.array([tuple(row) for row in part], dtype=np.float64) for part in found.partitions()
    ]
    table = np.concatenate(parts) if parts else np.empty((0, 2))
    return table[:, 0].astype(np.int64), table[:, 1]


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
