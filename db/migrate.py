"""Brings a database to the schema that this version of the station knows."""

from __future__ import annotations

from contextlib import nullcontext
from importlib.resources import files
from typing import TYPE_CHECKING

from sqlalchemy import Connection, Engine, inspect, text

from db import (
    camera_tables,
    checklist_tables,
    current_tables,
    decision_tables,
    delivery_tables,
    design_tables,
    lease_tables,
    link_tables,
    log_book_tables,
    map_tables,
    notice_tables,
    onboard_tables,
    person_tables,
    quality_tables,
    sample_tables,
    schedule_tables,
    state_sums,
    storage_tables,
    study_tables,
    tables,
    tag_tables,
    target_tables,
    water_tables,
)
from db.engine import READING

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from alembic.config import Config

_TABLE_MODULES = (
    tables,
    delivery_tables,
    quality_tables,
    sample_tables,
    study_tables,
    map_tables,
    person_tables,
    link_tables,
    onboard_tables,
    target_tables,
    current_tables,
    tag_tables,
    water_tables,
    design_tables,
    lease_tables,
    schedule_tables,
    state_sums,
    checklist_tables,
    notice_tables,
    log_book_tables,
    decision_tables,
    camera_tables,
    storage_tables,
)
"""All that have tables, so that none is missing in the metadata."""
METADATA = tables.Base.metadata
"""Every table of the station."""


class NewerSchemaError(Exception):
    """The database was written by a later version of the station."""


def configuration(connection: Connection | None = None) -> Config:
    """Return Alembic's configuration; a connection given here is the one it will use."""
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", str(files("db") / "migrations"))
    config.attributes["connection"] = connection
    return config


def schema_version(connection: Connection) -> str | None:
    """Return the revision of a database, or ``None`` before its first migration."""
    if not inspect(connection).has_table("alembic_version"):
        return None
    return connection.scalar(text("SELECT version_num FROM alembic_version"))


def revisions() -> list[str]:
    """Return every revision that this version knows, the newest last.

    The names of the migrations begin with it: a start that has nothing to migrate loads none.
    """
    names = (entry.name for entry in (files("db") / "migrations" / "versions").iterdir())
    return sorted(name.partition("_")[0] for name in names if name[:1].isdigit())


def needs_migration(engine: Engine) -> bool:
    """Tell whether a database that is there lacks migrations of this version.

    Raises:
        NewerSchemaError: If the database is of a version that this station does not know.
    """
    present, newest = _present(engine)
    return present is not None and present != newest


def migrate(engine: Engine, alone: AbstractContextManager[object] | None = None) -> None:
    """Apply every migration that the database lacks, all in one transaction.

    One that lacks none is only read: whoever opens it beside a running station, as each verb of the
    command line does, must not hold its write lock, and need not wait for Alembic.

    Args:
        engine: The database.
        alone: Entered only while migrations are applied; what it raises keeps them from being so.

    Raises:
        NewerSchemaError: If the database is of a version that this station does not know.
    """
    present, newest = _present(engine)
    if present != newest:
        from alembic import command

        with alone or nullcontext(), engine.begin() as connection:
            command.upgrade(configuration(connection), "head")


def _present(engine: Engine) -> tuple[str | None, str]:
    """Return the revision of a database, and that of this version."""
    known = revisions()
    with engine.connect().execution_options(**READING) as connection:
        present = schema_version(connection)
    if present is not None and present not in known:
        raise NewerSchemaError(
            f"The database has schema {present}, which this version does not know; "
            "start the newer version of the station, or use another data folder."
        )
    return present, known[-1]
