import asyncio
import threading

import pytest
from sqlalchemy import text

from db.fault import StoreClosedError, StoreUnavailableError, UnknownIdError
from db.query.fleet.robots import get_robot, list_robots
from db.query.measured.samples import sampled_variables
from db.query.station.events import add_event, events_after
from db.store import Store
from tests.db.conftest import START, report, sample


def count(store, robot="mini-1"):
    with store.read() as session:
        return sampled_variables(session, robot).get("blue_light", 0)


def test_appended_rows_are_there_when_their_future_resolves(store):
    store.append([sample(0), sample(1)]).result(60)
    assert count(store) == 2


def test_a_sample_that_arrives_twice_is_kept_once(store):
    store.append([sample(0), sample(0)]).result(60)
    store.append([sample(0), sample(1)]).result(60)
    assert count(store) == 2


def test_appends_while_the_writer_is_busy_share_a_commit(store):
    before, go_on = store.commits, threading.Event()
    store.change(lambda _: go_on.wait(60))
    futures = [store.append([sample(number)]) for number in range(20)]
    go_on.set()
    for future in futures:
        future.result(60)
    assert store.commits - before == 2


def test_changes_are_counted_before_whoever_asked_goes_on(store):
    before, counted = store.changes, []
    for _ in range(3):
        change = store.change(lambda _: None)
        change.add_done_callback(lambda _: counted.append(store.changes - before))
    store.append([sample(0)]).result(60)
    assert counted == [1, 2, 3]
    assert store.changes == before + 3


def test_a_change_sees_the_rows_that_were_appended_before_it(store):
    store.append([sample(0)])
    seen = store.change(lambda session: sampled_variables(session, "mini-1")).result(60)
    assert seen == {"blue_light": 1}


def test_rows_of_an_unknown_robot_fail_alone(store):
    good, bad, also_good = (
        store.append([sample(0)]),
        store.append([sample(0, robot="nobody")]),
        store.append([sample(1)]),
    )
    good.result(60)
    also_good.result(60)
    with pytest.raises(UnknownIdError, match="nobody"):
        bad.result(60)
    assert count(store) == 2
    assert store.waiting_rows == 0


def test_nothing_of_a_change_that_raises_is_kept(store):
    def half(session):
        add_event(session, START, "test", "half done")
        raise LookupError("stop")

    with pytest.raises(LookupError):
        store.change(half).result(60)
    with store.read() as session:
        assert events_after(session, 0) == []
    assert store.fault is None


def test_a_reader_sees_one_unchanging_moment(store):
    with store.read() as session:
        assert sampled_variables(session, "mini-1") == {}
        store.append([sample(0)]).result(60)
        assert sampled_variables(session, "mini-1") == {}
    assert count(store) == 1


def test_readers_do_not_wait_for_a_transaction_under_way(store):
    begun, go_on = threading.Event(), threading.Event()

    def slow(session):
        add_event(session, START, "test", "slow")
        begun.set()
        go_on.wait(60)

    future = store.change(slow)
    assert begun.wait(60)
    assert count(store) == 0
    go_on.set()
    future.result(60)


def test_a_reader_cannot_change_anything(store):
    with pytest.raises(StoreUnavailableError, match="read-only"), store.read() as session:
        session.execute(text("DELETE FROM robot"))
    with store.read() as session:
        assert len(list_robots(session)) == 1


async def test_a_wait_that_is_cancelled_does_not_take_its_rows_with_it(store):
    future = asyncio.wrap_future(store.append([sample(0)]))
    future.cancel()
    await store.write(lambda session: None)
    assert count(store) == 1


async def test_queries_run_beside_the_event_loop(store):
    robot = await store.query(lambda session: get_robot(session, "mini-1"))
    assert robot.site.kind == "tank"


def test_closing_writes_what_is_queued(url, store):
    futures = [store.append([sample(number)]) for number in range(5)]
    store.close()
    store.close()
    assert all(future.done() and future.exception() is None for future in futures)
    with pytest.raises(StoreClosedError):
        store.change(lambda session: None).result(60)
    with pytest.raises(StoreClosedError):
        store.append([report(0)]).result(60)
    again = Store.open(url)
    assert count(again) == 5
    again.close()


@pytest.mark.parametrize("bad", ["sqlite://", "sqlite:///:memory:", "mysql://host/db"])
def test_a_database_that_cannot_keep_its_promises_is_refused(bad):
    with pytest.raises(ValueError, match=r"in-memory|must be SQLite"):
        Store.open(bad)


def test_a_folder_that_does_not_exist_is_said_plainly(tmp_path):
    with pytest.raises(StoreUnavailableError, match="cannot be opened"):
        Store.open(f"sqlite:///{tmp_path / 'nowhere' / 'station.sqlite3'}")
