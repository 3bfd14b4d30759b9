"""What only a server has: it can be gone, and come back."""

import time

import pytest

from db.care import complaints
from db.engine import check_url
from db.fault import DatabaseUrlError, StoreUnavailableError
from db.query.measured.samples import sampled_variables
from db.query.station.events import add_event
from db.store import Store
from tests.db.conftest import ON_POSTGRESQL, START, sample
from tests.postgresql_server import postgresql_server


def stored(store):
    with store.read() as session:
        return sampled_variables(session, "mini-1").get("blue_light", 0)


def wait_until(condition, limit_s=60.0):
    give_up = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < give_up
        time.sleep(0.01)


@ON_POSTGRESQL
def test_what_was_appended_while_the_server_was_gone_arrives_when_it_is_back(store, postgresql):
    store.append([sample(0)]).result(60)
    postgresql.stop()
    try:
        waiting = store.append([sample(1)])
        wait_until(lambda: store.fault is not None)
        assert "does not answer" in store.fault
        assert len(store.fault.splitlines()) == 1
        with pytest.raises(StoreUnavailableError):
            store.change(lambda s: add_event(s, START, "test", "gone")).result(60)
        with pytest.raises(StoreUnavailableError):
            stored(store)
    finally:
        postgresql.start()
    waiting.result(60)
    assert store.fault is None
    wait_until(lambda: _answers(store))
    assert stored(store) == 2


def _answers(store):
    """Each connection of before is found broken once."""
    try:
        stored(store)
    except StoreUnavailableError:
        return False
    return True


def test_a_server_that_is_not_there_is_one_sentence_with_the_way_out(tmp_path):
    with pytest.raises(StoreUnavailableError, match="Is the server up") as caught:
        Store.open(f"postgresql://grace:secret-word@/grace?host={tmp_path}")
    assert "secret-word" not in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_driver_that_is_not_installed_is_named_with_the_extra():
    with pytest.raises(DatabaseUrlError, match=r"grace-ground-station\[postgres\]"):
        check_url("postgresql+asyncpg://grace@/grace")


@ON_POSTGRESQL
def test_a_whole_database_has_no_complaints_and_a_missing_table_is_one(store, url):
    assert complaints(url) == []
    store.change(lambda s: s.connection().exec_driver_sql("DROP TABLE raw_frame").close()).result(
        60
    )
    assert complaints(url) == ["The table raw_frame is missing."]


@ON_POSTGRESQL
def test_a_reader_cannot_write(store):
    def write():
        with store.read() as session:
            add_event(session, START, "test", "not allowed")
            session.flush()

    with pytest.raises(StoreUnavailableError, match="read-only"):
        write()


def test_a_machine_without_a_server_is_told_apart(monkeypatch):
    monkeypatch.setattr("tests.postgresql_server.program", lambda name: None)
    with postgresql_server() as server:
        assert server is None
