"""Kinds of data that may be pruned: their tables and series, and on which days they have rows."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Any, Final

from sqlalchemy import BigInteger, ColumnElement, Table, func, select, type_coerce
from sqlalchemy.orm import Session

from db.camera_tables import CameraFixRow
from db.column import EPOCH, Utc
from db.map_tables import SmoothedSample
from db.migrate import METADATA
from db.onboard_tables import ActuatorReportRow
from db.sample_tables import (
    COARSE_S,
    ChannelRow,
    ReadingRollup,
    ReadingRow,
    RecoveredSample,
    Rollup,
    SampleRollup,
    SampleRow,
)
from db.storage_tables import NOBODY
from db.tables import Base, RawFrameRow, Robot, StateRow

DAY_US: Final = COARSE_S * 1_000_000
BESIDE_SAMPLES: Final = (SmoothedSample, RecoveredSample)
"""What else is known of a sample; it goes and comes back with it."""
_BEFORE_ALL: Final = -50_000_000
_AT: Final = ("log_key", "sequence")


@dataclass(frozen=True, slots=True)
class Prunable:
    """One kind of data."""

    key: str
    """As in ``robot_link.storage_config.StorageConfig``."""
    title: str
    model: type[Base]
    at: str = "measured_at"
    received: str | None = "received_at"
    value: str | None = None
    """Whose extremes stay where it is thinned; ``None`` of what is never thinned."""
    marks: tuple[str, ...] = ()
    """Columns whose changes stay where it is thinned, with the row on either side."""
    rollup: type[Rollup] | None = None

    @property
    def table(self) -> Table:
        """Its table."""
        return METADATA.tables[self.model.__tablename__]

    @property
    def keys(self) -> list[str]:
        """Columns of the table's key."""
        return [column.name for column in self.table.primary_key.columns]

    @property
    def is_by_robot(self) -> bool:
        """Whether rows of a robot lie together; else those of all robots are taken together."""
        return self.keys[0] == "robot_key"

    @property
    def has_channels(self) -> bool:
        """Whether rows of a channel lie together."""
        return "channel_key" in self.keys

    def column(self, name: str) -> ColumnElement[Any]:
        """Return a column with a moment as whole microseconds from the epoch."""
        return plain(self.table.c[name])


PRUNABLE: Final[Mapping[str, Prunable]] = MappingProxyType(
    {
        kind.key: kind
        for kind in (
            Prunable("raw", "raw bytes", RawFrameRow, at="at", received=None),
            Prunable(
                "states",
                "state reports",
                StateRow,
                value="depth_m",
                marks=("has_fix", "is_by_cameras", "mode"),
            ),
            Prunable(
                "samples", "samples", SampleRow, received=None, value="value", rollup=SampleRollup
            ),
            Prunable(
                "readings",
                "readings",
                ReadingRow,
                received=None,
                value="value",
                rollup=ReadingRollup,
            ),
            Prunable(
                "actuators",
                "actuator reports",
                ActuatorReportRow,
                value="speed_share",
                marks=("is_mass_off", "is_swinging", "stuck"),
            ),
            Prunable("fixes", "camera fixes", CameraFixRow, value="depth_m", marks=("quality",)),
        )
    }
)
"""Every kind, by its key."""


def plain(column: ColumnElement[Any]) -> ColumnElement[Any]:
    """Return a column as the table keeps it: a moment is a whole number of microseconds."""
    return type_coerce(column, BigInteger) if isinstance(column.type, Utc) else column


def day_of(moment: datetime) -> int:
    """Return the day of a moment, in days from the epoch."""
    return (moment - EPOCH) // timedelta(days=1)


def day_begins(day: int) -> datetime:
    """Return the first moment of a day."""
    return EPOCH + timedelta(days=day)


def parts(session: Session, kind: Prunable) -> list[int]:
    """Return keys of the robots whose rows are looked at one after another."""
    if not kind.is_by_robot:
        return [NOBODY]
    return list(session.scalars(select(Robot.key).order_by(Robot.key)))


def days(session: Session, kind: Prunable, robot_key: int, before: int) -> Iterator[int]:
    """Yield the days before another on which there are rows, in order; each is one look."""
    day: int | None = _BEFORE_ALL
    while (day := _next_day(session, kind, robot_key, day)) is not None and day < before:
        yield day
        day += 1


def _next_day(session: Session, kind: Prunable, robot_key: int, first: int) -> int | None:
    if kind.rollup is not None:
        of = kind.rollup
        return session.scalar(
            select(func.min(of.stretch)).where(
                of.robot_key == robot_key, of.length_s == COARSE_S, of.stretch >= first
            )
        )
    at = kind.column(kind.at)
    where = [at >= first * DAY_US]
    if kind.is_by_robot:
        where.append(kind.table.c.robot_key == robot_key)
    found = session.scalar(select(func.min(at)).where(*where))
    return None if found is None else int(found) // DAY_US


def channels(session: Session, kind: Prunable, robot_key: int, day: int) -> list[int | None]:
    """Return the channels that have values on a day; ``[None]`` of what has no channels."""
    of = kind.rollup
    if of is None:
        return [None]
    return list(
        session.scalars(
            select(of.channel_key)
            .where(
                of.robot_key == robot_key,
                of.channel_key.in_(select(ChannelRow.key)),
                of.length_s == COARSE_S,
                of.stretch == day,
            )
            .order_by(of.channel_key)
        )
    )


def of_time(
    kind: Prunable, robot_key: int, begin_us: int, end_us: int, channel_key: int | None = None
) -> list[ColumnElement[bool]]:
    """Return what holds of the rows of a time, its end not included."""
    at = kind.column(kind.at)
    where = [at >= begin_us, at < end_us]
    if kind.is_by_robot:
        where.append(kind.table.c.robot_key == robot_key)
    if channel_key is not None:
        where.append(kind.table.c.channel_key == channel_key)
    elif kind.has_channels:
        # Named one by one: each is one range of the table's own order.
        where.append(kind.table.c.channel_key.in_(select(ChannelRow.key)))
    return where


def beside_columns(kind: Prunable) -> dict[str, ColumnElement[Any]]:
    """Return the columns of what else is known of a row, by names that tell the table."""
    if kind.key != "samples":
        return {}
    return {
        f"{beside.__tablename__}.{column.name}": plain(column)
        for beside in BESIDE_SAMPLES
        for column in METADATA.tables[beside.__tablename__].columns
        if column.name not in _AT
    }
