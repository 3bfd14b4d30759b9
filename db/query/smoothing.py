"""Tracks of finished dives, and where their samples were taken after all.

Every sample that was taken before a fix and looked at since has a row in ``smoothed_sample``, also
one that lay in no dive and stayed where it was: a sample without a row is one to look at.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy import BigInteger, Table, and_, func, literal, select, type_coerce
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from db.map_tables import SmoothedSample
from db.query.robots import robot_key
from db.tables import SampleRow, StateRow


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


def unjudged_span(session: Session, robot: str) -> tuple[datetime, datetime] | None:
    """Return when the first and the last sample were taken that smoothing has not looked at.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    known = and_(
        SmoothedSample.robot_key == SampleRow.robot_key,
        SmoothedSample.log == SampleRow.log,
        SmoothedSample.sequence == SampleRow.sequence,
    )
    count, first, last = session.execute(
        select(func.count(), func.min(SampleRow.measured_at), func.max(SampleRow.measured_at))
        .outerjoin(SmoothedSample, known)
        .where(SampleRow.robot_key == robot_key(session, robot), SmoothedSample.log.is_(None))
    ).one()
    return (first, last) if count else None


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
    ).where(StateRow.robot_key == key, StateRow.measured_at <= end)
    samples = select(
        type_coerce(SampleRow.measured_at, BigInteger).label("at"),
        SampleRow.north_m,
        SampleRow.east_m,
        SampleRow.depth_m,
        SampleRow.position_std_m,
        literal(value=False),
        SampleRow.log,
        SampleRow.sequence,
    ).where(SampleRow.robot_key == key, SampleRow.measured_at <= end)
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
        UnknownIdError: If there is no such robot.
    """
    if not places:
        return
    key = robot_key(session, robot)
    rows: list[dict[str, Any]] = []
    for place in places:
        north_m, east_m, depth_m = place.position_ned
        rows.append(
            {
                "robot_key": key,
                "log": place.log,
                "sequence": place.sequence,
                "north_m": north_m,
                "east_m": east_m,
                "depth_m": depth_m,
                "position_std_m": place.position_std_m,
            }
        )
    dialect = sqlite if session.get_bind().dialect.name == "sqlite" else postgresql
    table = SmoothedSample.__table__
    if not isinstance(table, Table):
        raise TypeError("smoothed_sample is not a plain table")
    statement = dialect.insert(table)
    changed = {name: statement.excluded[name] for name in ("north_m", "east_m", "depth_m")}
    session.execute(
        statement.on_conflict_do_update(
            index_elements=["robot_key", "log", "sequence"],
            set_={**changed, "position_std_m": statement.excluded["position_std_m"]},
        ),
        rows,
    )
