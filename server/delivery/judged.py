"""The rows of a deployment with their flags, as workers make them."""

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.frames import wgs84_from_ned
from autonomy.quality.flag import MISSING, FlagArray, og1_flags
from autonomy.quality.judgement import (
    Judgement,
    judge_depth,
    judge_position,
    judge_series,
    stretches,
)
from autonomy.quality.rules import QualityRules, SeriesRule
from db.column import microseconds, moment
from db.query.fleet.deployments import DeploymentRecord
from db.query.measured.derived import derived_columns
from db.query.measured.merged_rows import RowBlock, iterate_rows
from db.query.measured.quality import ManualFlag, QualityStretch
from server.base.worker import IsCancelled, WorkCancelledError

_CHANNEL = "channel:"
"""Before the key of a channel, which may be called like a column of another kind."""
POSITION, DEPTH = "position", "depth"
"""Series beside those of the channels."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which rows, and by what they are judged."""

    database_url: str
    deployment: DeploymentRecord
    believable: Mapping[str, tuple[float, float]]
    """Range of the catalogue now, by the channels that rows carry."""
    rules: QualityRules
    """With the ranges of the catalogue where they say none themselves."""
    smoothed: bool
    """Whether samples are where they were after all."""
    derived: tuple[str, ...] = ()
    """Those of the channels that are computed ashore of others."""
    has_true_headings: bool = False
    """Whether headings were told from true north, as recordings and vehicles of others do."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels that rows carry."""
        return tuple(self.believable)


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """What rules say of all rows: a judgement of each series, and which rows it is about."""

    at_us: IntArray
    """Shape ``(n,)``, strictly ascending."""
    told: Mapping[str, BoolArray]
    """Whether each row has a value, by series, shape ``(n,)`` each."""
    judgements: Mapping[str, Judgement]
    left_out: int
    """Further measurements of a channel at one moment."""
    depth_m: FloatArray
    """Shape ``(n,)``, NaN where nobody told."""
    mode: IntArray
    """``robot_link.messages.RobotMode``, -1 where nobody told, shape ``(n,)``."""
    has_fix: BoolArray
    """Shape ``(n,)``."""

    def og1(self, series: str, manual: Sequence[ManualFlag]) -> FlagArray:
        """Return the flags of a series as files have them, those of people before all others."""
        flags = np.full(len(self.at_us), MISSING, dtype=np.int8)
        flags[self.told[series]] = self.judgements[series].flags
        found = og1_flags(flags)
        for one in manual:
            if one.series == series:
                first, last = microseconds(one.first_at), microseconds(one.last_at)
                begin = np.searchsorted(self.at_us, first, side="left")
                end = np.searchsorted(self.at_us, last, side="right")
                part = found[begin:end]
                part[flags[begin:end] != MISSING] = one.flag
        return found

    def found(self) -> list[QualityStretch]:
        """Return what is not good, by series and time."""
        return [
            QualityStretch(
                series,
                moment(int(self.at_us[rows[one.first]])),
                moment(int(self.at_us[rows[one.last]])),
                one.flag,
                ",".join(one.tests),
            )
            for series, judgement in self.judgements.items()
            for rows in [np.flatnonzero(self.told[series])]
            for one in stretches(judgement)
        ]


def blocks_of(session: Session, wanted: Wanted, is_cancelled: IsCancelled) -> Generator[RowBlock]:
    """Yield the rows in order of time.

    Raises:
        WorkCancelledError: Between two blocks.
    """
    sampled = [key for key in wanted.channels if key not in wanted.derived]
    computed = _computed(session, wanted)
    for block in iterate_rows(session, wanted.deployment, sampled, smoothed=wanted.smoothed):
        if is_cancelled():
            raise WorkCancelledError
        if len(block):
            more = {key: _aligned(block, *found) for key, found in computed.items()}
            yield replace(block, value={**block.value, **more}) if more else block


def _computed(session: Session, wanted: Wanted) -> dict[str, tuple[IntArray, FloatArray]]:
    """Return times and values of the derived channels, worked out once for a reading."""
    known = session.info.setdefault("derived", {})
    record = wanted.deployment
    for key in wanted.derived:
        if key not in known:
            found = derived_columns(
                session, (record.robot,), key, record.begun_at, record.last_at, record.log
            )
            known[key] = found.measured_at_us, found.value
    return known


def _aligned(block: RowBlock, at_us: IntArray, values: FloatArray) -> FloatArray:
    """Return values at the moments of a block, NaN where there is none."""
    column = np.full(len(block), np.nan)
    first, last = block.measured_at_us[0], block.measured_at_us[-1]
    part = slice(*np.searchsorted(at_us, (first, last + 1)).tolist())
    rows = np.searchsorted(block.measured_at_us, at_us[part])
    column[rows] = values[part]
    return column


class Digest(Protocol):
    """A hash that takes more and more."""

    def update(self, data: bytes, /) -> None:
        """Take what follows."""
        ...


def add_rows(digest: Digest, block: RowBlock) -> None:
    """Add rows to a hash over all that a file is made of."""
    for part in (block.measured_at_us, block.position_ned, *block.value.values()):
        digest.update(np.ascontiguousarray(part).tobytes())


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """Where rows were taken."""

    wgs84: FloatArray
    """Latitude and longitude, degrees, and depth, m; shape ``(n, 3)``, NaN where nobody told."""
    is_known: BoolArray
    """Whether latitude and longitude are told, shape ``(n,)``."""
    raised: int
    """Depths just above the surface, which stand as 0."""


def places_of(block: RowBlock, wanted: Wanted) -> Placed:
    """Return where rows were taken, as files tell it."""
    site = wanted.deployment.site
    places = np.full((len(block), 3), np.nan)
    known = np.all(np.isfinite(block.position_ned[:, :2]), axis=1)
    places[known, :2] = wgs84_from_ned(
        block.position_ned[known, :2], site.origin_latitude_deg, site.origin_longitude_deg
    )
    depth = block.position_ned[:, 2]
    above = (depth < 0.0) & (depth >= -wanted.rules.depth.above_m)
    places[:, 2] = np.where(above, 0.0, depth)
    return Placed(places, known, int(np.count_nonzero(above)))


def judged(session: Session, wanted: Wanted, is_cancelled: IsCancelled) -> Judged:
    """Read all rows once and judge them.

    Raises:
        WorkCancelledError: Between two blocks or series.
    """
    columns = _Columns()
    left_out = 0
    for block in blocks_of(session, wanted, is_cancelled):
        columns.add(block)
        left_out += block.left_out
    at_us = columns.joined("at_us", np.int64)
    # of one beginning: a float of seconds since the epoch holds a tenth of a microsecond
    times_s = (at_us - at_us[:1]) / 1e6
    told: dict[str, BoolArray] = {}
    found: dict[str, Judgement] = {}
    for key in wanted.channels:
        if is_cancelled():
            raise WorkCancelledError
        told[key], found[key] = _channel(columns, key, times_s, wanted)
    fix = columns.joined("fix", np.bool_)
    told[POSITION], found[POSITION] = _position(columns, times_s, fix, wanted)
    depth_m = columns.joined("depth", np.float64)
    told[DEPTH] = np.isfinite(depth_m)
    found[DEPTH] = judge_depth(
        depth_m[told[DEPTH]],
        times_s[told[DEPTH]],
        wanted.rules.depth,
        wanted.deployment.site.domain.depth_max_m,
    )
    return Judged(at_us, told, found, left_out, depth_m, columns.joined("mode", np.int64), fix)


def _channel(
    columns: "_Columns", key: str, times_s: FloatArray, wanted: Wanted
) -> tuple[BoolArray, Judgement]:
    """Judge a channel; return which rows have a value of it too."""
    values = columns.joined(_CHANNEL + key, np.float64)
    told = np.isfinite(values)
    rule = wanted.rules.series.get(key, SeriesRule())
    return told, judge_series(values[told], times_s[told], rule)


def _position(
    columns: "_Columns", times_s: FloatArray, fix: BoolArray, wanted: Wanted
) -> tuple[BoolArray, Judgement]:
    """Judge places as the robot believed them, and smoothed ones, each in a line of their own.

    Between the two lies how far the robot was wrong, which is no movement. Which rows have a place
    is returned too.
    """
    north_east = columns.joined("north_east", np.float64, (0, 2))
    smoothed = columns.joined("smoothed", np.bool_)
    told = np.isfinite(north_east[:, 0]) & np.isfinite(north_east[:, 1])
    parts = [np.flatnonzero(told & ~smoothed), np.flatnonzero(told & smoothed)]
    box, rule = wanted.deployment.site.domain, wanted.rules.position
    said = [judge_position(north_east[part], times_s[part], fix[part], rule, box) for part in parts]
    order = np.argsort(np.concatenate(parts), kind="stable")
    whole = np.concatenate([one.flags for one in said])[order]
    by_test = {
        test: np.concatenate([one.by_test[test] for one in said])[order] for test in said[0].by_test
    }
    return told, Judgement(whole, by_test)


class _Columns:
    """Columns that grow in place; each is let go of once it is taken."""

    def __init__(self) -> None:
        self._columns: dict[str, np.ndarray] = {}
        self._count = 0

    def add(self, block: RowBlock) -> None:
        """Take what a judgement needs of a block."""
        end = self._count + len(block)
        for name, part in (
            ("at_us", block.measured_at_us),
            ("north_east", block.position_ned[:, :2]),
            ("depth", block.position_ned[:, 2]),
            ("fix", block.has_fix),
            ("smoothed", block.is_smoothed),
            ("mode", block.mode),
            *((_CHANNEL + key, values) for key, values in block.value.items()),
        ):
            column = self._columns.setdefault(name, np.empty_like(part[:0]))
            if len(column) < end:
                # nobody else holds it: the system moves its pages, and no row is held twice
                column.resize((end + end // 8, *part.shape[1:]), refcheck=False)
            column[self._count : end] = part
        self._count = end

    def joined(self, name: str, kind: type, empty: tuple[int, ...] = (0,)) -> np.ndarray:
        """Return a column, which is empty where there was no block."""
        column = self._columns.pop(name, None)
        if column is None:
            return np.empty(empty, dtype=kind)
        column.resize((self._count, *column.shape[1:]), refcheck=False)
        return column
