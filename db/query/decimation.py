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
    literal,
    select,
    type_coerce,
)
from sqlalchemy.orm import Session


@dataclass(frozen=True, slots=True)
class Series:
    """Which rows of which table are a series: their time, their value, and what selects them."""

    at: SQLColumnExpression[datetime]
    value: SQLColumnExpression[Any]
    where: tuple[ColumnElement[bool], ...]
    beside: tuple[SQLColumnExpression[Any], ...] = ()
    """Further columns to return with each row."""


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
    Each interval is one range scan of the table's order, so the whole reads every row once.

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
    kept = sorted(_extreme_moments(session, series, first, last, max(1, max_points // 2)))
    return _drivers_rows(session, statement.where(*where, at.in_(kept)).limit(max_points)), True


def _drivers_rows(session: Session, statement: Executable) -> Sequence[tuple[Any, ...]]:
    """Return plain tuples: wrapping twenty thousand rows takes longer than reading them."""
    with session.connection().execute(statement) as found:
        return [] if found.cursor is None else found.cursor.fetchall()


def _extreme_moments(
    session: Session, series: Series, begin: int, last: int, intervals: int
) -> set[int]:
    width = (last - begin) // intervals + 1
    interval = select(literal(0, BigInteger).label("number")).cte("interval", recursive=True)
    interval = interval.union_all(
        select(interval.c.number + 1).where(interval.c.number < intervals - 1)
    )
    at = type_coerce(series.at, BigInteger)

    def extreme(order: ColumnElement[Any]) -> ScalarSelect[Any]:
        return (
            select(at)
            .where(
                *series.where,
                at >= begin + interval.c.number * width,
                at < begin + (interval.c.number + 1) * width,
            )
            .order_by(order)
            .limit(1)
            .correlate(interval)
            .scalar_subquery()
        )

    pairs = session.execute(
        select(extreme(series.value.asc()), extreme(series.value.desc())).select_from(interval)
    )
    return {at_us for pair in pairs for at_us in pair if at_us is not None}
