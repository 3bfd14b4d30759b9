"""Measurements of fields."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy import BigInteger, ColumnElement, Select, and_, func, select, type_coerce
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from db.map_tables import SmoothedSample
from db.query.robots import robot_key
from db.tables import SampleCount, SampleRow
from robot_link.messages import LogId, RobotId, Sample

_ROWS_AT_ONCE = 10_000
"""Rows that are held as such: as arrays they take a tenth of the memory."""


@dataclass(frozen=True, slots=True)
class SampleColumns:
    """Measurements of one variable as arrays, in the order in which they were taken."""

    position_ned: FloatArray
    """Where the robot believed to be, shape ``(n, 3)``, m."""
    position_std_m: FloatArray
    """What it said of that, shape ``(n,)``."""
    smoothed_ned: FloatArray
    """Where it most probably was: smoothed where that was done, else as it believed, ``(n, 3)``."""
    smoothed_std_m: FloatArray
    """Shape ``(n,)``; never above ``position_std_m``."""
    value: FloatArray
    """Shape ``(n,)``, in the variable's unit."""
    measured_at_us: IntArray
    """Shape ``(n,)``, microseconds from the epoch."""
    robot: IntArray
    """Which of the robots that were asked for took it, shape ``(n,)``."""
    log: IntArray
    """Shape ``(n,)``."""
    sequence: IntArray
    """Shape ``(n,)``; unique within its robot's log."""

    def __len__(self) -> int:
        return len(self.value)

    @property
    def is_smoothed(self) -> BoolArray:
        """Whether smoothing located a sample better, shape ``(n,)``."""
        return self.smoothed_std_m < self.position_std_m

    def chosen(self, rows: BoolArray) -> "SampleColumns":
        """Return some of the measurements, by a mask of shape ``(n,)``."""
        return SampleColumns(**{one.name: getattr(self, one.name)[rows] for one in fields(self)})


def sample_columns(
    session: Session,
    robots: str | Sequence[str],
    variable: str,
    start: datetime | None = None,
    end: datetime | None = None,
    log: int | None = None,
) -> SampleColumns:
    """Return the measurements of one variable, both ends of the time range included.

    Args:
        session: A reading session.
        robots: Id of the robot that took them, or of several, whose samples are then in one order
            of time.
        variable: Key of the variable.
        start: First moment, ``None`` for the beginning.
        end: Last moment, ``None`` for now.
        log: Only those of this log.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    named = (robots,) if isinstance(robots, str) else tuple(robots)
    keys = [robot_key(session, robot) for robot in named]
    statement = (
        _with_smoothed()
        .where(SampleRow.robot_key.in_(keys), SampleRow.variable == variable)
        .where(*_between(start, end, log))
        .order_by(SampleRow.measured_at, SampleRow.robot_key, SampleRow.log, SampleRow.sequence)
    )
    numbers, names = _arrays(session, statement)
    order = np.argsort(keys)
    place = order[np.searchsorted(np.asarray(keys)[order], names[:, 1])] if keys else names[:, 1]
    return SampleColumns(
        position_ned=numbers[:, :3],
        position_std_m=numbers[:, 3],
        smoothed_ned=numbers[:, 4:7],
        smoothed_std_m=numbers[:, 7],
        value=numbers[:, 8],
        measured_at_us=names[:, 0],
        robot=place.astype(np.int64),
        log=names[:, 2],
        sequence=names[:, 3],
    )


def _with_smoothed() -> Select[*tuple[Any, ...]]:
    """Select where samples were taken, as believed and as smoothed, then value and names."""
    better = SmoothedSample
    return select(
        SampleRow.north_m,
        SampleRow.east_m,
        SampleRow.depth_m,
        SampleRow.position_std_m,
        func.coalesce(better.north_m, SampleRow.north_m),
        func.coalesce(better.east_m, SampleRow.east_m),
        func.coalesce(better.depth_m, SampleRow.depth_m),
        func.coalesce(better.position_std_m, SampleRow.position_std_m),
        SampleRow.value,
        type_coerce(SampleRow.measured_at, BigInteger),
        SampleRow.robot_key,
        SampleRow.log,
        SampleRow.sequence,
    ).outerjoin(
        better,
        and_(
            better.robot_key == SampleRow.robot_key,
            better.log == SampleRow.log,
            better.sequence == SampleRow.sequence,
        ),
    )


def _between(
    start: datetime | None, end: datetime | None, log: int | None
) -> list[ColumnElement[bool]]:
    """Return what holds for samples of a time, both ends included, and of a log."""
    conditions: list[ColumnElement[bool]] = []
    if start is not None:
        conditions.append(SampleRow.measured_at >= start)
    if end is not None:
        conditions.append(SampleRow.measured_at <= end)
    if log is not None:
        conditions.append(SampleRow.log == log)
    return conditions


def _arrays(session: Session, statement: Select[*tuple[Any, ...]]) -> tuple[FloatArray, IntArray]:
    """Return numbers, shape ``(n, 9)``, and names, shape ``(n, 4)``, of ``_with_smoothed``."""
    numbers, names = np.empty((0, 9)), np.empty((0, 4), dtype=np.int64)
    found = session.execute(statement.execution_options(yield_per=_ROWS_AT_ONCE))
    parts = [
        (
            np.array([row[:9] for row in rows], dtype=np.float64),
            np.array([row[9:] for row in rows], dtype=np.int64),
        )
        for rows in found.partitions()
    ]
    if parts:
        numbers, names = (np.concatenate(one) for one in zip(*parts, strict=True))
    return numbers, names


def count_received(session: Session, robots: Sequence[str], variable: str, after: datetime) -> int:
    """Return how many measurements of a variable of some robots came after a moment.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    keys = [robot_key(session, robot) for robot in robots]
    return session.scalars(
        select(func.count())
        .select_from(SampleRow)
        .where(
            SampleRow.robot_key.in_(keys),
            SampleRow.variable == variable,
            SampleRow.received_at > after,
        )
    ).one()


@dataclass(frozen=True, slots=True)
class SampleRecord:
    """One measurement as it was kept."""

    measured_at: datetime
    variable: str
    value: float
    position_ned: tuple[float, float, float]
    position_std_m: float


def iterate_samples(
    session: Session,
    robot: str,
    *,
    start: datetime | None = None,
    end: datetime | None = None,
    log: int | None = None,
) -> Generator[SampleRecord]:
    """Yield the measurements of all variables in order of time, without holding them all.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(SampleRow)
        .where(SampleRow.robot_key == robot_key(session, robot))
        .where(*_between(start, end, log))
        .order_by(SampleRow.measured_at, SampleRow.log, SampleRow.sequence)
        .execution_options(yield_per=1000)
    )
    for row in session.scalars(statement):
        position = (row.north_m, row.east_m, row.depth_m)
        yield SampleRecord(row.measured_at, row.variable, row.value, position, row.position_std_m)


def sampled_variables(
    session: Session,
    robot: str,
    *,
    start: datetime | None = None,
    end: datetime | None = None,
    log: int | None = None,
) -> dict[str, int]:
    """Return how many measurements of each variable a robot has, of a time and a log.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(SampleRow.variable, func.count())
        .where(SampleRow.robot_key == robot_key(session, robot))
        .where(*_between(start, end, log))
        .group_by(SampleRow.variable)
    )
    return {row[0]: row[1] for row in session.execute(statement)}


def kept_counts(session: Session, robot: str, *, of_deployment: bool = False) -> dict[str, int]:
    """Return how many measurements of each variable a robot has, without counting them.

    Args:
        session: A reading session.
        robot: Id of the robot.
        of_deployment: Only those of its live deployment.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(SampleCount.variable, func.sum(SampleCount.samples))
        .where(SampleCount.robot_key == robot_key(session, robot))
        .group_by(SampleCount.variable)
    )
    if of_deployment:
        statement = statement.where(SampleCount.is_live)
    return {row[0]: int(row[1]) for row in session.execute(statement)}


def newest_samples(session: Session, robot: str) -> list[Sample]:
    """Return the newest measurement of each variable of a robot.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    samples: list[Sample] = []
    for variable in kept_counts(session, robot):
        row = session.scalars(
            select(SampleRow)
            .where(SampleRow.robot_key == key, SampleRow.variable == variable)
            .order_by(SampleRow.measured_at.desc())
            .limit(1)
        ).one()
        samples.append(
            Sample(
                robot=RobotId(robot),
                log=LogId(row.log),
                sequence=row.sequence,
                variable=row.variable,
                value=row.value,
                position_ned=(row.north_m, row.east_m, row.depth_m),
                position_std_m=row.position_std_m,
                measured_at=row.measured_at,
                received_at=row.received_at,
            )
        )
    return samples
