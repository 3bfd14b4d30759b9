"""What a robot reported of itself, as arrays for those who work on whole recordings."""

from dataclasses import dataclass
from datetime import datetime

import numpy as np
from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from db.column import microseconds
from db.query.fleet.robots import robot_key
from db.tables import STATE_CHANNELS, StateRow

_NUMBERS = tuple(
    STATE_CHANNELS[key]
    for key in (
        *("north_m", "east_m", "depth_m", "position_std_m"),
        *("roll_rad", "pitch_rad", "heading_rad"),
        *("net_buoyancy_kg", "mass_position_m", "tail_rad"),
    )
)

_ROWS_AT_A_TIME = 1000


@dataclass(frozen=True, slots=True)
class StateColumns:
    """State reports of one robot in order of time; NaN where a report does not say."""

    measured_at_us: IntArray
    """Shape ``(n,)``, microseconds from the epoch."""
    position_ned: FloatArray
    """Shape ``(n, 3)``, m."""
    position_std_m: FloatArray
    """Shape ``(n,)``."""
    has_fix: BoolArray
    """Shape ``(n,)``."""
    attitude_rad: FloatArray
    """Roll, pitch and heading, shape ``(n, 3)``."""
    net_buoyancy_kg: FloatArray
    """Shape ``(n,)``."""
    mass_position_m: FloatArray
    """Shape ``(n,)``."""
    tail_rad: FloatArray
    """Shape ``(n,)``."""
    mode: IntArray
    """``robot_link.messages.RobotMode``, -1 where a report does not say, shape ``(n,)``."""

    def __len__(self) -> int:
        return len(self.measured_at_us)


def state_columns(
    session: Session,
    robot: str,
    start: datetime | None = None,
    end: datetime | None = None,
    *,
    limit: int | None = None,
) -> StateColumns:
    """Return the state reports of a robot, both ends of the time range included.

    Args:
        session: A reading session.
        robot: Id of the robot.
        start: First moment, ``None`` for the beginning.
        end: Last moment, ``None`` for now.
        limit: Only so many, the first.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(StateRow.measured_at, StateRow.has_fix, StateRow.mode, *_NUMBERS)
        .where(*_within(session, robot, start, end))
        .order_by(StateRow.measured_at)
        .limit(limit)
    )
    rows = session.execute(statement).all()
    numbers = np.array([row[3:] for row in rows], dtype=np.float64).reshape(-1, len(_NUMBERS))
    return StateColumns(
        measured_at_us=np.array([microseconds(row[0]) for row in rows], dtype=np.int64),
        position_ned=numbers[:, :3],
        position_std_m=numbers[:, 3],
        has_fix=np.array([row[1] for row in rows], dtype=np.bool_),
        attitude_rad=numbers[:, 4:7],
        net_buoyancy_kg=numbers[:, 7],
        mass_position_m=numbers[:, 8],
        tail_rad=numbers[:, 9],
        mode=np.array([-1 if row[2] is None else row[2] for row in rows], dtype=np.int64),
    )


def begin_of_last_dives(
    session: Session,
    robot: str,
    start: datetime | None,
    end: datetime | None,
    *,
    dives: int,
    surface_depth_m: float,
    shortest_s: float,
    limit: int,
) -> datetime | None:
    """Return the moment of the first report of the last dives, ``None`` without any report.

    Args:
        session: A reading session.
        robot: Id of the robot.
        start: First moment that is looked at, ``None`` for the beginning.
        end: Last moment that is looked at, ``None`` for now.
        dives: How many.
        surface_depth_m: Between two dives the robot was shallower than this.
        shortest_s: What is shorter was no dive.
        limit: So many reports at most, the newest, are looked at.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    statement = (
        select(StateRow.measured_at, StateRow.depth_m)
        .where(*_within(session, robot, start, end))
        .order_by(StateRow.measured_at.desc())
        .limit(limit)
        .execution_options(yield_per=_ROWS_AT_A_TIME)
    )
    found, last_under_water, complete = None, None, 0
    with session.execute(statement) as rows:
        for at, depth_m in rows:
            if depth_m is None:
                continue
            if depth_m >= surface_depth_m:
                last_under_water = last_under_water or at
            elif last_under_water is not None:
                complete += (last_under_water - at).total_seconds() >= shortest_s
                last_under_water = None
            if complete == dives:
                break
            found = at
    return found


def _within(
    session: Session, robot: str, start: datetime | None, end: datetime | None
) -> list[ColumnElement[bool]]:
    """Return what a report of a robot from a range of time fulfils."""
    mine = [StateRow.robot_key == robot_key(session, robot)]
    if start is not None:
        mine.append(StateRow.measured_at >= start)
    if end is not None:
        mine.append(StateRow.measured_at <= end)
    return mine
