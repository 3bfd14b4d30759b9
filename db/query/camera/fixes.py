"""Where cameras found robots."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import func, select, update
from sqlalchemy.orm import Session

from db.camera_tables import CameraFixRow
from db.query.fleet.robots import robot_key
from db.record import same, values
from robot_link.camera.fix import CameraFix
from robot_link.messages import RobotId


@dataclass(frozen=True, slots=True)
class FixRecord:
    """A fix as it is kept."""

    fix: CameraFix
    received_at: datetime
    sent_at: datetime | None
    """When it was sent to the robot; None where it was not."""

    @property
    def robot(self) -> RobotId:
        """Whose."""
        return self.fix.robot


def add_fixes(session: Session, fixes: Iterable[tuple[CameraFix, datetime]]) -> None:
    """Keep fixes with the moments at which the station had them; one of the same moment is new.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    for fix, received_at in fixes:
        columns = fix_columns(FixRecord(fix, received_at, None))
        session.merge(CameraFixRow(robot_key=robot_key(session, fix.robot), **columns))


def fix_columns(record: FixRecord) -> dict[str, Any]:
    """Return the columns of a fix's row, all but its robot's key."""
    north, east, depth = record.fix.ned_m
    own = values(record.fix, but=("robot", "ned_m", "calibration"))
    return {
        **own,
        **{name: list(own[name]) for name in _LISTS},
        "received_at": record.received_at,
        "sent_at": record.sent_at,
        "north_m": north,
        "east_m": east,
        "depth_m": depth,
        "calibration_key": record.fix.calibration,
    }


def mark_sent(session: Session, robot: str, measured_at: datetime, at: datetime) -> None:
    """Note that a fix was sent to its robot.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    session.execute(
        update(CameraFixRow)
        .where(
            CameraFixRow.robot_key == robot_key(session, robot),
            CameraFixRow.measured_at == measured_at,
        )
        .values(sent_at=at)
    )


def list_fixes(
    session: Session,
    robot: str,
    start: datetime | None = None,
    end: datetime | None = None,
    *,
    max_points: int = 1000,
) -> list[FixRecord]:
    """Return the fixes of a robot from ``start`` to ``end``, in order of time.

    Where there are more than ``max_points``, each so many-th is returned, the newest among them.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    where = [CameraFixRow.robot_key == robot_key(session, robot)]
    if start is not None:
        where.append(CameraFixRow.measured_at >= start)
    if end is not None:
        where.append(CameraFixRow.measured_at <= end)
    count = session.scalar(select(func.count()).select_from(CameraFixRow).where(*where)) or 0
    statement = select(CameraFixRow).where(*where)
    each = -(-count // max(max_points, 1))
    if each > 1:
        number = func.row_number().over(order_by=CameraFixRow.measured_at.desc()).label("number")
        numbered = select(CameraFixRow.measured_at, number).where(*where).subquery()
        chosen = select(numbered.c.measured_at).where(numbered.c.number % each == 1)
        statement = statement.where(CameraFixRow.measured_at.in_(chosen))
    rows = session.scalars(statement.order_by(CameraFixRow.measured_at))
    return [_record(row, robot) for row in rows]


def iterate_fixes(
    session: Session, robot: str, start: datetime, end: datetime | None
) -> Iterator[FixRecord]:
    """Yield the fixes of a robot from ``start`` to ``end``, in order of time.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    where = [
        CameraFixRow.robot_key == robot_key(session, robot),
        CameraFixRow.measured_at >= start,
    ]
    if end is not None:
        where.append(CameraFixRow.measured_at <= end)
    statement = select(CameraFixRow).where(*where).order_by(CameraFixRow.measured_at)
    for row in session.scalars(statement.execution_options(yield_per=1000)):
        yield _record(row, robot)


def newest_fix(
    session: Session,
    robot: str,
    *,
    is_taken: bool = False,
    at: datetime | None = None,
    heard_by: datetime | None = None,
) -> FixRecord | None:
    """Return the newest fix of a robot.

    Args:
        session: A reading session.
        robot: Whose.
        is_taken: Whether those that were refused do not count.
        at: Later ones do not count; None for no limit.
        heard_by: Those that the station had later do not count; None for no limit.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = select(CameraFixRow).where(CameraFixRow.robot_key == robot_key(session, robot))
    if is_taken:
        statement = statement.where(CameraFixRow.quality != "refused")
    if at is not None:
        statement = statement.where(CameraFixRow.measured_at <= at)
    if heard_by is not None:
        statement = statement.where(CameraFixRow.received_at <= heard_by)
    row = session.scalar(statement.order_by(CameraFixRow.measured_at.desc()).limit(1))
    return None if row is None else _record(row, robot)


_LISTS = ("covariance_m2", "considered_covariance_m2", "cameras", "tags")


def _record(row: CameraFixRow, robot: str) -> FixRecord:
    fix = same(
        CameraFix,
        row,
        robot=RobotId(robot),
        ned_m=(row.north_m, row.east_m, row.depth_m),
        calibration=row.calibration_key,
        **{name: tuple(getattr(row, name)) for name in _LISTS},
    )
    return FixRecord(fix, row.received_at, row.sent_at)
