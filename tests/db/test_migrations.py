import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import insert, text
from sqlalchemy.dialects import postgresql
from sqlalchemy.orm import Session
from sqlalchemy.schema import CreateIndex, CreateTable

from autonomy.site import LAKE
from db.column import microseconds, moment
from db.engine import is_sqlite, write_engine
from db.ingest import append_telemetry
from db.migrate import NewerSchemaError, configuration, migrate, revisions, schema_version
from db.query.fleet.deployments import list_deployments
from db.query.fleet.robots import list_robots
from db.query.fleet.vehicles import list_vehicles
from db.query.fleet.waters import add_water, list_waters, robots_of
from db.query.measured.samples import kept_counts, sample_columns
from db.query.measured.telemetry import newest_state
from db.query.mission.studies import add_study, get_arrays, get_checkpoint, get_study, list_studies
from db.store import Store
from db.study_tables import Base
from db.tables import StateRow
from robot_link.messages import STATE
from tests.db.conftest import ON_SQLITE, START, add_robot_as_of_old, report, robot_record, sample


def test_migrations_lead_to_the_tables_that_the_code_knows(url):
    engine = write_engine(url)
    migrate(engine)
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
    engine.dispose()


def test_names_of_migrations_tell_their_revisions_in_order():
    walked = ScriptDirectory.from_config(configuration()).walk_revisions()
    assert revisions() == [script.revision for script in walked][::-1]


def test_migrating_twice_changes_nothing(url):
    engine = write_engine(url)
    migrate(engine)
    with engine.connect() as connection:
        first = schema_version(connection)
    migrate(engine)
    with engine.connect() as connection:
        assert schema_version(connection) == first
    engine.dispose()


def add_states_as_of_old(session, *reports):
    """Keep states in the columns that the first version had."""
    for one in reports:
        row = STATE.values(one) | {"measured_at": one.measured_at, "received_at": one.received_at}
        row |= {"robot_key": 1, "has_fix": one.has_fix, "mode": int(one.mode)}
        session.execute(insert(StateRow).values(row))


def test_a_database_of_the_first_version_keeps_its_rows(url):
    engine = write_engine(url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0001")
        with Session(connection) as session:
            add_robot_as_of_old(session)
            add_states_as_of_old(session, report(0), report(1, 0.7))
            session.commit()
    migrate(engine)
    with Session(engine) as session:
        assert schema_version(session.connection()) != "0001"
        assert [robot.id for robot in list_robots(session)] == ["mini-1"]
        assert newest_state(session, "mini-1").position_ned[2] == 0.7
        assert list_vehicles(session) == []
    engine.dispose()


OLD_SAMPLES = """
INSERT INTO field_sample (robot_key, log, sequence, variable, measured_at, received_at, value,
                          north_m, east_m, depth_m, position_std_m)
  VALUES (1, 7, {0}, 'blue_light', {1}, 0, 3, 12.3456, -0.0004, 0.25, 0.0123456)
"""


def test_samples_of_a_database_of_before_are_counted_once(url):
    engine = write_engine(url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0008")
        with Session(connection) as session:
            add_robot_as_of_old(session)
            session.commit()
        for sequence in range(3):
            connection.exec_driver_sql(OLD_SAMPLES.format(sequence, 0))
    migrate(engine)
    with Session(engine) as session:
        append_telemetry(session, [sample(2), sample(3)])
        assert kept_counts(session, "mini-1") == {"blue_light": 4}
        assert kept_counts(session, "mini-1", deployment="deployment-1") == {"blue_light": 1}
    engine.dispose()


def test_the_endless_deployment_of_a_database_of_before_lasts_in_its_robot_s_water(url):
    engine = write_engine(url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0017")
        with Session(connection) as session:
            add_robot_as_of_old(session)
            session.commit()
        begin_us = microseconds(START)
        for sequence in range(7):
            taken = OLD_SAMPLES.format(sequence, begin_us + (sequence - 2) * 1_000_000)
            connection.exec_driver_sql(taken)
    migrate(engine)
    with Session(engine) as session:
        (deployment,) = list_deployments(session)
        assert (deployment.id, deployment.state) == ("deployment-1", "in_water")
        assert (deployment.started_at, deployment.ended_at) == (START, None)
        assert deployment.site == robot_record().site
        assert (deployment.purpose, deployment.people, deployment.void_reason) == ("", (), "")
        assert kept_counts(session, "mini-1") == {"blue_light": 7}
        assert kept_counts(session, "mini-1", deployment="deployment-1") == {"blue_light": 5}
        columns = sample_columns(session, "mini-1", "blue_light")
        assert columns.sequence.tolist() == list(range(7))
        assert columns.position_ned[0].tolist() == [12.346, 0.0, 0.25]
        assert columns.position_std_m[0] == 0.012346
        assert set(columns.log.tolist()) == {7}
        (robot,) = list_robots(session)
        assert (robot.retired_at, robot.system_id) == (None, 1)
    engine.dispose()


OLD_STUDIES = """
INSERT INTO job (key, kind, state, progress, message, created_at, created_by)
  VALUES (4, 'whatif', 'done', 1, '', 5, 'ann');
INSERT INTO whatif (key, robot_key, job_key, state, title, vehicle, scenario, controllers, message,
                    result, shown_from, created_at, created_by, ended_at)
  VALUES (3, 1, 4, 'done', 'PID', 'miniglider', '{"runs": 2}', '[{"kind": "controller.pid"}]', '',
          '{"seeds": [1]}', '{"origin_ned": [1, 2, 0]}', 5000000, 'ann', 6000000);
INSERT INTO identification (key, robot_key, deployment_key, state, vehicle, vehicle_document,
                            config, data_start_at, data_end_at, progress, message, convergence,
                            checkpoint, accepted_vehicle, created_at, created_by, ended_at)
  VALUES (2, 1, 1, 'cancelled', 'miniglider', '{"key": "miniglider"}', '{"particles": 4}',
          1000000, 2000000, 0.5, 'Cancelled.', '[{"iteration": 1, "cost": 2.0}]', '{"x": [1]}',
          'mini-b', 7000000, 'bob', 8000000);
INSERT INTO trim_advice (key, robot_key, deployment_key, trim_version, document, created_at,
                         created_by, accepted_at, accepted_by, accepted_share)
  VALUES (6, 1, 1, '"config-1"', '{"dives": 3, "vehicle": "miniglider", "vehicle_digest": "d"}',
          9000000, 'ann', 10000000, 'bob', 0.5);
INSERT INTO map_comparison (robot_key, variable, at, document, grid)
  VALUES (1, 'blue_light', 11000000, '{"samples": 9}', X'6162');
"""


def test_studies_of_a_database_of_before_keep_their_ids_and_all_that_is_in_them(url):
    engine = write_engine(url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0007")
        with Session(connection) as session:
            add_robot_as_of_old(session)
            session.commit()
        bytes_ab = "X'6162'" if is_sqlite(engine) else "'ab'"
        for statement in OLD_STUDIES.replace("X'6162'", bytes_ab).split(";\n")[:-1]:
            connection.exec_driver_sql(statement)
    migrate(engine)
    with Session(engine) as session:
        whatif = get_study(session, "whatif", "whatif-3")
        assert (whatif.robot, whatif.job, whatif.state) == ("mini-1", "job-4", "done")
        assert whatif.asked == {
            "title": "PID",
            "vehicle": "miniglider",
            "scenario": {"runs": 2},
            "controllers": [{"kind": "controller.pid"}],
        }
        assert (whatif.result, whatif.use) == ({"seeds": [1]}, {"origin_ned": [1, 2, 0]})
        assert (whatif.created_at, whatif.ended_at) == (moment(5_000_000), moment(6_000_000))

        search = get_study(session, "identification", "identification-2")
        assert (search.state, search.message, search.created_by) == (
            "cancelled",
            "Cancelled.",
            "bob",
        )
        assert search.asked["deployment"] == "deployment-1"
        assert search.asked["vehicle_document"] == {"key": "miniglider"}
        assert search.asked["data_end_at"] == "1970-01-01T00:00:02+00:00"
        assert search.news == {"progress": 0.5, "convergence": [{"iteration": 1, "cost": 2.0}]}
        assert (search.use, search.result) == ({"vehicle": "mini-b"}, None)
        assert search.has_checkpoint
        assert get_checkpoint(session, "identification", search.id) == {"x": [1]}

        advice = get_study(session, "advice", "advice-6")
        assert (advice.state, advice.result) == ("done", {"dives": 3})
        assert (advice.asked["trim_version"], advice.asked["vehicle"]) == (
            '"config-1"',
            "miniglider",
        )
        assert advice.use is not None
        assert (advice.use["accepted_by"], advice.use["accepted_share"]) == ("bob", 0.5)

        (comparison,) = list_studies(session, "comparison", "mini-1")
        assert (comparison.asked, comparison.created_at) == (
            {"variable": "blue_light"},
            moment(11_000_000),
        )
        assert get_arrays(session, "comparison", comparison.id) == b"ab"
        assert (
            add_study(session, "whatif", "mini-1", asked={}, at=moment(0), by="ann").id
            == "whatif-4"
        )
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


@ON_SQLITE
def test_commits_reach_the_disk_before_they_return(url, store):
    """An acknowledged row must survive a power cut: the writer syncs, and readers do not block."""
    settings = store.change(
        lambda s: (s.scalar(text("PRAGMA synchronous")), s.scalar(text("PRAGMA journal_mode")))
    ).result(60)
    assert settings == (2, "wal")


def test_robots_of_before_waters_had_rows_share_those_that_they_are_in(url):
    engine = write_engine(url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0006")
        with Session(connection) as session:
            add_robot_as_of_old(session)
            pond = LAKE.model_copy(update={"name": "Our pond"}).model_dump_json()
            for key, (name, kind) in enumerate(
                (("a", "real"), ("b", "real"), ("c", "recorded")), 2
            ):
                session.execute(
                    text(
                        "INSERT INTO robot (key, id, name, model, kind, system_id, links, site,"
                        " created_at) VALUES (:key, :id, :id, '', :kind, NULL, '[]', :site, 0)"
                    ),
                    {"key": key, "id": name, "kind": kind, "site": pond},
                )
            session.commit()
    migrate(engine)
    with Session(engine) as session:
        waters = {water.id: water for water in list_waters(session)}
        assert list(waters) == ["test-tank", "practice-lake", "our-pond"]
        assert waters["practice-lake"].site == LAKE
        assert robots_of(session) == {"test-tank": ["mini-1"], "our-pond": ["a", "b"]}
        robots = {robot.id: robot for robot in list_robots(session)}
        assert robots["a"].site == waters["our-pond"].site
        assert (robots["c"].water, robots["c"].site.name) == (None, "Our pond")
        added = add_water(session, "fourth", LAKE, at=moment(0), by="test")
        assert added.version == 1
        session.commit()
    with engine.begin() as connection:
        command.downgrade(configuration(connection), "0006")
        [site] = connection.execute(text("SELECT site FROM robot WHERE id = 'a'")).scalars()
        assert "Our pond" in str(site)
    engine.dispose()
