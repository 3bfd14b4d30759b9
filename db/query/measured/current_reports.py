"""What robots believed of the water's current."""

from datetime import datetime

import numpy as np
from sqlalchemy import select
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray
from db.current_tables import CurrentReportRow
from db.query.fleet.robots import robot_key
from db.record import same
from robot_link.messages import RobotId
from robot_link.report import CurrentReport


def newest_current_report(
    session: Session, robot: str, before: datetime | None = None
) -> CurrentReport | None:
    """Return the newest report of a robot on the current, ``None`` if it never told one.

    Args:
        session: A reading session.
        robot: Id of the robot.
        before: Only reports up to this moment count.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    at = CurrentReportRow.measured_at
    statement = select(CurrentReportRow).where(
        CurrentReportRow.robot_key == robot_key(session, robot)
    )
    if before is not None:
        statement = statement.where(at <= before)
    row = session.scalar(statement.order_by(at.desc()).limit(1))
    return None if row is None else _report(row, robot)


def current_reports(
    session: Session, robot: str, start: datetime | None, end: datetime
) -> list[CurrentReport]:
    """Return reports from the last one before ``start`` to ``end``, in order of time.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    at = CurrentReportRow.measured_at
    statement = select(CurrentReportRow).where(
        CurrentReportRow.robot_key == robot_key(session, robot), at <= end
    )
    first = None if start is None else newest_current_report(session, robot, start)
    if first is not None:
        statement = statement.where(at >= first.measured_at)
    return [_report(row, robot) for row in session.scalars(statement.order_by(at))]


def believed_currents(
    session: Session, robot: str, start: datetime | None, end: datetime
) -> FloatArray:
    """Return ``current_reports`` as ``autonomy.estimation.smoother.finished_dives`` takes them.

    Returns:
        Time s, north, east and standard deviation m/s of each, shape ``(m, 4)``.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    rows = [
        (one.measured_at.timestamp(), *one.current_ne_m_s, one.current_std_m_s)
        for one in current_reports(session, robot, start, end)
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _report(row: CurrentReportRow, robot: str) -> CurrentReport:
    return same(
        CurrentReport,
        row,
        robot=RobotId(robot),
        current_ne_m_s=(row.north_m_s, row.east_m_s),
        current_std_m_s=row.std_m_s,
    )
