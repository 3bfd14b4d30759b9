"""Rows for whatever tables a schema has: plausible ones, made of what the database says of itself.

A row obeys types, foreign keys, unique keys and what migrations read in it (``SAID``). Values of
other columns differ from row to row and from column to column, so that one that is lost, or put
elsewhere, is noticed.
"""

import json
from collections import Counter
from collections.abc import Mapping
from datetime import date
from decimal import Decimal
from itertools import count
from typing import Any

from sqlalchemy import (
    Column,
    Connection,
    ForeignKey,
    MetaData,
    Table,
    UniqueConstraint,
    insert,
    inspect,
    select,
)
from sqlalchemy.types import JSON, Boolean, Double, Float, Integer, LargeBinary, Numeric, String

from autonomy.site import LAKE

Tables = Mapping[str, Table]
Rows = Mapping[str, list[dict[str, Any]]]
SITE = LAKE.model_copy(update={"name": "Our pond"}).model_dump(mode="json")
SAID: Mapping[tuple[str, str], Any] = {
    ("robot", "site"): SITE,
    ("robot", "kind"): "simulated",
    ("robot", "water_key"): 1,
    ("robot", "links"): ["xbee:///dev/ttyUSB0"],
    ("deployment", "kind"): "live",
    ("deployment", "site"): SITE,
    ("water", "document"): SITE,
}
"""Values that migrations read."""
ALEMBIC = "alembic_version"


def reflected(connection: Connection, known: Tables | None = None) -> Tables:
    """Return the tables of a database as it describes them, new ones after those that they need.

    Args:
        connection: The database.
        known: Its tables at an earlier time; those that have the same columns now are not read.
    """
    known = known or {}
    shapes = {
        name: tuple((one["name"], str(one["type"]), bool(one["nullable"])) for one in columns)
        for (_, name), columns in inspect(connection).get_multi_columns().items()
        if name != ALEMBIC
    }
    same = {
        name: table
        for name, table in known.items()
        if name in shapes and shapes[name] == shape_of(table)
    }
    found = MetaData()
    others = shapes.keys() - same.keys()
    if others:
        found.reflect(connection, only=sorted(others))
    return same | {table.name: table for table in found.sorted_tables if table.name in others}


def shape_of(table: Table) -> tuple[tuple[str, str, bool], ...]:
    """Return what makes two versions of a table the same."""
    return tuple((one.name, str(one.type), bool(one.nullable)) for one in table.columns)


class RowMaker:
    """Adds rows; each value is another one."""

    def __init__(self) -> None:
        self._numbers = count(11)

    def add_row(self, connection: Connection, table: Table) -> None:
        """Add one row to a table, and refer to the newest rows of others.

        Of what it may refer to only once there is a new row first.
        """
        for other in _owners(table):
            self.add_row(connection, other)
        values: dict[str, Any] = {}
        for column in table.columns:
            if column.foreign_keys or _is_own_key(table, column):
                continue
            said = SAID.get((table.name, column.name))
            values[column.name] = self._value(column) if said is None else said
        for constraint in table.foreign_key_constraints:
            self._refer(connection, constraint.elements, values)
        connection.execute(insert(table).values(values))

    def _refer(
        self, connection: Connection, keys: list[ForeignKey], values: dict[str, Any]
    ) -> None:
        """Let columns refer to the newest row; leave out what may refer to nothing yet."""
        others = [key.column for key in keys]
        table = others[0].table
        newest = select(*others).order_by(*(one.desc() for one in table.primary_key)).limit(1)
        row = connection.execute(newest).first()
        for key, value in zip(keys, row or [None] * len(keys), strict=True):
            if value is not None or not key.parent.nullable:
                values[key.parent.name] = value

    def _value(self, column: Column[Any]) -> Any:
        number = next(self._numbers)
        match column.type:
            case JSON():
                return {"number": number}
            case Boolean():
                return number % 2 == 0
            case LargeBinary():
                return f"bytes {number}".encode()
            case Integer():
                return number
            case Float() | Double() | Numeric():
                return number + 0.5
            case String():
                return f"{column.name} {number}"
            case _:
                raise AssertionError(f"{column} has a type of which rows know nothing")


def _is_own_key(table: Table, column: Column[Any]) -> bool:
    """Tell whether the database numbers the rows itself."""
    keys = list(table.primary_key)
    return len(keys) == 1 and column is keys[0] and isinstance(column.type, Integer)


def _owners(table: Table) -> list[Table]:
    """Return the tables of which each row has at most one in this table."""
    keys = [{column.name for column in table.primary_key}]
    keys += [
        {column.name for column in one.columns}
        for one in table.constraints
        if isinstance(one, UniqueConstraint)
    ]
    keys += [{column.name for column in one.columns} for one in table.indexes if one.unique]
    foreign = {tuple(one.column_keys): one.referred_table for one in table.foreign_key_constraints}
    return [other for columns, other in foreign.items() if set(columns) in keys]


def rows_of(connection: Connection, tables: Tables) -> Rows:
    """Return everything that a database holds, in a form that does not depend on the engine."""
    found: dict[str, list[dict[str, Any]]] = {}
    for name, table in tables.items():
        rows = connection.exec_driver_sql(f'SELECT * FROM "{name}"').mappings()
        found[name] = [
            {column: _plain(value, table.columns[column]) for column, value in row.items()}
            for row in rows
        ]
    return found


def _plain(value: Any, column: Column[Any]) -> Any:
    if isinstance(value, str) and isinstance(column.type, JSON):
        return json.loads(value)
    if isinstance(value, memoryview | bytes):
        return bytes(value).hex()
    if isinstance(value, Decimal):
        return float(value)
    assert not isinstance(value, date), column
    return value


def missing(before: list[dict[str, Any]], after: list[dict[str, Any]], columns: set[str]) -> int:
    """Return how many rows are not there any more with the same values of some columns."""

    def told(rows: list[dict[str, Any]]) -> Counter[str]:
        return Counter(json.dumps([row[name] for name in sorted(columns)]) for row in rows)

    return (told(before) - told(after)).total()
