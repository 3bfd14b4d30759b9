"""The raw journal: every packet that crossed a link, as it was."""

from collections.abc import Generator
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.query.fleet.robots import robot_key
from db.tables import RawFrameRow, Robot
from robot_link.messages import RawFrame, RobotId

_ROWS_AT_ONCE = 2000


@dataclass(frozen=True, slots=True)
class JournalRange:
    """Which packets are asked for."""

    robot: str | None = None
    """Only those of this robot; packets of nobody known belong to none."""
    start: datetime | None = None
    """First moment, by the station's clock."""
    end: datetime | None = None
    """Last moment, by the station's clock."""
    incoming_only: bool = False


def iterate_frames(session: Session, wanted: JournalRange) -> Generator[RawFrame]:
    """Yield packets in the order in which the station had them.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = select(RawFrameRow, Robot.id).outerjoin(Robot, RawFrameRow.robot_key == Robot.key)
    if wanted.robot is not None:
        statement = statement.where(RawFrameRow.robot_key == robot_key(session, wanted.robot))
    if wanted.start is not None:
        statement = statement.where(RawFrameRow.at >= wanted.start)
    if wanted.end is not None:
        statement = statement.where(RawFrameRow.at <= wanted.end)
    if wanted.incoming_only:
        statement = statement.where(RawFrameRow.outgoing.is_(False))
    last = 0
    while True:
        page = session.execute(
            statement.where(RawFrameRow.key > last).order_by(RawFrameRow.key).limit(_ROWS_AT_ONCE)
        ).all()
        for row, robot in page:
            yield _frame(row, robot)
        if len(page) < _ROWS_AT_ONCE:
            return
        last = page[-1][0].key
        session.expunge_all()


def _frame(row: RawFrameRow, robot: str | None) -> RawFrame:
    return RawFrame(
        robot=None if robot is None else RobotId(robot),
        carrier=row.carrier,
        outgoing=row.outgoing,
        data=row.data,
        at=row.at,
        robot_at=row.robot_at,
        arrived_at=row.arrived_at,
    )
