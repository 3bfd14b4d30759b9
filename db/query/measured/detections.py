"""Acoustic tags that robots heard."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.ingest import insert_new
from db.query.fleet.robots import robot_key
from db.record import same
from db.tables import Robot
from db.tag_tables import DetectionRow, ReceiverReportRow
from robot_link.messages import RobotId
from robot_link.report import ReceiverReport


@dataclass(frozen=True, slots=True)
class DetectionRecord:
    """One transmission of a tag that was heard."""

    robot: str
    receiver: str
    tag: str
    measured_at: datetime
    sensor: float | None = None
    sensor_unit: str | None = None
    north_m: float | None = None
    """None where nobody knows where the receiver was."""
    east_m: float | None = None
    depth_m: float | None = None
    position_std_m: float | None = None
    tag_name: str | None = None
    tag_serial: str | None = None
    station: str | None = None


_COLUMNS = tuple(
    getattr(DetectionRow, name) for name in DetectionRecord.__dataclass_fields__ if name != "robot"
)


def detections(
    session: Session,
    robots: Sequence[str],
    tag: str | None = None,
    start: datetime | None = None,
    end: datetime | None = None,
) -> list[DetectionRecord]:
    """Return what robots heard from ``start`` to ``end``, both included, in order of time.

    Args:
        session: A reading session.
        robots: Their ids.
        tag: Only this transmitter; by default all.
        start: By default the beginning.
        end: By default the end.
    """
    at = DetectionRow.measured_at
    statement = (
        select(Robot.id, *_COLUMNS)
        .join(Robot, Robot.key == DetectionRow.robot_key)
        .where(Robot.id.in_(robots))
        .order_by(at)
    )
    if tag is not None:
        statement = statement.where(DetectionRow.tag == tag)
    if start is not None:
        statement = statement.where(at >= start)
    if end is not None:
        statement = statement.where(at <= end)
    return [DetectionRecord(*row) for row in session.execute(statement)]


def add_detections(
    session: Session, robot: str, rows: Iterable[Sequence[Mapping[str, Any]]]
) -> int:
    """Keep imported detections, block by block; those that are there already change nothing.

    Args:
        session: A writing session.
        robot: Who heard them.
        rows: Blocks of columns of ``DetectionRow``, without the robot.

    Returns:
        How many were new.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    return sum(
        insert_new(session, DetectionRow, [{**row, "robot_key": key} for row in some])
        for some in rows
    )


def newest_receiver_report(session: Session, robot: str) -> ReceiverReport | None:
    """Return the newest report of a robot on its tag receiver, ``None`` if it never told one.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    row = session.scalar(
        select(ReceiverReportRow)
        .where(ReceiverReportRow.robot_key == robot_key(session, robot))
        .order_by(ReceiverReportRow.measured_at.desc())
        .limit(1)
    )
    return None if row is None else same(ReceiverReport, row, robot=RobotId(robot))
