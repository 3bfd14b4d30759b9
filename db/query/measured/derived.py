"""Channels that are computed of what was measured together, as if they had been stored."""

import math
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray, IntArray
from autonomy.channel import CHANNELS
from autonomy.seawater import can_derive, derived
from db.column import moments
from db.query.fleet.robots import get_robot
from db.query.measured.sample_places import SamplePlaces
from db.query.measured.samples import SampleColumns, sample_columns, sampled_variables

_APART_US = 10_000_000
"""Measurements that lie farther apart in time than this belong to different waters."""
_BASE = "temperature"
"""Its measurements give the derived values their times and places."""
_OTHERS = ("conductivity", "salinity", "pressure")


def derivable(session: Session, robot: str, key: str) -> bool:
    """Tell whether a channel is computed for a robot: it tells what that needs, and not itself.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    return can_derive(key, set(sampled_variables(session, robot)))


def derived_columns(
    session: Session,
    robots: Sequence[str],
    key: str,
    start: datetime | None = None,
    end: datetime | None = None,
    log: int | None = None,
) -> SampleColumns:
    """Return a derived channel as ``sample_columns`` does a measured one.

    What was measured besides temperature is interpolated to its times; what no water can have is
    left out before.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    base = _possible(sample_columns(session, robots, _BASE, start, end, log), _BASE)
    values = np.full(len(base), np.nan)
    for number, robot in enumerate(robots):
        mine = base.robot == number
        if not mine.any():
            continue
        site = get_robot(session, robot).site
        told = {_BASE: base.value[mine]}
        for other in _OTHERS:
            found = _possible(sample_columns(session, robot, other, start, end, log), other)
            if other != key and len(found):
                told[other] = _at(base.measured_at_us[mine], found.measured_at_us, found.value)
        if can_derive(key, told):
            values[mine] = derived(
                key,
                told,
                base.smoothed_ned[mine, 2],
                site.origin_latitude_deg,
                site.origin_longitude_deg,
            )
    return replace(base, value=values).chosen(np.isfinite(values))


def _possible(columns: SampleColumns, key: str) -> SampleColumns:
    channel = CHANNELS[key]
    return columns.chosen((columns.value >= channel.low) & (columns.value <= channel.high))


def derived_places(
    session: Session,
    robot: str,
    key: str,
    start: datetime | None = None,
    end: datetime | None = None,
    max_points: int = 2000,
) -> SamplePlaces:
    """Return a derived channel as ``sample_places`` does a measured one, thinned alike.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    columns = derived_columns(session, (robot,), key, start, end)
    kept = _extremes(columns.measured_at_us, columns.value, max_points)
    return SamplePlaces(
        measured_at=moments(columns.measured_at_us[kept].tolist()),
        value=columns.value[kept].tolist(),
        position_ned=columns.smoothed_ned[kept],
        position_std_m=columns.smoothed_std_m[kept],
        is_smoothed=columns.is_smoothed[kept],
        decimated=len(kept) < len(columns),
    )


def _at(at_us: IntArray, known_us: IntArray, values: FloatArray) -> FloatArray:
    """Interpolate to moments; NaN where the nearest known one is too far off."""
    found = np.interp(at_us, known_us, values)
    after = np.clip(np.searchsorted(known_us, at_us), 0, len(known_us) - 1)
    before = np.maximum(after - 1, 0)
    off_us = np.minimum(np.abs(known_us[after] - at_us), np.abs(known_us[before] - at_us))
    return np.where(off_us <= _APART_US, found, math.nan)


def _extremes(at_us: IntArray, values: FloatArray, max_points: int) -> IntArray:
    """Return the rows with the least and the greatest value of each interval of time."""
    if len(values) <= max_points:
        return np.arange(len(values))
    count = max(1, max_points // 2)
    width = (int(at_us[-1]) - int(at_us[0])) // count + 1
    interval = (at_us - at_us[0]) // width
    order = np.lexsort((values, interval))
    first = np.flatnonzero(np.diff(interval[order], prepend=-1))
    last = np.append(first[1:], len(order)) - 1
    return np.unique(np.concatenate([order[first], order[last]]))
