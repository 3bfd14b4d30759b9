"""Tracks of finished dives, and where their samples were taken after all.

Every sample that was taken before a fix and looked at since has a row in ``smoothed_place``, also
one that lay in no dive and stayed where it was: a sample without a row is one to look at. From when
on there may be such is kept with each log, so that nobody has to search for them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy import BigInteger, ColumnElement, Select, func, literal, select, type_coerce, update
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from db.fault import UnknownIdError
from db.map_tables import SmoothedSample
from db.query.fleet.robots import robot_key
from db.query.measured.samples import is_smoothed
from db.sample_ingest import place_columns, unclaimed, upsert
from db.sample_tables import ChannelRow, SampleLog, SampleRow
from db.tables import StateRow


@dataclass(frozen=True, slots=True, eq=False)
class TrackColumns:
    """What a robot said of its position, in state reports and with samples, in order of time."""

    measured_at_us: IntArray
    """Shape ``(n,)``, microseconds from the epoch."""
    position_ned: FloatArray
    """Shape ``(n, 3)``, m."""
    position_std_m: FloatArray
    """Shape ``(n,)``."""
    has_fix: BoolArray
    """Whether it is a report with a fix; a sample does not say, shape ``(n,)``."""
    log: IntArray
    """Log of a sample, -1 of a report, shape ``(n,)``."""
    sequence: IntArray
    """Shape ``(n,)``."""

    def __len__(self) -> int:
        return len(self.measured_at_us)

    @property
    def is_sample(self) -> BoolArray:
        """Whether it came with a sample, shape ``(n,)``."""
        return self.log >= 0

    def until(self, end: int) -> "TrackColumns":
        """Return the first ``end`` rows."""
        return TrackColumns(**{one.name: getattr(self, one.name)[:end] for one in fields(self)})


@dataclass(frozen=True, slots=True)
class SmoothedPlace:
    """Where one sample was taken."""

    log: int
    sequence: int
    position_ned: tuple[float, float, float]
    position_std_m: float


def unsmoothed_from(session: Session, robot: str) -> datetime | None:
    """Return when the first sample was taken that smoothing has not looked at, None: it saw all.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    return session.scalar(
        select(func.min(SampleLog.unsmoothed_from)).where(
            SampleLog.robot_key == robot_key(session, robot)
        )
    )


def note_smoothed(session: Session, robot: str, begin: datetime, end: datetime) -> None:
    """Note that smoothing looked at all samples from ``begin`` to ``end`` that have a place now.

    One that came meanwhile has none: what is still to be looked at begins there. Nothing is noted
    where an earlier one waits, which is looked at next.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    waiting = unsmoothed_from(session, robot)
    if waiting is None or waiting < begin:
        return
    missed = (
        select(func.min(SampleRow.measured_at))
        .outerjoin(SmoothedSample, is_smoothed())
        .where(
            SampleRow.robot_key == key,
            _in_own_order(),
            SampleRow.measured_at.between(begin, end),
            SmoothedSample.sequence.is_(None),
        )
    )
    rest = session.scalar(missed)
    if rest is None:
        after = _of_each_channel(key, func.min(SampleRow.measured_at))
        first = after.where(SampleRow.measured_at > end).scalar_subquery()
        rest = session.scalar(select(func.min(first)).select_from(ChannelRow))
    session.execute(
        update(SampleLog)
        .where(SampleLog.robot_key == key, SampleLog.unsmoothed_from.is_not(None))
        .values(unsmoothed_from=rest)
    )


def newest_sample(session: Session, robot: str) -> datetime | None:
    """Return when a robot took its newest sample that is kept.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    newest = _of_each_channel(key, func.max(SampleRow.measured_at)).scalar_subquery()
    return session.scalar(select(func.max(newest)).select_from(ChannelRow))


def _of_each_channel(key: int, extreme: ColumnElement[Any]) -> Select[Any]:
    """Return what one step along the table's own order finds, for each row of the channels."""
    own = (SampleRow.robot_key == key, SampleRow.channel_key == ChannelRow.key)
    return select(extreme).where(*own).correlate(ChannelRow)


def _in_own_order() -> ColumnElement[bool]:
    """Name channels one by one: each is one range of the table's own order."""
    return SampleRow.channel_key.in_(select(ChannelRow.key))


def newest_fix(session: Session, robot: str, before: datetime | None = None) -> datetime | None:
    """Return when a robot last reported a fix, or last did before a moment.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(StateRow.measured_at)
        .where(StateRow.robot_key == robot_key(session, robot), StateRow.has_fix.is_(True))
        .order_by(StateRow.measured_at.desc())
        .limit(1)
    )
    if before is not None:
        statement = statement.where(StateRow.measured_at < before)
    return session.scalar(statement)


def track_columns(
    session: Session, robot: str, start: datetime | None, end: datetime, limit: int
) -> TrackColumns:
    """Return what a robot said of its position from ``start`` to ``end``, both included.

    Args:
        session: A reading session.
        robot: Id of the robot.
        start: First moment, ``None`` for the beginning.
        end: Last moment.
        limit: Most rows.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    at = type_coerce(StateRow.measured_at, BigInteger)
    reports = select(
        at.label("at"),
        StateRow.north_m,
        StateRow.east_m,
        StateRow.depth_m,
        StateRow.position_std_m,
        StateRow.has_fix,
        literal(-1, BigInteger).label("log"),
        literal(0, BigInteger).label("sequence"),
    ).where(StateRow.robot_key == key, StateRow.measured_at <= end, StateRow.north_m.is_not(None))
    samples = select(
        type_coerce(SampleRow.measured_at, BigInteger).label("at"),
        SampleRow.north_mm / 1e3,
        SampleRow.east_mm / 1e3,
        SampleRow.depth_mm / 1e3,
        SampleRow.position_std_um / 1e6,
        literal(value=False),
        SampleLog.log,
        SampleRow.sequence,
    ).join(SampleLog, SampleLog.key == SampleRow.log_key)
    samples = samples.where(
        SampleRow.robot_key == key,
        _in_own_order(),
        SampleRow.measured_at <= end,
    )
    if start is not None:
        reports = reports.where(StateRow.measured_at >= start)
        samples = samples.where(SampleRow.measured_at >= start)
    rows = [
        *session.execute(reports.order_by("at").limit(limit)).all(),
        *session.execute(samples.order_by("at").limit(limit)).all(),
    ]
    rows.sort(key=lambda row: (row[0], row[6], row[7]))
    numbers = np.array([row[1:5] for row in rows[:limit]], dtype=np.float64).reshape(-1, 4)
    names = np.array([(row[0], *row[5:]) for row in rows[:limit]], dtype=np.int64).reshape(-1, 4)
    return TrackColumns(
        measured_at_us=names[:, 0],
        position_ned=numbers[:, :3],
        position_std_m=numbers[:, 3],
        has_fix=names[:, 1].astype(np.bool_),
        log=names[:, 2],
        sequence=names[:, 3],
    )


def keep_smoothed(session: Session, robot: str, places: Sequence[SmoothedPlace]) -> None:
    """Keep where samples were taken; one that was kept before is moved.

    Raises:
        UnknownIdError: If there is no such robot, or no such sample; nothing is kept then.
    """
    key = robot_key(session, robot)
    by_log: dict[int, list[SmoothedPlace]] = {}
    for place in places:
        by_log.setdefault(place.log, []).append(place)
    rows: list[dict[str, Any]] = []
    for log, of_log in by_log.items():
        log_key = session.scalar(
            select(SampleLog.key).where(SampleLog.robot_key == key, SampleLog.log == log)
        )
        missing = unclaimed(session, log_key, sorted(place.sequence for place in of_log))
        if log_key is None or missing:
            raise UnknownIdError("sample", f"{missing[0]} of log {log}")
        for place in of_log:
            columns = place_columns(place.position_ned, place.position_std_m)
            rows.append({"log_key": log_key, "sequence": place.sequence, **columns})
    if not rows:
        return
    statement = upsert(session, SmoothedSample)
    session.execute(
        statement.on_conflict_do_update(
            index_elements=["log_key", "sequence"],
            set_={
                name: statement.excluded[name]
                for name in ("north_mm", "east_mm", "depth_mm", "position_std_um")
            },
        ),
        rows,
    )
