"""All rows of a deployment as columns, with the flags that they have, and the dives in them."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.profile.dive import Dive, Legs, find_dives, leg_at, legs_of
from autonomy.quality.flag import FAIL, OG1_FILL, FlagArray
from autonomy.seawater import conservative_temperature
from db.column import microseconds
from db.query.measured.flags_at import flags_of
from db.query.measured.merged_rows import RowBlock
from db.query.measured.quality import (
    ManualFlag,
    manual_flags,
    newest_quality_run,
)
from server.analysis import kept
from server.analysis.question import CONSERVATIVE, SALINITY, TEMPERATURE, Question
from server.base.worker import IsCancelled, Report
from server.delivery.judged import DEPTH, blocks_of
from server.delivery.og1_state import state_values

APART_US: Final = 10_000_000
"""Two values of a series that are farther apart in time say nothing of a moment between them."""
_READING: Final = 0.95
"""Part of the work that is done when all rows are read."""
_VALUE: Final = "value:"
"""Before the key of a series."""


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Rows in order of time, shape ``(n,)`` each; NaN where nobody told."""

    at_us: IntArray
    position_ned: FloatArray
    """Shape ``(n, 3)``."""
    has_fix: BoolArray
    is_paced: BoolArray
    """Whether dives are found by the depth of this row."""
    values: Mapping[str, FloatArray]
    """By series."""

    @property
    def depth_m(self) -> FloatArray:
        """Depths, m."""
        return self.position_ned[:, 2]


def untold(_: tuple[float, str]) -> None:
    """Tell nobody how far it is."""


def read_columns(
    session: Session, question: Question, is_cancelled: IsCancelled, report: Report = untold
) -> Columns:
    """Return all rows: as they were kept when they were read last, else read block by block.

    Raises:
        WorkCancelledError: Between two blocks.
    """
    place = kept.place_of(session, question)
    arrays = kept.load(place)
    if arrays is None:
        arrays = _read(session, question, is_cancelled, report)
        kept.keep(place, arrays)
    position = arrays.pop("position")
    values: dict[str, FloatArray] = {
        name.removeprefix(_VALUE): one for name, one in arrays.items() if name.startswith(_VALUE)
    }
    values[DEPTH] = position[:, 2]
    if any(one.key == CONSERVATIVE for one in question.series):
        latitude_deg = question.wanted.deployment.site.origin_latitude_deg
        values[CONSERVATIVE] = conservative_temperature(
            values[SALINITY], values[TEMPERATURE], position[:, 2], latitude_deg
        )
    return Columns(arrays["at"], position, arrays["fix"], arrays["paced"], values)


def _read(
    session: Session, question: Question, is_cancelled: IsCancelled, report: Report
) -> dict[str, np.ndarray]:
    deployment, parts = question.wanted.deployment, defaultdict[str, list[np.ndarray]](list)
    first_us = microseconds(deployment.begun_at)
    last_us = microseconds(deployment.last_at or question.asked_at or deployment.begun_at)
    for block in blocks_of(session, question.wanted, is_cancelled):
        for name, part in _parts(block, question):
            # a copy: a view would hold the whole block
            parts[name].append(part.copy())
        if len(block):
            share = (int(block.measured_at_us[-1]) - first_us) / max(1, last_us - first_us)
            report((_READING * min(max(share, 0.0), 1.0), "Reading"))

    def joined(name: str, kind: type, width: int | None = None) -> Any:  # noqa: ANN401 - any array
        found = parts.pop(name, [])
        shape = (0,) if width is None else (0, width)
        return np.concatenate(found) if found else np.empty(shape, dtype=kind)

    keys = {one.key for one in question.series} | set(question.wanted.channels)
    return {
        "at": joined("at", np.int64),
        "position": joined("position", np.float64, 3),
        "fix": joined("fix", np.bool_),
        "paced": joined("paced", np.bool_),
        **{
            f"{_VALUE}{key}": joined(f"{_VALUE}{key}", np.float64)
            for key in sorted(keys - {DEPTH, CONSERVATIVE})
        },
    }


def _parts(block: RowBlock, question: Question) -> list[tuple[str, np.ndarray]]:
    # a recording's states have no mode, and are there at the times of its samples
    is_recorded = question.wanted.deployment.kind == "recorded"
    paced = np.full(len(block), is_recorded) | (block.mode >= 0)
    if question.pace is not None:
        paced |= np.isfinite(block.value[question.pace])
    states = [
        (f"{_VALUE}{one.key}", state_values(block, one.key, question.wanted))
        for one in question.series
        if one.kind == "state" and one.key != DEPTH
    ]
    return [
        ("at", block.measured_at_us),
        ("position", block.position_ned),
        ("fix", block.has_fix),
        ("paced", paced),
        *states,
        *((f"{_VALUE}{key}", values) for key, values in block.value.items()),
    ]


@dataclass(frozen=True, slots=True, eq=False)
class Flown:
    """The dives of a deployment."""

    dives: list[Dive]
    rows: IntArray
    """Rows of the deployment by the numbers that dives have of them."""
    legs: Legs


def dives_in(columns: Columns, flags: FlagArray) -> Flown:
    """Find the dives by depths that nobody calls bad.

    Args:
        columns: All rows.
        flags: Of the depths, shape ``(n,)``.
    """
    rows = np.flatnonzero(columns.is_paced & np.isfinite(columns.depth_m) & (flags < FAIL))
    times_s, depth_m = columns.at_us[rows] / 1e6, columns.depth_m[rows]
    dives = find_dives(depth_m, times_s)
    return Flown(dives, rows, legs_of(dives, depth_m, times_s))


class Flags:
    """What is known of the quality of a deployment: its newest run of rules, and people's flags."""

    def __init__(self, session: Session, deployment: str) -> None:
        self._session = session
        self._run = newest_quality_run(session, deployment)
        self._manual: list[ManualFlag] = manual_flags(session, deployment)

    @property
    def is_checked(self) -> bool:
        """Whether rules were run."""
        return self._run is not None

    def of(self, series: str, columns: Columns) -> FlagArray:
        """Return the flags of OG1.0 of a series, shape ``(n,)``; ``OG1_FILL`` where no value is.

        A value that the newest run did not see has 0, no control. What is computed of two series
        here has the greater of their flags.
        """
        if series == CONSERVATIVE:
            found = np.maximum(self.of(SALINITY, columns), self.of(TEMPERATURE, columns))
            found[~np.isfinite(columns.values[CONSERVATIVE])] = OG1_FILL
            return found
        told = np.isfinite(columns.values[series])
        flags = flags_of(self._session, self._run, self._manual, series, columns.at_us, told)
        flags[~told] = OG1_FILL
        return flags


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Values of some series at the same moments, shape ``(m,)`` each."""

    at_us: IntArray
    dive: IntArray
    leg: IntArray
    direction: IntArray
    depth_m: FloatArray
    values: Mapping[str, FloatArray]
    flags: Mapping[str, FlagArray]
    interpolated: Mapping[str, int]
    """How many values lie between two that were measured."""

    def __len__(self) -> int:
        return len(self.at_us)


def read_table(
    session: Session, question: Question, is_cancelled: IsCancelled, report: Report = untold
) -> Table:
    """Read some series of a deployment, each value at the moments of the one that has fewest.

    Others are interpolated in time between two values that are at most ten seconds apart; such a
    value has the greater flag of the two. Rows of other dives are left out, and so are values
    whose flag is beyond ``flag_max``; rows without any value are none.

    Raises:
        WorkCancelledError: Between two blocks.
    """
    columns = read_columns(session, question, is_cancelled, report)
    flags = Flags(session, question.wanted.deployment.id)
    legs = dives_in(columns, flags.of(DEPTH, columns)).legs
    known = {one.key: flags.of(one.key, columns) for one in question.series}
    values = {
        key: np.where(found <= question.flag_max, columns.values[key], np.nan)
        for key, found in known.items()
    }
    told = {key: np.flatnonzero(np.isfinite(one)) for key, one in values.items()}
    sampled = [key for key in told if key != DEPTH] or list(told)
    rows = told[min(sampled, key=lambda key: len(told[key]))]
    dive, leg, direction = leg_at(legs, columns.at_us[rows] / 1e6)
    if question.spans is not None:
        chosen = np.zeros(len(rows), dtype=np.bool_)
        for first, last in question.spans:
            chosen |= (dive >= first) & (dive <= last)
        rows, dive, leg, direction = rows[chosen], dive[chosen], leg[chosen], direction[chosen]
    aligned = {key: _at(rows, columns.at_us, values[key], known[key]) for key in known}
    return Table(
        at_us=columns.at_us[rows],
        dive=dive,
        leg=leg,
        direction=direction,
        depth_m=_at(rows, columns.at_us, columns.depth_m, known.get(DEPTH))[0],
        values={key: one[0] for key, one in aligned.items()},
        flags={key: one[1] for key, one in aligned.items()},
        interpolated={key: one[2] for key, one in aligned.items()},
    )


def _at(
    rows: IntArray, at_us: IntArray, values: FloatArray, flags: FlagArray | None
) -> tuple[FloatArray, FlagArray, int]:
    """Return values and flags at some rows, and how many of them lie between two others."""
    found = values[rows]
    given = np.zeros(len(rows), dtype=np.int8) if flags is None else flags[rows].copy()
    given[~np.isfinite(found)] = OG1_FILL
    told = np.flatnonzero(np.isfinite(values))
    lacking = np.flatnonzero(~np.isfinite(found))
    after = np.searchsorted(told, rows[lacking])
    between = (after > 0) & (after < len(told))
    lacking, after = lacking[between], after[between]
    one, other = told[after - 1], told[after]
    near = at_us[other] - at_us[one] <= APART_US
    lacking, one, other = lacking[near], one[near], other[near]
    share = (at_us[rows[lacking]] - at_us[one]) / (at_us[other] - at_us[one])
    found[lacking] = values[one] + share * (values[other] - values[one])
    if flags is not None:
        given[lacking] = np.maximum(flags[one], flags[other])
    else:
        given[lacking] = 0
    return found, given, len(lacking)
