"""Every schema that a station ever had migrates up, and what it held is there afterwards.

A database goes through all revisions, one after another. At each of them every table that is new,
or has other columns than before, gets a row as that revision would have kept it. After each step
all that was held before is looked for.
"""

from collections.abc import Mapping

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, Engine

from db.care import complaints
from db.engine import write_engine
from db.migrate import METADATA, configuration, schema_version
from tests.db.old_schema import (
    RowMaker,
    Rows,
    Tables,
    missing,
    reflected,
    rows_of,
    shape_of,
)

MOVED: Mapping[str, Mapping[str, str]] = {
    "0008": dict.fromkeys(("map_comparison", "whatif", "identification", "trim_advice"), "study"),
    "0019": {
        "field_sample": "sample",
        "sample_count": "sample_rollup",
        "smoothed_sample": "smoothed_place",
    },
}
"""Tables that a revision dropped, by the table that has their rows since then."""
COUNTED_ANEW = {"sample_count"}
"""What says how many rows another table has; in its new place it may need fewer rows."""
DROPPED = {("0018", "sample_count"): {"is_live"}}
"""Columns that a revision dropped on purpose: counts are kept by deployment since then."""
REWRITTEN = {("0017", "robot"): {"site"}}
"""Columns whose values a revision moved: sites are rows of their own since then."""

ONE_ROW = {"event_head"}
"""Tables that have one row alone, which their revision makes."""


def revisions() -> list[str]:
    scripts = ScriptDirectory.from_config(configuration())
    return [script.revision for script in reversed(list(scripts.walk_revisions()))]


class History:
    """One database on its way through all revisions."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self.maker = RowMaker()
        self.tables: Tables = {}
        self.rows: Rows = {}

    def go_to(self, revision: str) -> list[str]:
        """Migrate, and return what is lost."""
        with self.engine.begin() as connection:
            command.upgrade(configuration(connection), revision)
        with self.engine.begin() as connection:
            tables = reflected(connection, self.tables)
            lost = self._lost(revision, tables, rows_of(connection, tables))
            self._fill(connection, tables)
            self.tables, self.rows = tables, rows_of(connection, tables)
        empty = [f"{revision}: nothing is in {name}" for name in tables if not self.rows[name]]
        return [*lost, *empty]

    def _fill(self, connection: Connection, tables: Tables) -> None:
        for name, table in tables.items():
            is_new = name not in self.tables or shape_of(self.tables[name]) != shape_of(table)
            if is_new and name not in ONE_ROW:
                self.maker.add_row(connection, table)

    def _lost(self, revision: str, tables: Tables, rows: Rows) -> list[str]:
        lost: list[str] = []
        moved = MOVED.get(revision, {})
        for name, held in self.rows.items():
            if name in tables:
                lost += self._lost_columns(revision, name, tables, rows)
            elif name not in moved:
                lost.append(f"{revision}: {name} is gone with {len(held)} rows")
        for target in set(moved.values()):
            from_there = [name for name, to in moved.items() if to == target]
            due = sum(len(self.rows[name]) for name in from_there if name not in COUNTED_ANEW)
            if len(rows[target]) < max(1, due):
                lost.append(f"{revision}: {target} has not all rows of {from_there}")
        return lost

    def _lost_columns(self, revision: str, name: str, tables: Tables, rows: Rows) -> list[str]:
        before = {column.name for column in self.tables[name].columns}
        after = {column.name for column in tables[name].columns}
        gone = before - after - DROPPED.get((revision, name), set())
        same = (before & after) - REWRITTEN.get((revision, name), set())
        lost = missing(self.rows[name], rows[name], same)
        return [
            *([f"{revision}: {name} has no columns {sorted(gone)}"] if gone else []),
            *([f"{revision}: {lost} rows of {name} are not what they were"] if lost else []),
        ]


def test_every_old_schema_migrates_up_with_all_that_it_held(url):
    engine = write_engine(url)
    history = History(engine)
    lost = [one for revision in revisions() for one in history.go_to(revision)]
    assert lost == []
    assert set(history.tables) == set(METADATA.tables)
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), METADATA) == []
        assert schema_version(connection) == revisions()[-1]
    engine.dispose()
    assert complaints(url) == []


def test_a_migration_that_loses_something_is_noticed(url):
    engine = write_engine(url)
    history = History(engine)
    history.go_to("0001")
    with engine.begin() as connection:
        connection.exec_driver_sql("UPDATE robot SET name = 'other'")
        connection.exec_driver_sql("DELETE FROM event")
    lost = history.go_to("0002")
    engine.dispose()
    assert "0002: 1 rows of robot are not what they were" in lost
    assert any("of event are not what they were" in one for one in lost)


@pytest.mark.parametrize(("revision", "tables"), MOVED.items())
def test_what_was_moved_is_named_by_revisions_that_there_are(revision, tables):
    assert revision in revisions()
    assert not set(tables) & set(METADATA.tables)
    assert set(tables.values()) <= set(METADATA.tables)
