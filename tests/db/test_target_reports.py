"""What robots say of their targets, as rows."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from datetime import timedelta

import pytest
from alembic import command
from alembic.script import ScriptDirectory
from sqlalchemy import inspect
from sqlalchemy.orm import Session

from autonomy.tracking.phase import SpeedClass, TargetPhase
from db.engine import write_engine
from db.ingest import append_telemetry
from db.migrate import configuration, migrate, schema_version
from db.query.fleet.robots import add_robot
from db.query.measured.telemetry import newest_state
from db.query.mission.target_reports import (
    iterate_target_reports,
    lost_since,
    newest_event_of,
    newest_target_report,
    target_reports,
)
from db.query.mission.target_span import TargetSpan
from db.query.station.events import add_event
from db.store import Store
from tests.db.conftest import (
    START,
    add_reports_as_of_old,
    add_robot_as_of_old,
    report,
    robot_record,
)
from tests.db.target import target_report


def kept(store, *values):
    store.append(values).result(60)


def at(second):
    return START + timedelta(seconds=second)


def test_a_report_comes_back_as_it_was(store):
    first = target_report(1)
    bare = replace(
        target_report(2, TargetPhase.WAITING), hypotheses=(), range_m=None, true_ne_m=None
    )
    fish = target_report(3, is_too_fast=True, speed_class=SpeedClass.RESTING, delay_s=1.25)
    kept(store, first, bare, fish)
    with store.read() as session:
        assert target_reports(session, "mini-1") == [first, bare, fish]
        assert newest_target_report(session, "mini-1") == fish


def test_a_report_that_comes_twice_is_one_row(store):
    kept(store, target_report(1))
    kept(store, target_report(1), target_report(2))
    with store.read() as session:
        assert [one.measured_at for one in target_reports(session, "mini-1")] == [at(1), at(2)]


def test_a_robot_that_never_followed_a_target_has_no_report(store):
    with store.read() as session:
        assert newest_target_report(session, "mini-1") is None
        assert target_reports(session, "mini-1") == []
        assert lost_since(session, "mini-1", at(9)) is None


def test_a_list_goes_on_where_it_ended(store):
    kept(store, *(target_report(second) for second in range(10)))

    def seconds(session, **asked):
        found = target_reports(session, "mini-1", **asked)
        return [round((one.measured_at - START).total_seconds()) for one in found]

    with store.read() as session:
        assert seconds(session, limit=3) == [7, 8, 9]
        assert seconds(session, limit=3, newest=False) == [0, 1, 2]
        after = TargetSpan(after=at(2), until=at(5))
        assert seconds(session, wanted=after, limit=2, newest=False) == [3, 4]
        assert seconds(session, wanted=after) == [3, 4, 5]
        assert len(list(iterate_target_reports(session, "mini-1", after))) == 3


def test_a_loss_lasts_from_its_first_report_however_the_robot_coasts(store):
    phases = ["TRACKING", "LOST", "TRACKING", "COASTING", "LOST", "LOST", "COASTING", "TRACKING"]
    kept(store, *(target_report(i, TargetPhase[name]) for i, name in enumerate(phases)))
    with store.read() as session:
        assert lost_since(session, "mini-1", at(7)) == at(4)
        assert lost_since(session, "mini-1", at(2)) == at(1)
        assert lost_since(session, "mini-1", at(1)) is None
        assert lost_since(session, "mini-1", at(8)) is None


def test_newest_event_is_found_among_others(store):
    def write(session):
        for number, kind in enumerate(("track.lost", "track.found", "plan.done")):
            add_event(session, at(number), kind, "so it was", robot="mini-1")

    store.change(write).result(60)
    with store.read() as session:
        assert newest_event_of(session, "mini-1", ("track.lost", "track.found")) == "track.found"
        assert newest_event_of(session, "mini-1", ("track.ended",)) is None


def test_a_database_of_the_version_before_keeps_its_rows_and_takes_reports(url):
    engine = write_engine(url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0006")
        with Session(connection) as session:
            add_robot_as_of_old(session)
            add_reports_as_of_old(session, report(0), report(1, 0.7))
            session.commit()
    migrate(engine)
    with Session(engine) as session:
        newest = ScriptDirectory.from_config(configuration()).get_current_head()
        assert schema_version(session.connection()) == newest
        assert newest_state(session, "mini-1").position_ned[2] == 0.7
        append_telemetry(session, [target_report(3)])
        session.commit()
        assert newest_target_report(session, "mini-1") == target_report(3)
    engine.dispose()


def test_reports_from_before_targets_had_a_speed_class_are_kept_without_one(url):
    engine = write_engine(url)
    migrate(engine)
    said = target_report(3, is_too_fast=True, speed_class=SpeedClass.FAST, delay_s=0.4)
    with Session(engine) as session:
        add_robot(session, robot_record())
        append_telemetry(session, [said])
        session.commit()
        assert newest_target_report(session, "mini-1") == said
    with engine.begin() as connection:
        command.downgrade(configuration(connection), "0011")
        columns = {one["name"] for one in inspect(connection).get_columns("track_report")}
        assert not {"is_too_fast", "speed_class", "delay_s"} & columns
    migrate(engine)
    with Session(engine) as session:
        assert newest_target_report(session, "mini-1") == target_report(3)
    engine.dispose()


def test_the_migration_can_be_taken_back(url):
    engine = write_engine(url)
    migrate(engine)
    with engine.begin() as connection:
        command.downgrade(configuration(connection), "0006")
        assert not inspect(connection).has_table("track_report")
        assert inspect(connection).has_table("robot_log")
    engine.dispose()


CHILD = """
import sys
from db.store import Store
from tests.db.target import target_report

store = Store.open(sys.argv[1])
waiting = []
for number in range(1_000_000):
    waiting.append((number, store.append([target_report(number)])))
    if len(waiting) > 50:
        done, future = waiting.pop(0)
        future.result()
        print(done, flush=True)
"""


@pytest.mark.process
def test_every_report_that_was_committed_survives_sigkill(url):
    store = Store.open(url)
    store.change(lambda session: add_robot(session, robot_record())).result(60)
    store.close()
    child = subprocess.Popen([sys.executable, "-c", CHILD, url], stdout=subprocess.PIPE, text=True)
    told = [int(child.stdout.readline()) for _ in range(200)]
    os.kill(child.pid, signal.SIGKILL)
    told += [int(line) for line in child.stdout.read().splitlines() if line]
    child.stdout.close()
    assert child.wait() == -signal.SIGKILL
    store = Store.open(url)
    with store.read() as session:
        found = list(iterate_target_reports(session, "mini-1"))
    store.close()
    assert {at(number) for number in told} <= {one.measured_at for one in found}
    assert found[0] == target_report(0)
