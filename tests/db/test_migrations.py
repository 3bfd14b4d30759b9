import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from sqlalchemy import text
from sqlalchemy.dialects import postgresql
from sqlalchemy.orm import Session
from sqlalchemy.schema import CreateIndex, CreateTable

from db.engine import write_engine
from db.ingest import append_telemetry
from db.migrate import NewerSchemaError, configuration, migrate, schema_version
from db.query.robots import add_robot, list_robots
from db.query.telemetry import newest_state
from db.query.vehicles import list_vehicles
from db.store import Store
from db.study_tables import Base
from tests.db.conftest import report, robot_record


def test_migrations_lead_to_the_tables_that_the_code_knows(url):
    engine = write_engine(url)
    migrate(engine)
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
    engine.dispose()


def test_migrating_twice_changes_nothing(url):
    engine = write_engine(url)
    migrate(engine)
    with engine.connect() as connection:
        first = schema_version(connection)
    migrate(engine)
    with engine.connect() as connection:
        assert schema_version(connection) == first
    engine.dispose()


def test_a_database_of_the_first_version_keeps_its_rows(url):
    engine = write_engine(url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0001")
        with Session(connection) as session:
            add_robot(session, robot_record())
            append_telemetry(session, [report(0), report(1, 0.7)])
            session.commit()
    migrate(engine)
    with Session(engine) as session:
        assert schema_version(session.connection()) != "0001"
        assert [robot.id for robot in list_robots(session)] == ["mini-1"]
        assert newest_state(session, "mini-1").position_ned[2] == 0.7
        assert list_vehicles(session) == []
    engine.dispose()


def test_a_database_of_a_later_version_is_refused(url, store):
    store.change(
        lambda session: (
            session.execute(text("UPDATE alembic_version SET version_num = '9999'")) and None
        )
    ).result(60)
    store.close()
    with pytest.raises(NewerSchemaError, match="9999"):
        Store.open(url)


def test_every_table_can_be_made_in_postgresql():
    dialect = postgresql.dialect()
    for table in Base.metadata.sorted_tables:
        statement = str(CreateTable(table).compile(dialect=dialect))
        assert "AUTOINCREMENT" not in statement
        for index in table.indexes:
            assert str(CreateIndex(index).compile(dialect=dialect))


def test_commits_reach_the_disk_before_they_return(url, store):
    """An acknowledged row must survive a power cut: the writer syncs, and readers do not block."""
    settings = store.change(
        lambda s: (s.scalar(text("PRAGMA synchronous")), s.scalar(text("PRAGMA journal_mode")))
    ).result(60)
    assert settings == (2, "wal")
