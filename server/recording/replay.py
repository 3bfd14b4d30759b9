"""Builds the rows of telemetry anew from the raw journal, and holds them against what is stored.

The journal is the only source: each packet is decoded as the link decodes it, at the moment at
which the station had it, and what no robot can have measured is left out as it was then.
"""

from collections.abc import Generator, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeGuard

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.ingest import Telemetry, append_telemetry
from db.query.journal import JournalRange, iterate_frames
from db.query.robots import RobotRecord, add_robot, list_robots
from db.store import Store
from db.tables import Base, PlanReportRow, Robot, SampleRow, StateRow
from robot_link.mavlink.codec import STATION_COMPONENT, STATION_SYSTEM, Codec
from robot_link.mavlink.decode import Value, decoded
from robot_link.messages import (
    OnboardPlanState,
    PlanReport,
    RawFrame,
    Sample,
    StateReport,
)
from server.service.believable import fault_of_sample, fault_of_state

TABLES: tuple[type[Base], ...] = (StateRow, SampleRow, PlanReportRow)
"""What is built from the journal."""
_ROWS_AT_ONCE = 5000
_NOT_KEPT = (OnboardPlanState.RECEIVING, OnboardPlanState.REFUSED)
"""What a robot says of an offer concerns its upload alone."""


@dataclass(frozen=True, slots=True)
class TableComparison:
    """One table as it is stored and as the journal gives it."""

    table: str
    same: int
    only_stored: int
    """Rows that the journal does not give."""
    only_replayed: int
    """Rows that the journal gives and that are not stored."""


def replayed_values(
    frames: Iterable[RawFrame], robots: Mapping[str, RobotRecord], speed: float
) -> Generator[Telemetry]:
    """Decode what robots said, in order.

    Args:
        frames: Incoming packets of the journal.
        robots: Every robot by its id.
        speed: Seconds of the robots' clock per second of the wall, as it was then.
    """
    codec = Codec(STATION_SYSTEM, STATION_COMPONENT)
    for frame in frames:
        robot = None if frame.robot is None else robots.get(frame.robot)
        if robot is None:
            continue
        for message in codec.unpack(frame.data).messages:
            if message.get_srcSystem() != robot.system_id:
                continue
            try:
                value = decoded(message, robot.id, frame.at)
            except ValueError:
                continue
            if _is_kept(value, robot, frame, speed):
                yield value


def _is_kept(
    value: Value, robot: RobotRecord, frame: RawFrame, speed: float
) -> TypeGuard[StateReport | Sample | PlanReport]:
    match value:
        case StateReport():
            return fault_of_state(value, robot.site, frame.at, speed) is None
        case Sample():
            return fault_of_sample(value, robot.site, frame.at, speed) is None
        case PlanReport():
            return value.state not in _NOT_KEPT
        case _:
            return False


def replay_into(source: Session, target: Store, speed: float) -> int:
    """Fill an empty database with the robots of another and what its journal says of them.

    Args:
        source: One moment of the database with the journal.
        target: The empty database.
        speed: Seconds of the robots' clock per second of the wall, as it was then.

    Returns:
        Packets that were read.
    """
    robots: dict[str, RobotRecord] = {robot.id: robot for robot in list_robots(source)}
    for robot in robots.values():
        target.change(lambda session, robot=robot: add_robot(session, robot)).result()
    packets = 0

    def counted() -> Generator[RawFrame]:
        nonlocal packets
        for frame in iterate_frames(source, JournalRange(incoming_only=True)):
            packets += 1
            yield frame

    batch: list[Telemetry] = []
    for value in replayed_values(counted(), robots, speed):
        batch.append(value)
        if len(batch) == _ROWS_AT_ONCE:
            _keep(target, batch)
            batch = []
    _keep(target, batch)
    return packets


def _keep(target: Store, batch: list[Telemetry]) -> None:
    target.change(lambda session: append_telemetry(session, batch)).result()


def compare(source: Session, target: Store) -> list[TableComparison]:
    """Hold the rows of robots that talk over links against those of a replay."""
    with target.read() as replayed:
        return [_compare_table(source, replayed, table) for table in TABLES]


def _compare_table(stored: Session, replayed: Session, table: type[Base]) -> TableComparison:
    here, there = _rows(stored, table), _rows(replayed, table)
    return TableComparison(
        table.__tablename__, len(here & there), len(here - there), len(there - here)
    )


def _rows(session: Session, table: type[Base]) -> set[tuple[Any, ...]]:
    columns = [column for column in table.__table__.columns if column.name != "robot_key"]
    statement = (
        select(Robot.id, *columns)
        .join(Robot, table.__table__.c.robot_key == Robot.key)
        .where(Robot.system_id.is_not(None))
    )
    return {tuple(row) for row in session.execute(statement)}
