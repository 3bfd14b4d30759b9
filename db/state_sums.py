"""Extremes of state reports by stretches of time, for charts and tracks of months of them.

A robot's reports are summed up stretch by stretch once they are old enough, up to a moment that is
kept with them; what comes later for a time before that moment is summed up as it is kept. So what
is read by sums below that moment, and row by row from it on, is all that there is.
"""

from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Any, Final, cast

import numpy as np
from sqlalchemy import (
    BigInteger,
    ForeignKey,
    Integer,
    Table,
    delete,
    func,
    insert,
    select,
    type_coerce,
)
from sqlalchemy.orm import Mapped, Session, mapped_column

from autonomy.arrays import FloatArray, IntArray
from db.column import microseconds, moment
from db.sample_ingest import upsert
from db.sample_tables import FINE_S
from db.tables import CLUSTERED, STATE_CHANNELS, Base, Robot, StateRow
from robot_link.messages import STATE

PLACE = "place"
"""Series of the depths of reports that tell a whole place; what a track is thinned by."""
STRETCH_US = FINE_S * 1_000_000
_PARTS = {
    PLACE: ("depth_m",),
    **{key: STATE.parts_of_norm(key) or (key,) for key in (*STATE.keys, *STATE.norms)},
}
"""The columns of each series; of several, the square of their length is summed up."""
_PLACES = {key: place for place, key in enumerate(STATE_CHANNELS)}


class StateRollup(Base):
    """A stretch of time of a channel of a robot's state reports, and its extreme ones."""

    __tablename__ = "state_rollup"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    channel: Mapped[str] = mapped_column(primary_key=True)
    """A channel of a state, or ``PLACE``."""
    length_s: Mapped[int] = mapped_column(Integer, primary_key=True)
    stretch: Mapped[int] = mapped_column(BigInteger, primary_key=True)
    """Whole lengths from the epoch to its beginning."""
    size: Mapped[int] = mapped_column(BigInteger)
    """How many reports tell the channel."""
    least: Mapped[float]
    least_at: Mapped[datetime]
    greatest: Mapped[float]
    greatest_at: Mapped[datetime]


class StateSummed(Base):
    """Up to when the state reports of a robot are summed up."""

    __tablename__ = "state_summed"
    __table_args__ = CLUSTERED

    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)
    until: Mapped[datetime]
    """The beginning of a stretch; not included."""


_TABLE: Final = cast("Table", StateSummed.__table__)
_SUMMED: Final = select(_TABLE.c.robot_key, _TABLE.c.until)
"""Made once, and no statement of the ORM: each batch of telemetry asks it."""


def summed_until_us(session: Session, robot_key: int) -> int | None:
    """Return up to when a robot's reports are summed up, us; ``None`` where none is."""
    until = session.scalar(select(StateSummed.until).where(StateSummed.robot_key == robot_key))
    return None if until is None else microseconds(until)


def sum_up_next(session: Session, stretches: int, before: datetime) -> bool:
    """Sum up the next stretches of every robot; tell whether there may be more.

    Args:
        session: A session of a change.
        stretches: At most about so many.
        before: Only those that ended by then.
    """
    end_us = microseconds(before) // STRETCH_US * STRETCH_US
    left = stretches
    for robot_key in session.scalars(select(Robot.key).order_by(Robot.key)).all():
        while (begin_us := _next_us(session, robot_key)) is not None and begin_us < end_us:
            if left <= 0:
                return True
            until_us = min(begin_us + left * STRETCH_US, end_us)
            _sum_up(session, robot_key, begin_us, until_us)
            until = {"robot_key": robot_key, "until": moment(until_us)}
            statement = upsert(session, StateSummed)
            session.execute(
                statement.on_conflict_do_update(
                    index_elements=["robot_key"], set_={"until": statement.excluded.until}
                ),
                [until],
            )
            left -= (until_us - begin_us) // STRETCH_US
    return False


def _next_us(session: Session, robot_key: int) -> int | None:
    """Return the beginning of the first stretch of a robot that is to be summed up, us."""
    at = type_coerce(StateRow.measured_at, BigInteger)
    waiting = select(func.min(at)).where(StateRow.robot_key == robot_key)
    until_us = summed_until_us(session, robot_key)
    if until_us is not None:
        waiting = waiting.where(StateRow.measured_at >= moment(until_us))
    first_us = session.scalar(waiting)
    return None if first_us is None else first_us // STRETCH_US * STRETCH_US


def sum_up_late(session: Session, robot_keys: Iterable[int], at: Sequence[datetime]) -> None:
    """Sum up anew what was summed up before reports of these robots and times came or changed.

    Args:
        session: The session that holds the reports.
        robot_keys: Of each report.
        at: When each was measured.
    """
    until = {row.robot_key: microseconds(row.until) for row in session.execute(_SUMMED)}
    late = {
        (key, us // STRETCH_US)
        for key, us in zip(robot_keys, map(microseconds, at), strict=True)
        if us < until.get(key, us)
    }
    for key, stretch in sorted(late):
        _sum_up(session, key, stretch * STRETCH_US, (stretch + 1) * STRETCH_US)


def _sum_up(session: Session, robot_key: int, begin_us: int, end_us: int) -> None:
    """Sum up whole stretches from a moment to another, whatever was summed up of them before."""
    session.execute(
        delete(StateRollup).where(
            StateRollup.robot_key == robot_key,
            StateRollup.channel.in_(_PARTS),
            StateRollup.length_s == FINE_S,
            StateRollup.stretch >= begin_us // STRETCH_US,
            StateRollup.stretch < end_us // STRETCH_US,
        )
    )
    rows = session.execute(
        select(type_coerce(StateRow.measured_at, BigInteger), *STATE_CHANNELS.values())
        .where(
            StateRow.robot_key == robot_key,
            StateRow.measured_at >= moment(begin_us),
            StateRow.measured_at < moment(end_us),
        )
        .order_by(StateRow.measured_at)
    ).all()
    if not rows:
        return
    at_us = np.array([row[0] for row in rows], dtype=np.int64)
    numbers = np.array([row[1:] for row in rows], dtype=np.float64)
    sums = [
        {"robot_key": robot_key, "channel": channel, "length_s": FINE_S, **one}
        for channel in _PARTS
        for one in _extremes(at_us, _values(channel, numbers))
    ]
    if sums:
        session.execute(insert(StateRollup), sums)


def _values(channel: str, numbers: FloatArray) -> FloatArray:
    """Return a series of reports, shape ``(n,)``; NaN where one does not tell it.

    Args:
        channel: Which.
        numbers: The channels of the reports, shape ``(n, len(STATE_CHANNELS))``.
    """
    parts = _PARTS[channel]
    columns = numbers[:, [_PLACES[part] for part in parts]]
    values = columns[:, 0] if len(parts) == 1 else np.sum(columns * columns, axis=1)
    told = np.isfinite(values)
    if channel == PLACE:
        told &= np.isfinite(numbers[:, _PLACES["north_m"]])
    return cast("FloatArray", np.where(told, values, np.nan))


def _extremes(at_us: IntArray, values: FloatArray) -> Iterable[Mapping[str, Any]]:
    """Yield each stretch that has values, with its extremes."""
    told = ~np.isnan(values)
    at_us, values = at_us[told], values[told]
    stretches, begins = np.unique(at_us // STRETCH_US, return_index=True)
    ends = np.append(begins, len(values))[1:]
    for stretch, begin, end in zip(stretches.tolist(), begins, ends, strict=True):
        low = int(begin + np.argmin(values[begin:end]))
        high = int(begin + np.argmax(values[begin:end]))
        yield {
            "stretch": stretch,
            "size": int(end - begin),
            "least": float(values[low]),
            "least_at": moment(int(at_us[low])),
            "greatest": float(values[high]),
            "greatest_at": moment(int(at_us[high])),
        }
