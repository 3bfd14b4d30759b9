"""How many rows and bytes each table has, without reading all of a large one again and again.

A table is counted whole at first, and again the more seldom the longer that took; in between only
what was added is counted, by the order in which the table lies. Rows of samples and readings are
the sum of their stretches, which are kept anyway (``db.sample_tables``).
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, Final

from sqlalchemy import (
    JSON,
    BigInteger,
    ColumnElement,
    LargeBinary,
    String,
    Table,
    func,
    select,
    text,
    type_coerce,
)
from sqlalchemy.orm import Session

from db.column import moment
from db.migrate import METADATA
from db.sample_tables import COARSE_S, ChannelRow, ReadingRollup, SampleRollup
from db.tables import Robot

_ROLLUPS: Final = {"sample": SampleRollup, "reading": ReadingRollup}
_SAMPLED_ROWS: Final = 100
_RECOUNT_S: Final = 86_400.0
_COST: Final = 20_000.0
"""A whole count is made again after so many times what it took."""
_BEFORE_ALL: Final = -(2**62)
_CELL_BYTES: Final = 4
_INDEX_BYTES: Final = 14
"""Of one entry of an index over a moment or a number."""


@dataclass(frozen=True, slots=True)
class TableCount:
    """How many rows a table has, and what going on from there needs."""

    rows: int
    whole_at_s: float
    """When all were counted, by the wall's clock."""
    took_s: float
    marks: Mapping[str, int]
    """Where counting goes on: behind the last moment of each robot, or behind the last key."""


@dataclass(frozen=True, slots=True)
class DatabaseSize:
    """Bytes of the whole database."""

    used: int
    free: int
    """Inside its file, for rows to come; ``grace db vacuum`` gives them back to the disk."""


def table_names() -> list[str]:
    """Return every table of the station."""
    return sorted(METADATA.tables)


def count_table(session: Session, name: str, last: TableCount | None) -> TableCount:
    """Return how many rows a table has, going on from an earlier count where that will do."""
    table = METADATA.tables[name]
    now_s = time.time()
    if name in _ROLLUPS:
        return TableCount(_sum_of_stretches(session, name), now_s, 0.0, {})
    if last is not None and now_s < last.whole_at_s + max(_RECOUNT_S, _COST * last.took_s):
        rows, marks = _behind(session, table, last.marks)
        return replace(last, rows=last.rows + rows, marks={**last.marks, **marks})
    began_s = time.monotonic()
    if _is_by_robot(table) or _is_by_key(table):
        rows, marks = _behind(session, table, {})
    else:
        rows, marks = session.scalar(select(func.count()).select_from(table)) or 0, {}
    return TableCount(rows, now_s, time.monotonic() - began_s, marks)


def _behind(session: Session, table: Table, marks: Mapping[str, int]) -> tuple[int, dict[str, int]]:
    """Return how many rows lie behind the marks, and the new marks; none of an unordered table."""
    found = 0
    new: dict[str, int] = {}
    for place, order, where in _orders(session, table):
        rows, newest = session.execute(
            select(func.count(), func.max(order)).where(
                *where, order > marks.get(place, _BEFORE_ALL)
            )
        ).one()
        found += rows
        if newest is not None:
            new[place] = int(newest)
    return found, new


def _orders(
    session: Session, table: Table
) -> list[tuple[str, ColumnElement[Any], list[ColumnElement[bool]]]]:
    """Return in which orders rows are added: each with its name, its column, and its rows."""
    if _is_by_robot(table):
        at = type_coerce(table.c.measured_at, BigInteger)
        robots = session.scalars(select(Robot.key)).all()
        return [(str(robot), at, [table.c.robot_key == robot]) for robot in robots]
    if _is_by_key(table):
        return [("", next(iter(table.primary_key.columns)), [])]
    return []


def _is_by_robot(table: Table) -> bool:
    return [one.name for one in table.primary_key.columns][:2] == ["robot_key", "measured_at"]


def _is_by_key(table: Table) -> bool:
    keys = list(table.primary_key.columns)
    return len(keys) == 1 and keys[0].type.python_type is int


def _sum_of_stretches(session: Session, name: str) -> int:
    rollup = _ROLLUPS[name]
    coarse = select(func.sum(rollup.size)).where(rollup.length_s == COARSE_S)
    return int(session.scalar(coarse) or 0)


def table_bytes(session: Session, name: str, rows: int) -> int:
    """Return about how many bytes a table takes, its indices included.

    PostgreSQL knows; of SQLite it is judged by the rows at the table's both ends.
    """
    if session.get_bind().dialect.name == "postgresql":
        found = session.scalar(text("select pg_total_relation_size(:name)"), {"name": f'"{name}"'})
        return int(found or 0)
    table = METADATA.tables[name]
    keys = list(table.primary_key.columns)
    is_long = [isinstance(column.type, (LargeBinary, JSON, String)) for column in table.columns]
    columns = [
        # A length is told without reading what is long.
        func.length(type_coerce(column, LargeBinary)) if long else column
        for column, long in zip(table.columns, is_long, strict=True)
    ]
    rows_at_ends = [
        row
        for order in (keys, [key.desc() for key in keys])
        for row in session.execute(select(*columns).order_by(*order).limit(_SAMPLED_ROWS))
    ]
    if not rows_at_ends:
        return 0
    width = sum(_width(row, is_long) for row in rows_at_ends) / len(rows_at_ends)
    return round(rows * (width + _INDEX_BYTES * len(table.indexes)))


def row_bytes(session: Session, name: str) -> float:
    """Return about how many bytes a row of a table takes."""
    if session.get_bind().dialect.name == "postgresql":
        told = session.scalar(
            text("select reltuples from pg_class where oid = cast(:name as regclass)"),
            {"name": f'"{name}"'},
        )
        return table_bytes(session, name, 0) / max(1.0, float(told or 0.0))
    return table_bytes(session, name, 1000) / 1000


def _width(row: Sequence[Any], is_long: Sequence[bool]) -> int:
    """Return the bytes of a row in SQLite's record format; of what is long the length is given."""
    return _CELL_BYTES + sum(
        1 + ((value or 0) if long else _value_bytes(value))
        for value, long in zip(row, is_long, strict=True)
    )


def _value_bytes(value: object) -> int:
    match value:
        case None | bool():
            return 0
        case int():
            return 4 if -(2**31) <= value < 2**31 else 6
        case _:
            return 8


def database_size(session: Session) -> DatabaseSize:
    """Return how large the database is."""
    if session.get_bind().dialect.name == "postgresql":
        size = session.scalar(text("select pg_database_size(current_database())"))
        return DatabaseSize(int(size or 0), 0)
    page, pages, free = (
        int(session.scalar(text(f"pragma {name}")) or 0)
        for name in ("page_size", "page_count", "freelist_count")
    )
    return DatabaseSize((pages - free) * page, free * page)


def span(session: Session, name: str, column: str) -> tuple[datetime | None, datetime | None]:
    """Return the oldest and the newest moment of a column of a table, each by one look an order."""
    table = METADATA.tables[name]
    at = type_coerce(table.c[column], BigInteger)
    ends: list[int] = []
    for where in _places(session, table):
        for extreme in (func.min(at), func.max(at)):
            found = session.scalar(select(extreme).where(*where))
            if found is not None:
                ends.append(int(found))
    return (moment(min(ends)), moment(max(ends))) if ends else (None, None)


def _places(session: Session, table: Table) -> list[list[ColumnElement[bool]]]:
    """Return what selects each part of a table that lies in the order of time."""
    keys = [one.name for one in table.primary_key.columns]
    if keys[:1] != ["robot_key"]:
        return [[]]
    robots = session.scalars(select(Robot.key)).all()
    if keys[1] != "channel_key":
        return [[table.c.robot_key == robot] for robot in robots]
    channels = session.scalars(select(ChannelRow.key)).all()
    return [
        [table.c.robot_key == robot, table.c.channel_key == channel]
        for robot in robots
        for channel in channels
    ]
