"""What robots said of the targets that they follow."""

from collections.abc import Generator
from datetime import datetime

from sqlalchemy import Select, func, select
from sqlalchemy.orm import Session

from autonomy.tracking.phase import SpeedClass, TargetPhase
from db.query.fleet.robots import robot_key
from db.query.mission.target_span import EVERYTHING, TargetSpan
from db.record import same
from db.tables import Event, PlanReportRow
from db.target_tables import TargetReportRow
from robot_link.messages import OnboardPlanState, RobotId
from robot_link.report import TargetEstimate, TargetReport

_ROWS_AT_ONCE = 1000
_ENDED = (int(OnboardPlanState.DONE), int(OnboardPlanState.FAILED))
_NOT_HELD = (int(TargetPhase.LOST), int(TargetPhase.COASTING))


def newest_target_report(session: Session, robot: str) -> TargetReport | None:
    """Return the newest report of a robot on its target, ``None`` if it never followed one.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = session.scalar(
        select(TargetReportRow)
        .where(TargetReportRow.robot_key == robot_key(session, robot))
        .order_by(TargetReportRow.measured_at.desc())
        .limit(1)
    )
    return None if row is None else _report(row, robot)


def target_reports(
    session: Session,
    robot: str,
    wanted: TargetSpan = EVERYTHING,
    limit: int = 1000,
    *,
    newest: bool = True,
) -> list[TargetReport]:
    """Return reports in order of time.

    Args:
        session: A reading session.
        robot: Id of the robot.
        wanted: Which reports.
        limit: Most reports that are returned.
        newest: Whether the last of them are returned where there are more, else the first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    at = TargetReportRow.measured_at
    order = at.desc() if newest else at
    statement = _within(session, robot, wanted).order_by(order).limit(limit)
    rows = list(session.scalars(statement))
    return [_report(row, robot) for row in (reversed(rows) if newest else rows)]


def iterate_target_reports(
    session: Session, robot: str, wanted: TargetSpan = EVERYTHING
) -> Generator[TargetReport]:
    """Yield reports in order of time, without holding them all.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = _within(session, robot, wanted).order_by(TargetReportRow.measured_at)
    for row in session.scalars(statement.execution_options(yield_per=_ROWS_AT_ONCE)):
        yield _report(row, robot)


def lost_since(session: Session, robot: str, moment: datetime) -> datetime | None:
    """Return when a robot lost the target that it had not found again before a moment.

    Returns:
        ``None`` if its reports from before do not say that it had lost it.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    at, phase = TargetReportRow.measured_at, TargetReportRow.phase
    before = (TargetReportRow.robot_key == robot_key(session, robot), at < moment)
    held = session.scalar(select(func.max(at)).where(*before, phase.not_in(_NOT_HELD)))
    lost = select(func.min(at)).where(*before, phase == int(TargetPhase.LOST))
    return session.scalar(lost if held is None else lost.where(at > held))


def has_ended_within(session: Session, robot: str, since: datetime, until: datetime) -> bool:
    """Tell whether a robot said between two moments that a mission of it had ended.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    at = PlanReportRow.measured_at
    ended = select(at).where(
        PlanReportRow.robot_key == robot_key(session, robot),
        PlanReportRow.state.in_(_ENDED),
        at > since,
        at < until,
    )
    return session.scalar(ended.limit(1)) is not None


def newest_event_of(session: Session, robot: str, kinds: tuple[str, ...]) -> str | None:
    """Return the kind of a robot's newest event among these, ``None`` if there is none.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    return session.scalar(
        select(Event.kind)
        .where(Event.robot_key == robot_key(session, robot), Event.kind.in_(kinds))
        .order_by(Event.cursor.desc())
        .limit(1)
    )


def _within(session: Session, robot: str, wanted: TargetSpan) -> Select[TargetReportRow]:
    statement = select(TargetReportRow).where(
        TargetReportRow.robot_key == robot_key(session, robot)
    )
    if wanted.after is not None:
        statement = statement.where(TargetReportRow.measured_at > wanted.after)
    if wanted.until is not None:
        statement = statement.where(TargetReportRow.measured_at <= wanted.until)
    return statement


def _report(row: TargetReportRow, robot: str) -> TargetReport:
    true_ne_m = None
    if row.true_north_m is not None and row.true_east_m is not None:
        true_ne_m = (row.true_north_m, row.true_east_m)
    return same(
        TargetReport,
        row,
        robot=RobotId(robot),
        phase=TargetPhase(row.phase),
        position_ne_m=(row.north_m, row.east_m),
        hypotheses=tuple(_estimate(one) for one in row.hypotheses),
        nominal=(row.nominal_turn_rate_rad_s, row.nominal_acceleration_m_s2),
        command=(row.turn_rate_rad_s, row.acceleration_m_s2),
        true_ne_m=true_ne_m,
        speed_class=None if row.speed_class is None else SpeedClass(row.speed_class),
    )


def _estimate(numbers: list[float]) -> TargetEstimate:
    north_m, east_m, north_m_s, east_m_s, nn, ne, ee, weight = numbers
    return TargetEstimate((north_m, east_m), (north_m_s, east_m_s), (nn, ne, ee), weight)
