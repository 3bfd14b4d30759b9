"""Measurements of fields."""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from sqlalchemy import (
    BigInteger,
    ColumnElement,
    ScalarSelect,
    Select,
    and_,
    false,
    func,
    or_,
    select,
    type_coerce,
)
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from db.deployment_span import LiveSpan, live_spans
from db.identity import key_of
from db.map_tables import SmoothedSample
from db.query.fleet.robots import robot_key
from db.query.measured.decimation import Series, spread_moments
from db.query.measured.rollup import counts
from db.sample_tables import ChannelRow, ReadingRow, SampleLog, SampleRow
from robot_link.messages import LogId, RobotId, Sample
from robot_link.report import Reading

_UNITS = np.array([1e3, 1e3, 1e3, 1e6, 1e3, 1e3, 1e3, 1e6, 1.0])
"""What a row holds of two places with their uncertainties, of a metre, and the value."""
MANY, THINNED = 200_000, 20_000
"""Samples that are read as they are, and how many are chosen of more than that."""
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
    within: Mapping[str, LiveSpan] | None = None,
    thins: bool = False,
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
        within: Only those of these deployments, by id of the robot; of a robot that has none here
            no sample.
        thins: Whether more than ``MANY`` of these deployments become ``THINNED`` at most, evenly
            spread over their time.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    named = (robots,) if isinstance(robots, str) else tuple(robots)
    keys = [robot_key(session, robot) for robot in named]
    statement = (
        _with_smoothed()
        .where(SampleRow.robot_key.in_(keys), SampleRow.channel_key == channel_key(variable))
        .where(*_between(start, end, log))
        .order_by(SampleRow.measured_at, SampleRow.robot_key, SampleLog.log, SampleRow.sequence)
    )
    if within is not None:
        taken = {key: within[name] for key, name in zip(keys, named, strict=True) if name in within}
        spans = [_in_span(key, span) for key, span in taken.items()]
        if thins:
            spans = _thinned(session, taken, variable) or spans
        statement = statement.where(or_(false(), *spans))
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
    """Select where samples were taken in mm, as believed and as smoothed, value and names."""
    better = SmoothedSample
    return (
        select(
            SampleRow.north_mm,
            SampleRow.east_mm,
            SampleRow.depth_mm,
            SampleRow.position_std_um,
            func.coalesce(better.north_mm, SampleRow.north_mm),
            func.coalesce(better.east_mm, SampleRow.east_mm),
            func.coalesce(better.depth_mm, SampleRow.depth_mm),
            func.coalesce(better.position_std_um, SampleRow.position_std_um),
            SampleRow.value,
            type_coerce(SampleRow.measured_at, BigInteger),
            SampleRow.robot_key,
            SampleLog.log,
            SampleRow.sequence,
        )
        .join(SampleLog, SampleLog.key == SampleRow.log_key)
        .outerjoin(better, is_smoothed())
    )


def _in_span(key: int, span: LiveSpan) -> ColumnElement[bool]:
    """Return what holds for samples that a robot took in a deployment."""
    begun = and_(SampleRow.robot_key == key, SampleRow.measured_at >= span.started_at)
    return begun if span.ended_at is None else and_(begun, SampleRow.measured_at < span.ended_at)


def _thinned(
    session: Session, taken: Mapping[int, LiveSpan], variable: str
) -> list[ColumnElement[bool]]:
    """Return what holds for an even part of very many samples; nothing where they are few."""
    number = {
        key: counts(session, SampleRow, key, span.started_at, span.ended_at).get(variable, 0)
        for key, span in taken.items()
    }
    total = sum(number.values())
    if total <= MANY:
        return []
    spread: list[ColumnElement[bool]] = []
    for key, span in taken.items():
        mine = (SampleRow.robot_key == key, SampleRow.channel_key == channel_key(variable))
        at = type_coerce(SampleRow.measured_at, BigInteger)
        within = select(at).where(*mine, _in_span(key, span)).limit(1)
        first = session.scalar(within.order_by(at))
        last = session.scalar(within.order_by(at.desc()))
        if first is not None and last is not None:
            pairs = max(1, THINNED * number[key] // total // 2)
            series = Series(SampleRow.measured_at, SampleRow.value, mine)
            chosen = spread_moments(session, series, first, last, pairs)
            spread.append(and_(SampleRow.robot_key == key, at.in_(chosen)))
    return spread


def is_smoothed() -> ColumnElement[bool]:
    """Join a sample with the place where it was taken after all."""
    return and_(
        SmoothedSample.log_key == SampleRow.log_key, SmoothedSample.sequence == SampleRow.sequence
    )


def channel_key(channel: str) -> ScalarSelect[int]:
    """Return the number of a channel, or nothing where no value of it was ever kept."""
    return select(ChannelRow.key).where(ChannelRow.name == channel).scalar_subquery()


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
        conditions.append(SampleLog.log == log)
    return conditions


def _arrays(session: Session, statement: Select[*tuple[Any, ...]]) -> tuple[FloatArray, IntArray]:
    """Return numbers, shape ``(n, 9)``, and names, shape ``(n, 4)``, of ``_with_smoothed``."""
    numbers, names = np.empty((0, 9)), np.empty((0, 4), dtype=np.int64)
    found = session.execute(statement.execution_options(yield_per=_ROWS_AT_ONCE))
    parts = [
        (
            np.array([row[:9] for row in rows], dtype=np.float64) / _UNITS,
            np.array([row[9:] for row in rows], dtype=np.int64),
        )
        for rows in found.partitions()
    ]
    if parts:
        numbers, names = (np.concatenate(one) for one in zip(*parts, strict=True))
    return numbers, names


def count_since(session: Session, robots: Sequence[str], variable: str, after: datetime) -> int:
    """Return how many measurements of a variable some robots took after a moment.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    start = after + timedelta(microseconds=1)
    keys = [robot_key(session, robot) for robot in robots]
    return sum(counts(session, SampleRow, key, start).get(variable, 0) for key in keys)


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
        select(ChannelRow.name, SampleRow)
        .join(ChannelRow, ChannelRow.key == SampleRow.channel_key)
        .join(SampleLog, SampleLog.key == SampleRow.log_key)
        .where(SampleRow.robot_key == robot_key(session, robot))
        .where(*_between(start, end, log))
        .order_by(SampleRow.measured_at, SampleLog.log, SampleRow.sequence)
        .execution_options(yield_per=1000)
    )
    for variable, row in session.execute(statement):
        yield SampleRecord(
            row.measured_at, variable, row.value, _position(row), row.position_std_um / 1e6
        )


def sampled_variables(
    session: Session,
    robot: str,
    *,
    start: datetime | None = None,
    end: datetime | None = None,
    log: int | None = None,
) -> dict[str, int]:
    """Return how many measurements of each variable a robot has, of a time and a log.

    Without a log they are known without counting them.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    if log is None:
        return counts(session, SampleRow, key, start, end)
    statement = (
        select(ChannelRow.name, func.count())
        .join(SampleRow, SampleRow.channel_key == ChannelRow.key)
        .join(SampleLog, SampleLog.key == SampleRow.log_key)
        .where(SampleRow.robot_key == key)
        .where(*_between(start, end, log))
        .group_by(ChannelRow.name)
    )
    return {row[0]: row[1] for row in session.execute(statement)}


def kept_counts(session: Session, robot: str, *, deployment: str | None = None) -> dict[str, int]:
    """Return how many measurements of each variable a robot has.

    Args:
        session: A reading session.
        robot: Id of the robot.
        deployment: Only those of this live deployment's time.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    if deployment is None:
        return counts(session, SampleRow, key)
    wanted = key_of("deployment", deployment)
    span = next((one for one in live_spans(session, [key])[key] if one.key == wanted), None)
    if span is None:
        return {}
    end = None if span.ended_at is None else span.ended_at - timedelta(microseconds=1)
    return counts(session, SampleRow, key, span.started_at, end)


def newest_samples(session: Session, robot: str) -> list[Sample]:
    """Return the newest measurement of each variable of a robot.

    Each counts as received when the newest of its log was.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    samples: list[Sample] = []
    for variable in counts(session, SampleRow, key):
        row, log = session.execute(
            select(SampleRow, SampleLog)
            .join(SampleLog, SampleLog.key == SampleRow.log_key)
            .where(SampleRow.robot_key == key, SampleRow.channel_key == channel_key(variable))
            .order_by(SampleRow.measured_at.desc())
            .limit(1)
        ).one()
        samples.append(
            Sample(
                robot=RobotId(robot),
                log=LogId(log.log),
                sequence=row.sequence,
                variable=variable,
                value=row.value,
                position_ned=_position(row),
                position_std_m=row.position_std_um / 1e6,
                measured_at=row.measured_at,
                received_at=log.received_at,
            )
        )
    return samples


def newest_readings(session: Session, robot: str) -> list[Reading]:
    """Return the newest reading of each channel of a robot that has some.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    readings: list[Reading] = []
    for channel in counts(session, ReadingRow, key):
        row = session.scalars(
            select(ReadingRow)
            .where(ReadingRow.robot_key == key, ReadingRow.channel_key == channel_key(channel))
            .order_by(ReadingRow.measured_at.desc())
            .limit(1)
        ).one()
        at = row.measured_at
        readings.append(Reading(RobotId(robot), channel, row.value, at, received_at=at))
    return readings


def _position(row: SampleRow) -> tuple[float, float, float]:
    return (row.north_mm / 1e3, row.east_mm / 1e3, row.depth_mm / 1e3)
