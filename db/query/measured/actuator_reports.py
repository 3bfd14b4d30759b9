"""What robots said of how their actuators follow."""

from collections.abc import Generator
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.onboard_tables import ActuatorReportRow
from db.query.fleet.robots import robot_key
from db.record import same
from robot_link.messages import RobotId
from robot_link.report import ActuatorFollowing, ActuatorReport

_ROWS_AT_ONCE = 1000


def newest_actuator_report(session: Session, robot: str) -> ActuatorReport | None:
    """Return the newest report of a robot on its actuators, ``None`` if it never told one.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    at = ActuatorReportRow.measured_at
    row = session.scalar(
        select(ActuatorReportRow)
        .where(ActuatorReportRow.robot_key == robot_key(session, robot))
        .order_by(at.desc())
        .limit(1)
    )
    return None if row is None else _report(row, robot)


def iterate_actuator_reports(
    session: Session, robot: str, start: datetime, end: datetime | None
) -> Generator[ActuatorReport]:
    """Yield reports of a stretch of time, both ends included, in order of time.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    at = ActuatorReportRow.measured_at
    statement = (
        select(ActuatorReportRow)
        .where(ActuatorReportRow.robot_key == robot_key(session, robot), at >= start)
        .order_by(at)
        .execution_options(yield_per=_ROWS_AT_ONCE)
    )
    if end is not None:
        statement = statement.where(at <= end)
    for row in session.scalars(statement):
        yield _report(row, robot)


def _report(row: ActuatorReportRow, robot: str) -> ActuatorReport:
    return same(
        ActuatorReport,
        row,
        robot=RobotId(robot),
        mass=ActuatorFollowing(
            row.mass_rate_share,
            row.mass_rate_std_octaves,
            row.mass_delay_s,
            row.mass_delay_std_s,
            row.mass_learned_age_s,
        ),
        pump=ActuatorFollowing(
            row.pump_rate_share,
            row.pump_rate_std_octaves,
            row.pump_delay_s,
            row.pump_delay_std_s,
            row.pump_learned_age_s,
        ),
        stuck=tuple(filter(None, row.stuck.split(","))),
    )
