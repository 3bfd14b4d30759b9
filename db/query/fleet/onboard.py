"""What is kept ashore of a robot's own memory: parameters as it said them, and its log files."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import delete, select
from sqlalchemy.orm import Session

from db.identity import public_id
from db.onboard_tables import RobotLogRow, RobotParameterRow
from db.query.change import row_and_robot, row_of
from db.query.fleet.robots import robot_key
from db.record import same, values


@dataclass(frozen=True, slots=True)
class ParameterRecord:
    """One parameter as the robot said it last."""

    name: str
    value: float
    type: str
    """``real32``, ``int32``, ``uint8`` ..."""
    read_at: datetime


@dataclass(frozen=True, slots=True)
class LogRecord:
    """One file on board as it was listed last, and what was fetched of it."""

    id: str
    robot: str
    path: str
    size: int
    """Bytes when it was listed."""
    listed_at: datetime
    fetched_size: int | None
    """Bytes that were fetched, ``None`` before the first time."""
    sha256: str | None
    fetched_at: datetime | None


def keep_parameters(session: Session, robot: str, found: Sequence[ParameterRecord]) -> None:
    """Replace everything that is known of a robot's parameters.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    session.execute(delete(RobotParameterRow).where(RobotParameterRow.robot_key == key))
    for place, one in enumerate(found):
        session.add(RobotParameterRow(robot_key=key, place=place, **values(one)))


def keep_parameter(session: Session, robot: str, found: ParameterRecord) -> None:
    """Keep one parameter as the robot says that it is now.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    row = session.get(RobotParameterRow, (key, found.name))
    if row is None:
        row = RobotParameterRow(robot_key=key, name=found.name, place=2**16)
        session.add(row)
    row.value, row.type, row.read_at = found.value, found.type, found.read_at


def list_parameters(session: Session, robot: str) -> list[ParameterRecord]:
    """Return a robot's parameters in its own order."""
    rows = session.scalars(
        select(RobotParameterRow)
        .where(RobotParameterRow.robot_key == robot_key(session, robot))
        .order_by(RobotParameterRow.place, RobotParameterRow.name)
    )
    return [ParameterRecord(row.name, row.value, row.type, row.read_at) for row in rows]


def keep_listing(session: Session, robot: str, sizes: dict[str, int], at: datetime) -> None:
    """Keep which files a robot says it has; one that is gone is forgotten unless it was fetched.

    Args:
        session: The transaction.
        robot: Id of the robot.
        sizes: Bytes of each file by its path.
        at: When it said so.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    known = {
        row.path: row
        for row in session.scalars(select(RobotLogRow).where(RobotLogRow.robot_key == key))
    }
    for path, row in known.items():
        if path not in sizes and row.sha256 is None:
            session.delete(row)
    for path, size in sizes.items():
        row = known.get(path)
        if row is None:
            row = RobotLogRow(robot_key=key, path=path)
            session.add(row)
        row.size, row.listed_at = size, at


def note_fetched(session: Session, log: str, *, size: int, sha256: str, at: datetime) -> LogRecord:
    """Note that a file is ashore, whole.

    Raises:
        UnknownIdError: If there is no such file.
    """
    row = row_of(session, RobotLogRow, "log", log)
    row.fetched_size, row.sha256, row.fetched_at = size, sha256, at
    session.flush()
    return get_log(session, log)


def list_logs(session: Session, robot: str) -> list[LogRecord]:
    """Return the files of a robot by their paths."""
    rows = session.scalars(
        select(RobotLogRow)
        .where(RobotLogRow.robot_key == robot_key(session, robot))
        .order_by(RobotLogRow.path)
    )
    return [_record(row, robot) for row in rows]


def get_log(session: Session, log: str) -> LogRecord:
    """Return one file.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(*row_and_robot(session, RobotLogRow, "log", log))


def _record(row: RobotLogRow, robot: str) -> LogRecord:
    return same(LogRecord, row, id=public_id("log", row.key), robot=robot)
