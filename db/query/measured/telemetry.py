"""What robots reported of themselves: newest state, history of a channel, track."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import reduce
from operator import add
from typing import Any

import numpy as np
from sqlalchemy import BigInteger, Integer, func, or_, select, type_coerce
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray
from db.column import moments
from db.query.fleet.robots import robot_key
from db.query.measured.decimation import Series, thinned_rows
from db.query.measured.sample_places import sample_series
from db.query.measured.samples import channel_key
from db.record import same
from db.sample_tables import FINE_S, ReadingRollup, ReadingRow
from db.state_sums import PLACE, StateRollup, summed_until_us
from db.tables import STATE_CHANNELS, PlanQueueRow, PlanReportRow, StateRow
from robot_link.messages import (
    STATE,
    OnboardPlanState,
    PlanHash,
    PlanQueue,
    PlanReport,
    RobotId,
    RobotMode,
    StateReport,
)


@dataclass(frozen=True, slots=True)
class History:
    """Values of one channel in order of time."""

    measured_at: list[datetime]
    value: list[float]
    decimated: bool
    """Whether values were left out; the extremes of every interval are kept."""
    received_at: list[datetime] | None = None
    """When the station heard of each; ``None`` of what was sampled or read, of which that is not
    kept."""


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """Where a robot believed to be."""

    measured_at: datetime
    position_ned: tuple[float, float, float]
    position_std_m: float
    has_fix: bool
    mode: RobotMode | None
    """What it was doing, ``None`` in a recording of something that does not say so."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Positions in order of time, column by column."""

    measured_at: list[datetime]
    position_ned: FloatArray
    """Shape ``(n, 3)``, m."""
    position_std_m: FloatArray
    """Shape ``(n,)``."""
    has_fix: BoolArray
    """Shape ``(n,)``."""
    mode: list[RobotMode | None]
    received_us: FloatArray
    """When the station heard of each, us since 1970; shape ``(n,)``."""
    decimated: bool
    """Whether points were left out; the shallowest and deepest of every interval are kept."""

    @property
    def points(self) -> list[TrackPoint]:
        """Return the positions one by one; a long track is read faster by column."""
        columns = (
            self.measured_at,
            self.position_ned.tolist(),
            self.position_std_m.tolist(),
            self.has_fix.tolist(),
            self.mode,
        )
        return [
            TrackPoint(at, (north_m, east_m, depth_m), std_m, has_fix, mode)
            for at, (north_m, east_m, depth_m), std_m, has_fix, mode in zip(*columns, strict=True)
        ]


_MODES: dict[int | None, RobotMode | None] = {None: None, **{int(mode): mode for mode in RobotMode}}
"""A lookup: making the members of twenty thousand numbers takes longer than to read them."""


def newest_state(session: Session, robot: str) -> StateReport | None:
    """Return the newest report of a robot about itself; a recording has none."""
    row = session.scalar(
        select(StateRow)
        .where(
            StateRow.robot_key == robot_key(session, robot),
            StateRow.mode.is_not(None),
            StateRow.north_m.is_not(None),
            StateRow.depth_m.is_not(None),
        )
        .order_by(StateRow.measured_at.desc())
        .limit(1)
    )
    return None if row is None else _report(row, robot)


def idle_since(
    session: Session, robot: str, after: datetime, depth_max_m: float
) -> datetime | None:
    """Return since when, after a moment, a robot has been idle and not deeper than this.

    ``None`` if its newest report says otherwise, or there is none.
    """
    key = robot_key(session, robot)
    of_robot = (
        StateRow.robot_key == key,
        StateRow.mode.is_not(None),
        StateRow.measured_at >= after,
    )
    active = session.scalar(
        select(func.max(StateRow.measured_at)).where(
            *of_robot, or_(StateRow.mode != int(RobotMode.IDLE), StateRow.depth_m > depth_max_m)
        )
    )
    since = select(func.min(StateRow.measured_at)).where(*of_robot)
    if active is not None:
        since = since.where(StateRow.measured_at > active)
    return session.scalar(since)


def newest_plan_report(
    session: Session, robot: str, *, flying: PlanHash | None = None
) -> PlanReport | None:
    """Return what a robot last said of the plan that it holds, or while it flew a certain one."""
    words = select(PlanReportRow).where(PlanReportRow.robot_key == robot_key(session, robot))
    if flying is not None:
        running = PlanReportRow.state == int(OnboardPlanState.RUNNING)
        words = words.where(PlanReportRow.sha256 == flying, running)
    row = session.scalar(words.order_by(PlanReportRow.measured_at.desc()).limit(1))
    if row is None:
        return None
    return same(
        PlanReport,
        row,
        robot=RobotId(robot),
        sha256=None if row.sha256 is None else PlanHash(row.sha256),
        state=OnboardPlanState(row.state),
    )


def leg_flown(session: Session, robot: str, sha256: str, heard_by: datetime) -> int | None:
    """Return which leg of a plan a robot flew, by what the station had heard by a moment."""
    return session.scalar(
        select(PlanReportRow.leg)
        .where(
            PlanReportRow.robot_key == robot_key(session, robot),
            PlanReportRow.measured_at <= heard_by,
            PlanReportRow.received_at <= heard_by,
            PlanReportRow.sha256 == sha256,
            PlanReportRow.state == int(OnboardPlanState.RUNNING),
        )
        .order_by(PlanReportRow.measured_at.desc())
        .limit(1)
    )


def newest_plan_queue(session: Session, robot: str) -> PlanQueue | None:
    """Return what a robot last said of the plan that waits on board."""
    row = session.scalar(
        select(PlanQueueRow)
        .where(PlanQueueRow.robot_key == robot_key(session, robot))
        .order_by(PlanQueueRow.received_at.desc())
        .limit(1)
    )
    if row is None:
        return None
    hashes = {
        name: None if (one := getattr(row, name)) is None else PlanHash(one)
        for name in ("sha256", "next_sha256", "last_sha256")
    }
    return same(PlanQueue, row, robot=RobotId(robot), **hashes)


def flown_legs(session: Session, robot: str, sha256: PlanHash) -> list[tuple[datetime, int]]:
    """Return when a robot said which leg of a plan it flies, the earliest word first."""
    rows = session.execute(
        select(PlanReportRow.measured_at, PlanReportRow.leg)
        .where(
            PlanReportRow.robot_key == robot_key(session, robot),
            PlanReportRow.sha256 == sha256,
            PlanReportRow.state == int(OnboardPlanState.RUNNING),
        )
        .order_by(PlanReportRow.measured_at)
    )
    return [(moment, leg) for moment, leg in rows]


def history(
    session: Session,
    robot: str,
    channel: str,
    start: datetime | None = None,
    end: datetime | None = None,
    max_points: int = 2000,
) -> History:
    """Return a channel's values from ``start`` to ``end``, both included.

    Args:
        session: A reading session.
        robot: Id of the robot.
        channel: A channel of a state, or one that was sampled or read.
        start: First moment, ``None`` for the beginning.
        end: Last moment, ``None`` for now.
        max_points: When there are more values, only the smallest and largest of each of
            ``max_points / 2`` intervals are returned.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    parts = STATE.parts_of_norm(channel)
    if parts is not None or channel in STATE_CHANNELS:
        columns = [STATE_CHANNELS[part] for part in parts or (channel,)]
        squares = reduce(add, (column * column for column in columns))
        series = Series(
            StateRow.measured_at,
            columns[0] if parts is None else squares,
            (StateRow.robot_key == key, columns[-1].is_not(None), columns[-1] < math.inf),
            (type_coerce(StateRow.received_at, BigInteger),),
            **_sums(session, key, channel),
        )
    else:
        series = sample_series(key, channel)
        if not _is_kept(session, series):
            series = _reading_series(key, channel)
    rows, decimated = thinned_rows(session, series, start, end, max_points)
    values = [row[1] if parts is None else math.sqrt(row[1]) for row in rows]
    received_at = moments([row[2] for row in rows]) if series.beside else None
    return History(moments([row[0] for row in rows]), values, decimated, received_at)


@dataclass(frozen=True, slots=True)
class StatePast:
    """State reports of some time, in order, as they were told."""

    measured_at: list[datetime]
    mode: list[RobotMode]
    values: dict[str, list[float]]
    """By channel; NaN where a report did not know it."""


def state_past(
    session: Session, robot: str, channels: Sequence[str], start: datetime, end: datetime
) -> StatePast:
    """Return some channels of every state report from ``start`` to ``end``, both included.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    parts = {channel: STATE.parts_of_norm(channel) or (channel,) for channel in channels}
    names = list(dict.fromkeys(name for each in parts.values() for name in each))
    rows: Sequence[Any] = session.execute(
        select(StateRow.measured_at, StateRow.mode, *(STATE_CHANNELS[name] for name in names))
        .where(
            StateRow.robot_key == robot_key(session, robot),
            StateRow.measured_at.between(start, end),
        )
        .order_by(StateRow.measured_at)
    ).all()
    told: dict[str, list[float]] = {
        name: [math.nan if row[place] is None else float(row[place]) for row in rows]
        for place, name in enumerate(names, start=2)
    }
    values = {
        channel: told[channel]
        if each == (channel,)
        else [math.hypot(*one) for one in zip(*(told[part] for part in each), strict=True)]
        for channel, each in parts.items()
    }
    return StatePast(
        measured_at=[row[0] for row in rows],
        mode=[RobotMode(0 if row[1] is None else row[1]) for row in rows],
        values=values,
    )


def _is_kept(session: Session, series: Series) -> bool:
    """Tell whether there is any value of a series."""
    # in the order of its key, or PostgreSQL looks for the first of them through all of the table
    first = select(series.at).where(*series.where).order_by(series.at).limit(1)
    return session.scalar(first) is not None


def _reading_series(robot_key: int, channel: str) -> Series:
    number = channel_key(channel)
    return Series(
        ReadingRow.measured_at,
        ReadingRow.value,
        (ReadingRow.robot_key == robot_key, ReadingRow.channel_key == number),
        (),
        ReadingRollup,
        (ReadingRollup.robot_key == robot_key, ReadingRollup.channel_key == number),
    )


def states_kept(
    session: Session, robot: str, start: datetime, end: datetime
) -> tuple[int, datetime | None]:
    """Return how many states are kept of a time, both ends included, and when the newest came.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    count, newest = session.execute(
        select(func.count(), func.max(StateRow.received_at)).where(
            StateRow.robot_key == robot_key(session, robot),
            StateRow.measured_at.between(start, end),
        )
    ).one()
    return count, newest


def track(
    session: Session,
    robot: str,
    start: datetime | None = None,
    end: datetime | None = None,
    max_points: int = 2000,
) -> Track:
    """Return the positions of a robot from ``start`` to ``end``, both included.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    series = Series(
        StateRow.measured_at,
        StateRow.depth_m,
        (
            StateRow.robot_key == key,
            StateRow.north_m.is_not(None),
            StateRow.depth_m.is_not(None),
        ),
        (
            StateRow.north_m,
            StateRow.east_m,
            StateRow.position_std_m,
            type_coerce(StateRow.has_fix, Integer),
            StateRow.mode,
            type_coerce(StateRow.received_at, BigInteger),
        ),
        **_sums(session, key, PLACE),
    )
    rows, decimated = thinned_rows(session, series, start, end, max_points)
    numbers = np.array(rows, dtype=np.float64).reshape(-1, 8)
    return Track(
        measured_at=moments(numbers[:, 0]),
        position_ned=numbers[:, [2, 3, 1]],
        position_std_m=numbers[:, 4],
        has_fix=numbers[:, 5] != 0.0,
        mode=[_MODES.get(one) for one in numbers[:, 6].tolist()],
        received_us=numbers[:, 7],
        decimated=decimated,
    )


def _sums(session: Session, robot_key: int, channel: str) -> dict[str, Any]:
    """Return how a series of state reports is summed up, as fields of ``Series``."""
    until_us = summed_until_us(session, robot_key)
    if until_us is None:
        return {}
    of_series = (StateRollup.robot_key == robot_key, StateRollup.channel == channel)
    return {
        "rollup": StateRollup,
        "of_rollup": of_series,
        "lengths_s": (FINE_S,),
        "summed_until_us": until_us,
    }


def _report(row: StateRow, robot: str) -> StateReport:
    kept = (getattr(row, key) for key in STATE.keys)
    numbers = tuple(math.nan if value is None else value for value in kept)
    return StateReport(
        robot=RobotId(robot),
        measured_at=row.measured_at,
        received_at=row.received_at,
        mode=RobotMode(0 if row.mode is None else row.mode),
        has_fix=row.has_fix,
        is_by_cameras=row.is_by_cameras,
        **STATE.fields(numbers),
    )
