"""Events, alarms, jobs and what else tells what happened."""

from dataclasses import replace

from sqlalchemy import select, text

from db.query.station.alarms import (
    AlarmRecord,
    closed_alarms,
    last_alarm_number,
    open_alarms,
    save_alarm,
)
from db.query.station.events import EventFilter, add_event, events_after, last_cursor, newest_events
from db.query.station.jobs import add_job, fail_open_jobs, get_job, list_jobs, save_job
from db.query.station.settings import put_setting
from db.store import Store
from db.tables import Setting
from tests.db.conftest import START


def test_the_cursor_goes_on_after_a_restart(url, store):
    first = store.change(lambda s: add_event(s, START, "a", "first", robot="mini-1")).result(60)
    store.close()
    again = Store.open(url)
    second = again.change(lambda s: add_event(s, START, "b", "second")).result(60)
    with again.read() as session:
        assert second > first
        assert [event.text for event in events_after(session, first)] == ["second"]
        assert last_cursor(session) == second
    again.close()


def test_a_cursor_is_never_given_twice(store):
    cursor = store.change(lambda s: add_event(s, START, "a", "gone")).result(60)
    store.change(lambda s: s.execute(text("DELETE FROM event")) and None).result(60)
    assert store.change(lambda s: add_event(s, START, "a", "new")).result(60) > cursor


def test_events_come_in_pages_and_by_robot(store):
    for number in range(5):
        robot = "mini-1" if number % 2 else None
        store.change(lambda s, n=number, r=robot: add_event(s, START, "a", str(n), robot=r)).result(
            60
        )
    with store.read() as session:
        assert [e.text for e in events_after(session, 0, limit=2)] == ["0", "1"]
        assert [e.text for e in events_after(session, 0, EventFilter(robot="mini-1"))] == ["1", "3"]
        assert [e.text for e in newest_events(session, limit=2)] == ["3", "4"]
        newest = newest_events(session, EventFilter(robot="mini-1"))
        assert [event.robot for event in newest] == ["mini-1", "mini-1"]


def test_an_alarm_is_open_until_it_is_closed(store):
    alarm = AlarmRecord("alarm-3", "battery", "mini-1", "warning", "Low", "unacknowledged", START)
    store.change(lambda s: save_alarm(s, alarm)).result(60)
    with store.read() as session:
        assert open_alarms(session) == [alarm]
        assert last_alarm_number(session) == 3
    closed = replace(
        alarm, state="closed", acknowledged_at=START, acknowledged_by="a", cleared_at=START
    )
    store.change(lambda s: save_alarm(s, closed)).result(60)
    with store.read() as session:
        assert open_alarms(session) == []
        assert closed_alarms(session, 10) == [closed]


def test_a_job_that_was_cut_off_is_failed_at_the_next_start(store):
    job = store.change(lambda s: add_job(s, "import", at=START, by="a")).result(60)
    done = store.change(lambda s: add_job(s, "import", at=START, by="a")).result(60)
    store.change(lambda s: save_job(s, replace(done, state="done", progress=1.0))).result(60)
    store.change(lambda s: fail_open_jobs(s, START, "cut off")).result(60)
    with store.read() as session:
        assert get_job(session, job.id).state == "failed"
        assert get_job(session, done.id).state == "done"
        assert [record.id for record in list_jobs(session)] == [done.id, job.id]
        assert [record.id for record in list_jobs(session, before=done.id)] == [job.id]


def test_a_setting_is_replaced_by_its_new_value(store):
    for value in ({"a": 1}, {"a": 2}):
        store.change(lambda s, v=value: put_setting(s, "x", v)).result(60)
    with store.read() as session:
        assert [row.value for row in session.scalars(select(Setting))] == [{"a": 2}]
