"""Joins the rows of a recording with what is kept of its robot: new, duplicate or different.

A row is a duplicate if all that it measured is kept; it differs if a measurement of the same moment
has another value, of which the one that was kept first stays and the other is noted beside it.
Where a source tells more often than the one that is kept, its rows take the place of those of
earlier recordings, so that the order in which files come in does not matter.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from db.query.measured import imported
from db.query.measured.imported import KnownSamples, NewSamples
from server.recording.duplicate import SAME_US, Matches, matches
from server.recording.table import Recording

_NEW, _SAME, _OTHER = 0, 1, 2
_MOVED_M: Final = 0.01
_MARGIN_US: Final = 3_600_000_000
"""Kept measurements so far around a recording are looked at: intervals may be long."""


@dataclass(frozen=True, slots=True, eq=False)
class _Series:
    """The told rows of one channel."""

    channel: str
    rows: IntArray
    """Their places among the rows of the recording."""
    value: FloatArray
    known: KnownSamples
    found: Matches


@dataclass(frozen=True, slots=True, eq=False)
class Merge:
    """What is to be kept of a recording, and how many of its rows are which."""

    at_us: IntArray
    position_ned: FloatArray
    flight: Mapping[str, FloatArray]
    series: tuple[_Series, ...]
    status: IntArray
    """Of each row: new, the same as kept, or different, shape ``(n,)``."""
    known_state_us: IntArray
    """Moment of the kept state of the same moment, -1 without one, shape ``(n,)``."""

    @property
    def counts(self) -> dict[str, int]:
        """How many rows are new, duplicate, and different."""
        new, same, other = (int((self.status == one).sum()) for one in (_NEW, _SAME, _OTHER))
        return {"new": new, "duplicate": same, "differs": other}

    @property
    def is_new(self) -> BoolArray:
        """Which rows are new, shape ``(n,)``."""
        return self.status == _NEW

    @property
    def changes(self) -> bool:
        """Whether anything is to be kept or taken out."""
        return bool(self.is_new.any()) or any(len(_better(self, one)) for one in self.series)


def kept_mark(session: Session, robot_key: int, recording: Recording) -> tuple[int, ...]:
    """Return what is another one once ``merge`` would look at anything else."""
    return imported.kept_mark(session, robot_key, *_around(_moments_us(recording)))


def _moments_us(recording: Recording) -> IntArray:
    return np.round(recording.time_s * 1e6).astype(np.int64)


def _around(at_us: IntArray) -> tuple[int, int]:
    return int(at_us[0]) - _MARGIN_US, int(at_us[-1]) + _MARGIN_US


def merge(
    session: Session, robot_key: int, recording: Recording, position_ned: FloatArray
) -> Merge:
    """Hold a recording against what is kept of its robot."""
    at_us = _moments_us(recording)
    first, last = _around(at_us)
    series: list[_Series] = []
    has_new, has_other, has_value = (np.zeros(len(at_us), dtype=np.bool_) for _ in range(3))
    for channel, values in recording.values.items():
        rows = np.flatnonzero(np.isfinite(values))
        known = imported.known_samples(session, robot_key, channel, first, last)
        found = matches(known.at_us, known.value, at_us[rows], values[rows])
        series.append(_Series(channel, rows, values[rows], known, found))
        has_value[rows] = True
        has_new[rows] |= found.known < 0
        has_other[rows] |= found.differs
    state_us, flown = imported.known_states(session, robot_key, int(at_us[0]), int(at_us[-1]))
    nearest = nearest_state(state_us, at_us)
    is_known = nearest >= 0
    status = np.where(has_value, np.where(has_new, _NEW, _SAME), np.where(is_known, _SAME, _NEW))
    other = has_other | _flies_otherwise(recording.flight, flown, nearest)
    status = np.where((status == _SAME) & other, _OTHER, status)
    known_us = np.full(len(at_us), -1, dtype=np.int64)
    known_us[is_known] = state_us[nearest[is_known]]
    return Merge(at_us, position_ned, recording.flight, tuple(series), status, known_us)


def keep(
    session: Session,
    robot_key: int,
    log: int,
    merged: Merge,
    received_us: int,
    go_on: Callable[[], None],
) -> None:
    """Keep what is new and what is better, in the caller's transaction.

    Raises:
        WorkStoppedError: If ``go_on``, which is called between two blocks, says so.
    """
    for one in merged.series:
        better = _better(merged, one)
        imported.remove_samples(session, robot_key, one.channel, one.known, one.found.known[better])
        places = np.sort(np.concatenate([np.flatnonzero(one.found.known < 0), better]))
        rows = one.rows[places]
        imported.add_samples(
            session,
            robot_key,
            log,
            NewSamples(
                one.channel, merged.at_us[rows], one.value[places], merged.position_ned[rows]
            ),
            received_us,
            go_on,
        )
        _note_other(session, merged, one, received_us)
    is_state = np.flatnonzero(merged.is_new & (merged.known_state_us < 0))
    for begin in range(0, len(is_state), imported.BATCH_ROWS):
        rows = is_state[begin : begin + imported.BATCH_ROWS]
        imported.add_states(session, robot_key, _states(merged, rows), received_us, go_on)
    is_known = np.flatnonzero(merged.known_state_us >= 0)
    for begin in range(0, len(is_known), imported.BATCH_ROWS):
        go_on()
        rows = is_known[begin : begin + imported.BATCH_ROWS].tolist()
        told = [(int(merged.known_state_us[row]), _told(merged.flight, row)) for row in rows]
        imported.complete_states(session, robot_key, [one for one in told if one[1]])


def _states(merged: Merge, rows: IntArray) -> list[dict[str, Any]]:
    """Return rows as states; of a block at a time, for a file may have millions."""
    places = merged.position_ned[rows].tolist()
    return [
        {
            "at_us": int(merged.at_us[row]),
            "position_ned": place,
            "flight": _told(merged.flight, row),
        }
        for row, place in zip(rows.tolist(), places, strict=True)
    ]


def _better(merged: Merge, one: _Series) -> IntArray:
    """Return the places in a series of rows that take the place of kept ones."""
    if not one.found.is_denser:
        return np.empty(0, dtype=np.int64)
    same = np.flatnonzero((one.found.known >= 0) & ~one.found.differs)
    known = one.found.known[same]
    moved = one.known.position_ned[known] - merged.position_ned[one.rows[same]]
    is_other = (np.abs(moved) > _MOVED_M).any(axis=1)
    is_other |= one.known.at_us[known] != merged.at_us[one.rows[same]]
    is_other |= one.known.value[known] != one.value[same]
    return same[is_other & (one.known.is_imported[known] == 1)]


def _note_other(session: Session, merged: Merge, one: _Series, received_us: int) -> None:
    places = np.flatnonzero(one.found.differs)
    imported.note_recovered(
        session,
        [
            imported.Recovered(
                int(one.known.log_key[known]),
                int(one.known.sequence[known]),
                int(merged.at_us[one.rows[place]]),
                float(one.value[place]),
                (float(north), float(east), float(down)),
            )
            for place, known in zip(places.tolist(), one.found.known[places].tolist(), strict=True)
            for north, east, down in [merged.position_ned[one.rows[place]]]
        ],
        received_us,
    )


def nearest_state(state_us: IntArray, at_us: IntArray) -> IntArray:
    """Return the index of the state of the same millisecond, -1 without one, shape ``(n,)``."""
    if not len(state_us):
        return np.full(len(at_us), -1, dtype=np.int64)
    after = np.clip(np.searchsorted(state_us, at_us), 0, len(state_us) - 1)
    before = np.maximum(after - 1, 0)
    is_before = np.abs(state_us[before] - at_us) < np.abs(state_us[after] - at_us)
    near = np.where(is_before, before, after)
    return np.where(np.abs(state_us[near] - at_us) <= SAME_US, near, -1)


def _flies_otherwise(
    flight: Mapping[str, FloatArray], flown: Mapping[str, FloatArray], nearest: IntArray
) -> BoolArray:
    found = np.zeros(len(nearest), dtype=np.bool_)
    known = nearest >= 0
    for key, told in flight.items():
        if key in flown and known.any():
            kept = flown[key][nearest[known]]
            limit = 1e-6 * np.maximum(1.0, np.abs(kept))
            found[known] |= np.abs(kept - told[known]) > limit
    return found


def _told(flight: Mapping[str, FloatArray], row: int) -> dict[str, float]:
    return {key: float(told[row]) for key, told in flight.items() if np.isfinite(told[row])}
