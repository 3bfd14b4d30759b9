"""What was known of a robot at a moment: the newest value of everything that it had measured."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.query.fleet.robots import robot_key
from db.sample_tables import ChannelRow, ReadingRow, SampleRow
from db.tables import STATE_CHANNELS, StateRow
from robot_link.messages import RobotMode


@dataclass(frozen=True, slots=True)
class ValueThen:
    """The newest value of a channel at a moment."""

    channel: str
    value: float
    measured_at: datetime


@dataclass(frozen=True, slots=True)
class KnownThen:
    """What a robot had measured by a moment, whenever it was heard of."""

    mode: str | None
    """What it was doing; ``None`` where it never said."""
    mode_at: datetime | None
    position_ned: tuple[float, float, float] | None
    position_std_m: float | None
    position_at: datetime | None
    values: list[ValueThen]


def known_then(session: Session, robot: str, at: datetime) -> KnownThen:
    """Return what a robot had measured by a moment, the moment included.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    newest_first = StateRow.measured_at.desc()
    by_then = select(StateRow).where(StateRow.robot_key == key, StateRow.measured_at <= at)
    state = session.scalar(by_then.order_by(newest_first).limit(1))
    told = session.scalar(by_then.where(StateRow.mode.is_not(None)).order_by(newest_first).limit(1))
    place = session.scalar(
        by_then.where(StateRow.north_m.is_not(None), StateRow.depth_m.is_not(None))
        .order_by(newest_first)
        .limit(1)
    )
    values = [] if state is None else _of_state(state)
    known = {one.channel for one in values}
    values += [one for one in _measured(session, key, at) if one.channel not in known]
    return KnownThen(
        mode=None if told is None or told.mode is None else RobotMode(told.mode).name.lower(),
        mode_at=None if told is None else told.measured_at,
        position_ned=None if place is None else _position(place),
        position_std_m=None if place is None else place.position_std_m,
        position_at=None if place is None else place.measured_at,
        values=values,
    )


def _position(row: StateRow) -> tuple[float, float, float]:
    return (row.north_m or 0.0, row.east_m or 0.0, row.depth_m or 0.0)


def _of_state(row: StateRow) -> list[ValueThen]:
    found = {name: getattr(row, column.key) for name, column in STATE_CHANNELS.items()}
    return [
        ValueThen(name, float(value), row.measured_at)
        for name, value in found.items()
        if value is not None
    ]


def _measured(session: Session, key: int, at: datetime) -> list[ValueThen]:
    """Return the newest sample, or else reading, of each channel."""
    found = list[ValueThen]()
    for channel, name in session.execute(select(ChannelRow.key, ChannelRow.name)).all():
        for table in (SampleRow, ReadingRow):
            row = session.execute(
                select(table.value, table.measured_at)
                .where(
                    table.robot_key == key,
                    table.channel_key == channel,
                    table.measured_at <= at,
                )
                .order_by(table.measured_at.desc())
                .limit(1)
            ).one_or_none()
            if row is not None:
                found.append(ValueThen(name, row[0], row[1]))
                break
    return found
