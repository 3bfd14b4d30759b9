"""The chain of the event log: whatever is changed in it shows, and where."""

import numpy as np
import pytest
from alembic import command
from sqlalchemy import select, text, update
from sqlalchemy.orm import Session

from db.actor import Actor, acting
from db.engine import write_engine
from db.migrate import configuration, migrate
from db.query.station.event_chain import GENESIS, look_through
from db.query.station.events import add_event, newest_events
from db.store import Store
from db.tables import Event
from tests.db.conftest import START

COUNT = 40


def told(number: int) -> dict[str, object]:
    """Data of all kinds that a database may keep otherwise than it was given."""
    return {"number": number, "share": number / 7.0, "whole": float(number), "list": [1.0, None]}


@pytest.fixture
def store(url):
    opened = Store.open(url)

    def fill(session: Session) -> None:
        for number in range(COUNT):
            add_event(session, START, f"kind.{number % 3}", f"Event {number}", data=told(number))

    opened.change(fill).result()
    yield opened
    opened.close()


def test_a_log_that_nobody_touched_fits(store):
    with store.read() as session:
        found = look_through(session)
    assert (found.rows, found.fault) == (COUNT, "")
    assert len(found.head) == 2 * len(GENESIS)


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE event SET text = 'Nothing happened.' WHERE cursor = :cursor",
        "UPDATE event SET actor = 'nobody' WHERE cursor = :cursor",
        "UPDATE event SET at = at + 1 WHERE cursor = :cursor",
        "UPDATE event SET data = '{}' WHERE cursor = :cursor",
        "DELETE FROM event WHERE cursor = :cursor",
    ],
)
def test_a_row_that_is_changed_or_missing_shows_where(store, statement):
    place = int(np.random.default_rng().integers(1, COUNT))
    with store.read() as session:
        cursor = session.scalars(select(Event.cursor).order_by(Event.cursor)).all()[place - 1]
    store.change(lambda session: session.execute(text(statement), {"cursor": cursor})).result()
    with store.read() as session:
        found = look_through(session)
    assert found.rows == place - 1
    assert "does not follow" in found.fault


def test_rows_that_change_places_show(store):
    def swap(session: Session) -> None:
        one, other = session.scalars(select(Event).order_by(Event.cursor).limit(2))
        texts = one.text, other.text
        session.execute(update(Event).where(Event.cursor == one.cursor).values(text=texts[1]))
        session.execute(update(Event).where(Event.cursor == other.cursor).values(text=texts[0]))

    store.change(swap).result()
    with store.read() as session:
        assert look_through(session).rows == 0


def test_missing_newest_rows_show_by_the_head(store):
    statement = "DELETE FROM event WHERE cursor > (SELECT max(cursor) - 3 FROM event)"
    store.change(lambda session: session.execute(text(statement))).result()
    with store.read() as session:
        found = look_through(session)
    assert found.rows == COUNT - 3
    assert "newest 3 of 40 events are missing" in found.fault


def test_who_caused_an_event_is_whoever_the_change_is_for(store):
    before = acting.set(Actor("ann", "person"))
    try:
        change = store.change(lambda session: add_event(session, START, "one", "By ann."))
        change.result()
        actor = acting.get()
    finally:
        acting.reset(before)
    store.change(lambda session: add_event(session, START, "two", "By itself.")).result()
    assert actor is not None
    assert actor.events == 1
    with store.read() as session:
        mine, its = newest_events(session, limit=2)
        assert look_through(session).fault == ""
    assert (mine.by, mine.by_kind) == ("ann", "person")
    assert (its.by, its.by_kind) == (None, None)


def test_what_is_undone_leaves_no_link(store):
    def fail(session: Session) -> None:
        add_event(session, START, "one", "It did not happen.")
        raise ValueError("undone")

    with pytest.raises(ValueError, match="undone"):
        store.change(fail).result()
    store.change(lambda session: add_event(session, START, "two", "It did.")).result()
    with store.read() as session:
        found = look_through(session)
    assert (found.rows, found.fault) == (COUNT + 1, "")


def test_a_log_of_before_is_chained_as_it_is(url):
    engine = write_engine(url)
    with engine.begin() as connection:
        command.upgrade(configuration(connection), "0024")
        statement = text(
            "INSERT INTO event (at, kind, level, text, data) "
            """VALUES (:at, 'kind', 'info', 'Before', '{"share": 0.1, "list": [1.0]}')"""
        )
        for number in range(5):
            connection.execute(statement, {"at": 1_700_000_000_000_000 + number})
    migrate(engine)
    with Session(engine) as session:
        found = look_through(session)
        assert (found.rows, found.fault) == (5, "")
    engine.dispose()
