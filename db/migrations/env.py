"""Alembic's entry: migrates over the connection that ``db.migrate`` hands in."""

from alembic import context

from db.migrate import METADATA

connection = context.config.attributes["connection"]
context.configure(
    connection=connection,
    target_metadata=METADATA,
    render_as_batch=connection.dialect.name == "sqlite",
)
with context.begin_transaction():
    context.run_migrations()
