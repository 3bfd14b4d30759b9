"""Long series thinned in the database so that the extremes of every interval stay."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from sqlalchemy import (
    BigInteger,
    ColumnElement,
    Executable,
    ScalarSelect,
    SQLColumnExpression,
    case,
    func,
    literal,
    select,
    type_coerce,
)
from sqlalchemy.orm import InstrumentedAttribute, Session

from db.query.measured.rollup import SECOND_US, AnyRollup, Piece, pieces
from db.sample_tables import COARSE_S, FINE_S

READ_ROWS_MAX = 150_000
"""Rows of which the extremes are found by reading all."""
_ENDS = 4
"""Most intervals that lie before and after whole stretches."""


@dataclass(frozen=True, slots=True)
class Series:
    """Which rows of which table are a series: their time, their value, and what selects them."""

    at: SQLColumnExpression[datetime]
    value: SQLColumnExpression[Any]
    where: tuple[ColumnElement[bool], ...]
    beside: tuple[SQLColumnExpression[Any], ...] = ()
    """Further columns to return with each row."""
    rollup: type[AnyRollup] | None = None
    """Where stretches of these values are summed up, if they are."""
    of_rollup: tuple[ColumnElement[bool], ...] = ()
    """What selects those of this series."""
    lengths_s: tuple[int, ...] = (COARSE_S, FINE_S)
    """Lengths of the stretches that are summed up, descending."""
    summed_until_us: int | None = None
    """From when on nothing is summed up; ``None`` where everything is."""


def thinned_rows(
    session: Session,
    series: Series,
    start: datetime | None,
    end: datetime | None,
    max_points: int,
) -> tuple[Sequence[tuple[Any, ...]], bool]:
    """Return rows ``(at_us, value, *beside)`` from ``start`` to ``end``, in order of time.

    Times are whole microseconds from the epoch, see ``db.column.moments``.
    With more than ``max_points`` rows, the range is cut into ``max_points // 2`` intervals of
    equal length and only the rows with the smallest and the largest value of each are returned.
    Each interval is one range scan of the table's order, so the whole reads every row once. A
    series of more than ``READ_ROWS_MAX`` rows that is summed up is cut into whole stretches, and
    their extremes are read instead.

    Returns:
        The rows, and whether any were left out.
    """
    where = [*series.where]
    if start is not None:
        where.append(series.at >= start)
    if end is not None:
        where.append(series.at <= end)
    at = type_coerce(series.at, BigInteger)
    statement = select(at, series.value, *series.beside).order_by(at)
    rows = _drivers_rows(session, statement.where(*where).limit(max_points + 1))
    if len(rows) <= max_points:
        return rows, False
    first = rows[0][0]
    last = session.scalars(select(at).where(*where).order_by(at.desc()).limit(1)).one()
    intervals = max(1, max_points // 2)
    rollup = series.rollup if intervals >= 2 * _ENDS else None
    if rollup is None or _size(session, series, first, last) <= READ_ROWS_MAX:
        found = _extreme_moments(session, series, first, last, intervals)
    else:
        found = _summed_extreme_moments(session, series, rollup, first, last, intervals - _ENDS)
    kept = sorted(found)
    # Without the range, each moment is one look into the table's order.
    chosen = statement.where(*series.where, at.in_(kept)).limit(max_points)
    return _drivers_rows(session, chosen), True


def spread_moments(
    session: Session, series: Series, begin: int, last: int, count: int
) -> list[int]:
    """Return the first and the last moment of each of ``count`` equal intervals, in order, us.

    Each is one look into the table's order, however many rows there are.
    """
    at = type_coerce(series.at, BigInteger)
    width = (last - begin) // count + 1
    reading = _Reading(at, at, at, at, at, series.where)
    return sorted(_extremes(session, reading, begin, last + 1, width))


def _drivers_rows(session: Session, statement: Executable) -> Sequence[tuple[Any, ...]]:
    """Return plain tuples: wrapping twenty thousand rows takes longer than reading them."""
    with session.connection().execute(statement) as found:
        return [] if found.cursor is None else found.cursor.fetchall()


def _size(session: Session, series: Series, first: int, last: int) -> int:
    """Return about how many rows there are between two moments."""
    if series.rollup is None:
        return 0
    length_us = FINE_S * SECOND_US
    whole = Piece(FINE_S, first // length_us * length_us, (last // length_us + 1) * length_us)
    statement = select(func.coalesce(func.sum(series.rollup.size), 0))
    where = (*series.of_rollup, *whole.holds(series.rollup))
    return int(session.scalars(statement.where(*where)).one())


def _extreme_moments(
    session: Session, series: Series, begin: int, last: int, intervals: int
) -> set[int]:
    at = type_coerce(series.at, BigInteger)
    width = (last - begin) // intervals + 1
    reading = _Reading(at, at, at, series.value, series.value, series.where)
    return _extremes(session, reading, begin, last + 1, width)


def _summed_extreme_moments(
    session: Session,
    series: Series,
    rollup: type[AnyRollup],
    first: int,
    last: int,
    intervals: int,
) -> set[int]:
    """Return moments of extremes by whole stretches, and row by row before and after them."""
    found: set[int] = set()
    wanted_us = (last - first) // intervals + 1
    lengths_s = tuple(
        one for one in series.lengths_s if one == FINE_S or one * SECOND_US < wanted_us
    )
    until_us = last + 1 if series.summed_until_us is None else series.summed_until_us
    begin_us = max(first, until_us)
    if begin_us <= last:
        count = -(-(last + 1 - begin_us) // wanted_us)
        found |= _extreme_moments(session, series, begin_us, last, count)
    for piece in pieces(first, min(last + 1, until_us), lengths_s):
        if not piece.length_s:
            found |= _extreme_moments(session, series, piece.begin_us, piece.end_us - 1, 1)
            continue
        length_us = piece.length_s * SECOND_US
        begin, end = piece.begin_us // length_us, piece.end_us // length_us
        width = max(1, -(-wanted_us // length_us))
        reading = _Reading(
            rollup.stretch,
            type_coerce(rollup.least_at, BigInteger),
            type_coerce(rollup.greatest_at, BigInteger),
            rollup.least,
            rollup.greatest,
            (*series.of_rollup, rollup.length_s == piece.length_s),
        )
        found |= _extremes(session, reading, begin, end, width)
    return found


@dataclass(frozen=True, slots=True)
class _Reading:
    """What the smallest and the largest of each interval of something is, and when."""

    place: ColumnElement[Any] | InstrumentedAttribute[Any]
    """What intervals are cut of."""
    least_at: ColumnElement[Any]
    greatest_at: ColumnElement[Any]
    least: SQLColumnExpression[Any]
    greatest: SQLColumnExpression[Any]
    where: tuple[ColumnElement[bool], ...]


def _extremes(session: Session, reading: _Reading, begin: int, end: int, width: int) -> set[int]:
    """Return moments of the extremes of each width from a place to another, not included."""
    intervals = -(-(end - begin) // width)
    interval = select(literal(0, BigInteger).label("number")).cte("interval", recursive=True)
    interval = interval.union_all(
        select(interval.c.number + 1).where(interval.c.number < intervals - 1)
    )

    after = begin + (interval.c.number + 1) * width
    after = case((after < end, after), else_=end)

    def extreme(at: ColumnElement[Any], order: ColumnElement[Any]) -> ScalarSelect[Any]:
        return (
            select(at)
            .where(
                *reading.where,
                reading.place >= begin + interval.c.number * width,
                reading.place < after,
            )
            .order_by(order)
            .limit(1)
            .correlate(interval)
            .scalar_subquery()
        )

    pairs = session.execute(
        select(
            extreme(reading.least_at, reading.least.asc()),
            extreme(reading.greatest_at, reading.greatest.desc()),
        ).select_from(interval)
    )
    return {at_us for pair in pairs for at_us in pair if at_us is not None}
