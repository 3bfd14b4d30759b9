"""Alembic's entry: migrates over the connection that ``db.migrate`` hands in."""

from alembic import context

from db import link_tables, map_tables, onboard_tables, person_tables, study_tables, tables
from db import target_tables as tracking_tables

KNOWN = (
    tables,
    study_tables,
    map_tables,
    person_tables,
    link_tables,
    onboard_tables,
    tracking_tables,
)
"""Every module with tables, so that all of them are in the one metadata."""

connection = context.config.attributes["connection"]
context.configure(
    connection=connection,
    target_metadata=tables.Base.metadata,
    render_as_batch=connection.dialect.name == "sqlite",
)
with context.begin_transaction():
    context.run_migrations()
