"""Where cameras saw robots as they measured: positions that the map itself knows nothing of."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import FloatArray, IntArray
from db.column import microseconds, moment
from db.query.camera.fixes import iterate_fixes
from db.query.measured.samples import SampleColumns

NEAR_US: Final = 500_000
"""A measurement is placed between two fixes of which neither is farther away in time."""


def places_seen(session: Session, robots: Sequence[str], columns: SampleColumns) -> FloatArray:
    """Return where cameras saw the robots at their measurements, in NED, shape ``(n, 3)``, m.

    Not numbers where they did not see them just before and just after.

    Args:
        session: To read with.
        robots: That the columns count.
        columns: Measurements, ``n`` of them.
    """
    places = np.full((len(columns), 3), np.nan)
    for number, robot in enumerate(robots):
        rows = np.flatnonzero(columns.robot == number)
        if not len(rows):
            continue
        at_us = columns.measured_at_us[rows]
        first, last = int(at_us.min()) - NEAR_US, int(at_us.max()) + NEAR_US
        fixes = [
            (microseconds(one.fix.measured_at), *one.fix.ned_m)
            for one in iterate_fixes(session, robot, moment(first), moment(last))
            if one.fix.quality != "refused"
        ]
        if len(fixes) > 1:
            times = np.array([one[0] for one in fixes], dtype=np.int64)
            places[rows] = _between(times, np.array([one[1:] for one in fixes]), at_us)
    return places


def _between(times_us: IntArray, places_ned: FloatArray, at_us: IntArray) -> FloatArray:
    """Return places between the two fixes around each moment, shape ``(n, 3)``."""
    after = np.clip(np.searchsorted(times_us, at_us), 1, len(times_us) - 1)
    before = after - 1
    since, until = at_us - times_us[before], times_us[after] - at_us
    share = since / np.maximum(since + until, 1)
    between = places_ned[before] + share[:, None] * (places_ned[after] - places_ned[before])
    is_near = (since >= 0) & (until >= 0) & (since <= NEAR_US) & (until <= NEAR_US)
    return np.where(is_near[:, None], between, np.nan)
