"""What is told of a deployment's rows: dives, thinned rows, statistics, lines of density."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from sqlalchemy.orm import Session

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.profile.dive import Dive
from autonomy.seawater import sigma0
from db.engine import reading
from db.query.measured.battery import charge_told
from server.analysis.column import (
    Columns,
    Flags,
    Flown,
    Table,
    dives_in,
    read_columns,
    read_table,
    untold,
)
from server.analysis.question import CONSERVATIVE, SALINITY, Question, Series
from server.base.worker import IsCancelled, Report
from server.delivery.judged import DEPTH

DIVES_TASK: Final = f"{__name__}:run_dives"
ROWS_TASK: Final = f"{__name__}:run_rows"
BINS: Final = 40
_DENSITY_POINTS: Final = 41
_SPEECH_US: Final = 60_000_000
"""A charge that was told longer before or after a moment is not that of the moment."""
_FIX_US: Final = 600_000_000
"""A fix that came later after a dive says where the robot drifted."""
_J_PER_WH: Final = 3600.0
_STEPS: Final = 2.0


@dataclass(frozen=True, slots=True)
class DiveFacts:
    """One dive."""

    number: int
    begin_us: int
    end_us: int
    depth_m: float
    distance_m: float | None
    """In a straight line over ground; ``None`` where its ends have no place."""
    energy_j: float | None
    """``None`` where the robot does not tell its charge, or it fell by less than is told."""
    legs: int
    samples: int
    """Moments with a value of the channel that has most."""


@dataclass(frozen=True, slots=True)
class DivesFound:
    """The dives of a deployment, and what can be asked of it."""

    dives: list[DiveFacts]
    series: list[Series]
    rows: int
    is_checked: bool
    energy_step_j: float | None
    """Steps in which the robot tells its charge, ``None`` where it tells none."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """Of all values of a series that were chosen; numbers are ``None`` without any."""

    count: int
    mean: float | None = None
    std: float | None = None
    """Of the sample; ``None`` of a single value."""
    median: float | None = None
    low_5: float | None = None
    """One in twenty values is less."""
    high_95: float | None = None
    least: float | None = None
    greatest: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class RowsFound:
    """Rows of some series, thinned for the screen."""

    table: Table
    total: int
    """Rows before thinning."""
    is_checked: bool
    statistics: Mapping[str, Statistics]
    bins: Mapping[str, tuple[list[float], list[int]]]
    """Edges, one more than there are counts, and counts."""
    density: tuple[list[float], list[float], list[list[float]]] | None
    """Absolute salinity, conservative temperature, and sigma0 by temperature, then salinity."""


def find_facts(
    session: Session, question: Question, is_cancelled: IsCancelled, report: Report = untold
) -> DivesFound:
    """Find the dives of a deployment, and which series have a value in it.

    Raises:
        WorkCancelledError: Between two blocks.
    """
    columns = read_columns(session, question, is_cancelled, report)
    flags = Flags(session, question.wanted.deployment.id)
    flown = dives_in(columns, flags.of(DEPTH, columns))
    deployment = question.wanted.deployment
    charge = charge_told(session, deployment.robot, deployment.begun_at, deployment.last_at)
    step = _step_of(charge[1])
    capacity_j = question.capacity_wh * _J_PER_WH
    paced = np.zeros(len(columns.at_us), dtype=np.bool_)
    if question.pace is not None:
        paced = np.isfinite(columns.values[question.pace])
    told = np.concatenate([[0], np.cumsum(paced)])
    facts: list[DiveFacts] = []
    for number, dive in enumerate(flown.dives, 1):
        first, last, deepest = flown.rows[[dive.first, dive.last, dive.deepest]].tolist()
        begin_us, end_us = int(columns.at_us[first]), int(columns.at_us[last])
        fell = None if step is None else _fallen(charge, begin_us, end_us, step)
        facts.append(
            DiveFacts(
                number=number,
                begin_us=begin_us,
                end_us=end_us,
                depth_m=float(columns.depth_m[deepest]),
                distance_m=_distance_m(columns, flown, number, dive),
                energy_j=None if fell is None else fell * capacity_j,
                legs=len(dive.turns) - 1,
                samples=int(told[last + 1] - told[first]),
            )
        )
    series = [one for one in question.offered if one.kind != "state" or _is_told(columns, one.key)]
    return DivesFound(
        facts,
        series,
        len(columns.at_us),
        flags.is_checked,
        None if step is None else step * capacity_j,
    )


def find_rows(
    session: Session, question: Question, is_cancelled: IsCancelled, report: Report = untold
) -> RowsFound:
    """Read some series, sum them up, and thin them.

    Raises:
        WorkCancelledError: Between two blocks.
    """
    table = read_table(session, question, is_cancelled, report)
    keys = {one.key for one in question.series}
    has_density = {SALINITY, CONSERVATIVE} <= keys
    return RowsFound(
        table=_thinned(table, question.limit),
        total=len(table),
        is_checked=Flags(session, question.wanted.deployment.id).is_checked,
        statistics={key: statistics_of(values) for key, values in table.values.items()},
        bins={key: bins_of(values) for key, values in table.values.items()},
        density=_density(table.values[SALINITY], table.values[CONSERVATIVE])
        if has_density
        else None,
    )


def run_dives(question: Question, report: Report, is_cancelled: IsCancelled) -> DivesFound:
    """Do ``find_facts`` in a worker process."""
    with reading(question.wanted.database_url) as session:
        return find_facts(session, question, is_cancelled, report)


def run_rows(question: Question, report: Report, is_cancelled: IsCancelled) -> RowsFound:
    """Do ``find_rows`` in a worker process."""
    with reading(question.wanted.database_url) as session:
        return find_rows(session, question, is_cancelled, report)


def statistics_of(values: FloatArray) -> Statistics:
    """Sum up the values that are there, shape ``(n,)``."""
    told = values[np.isfinite(values)]
    if told.size == 0:
        return Statistics(0)
    low, median, high = np.percentile(told, (5.0, 50.0, 95.0)).tolist()
    return Statistics(
        count=told.size,
        mean=float(told.mean()),
        std=float(told.std(ddof=1)) if told.size > 1 else None,
        median=median,
        low_5=low,
        high_95=high,
        least=float(told.min()),
        greatest=float(told.max()),
    )


def bins_of(values: FloatArray) -> tuple[list[float], list[int]]:
    """Count values in ``BINS`` bins of one width; none without values, one where all are equal."""
    told = values[np.isfinite(values)]
    if told.size == 0:
        return [], []
    low, high = float(told.min()), float(told.max())
    # neighbours that a float cannot keep apart have one bin
    if high - low <= BINS * np.spacing(max(abs(low), abs(high))):
        return [low - 0.5, low + 0.5], [int(told.size)]
    counts, edges = np.histogram(told, bins=BINS)
    return edges.tolist(), counts.tolist()


def _thinned(table: Table, limit: int | None) -> Table:
    """Keep rows at even steps, and the least and the greatest value of each series."""
    if limit is None or len(table) <= limit:
        return table
    kept = [np.linspace(0, len(table) - 1, limit).round().astype(np.int64)]
    kept += [
        np.array([np.nanargmin(values), np.nanargmax(values)])
        for values in (table.depth_m, *table.values.values())
        if np.isfinite(values).any()
    ]
    rows = np.unique(np.concatenate(kept))
    return Table(
        at_us=table.at_us[rows],
        dive=table.dive[rows],
        leg=table.leg[rows],
        direction=table.direction[rows],
        depth_m=table.depth_m[rows],
        values={key: values[rows] for key, values in table.values.items()},
        flags={key: flags[rows] for key, flags in table.flags.items()},
        interpolated=table.interpolated,
    )


def _density(
    salinity: FloatArray, temperature: FloatArray
) -> tuple[list[float], list[float], list[list[float]]] | None:
    """Return sigma0 on a grid around what was measured, ``None`` where nothing was."""
    told = np.isfinite(salinity) & np.isfinite(temperature)
    if not told.any():
        return None
    axes: list[FloatArray] = []
    for values, least in ((salinity[told], 0.0), (temperature[told], -np.inf)):
        low, high = float(values.min()), float(values.max())
        room = max(0.1 * (high - low), 0.05)
        axes.append(np.linspace(max(low - room, least), high + room, _DENSITY_POINTS))
    grid = sigma0(axes[0][np.newaxis, :], axes[1][:, np.newaxis])
    return axes[0].tolist(), axes[1].tolist(), grid.tolist()


def _is_told(columns: Columns, key: str) -> bool:
    return key in columns.values and bool(np.isfinite(columns.values[key]).any())


def _distance_m(columns: Columns, flown: Flown, number: int, dive: Dive) -> float | None:
    """Return how far a dive went over ground, by the fix after it where one came soon."""
    first, last = int(flown.rows[dive.first]), int(flown.rows[dive.last])
    has_next = number < len(flown.dives)
    end = int(flown.rows[flown.dives[number].first]) if has_next else len(columns.at_us) - 1
    known: BoolArray = np.asarray(np.isfinite(columns.position_ned[:, :2]).all(axis=1))
    after = slice(last, end + 1)
    soon = columns.at_us[after] <= columns.at_us[last] + _FIX_US
    fixes = np.flatnonzero(columns.has_fix[after] & known[after] & soon)
    last = last + int(fixes[0]) if fixes.size else last
    if not (known[first] and known[last]):
        return None
    way = columns.position_ned[last, :2] - columns.position_ned[first, :2]
    return float(np.hypot(*way))


def _step_of(fractions: FloatArray) -> float | None:
    """Return the least fall of a told charge; ``None`` where it never fell."""
    falls = -np.diff(fractions)
    falls = falls[falls > 1e-9]
    return float(falls.min()) if falls.size else None


def _fallen(
    charge: tuple[IntArray, FloatArray], begin_us: int, end_us: int, step: float
) -> float | None:
    """Return by how much of the full battery the charge fell; ``None`` where nobody can say."""
    at_us, fraction = charge
    ends: list[float] = []
    for moment_us in (begin_us, end_us):
        row = int(np.searchsorted(at_us, moment_us, side="right")) - 1
        if row < 0 or moment_us - int(at_us[row]) > _SPEECH_US:
            return None
        ends.append(float(fraction[row]))
    fell = ends[0] - ends[1]
    return fell if fell >= _STEPS * step else None
