"""Measurements of one variable with the places where they were taken, thinned like a channel."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
from sqlalchemy import SQLColumnExpression, func, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from autonomy.arrays import BoolArray, FloatArray
from db.column import moments
from db.map_tables import SmoothedSample
from db.query.fleet.robots import robot_key
from db.query.measured.decimation import Series, thinned_rows
from db.query.measured.samples import channel_key, is_smoothed
from db.sample_tables import SampleRollup, SampleRow


@dataclass(frozen=True, slots=True, eq=False)
class SamplePlaces:
    """Measurements in order of time."""

    measured_at: list[datetime]
    value: list[float]
    position_ned: FloatArray
    """Where each was taken, smoothed where that was done, shape ``(n, 3)``, m."""
    position_std_m: FloatArray
    """Shape ``(n,)``."""
    is_smoothed: BoolArray
    """Whether smoothing located it better than the robot had, shape ``(n,)``."""
    decimated: bool
    """Whether values were left out; the extremes of every interval are kept."""


def sample_places(
    session: Session,
    robot: str,
    variable: str,
    start: datetime | None = None,
    end: datetime | None = None,
    max_points: int = 2000,
) -> SamplePlaces:
    """Return the measurements of a variable from ``start`` to ``end``, both included.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    series = sample_series(
        robot_key(session, robot),
        variable,
        (
            _better(SmoothedSample.north_mm, SampleRow.north_mm),
            _better(SmoothedSample.east_mm, SampleRow.east_mm),
            _better(SmoothedSample.depth_mm, SampleRow.depth_mm),
            _better(SmoothedSample.position_std_um, SampleRow.position_std_um),
            SampleRow.position_std_um,
        ),
    )
    rows, decimated = thinned_rows(session, series, start, end, max_points)
    numbers = np.array([row[2:] for row in rows], dtype=np.float64).reshape(-1, 5)
    numbers /= (1e3, 1e3, 1e3, 1e6, 1e6)
    return SamplePlaces(
        measured_at=moments([row[0] for row in rows]),
        value=[row[1] for row in rows],
        position_ned=numbers[:, :3],
        position_std_m=numbers[:, 3],
        is_smoothed=numbers[:, 3] < numbers[:, 4],
        decimated=decimated,
    )


def sample_series(
    robot_key: int, variable: str, beside: tuple[SQLColumnExpression[Any], ...] = ()
) -> Series:
    """Return the measurements of a variable as a series."""
    number = channel_key(variable)
    return Series(
        SampleRow.measured_at,
        SampleRow.value,
        (SampleRow.robot_key == robot_key, SampleRow.channel_key == number),
        beside,
        SampleRollup,
        (SampleRollup.robot_key == robot_key, SampleRollup.channel_key == number),
    )


def _better(
    smoothed: InstrumentedAttribute[int], said: InstrumentedAttribute[int]
) -> SQLColumnExpression[int]:
    found = select(smoothed).where(is_smoothed()).correlate(SampleRow).scalar_subquery()
    return func.coalesce(found, said)
