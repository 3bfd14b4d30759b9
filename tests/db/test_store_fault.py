import sqlite3
import time
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import contextmanager

import pytest
from sqlalchemy import text

from db import engine, writer
from db.fault import BufferFullError, StoreUnavailableError
from db.query.measured.samples import sampled_variables
from db.query.station.events import add_event
from db.store import Store
from tests.db.conftest import ON_SQLITE, START, sample

pytestmark = ON_SQLITE  # a server's faults are in test_postgresql


@contextmanager
def locked(url):
    """Another program holds the write lock."""
    other = sqlite3.connect(url.removeprefix("sqlite:///"), isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    try:
        yield
    finally:
        other.execute("ROLLBACK")
        other.close()


def event(session):
    add_event(session, START, "test", "something happened")


def pragma(store, statement):
    store.change(lambda session: session.execute(text(f"PRAGMA {statement}")).close()).result(60)


def wait_until(condition, limit_s=60.0):
    give_up = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < give_up
        time.sleep(0.01)


def stored(store):
    with store.read() as session:
        return sampled_variables(session, "mini-1").get("blue_light", 0)


def test_a_locked_database_refuses_changes_and_keeps_rows_for_later(store, url):
    told = []
    store.add_fault_listener(told.append)
    with locked(url):
        waiting = store.append([sample(0), sample(1)])
        with pytest.raises(StoreUnavailableError, match="locked"):
            store.change(event).result(60)
        assert not waiting.done()
        assert store.waiting_rows == 2
        assert store.fault == "The database stayed locked for 1 s."
    waiting.result(60)
    assert stored(store) == 2
    assert store.fault is None
    assert told == ["The database stayed locked for 1 s.", None]


def test_opening_a_database_that_lacks_no_migration_takes_no_write_lock(store, url):
    """As met: a verb beside a busy station held the lock while Alembic read its migrations."""
    store.change(event).result(60)
    with locked(url):
        beside = Store.open(url)
        with beside.read() as session:
            assert session.scalar(text("SELECT count(*) FROM event")) >= 1
        beside.close()


def test_a_full_disk_loses_nothing_that_was_acknowledged(store):
    """Rows are appended until the disk is full, then room is made: every row arrives once."""
    pages = store.change(lambda s: s.scalar(text("PRAGMA page_count"))).result(60)
    pragma(store, f"max_page_count={pages + 40}")
    futures = []
    number = 0
    while store.fault is None:
        assert number < 100_000
        futures.append(store.append([sample(number + i) for i in range(200)]))
        number += 200
        wait_until(lambda: store.waiting_rows < 2000 or store.fault is not None)
    assert store.fault == "The disk is full."
    acknowledged = sum(200 for future in futures if future.done() and not future.exception())
    assert stored(store) >= acknowledged
    with pytest.raises(StoreUnavailableError, match="full"):
        store.change(
            lambda session: add_event(session, START, "test", "long", data={"x": "x" * 1_000_000})
        ).result(60)
    pragma(store, "max_page_count=1000000")
    for future in futures:
        future.result(60)
    assert stored(store) == number
    assert store.fault is None


def test_a_read_only_database_is_a_fault_and_not_a_crash(store):
    pragma(store, "query_only=ON")
    waiting = store.append([sample(0)])
    wait_until(lambda: store.fault is not None)
    assert store.fault == "The database cannot be written: it is read-only."
    store._write_engine.dispose()  # the next connection may write
    waiting.result(60)
    assert stored(store) == 1


def test_rows_are_refused_when_too_many_wait(store, url, monkeypatch):
    monkeypatch.setattr(writer, "BUFFERED_ROWS_MAX", 10)
    with locked(url):
        taken = store.append([sample(number) for number in range(10)])
        refused = store.append([sample(10)])
        with pytest.raises(BufferFullError):
            refused.result(60)
    taken.result(60)
    store.append([sample(10)]).result(60)
    assert stored(store) == 11


def test_a_bug_in_a_change_is_not_taken_for_a_fault_of_the_storage(store):
    with pytest.raises(Exception, match="no such table") as caught:
        store.change(lambda session: session.execute(text("SELECT * FROM nowhere"))).result(60)
    assert not isinstance(caught.value, StoreUnavailableError)
    assert store.fault is None


def test_a_listener_that_fails_does_not_stop_the_writer(store, url, caplog):
    def broken(fault):
        raise RuntimeError("listener")

    store.add_fault_listener(broken)
    with locked(url), pytest.raises(StoreUnavailableError):
        store.change(event).result(60)
    store.change(event).result(60)
    assert "listener for storage faults failed" in caplog.text


def test_rows_that_cannot_be_written_before_the_end_are_given_back(store, url):
    with locked(url):
        waiting = store.append([sample(0)])
        store.close()
        with pytest.raises(StoreUnavailableError):
            waiting.result(60)


def test_a_database_that_another_process_closes_is_waited_for(url):
    """As met: the log of a station that ends is written back while the next one starts."""
    Store.open(url).close()
    other = sqlite3.connect(url.removeprefix("sqlite:///"), isolation_level=None)
    other.execute("PRAGMA locking_mode=EXCLUSIVE")
    other.execute("PRAGMA journal_mode=DELETE")
    other.execute("BEGIN EXCLUSIVE")
    with ThreadPoolExecutor(1) as pool:
        opening = pool.submit(Store.open, url)
        wait([opening], timeout=2 * engine.BUSY_TIMEOUT_MS / 1000)
        other.execute("COMMIT")
        other.close()
        opening.result(60).close()
