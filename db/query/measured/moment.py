"""What was known of a robot at a moment: the newest value of everything that it had measured."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import ColumnElement, func, select
from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.query.fleet.robots import robot_key
from db.sample_tables import ChannelRow, ReadingRow, SampleRow
from db.tables import STATE_CHANNELS, Event, StateRow
from robot_link.messages import RobotMode

_REPORTS = 32
"""So many state reports are read at once; what they do not tell is looked for by itself."""
_PLACE = ("north_m", "east_m", "depth_m", "position_std_m", "has_fix", "is_by_cameras", "mode")
_COLUMNS = {name: getattr(StateRow, name) for name in _PLACE} | {
    name: column for name, column in STATE_CHANNELS.items() if name not in _PLACE
}


@dataclass(frozen=True, slots=True)
class ValueThen:
    """The newest value of a channel at a moment."""

    channel: str
    value: float
    measured_at: datetime
    received_at: datetime | None
    """``None`` of samples and readings: when each arrived is not kept."""


@dataclass(frozen=True, slots=True)
class PlaceThen:
    """The newest place of a robot at a moment."""

    position_ned: tuple[float, float, float]
    position_std_m: float
    """Infinite where nobody knows it."""
    has_fix: bool
    is_by_cameras: bool
    measured_at: datetime
    received_at: datetime


@dataclass(frozen=True, slots=True)
class KnownThen:
    """What a robot had measured by a moment."""

    mode: RobotMode | None
    """What it was doing; ``None`` where it never said."""
    mode_at: datetime | None
    place: PlaceThen | None
    reported: dict[str, ValueThen]
    """Channels of its state reports."""
    measured: dict[str, ValueThen]
    """Samples of fields and readings of its own condition."""
    undated: list[str]
    """Channels of samples and readings that are left out: when they arrived is not kept."""


@dataclass(frozen=True, slots=True)
class Beside:
    """Moments before and after one, of what a robot measured and of what is in the log."""

    sample_before: datetime | None
    sample_after: datetime | None
    event_before: datetime | None
    event_after: datetime | None


def known_then(
    session: Session,
    robot: str,
    at: datetime,
    told: Collection[str],
    *,
    ranges: Mapping[str, tuple[float, float]],
    heard_by: datetime | None = None,
) -> KnownThen:
    """Return the newest of everything that a robot had measured by a moment, that one included.

    Args:
        session: A reading session.
        robot: Id of the robot.
        at: The moment.
        told: Columns of its state reports that it ever told; see ``told_columns``. What is not
            among them is looked for in the last reports alone.
        ranges: Least and greatest value that can be true, of each channel that counts; what a robot
            told beyond is kept, and used for nothing.
        heard_by: Only what the station had heard by then. Samples and readings are left out: of
            them is not kept when they arrived.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    where = [StateRow.robot_key == key, StateRow.measured_at <= at]
    if heard_by is not None:
        where.append(StateRow.received_at <= heard_by)
    newest = _newest_of_each(session, where, told)
    place, mode = newest.get("north_m"), newest.get("mode")
    measured = _measured(session, key, at, ranges)
    return KnownThen(
        mode=None if mode is None else RobotMode(mode["mode"]),
        mode_at=None if mode is None else mode["measured_at"],
        place=None if place is None or place["depth_m"] is None else _place(place),
        reported={
            name: ValueThen(name, float(row[name]), row["measured_at"], row["received_at"])
            for name, row in newest.items()
            if name in STATE_CHANNELS
        },
        measured={} if heard_by is not None else measured,
        undated=[] if heard_by is None else list(measured),
    )


def told_columns(session: Session, robot: str, period: Period) -> frozenset[str]:
    """Return which columns of its state reports a robot told in a period; reads all of them.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    counts = session.execute(
        select(*(func.count(column) for column in _COLUMNS.values())).where(
            StateRow.robot_key == robot_key(session, robot), period.holds(StateRow.measured_at)
        )
    ).one()
    return frozenset(name for name, count in zip(_COLUMNS, counts, strict=True) if count)


def beside(session: Session, robot: str, at: datetime, kinds: Collection[str]) -> Beside:
    """Return what lies next to a moment.

    Args:
        session: A reading session.
        robot: Id of the robot.
        at: The moment, which is none of those returned, nor is anything else of its millisecond: a
            page counts in milliseconds, and would never get past what is told more finely.
        kinds: Kinds of events that count; of this robot, and of the station as a whole.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    first = at.replace(microsecond=at.microsecond // 1000 * 1000)
    last = first + timedelta(microseconds=999)
    measured = [(StateRow.measured_at, [StateRow.robot_key == key])]
    first_state = select(StateRow.measured_at).where(StateRow.robot_key == key)
    # in the order of its key, or PostgreSQL looks for the first of them through all of the table
    if session.scalar(first_state.order_by(StateRow.measured_at).limit(1)) is None:
        channels = session.scalars(select(ChannelRow.key)).all()
        measured = [
            (table.measured_at, [table.robot_key == key, table.channel_key == channel])
            for table in (SampleRow, ReadingRow)
            for channel in channels
        ]
    # Apart, each is one range of the log's order.
    logged = [
        (Event.at, [Event.kind.in_(kinds), about])
        for about in (Event.robot_key == key, Event.robot_key.is_(None))
    ]
    return Beside(
        sample_before=max(_next(session, measured, first, forward=False), default=None),
        sample_after=min(_next(session, measured, last, forward=True), default=None),
        event_before=max(_next(session, logged, first, forward=False), default=None),
        event_after=min(_next(session, logged, last, forward=True), default=None),
    )


def _next(
    session: Session,
    series: Iterable[tuple[Any, list[ColumnElement[bool]]]],
    at: datetime,
    *,
    forward: bool,
) -> Iterable[datetime]:
    for column, where in series:
        statement = select(column).where(*where, column > at if forward else column < at)
        found = session.scalar(statement.order_by(column if forward else column.desc()).limit(1))
        if found is not None:
            yield found


def _newest_of_each(
    session: Session, where: list[ColumnElement[bool]], told: Collection[str]
) -> dict[str, Any]:
    """Return of each column that was ever told the newest row that tells it."""
    columns = [column.label(name) for name, column in _COLUMNS.items()]
    statement = (
        select(StateRow.measured_at, StateRow.received_at, *columns)
        .where(*where)
        .order_by(StateRow.measured_at.desc())
    )
    found: dict[str, Any] = {}
    for row in session.execute(statement.limit(_REPORTS)).mappings():
        for name in _COLUMNS:
            if name not in found and row[name] is not None:
                found[name] = row
    for name in set(told).difference(found):
        tells = _COLUMNS[name].is_not(None)
        row = session.execute(statement.where(tells).limit(1)).mappings().one_or_none()
        if row is not None:
            found[name] = row
    return found


def _place(row: Any) -> PlaceThen:  # noqa: ANN401 - a row of some columns
    return PlaceThen(
        (row["north_m"], row["east_m"], row["depth_m"]),
        row["position_std_m"],
        row["has_fix"],
        row["is_by_cameras"],
        row["measured_at"],
        row["received_at"],
    )


def _measured(
    session: Session, key: int, at: datetime, ranges: Mapping[str, tuple[float, float]]
) -> dict[str, ValueThen]:
    """Return the newest sample, or else reading, of each channel that can be true."""
    found: dict[str, ValueThen] = {}
    for channel, name in session.execute(select(ChannelRow.key, ChannelRow.name)).all():
        if name not in ranges:
            continue
        for table in (SampleRow, ReadingRow):
            row = session.execute(
                select(table.value, table.measured_at)
                .where(
                    table.robot_key == key,
                    table.channel_key == channel,
                    table.measured_at <= at,
                    table.value.between(*ranges[name]),
                )
                .order_by(table.measured_at.desc())
                .limit(1)
            ).one_or_none()
            if row is not None:
                found[name] = ValueThen(name, row[0], row[1], None)
                break
    return found
