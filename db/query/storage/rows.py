"""Rows of a day as they are kept, out of the tables and back into them."""

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    FromClause,
    Table,
    and_,
    func,
    literal,
    not_,
    or_,
    select,
    type_coerce,
)
from sqlalchemy.orm import Session

from db.camera_tables import CameraCalibrationRow
from db.column import Utc, moment
from db.ingest import insert_new
from db.map_tables import SmoothedSample
from db.migrate import METADATA
from db.query.storage.prunable import (
    BESIDE_SAMPLES,
    DAY_US,
    Prunable,
    beside_columns,
    of_time,
)
from db.query.storage.taking import Row, note_back, sum_up_again
from db.sample_ingest import channel_keys, claim, note_unsmoothed
from db.sample_tables import FINE_S, ChannelRow, SampleLog
from db.state_sums import sum_up_late
from db.storage_tables import NOBODY
from db.tables import Base, Robot

_AT_ONCE = 2000
_HOUR_US = 3_600_000_000


def old_rows(
    kind: Prunable, before: datetime, held_robots: Collection[int] = ()
) -> list[ColumnElement[bool]]:
    """Return what holds of rows that may go: those that came late stay, and those of some robots.

    Args:
        kind: Of the rows.
        before: What arrived later stays.
        held_robots: Of kinds in which all robots lie together; ``NOBODY`` stands for none.
    """
    where: list[ColumnElement[bool]] = []
    if kind.received is not None:
        where.append(kind.table.c[kind.received] < before)
    if kind.key == "samples":
        late = select(SampleLog.key).where(SampleLog.received_at >= before)
        where.append(kind.table.c.log_key.not_in(late))
    if not kind.is_by_robot:
        robot = kind.table.c.robot_key
        named = [one for one in held_robots if one != NOBODY]
        allowed = robot.not_in(named) if named else robot.is_not(None)
        where.append(allowed if NOBODY in held_robots else or_(robot.is_(None), allowed))
    return where


@dataclass(frozen=True, slots=True)
class HourOf:
    """A day of a robot, or an hour of it; of one channel where the kind has channels."""

    robot_key: int
    day: int
    channel_key: int | None = None
    hour: int | None = None

    def where(self, kind: Prunable) -> list[ColumnElement[bool]]:
        """Return what holds of its rows."""
        begin_us, length_us = self.day * DAY_US, DAY_US
        if self.hour is not None:
            begin_us, length_us = begin_us + self.hour * _HOUR_US, _HOUR_US
        return of_time(kind, self.robot_key, begin_us, begin_us + length_us, self.channel_key)


def count_rows(
    session: Session, kind: Prunable, of: HourOf, where: Sequence[ColumnElement[bool]] = ()
) -> int:
    """Return how many rows there are."""
    statement = select(func.count()).select_from(kind.table)
    return session.scalar(statement.where(*of.where(kind), *where)) or 0


def has_late_rows(
    session: Session,
    kind: Prunable,
    robot_key: int,
    day: int,
    where: Sequence[ColumnElement[bool]],
) -> bool:
    """Tell whether a day has rows for which the conditions of those that may go do not hold."""
    if not where:
        return False
    of = HourOf(robot_key, day)
    late = select(literal(1)).where(*of.where(kind), not_(and_(*where)))
    return session.scalar(late.limit(1)) is not None


def rows_of(
    session: Session, kind: Prunable, of: HourOf, where: Sequence[ColumnElement[bool]]
) -> Iterator[Row]:
    """Yield rows in the order of time, all columns of each."""
    columns = {column.name: kind.column(column.name) for column in kind.table.columns}
    beside = beside_columns(kind)
    statement = (
        select(*columns.values(), *beside.values())
        .where(*of.where(kind), *where)
        .order_by(kind.column(kind.at), *(columns[key] for key in kind.keys if key != kind.at))
    )
    if beside:
        source: FromClause = kind.table
        for one in BESIDE_SAMPLES:
            other = _table(one)
            is_of = (other.c.log_key == kind.table.c.log_key) & (
                other.c.sequence == kind.table.c.sequence
            )
            source = source.outerjoin(other, is_of)
        statement = statement.select_from(source)
    names = (*columns, *beside)
    found = session.connection().execute(statement.execution_options(yield_per=_AT_ONCE))
    for row in found:
        yield dict(zip(names, row, strict=True))


def names_in(session: Session, kind: Prunable, robot_key: int) -> dict[str, dict[str, Any]]:
    """Return what the numbers in rows stand for, so that another database can read them."""
    robots = select(Robot.key, Robot.id)
    if kind.is_by_robot:
        robots = robots.where(Robot.key == robot_key)
    names: dict[str, dict[str, Any]] = {
        "robots": {str(key): name for key, name in session.execute(robots)}
    }
    if kind.has_channels:
        found = session.execute(select(ChannelRow.key, ChannelRow.name))
        names["channels"] = {str(key): name for key, name in found}
    if kind.key == "samples":
        logs = select(
            SampleLog.key, SampleLog.log, type_coerce(SampleLog.received_at, BigInteger)
        ).where(SampleLog.robot_key == robot_key)
        names["logs"] = {str(key): [log, at] for key, log, at in session.execute(logs)}
    return names


def put_back(
    session: Session, kind: Prunable, rows: Sequence[Row], names: Mapping[str, Any]
) -> int:
    """Put rows back that were moved out; return how many were not there already.

    These are told as moved no longer.

    Raises:
        LookupError: If the station does not know a robot of theirs.
    """
    keys = _Keys(session, names, rows)
    plain_rows = [keys.translated(row) for row in rows]
    own = [column.name for column in kind.table.columns]
    by_day: dict[tuple[int, int], list[dict[str, Any]]] = defaultdict(list)
    for row in plain_rows:
        by_day[row["robot_key"] or NOBODY, row[kind.at] // DAY_US].append(row)
    back = 0
    for (robot_key, day), of_day in by_day.items():
        new = insert_new(session, kind.model, [_typed(kind.model, row, own) for row in of_day])
        note_back(session, kind.key, robot_key, day, new)
        back += new
    if kind.key == "samples":
        _claim_numbers(session, plain_rows)
        _note_unsmoothed(session, plain_rows)
        for one in BESIDE_SAMPLES:
            _put_beside(session, one, plain_rows)
    if kind.key == "states":
        at = [moment(row[kind.at]) for row in plain_rows]
        sum_up_late(session, [row["robot_key"] for row in plain_rows], at)
    if kind.rollup is not None:
        stretches: dict[tuple[int, int], set[int]] = defaultdict(set)
        for row in plain_rows:
            series = row["robot_key"], row["channel_key"]
            stretches[series].add(row[kind.at] // (FINE_S * 1_000_000))
        for (robot_key, channel_key), touched in stretches.items():
            sum_up_again(session, kind, robot_key, channel_key, touched)
    return back


def _claim_numbers(session: Session, rows: Sequence[Row]) -> None:
    """Note that samples are kept, so that none is taken for new when its robot sends it again."""
    numbers: dict[int, set[int]] = defaultdict(set)
    for row in rows:
        numbers[row["log_key"]].add(row["sequence"])
    for log_key, of_log in numbers.items():
        claim(session, log_key, sorted(of_log))


def _note_unsmoothed(session: Session, rows: Sequence[Row]) -> None:
    """Note that smoothing has not looked at samples that come without a smoothed place."""
    place = f"{SmoothedSample.__tablename__}.north_mm"
    bare = [row for row in rows if row.get(place) is None]
    if bare:
        at = ((row["log_key"], moment(row["measured_at"])) for row in bare)
        note_unsmoothed(session, at)


def _put_beside(session: Session, beside: type[Base], rows: Sequence[Row]) -> None:
    begin = f"{beside.__tablename__}."
    own = [column.name for column in _table(beside).columns]
    found = [
        {name.removeprefix(begin): value for name, value in row.items() if name.startswith(begin)}
        | {"log_key": row["log_key"], "sequence": row["sequence"]}
        for row in rows
        if row.get(f"{begin}north_mm") is not None
    ]
    if found:
        insert_new(session, beside, [_typed(beside, row, own) for row in found])


def _typed(model: type[Base], row: Row, names: Sequence[str]) -> dict[str, Any]:
    """Return the columns of a row as the table takes them."""
    columns = _table(model).c
    return {
        name: moment(row[name])
        if isinstance(columns[name].type, Utc) and row[name] is not None
        else row[name]
        for name in names
        if name in row
    }


def _table(model: type[Base]) -> Table:
    return METADATA.tables[model.__tablename__]


class _Keys:
    """What the numbers in rows of a file are in this database."""

    def __init__(self, session: Session, names: Mapping[str, Any], rows: Sequence[Row]) -> None:
        known = {row.id: row.key for row in session.execute(select(Robot.id, Robot.key))}
        self._robots = {int(key): known.get(name) for key, name in names["robots"].items()}
        self._names = names["robots"]
        channels = names.get("channels", {})
        ours = channel_keys(session, channels.values()) if channels else {}
        self._channels = {int(key): ours[name] for key, name in channels.items()}
        self._logs = (
            {
                log_key: self._log(session, robot_key, *names["logs"][str(log_key)])
                for log_key, robot_key in {row["log_key"]: row["robot_key"] for row in rows}.items()
            }
            if "logs" in names
            else {}
        )
        self._calibrations = set(session.scalars(select(CameraCalibrationRow.key)))

    def _robot(self, theirs: int) -> int:
        key = self._robots.get(theirs)
        if key is None:
            raise LookupError(f"There is no robot {self._names.get(str(theirs), theirs)}.")
        return key

    def _log(self, session: Session, robot: int, log: int, at_us: int) -> int:
        robot_key = self._robot(robot)
        row = session.scalar(
            select(SampleLog).where(SampleLog.robot_key == robot_key, SampleLog.log == log)
        )
        if row is None:
            row = SampleLog(robot_key=robot_key, log=log, received_at=moment(at_us))
            session.add(row)
            session.flush()
        return row.key

    def translated(self, row: Row) -> dict[str, Any]:
        found = dict(row)
        if row["robot_key"] is not None:
            found["robot_key"] = self._robot(row["robot_key"])
        if "channel_key" in row:
            found["channel_key"] = self._channels[row["channel_key"]]
        if "log_key" in row:
            found["log_key"] = self._logs[row["log_key"]]
        if row.get("calibration_key") not in (None, *self._calibrations):
            found["calibration_key"] = None
        return found
