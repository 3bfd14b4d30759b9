"""What robots reported of themselves: newest state, history of a channel, track."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import InstrumentedAttribute, Session

from db.query.decimation import Series, thinned_rows
from db.query.robots import robot_key
from db.tables import PlanReportRow, SampleRow, StateRow
from robot_link.messages import (
    OnboardPlanState,
    PlanHash,
    PlanReport,
    RobotId,
    RobotMode,
    StateReport,
)

STATE_CHANNELS: Mapping[str, InstrumentedAttribute[Any]] = {
    "depth_m": StateRow.depth_m,
    "pitch_rad": StateRow.pitch_rad,
    "roll_rad": StateRow.roll_rad,
    "heading_rad": StateRow.heading_rad,
    "net_buoyancy_kg": StateRow.net_buoyancy_kg,
    "mass_position_m": StateRow.mass_position_m,
    "tail_rad": StateRow.tail_rad,
    "battery_fraction": StateRow.battery_fraction,
    "battery_v": StateRow.battery_v,
    "position_std_m": StateRow.position_std_m,
    "energy_used": StateRow.energy_used,
}
"""Columns that are channels; ``speed_m_s`` and the field variables are channels beside them."""
_SPEED_SQUARED = (
    StateRow.velocity_north_m_s * StateRow.velocity_north_m_s
    + StateRow.velocity_east_m_s * StateRow.velocity_east_m_s
    + StateRow.velocity_down_m_s * StateRow.velocity_down_m_s
)


@dataclass(frozen=True, slots=True)
class History:
    """Values of one channel in order of time."""

    measured_at: list[datetime]
    value: list[float]
    decimated: bool
    """Whether values were left out; the extremes of every interval are kept."""


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """Where a robot believed to be."""

    measured_at: datetime
    position_ned: tuple[float, float, float]
    position_std_m: float
    has_fix: bool
    mode: RobotMode | None
    """What it was doing, ``None`` in a recording of something that does not say so."""


@dataclass(frozen=True, slots=True)
class Track:
    """Positions in order of time."""

    points: list[TrackPoint]
    decimated: bool
    """Whether points were left out; the shallowest and deepest of every interval are kept."""


def newest_state(session: Session, robot: str) -> StateReport | None:
    """Return the newest report of a robot about itself; a recording has none."""
    row = session.scalar(
        select(StateRow)
        .where(StateRow.robot_key == robot_key(session, robot), StateRow.mode.is_not(None))
        .order_by(StateRow.measured_at.desc())
        .limit(1)
    )
    return None if row is None else _report(row, robot)


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
    return PlanReport(
        robot=RobotId(robot),
        sha256=None if row.sha256 is None else PlanHash(row.sha256),
        state=OnboardPlanState(row.state),
        leg=row.leg,
        legs=row.legs,
        energy_used=row.energy_used,
        reason=row.reason,
        measured_at=row.measured_at,
        received_at=row.received_at,
    )


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
        channel: A key of ``STATE_CHANNELS``, ``speed_m_s``, or a field variable.
        start: First moment, ``None`` for the beginning.
        end: Last moment, ``None`` for now.
        max_points: When there are more values, only the smallest and largest of each of
            ``max_points / 2`` intervals are returned.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key = robot_key(session, robot)
    mine = StateRow.robot_key == key
    if channel in STATE_CHANNELS:
        column = STATE_CHANNELS[channel]
        series = Series(StateRow.measured_at, column, (mine, column.is_not(None)))
    elif channel == "speed_m_s":
        series = Series(
            StateRow.measured_at, _SPEED_SQUARED, (mine, StateRow.velocity_down_m_s.is_not(None))
        )
    else:
        series = Series(
            SampleRow.measured_at,
            SampleRow.value,
            (SampleRow.robot_key == key, SampleRow.variable == channel),
        )
    rows, decimated = thinned_rows(session, series, start, end, max_points)
    values = [row[1] for row in rows]
    if channel == "speed_m_s":
        values = [math.sqrt(value) for value in values]
    return History([row[0] for row in rows], values, decimated)


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
    series = Series(
        StateRow.measured_at,
        StateRow.depth_m,
        (StateRow.robot_key == robot_key(session, robot),),
        (
            StateRow.north_m,
            StateRow.east_m,
            StateRow.position_std_m,
            StateRow.has_fix,
            StateRow.mode,
        ),
    )
    rows, decimated = thinned_rows(session, series, start, end, max_points)
    points = [
        TrackPoint(
            at,
            (north_m, east_m, depth_m),
            std_m,
            has_fix,
            None if mode is None else RobotMode(mode),
        )
        for at, depth_m, north_m, east_m, std_m, has_fix, mode in rows
    ]
    return Track(points, decimated)


def _report(row: StateRow, robot: str) -> StateReport:
    def known(value: float | None) -> float:
        if value is None:
            raise ValueError(f"the state report of {robot} at {row.measured_at} has gaps")
        return value

    return StateReport(
        robot=RobotId(robot),
        measured_at=row.measured_at,
        received_at=row.received_at,
        position_ned=(row.north_m, row.east_m, row.depth_m),
        position_std_m=row.position_std_m,
        velocity_ned=(
            known(row.velocity_north_m_s),
            known(row.velocity_east_m_s),
            known(row.velocity_down_m_s),
        ),
        roll_rad=known(row.roll_rad),
        pitch_rad=known(row.pitch_rad),
        heading_rad=known(row.heading_rad),
        net_buoyancy_kg=known(row.net_buoyancy_kg),
        mass_position_m=known(row.mass_position_m),
        tail_rad=known(row.tail_rad),
        battery_fraction=known(row.battery_fraction),
        battery_v=known(row.battery_v),
        mode=RobotMode(int(known(row.mode))),
        has_fix=row.has_fix,
        energy_used=known(row.energy_used),
    )
