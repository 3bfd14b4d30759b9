"""A station whose storage fails says so, refuses changes, and comes back by itself."""

import asyncio
import sqlite3
from contextlib import contextmanager
from datetime import datetime

import pytest

from db.query.fleet.robots import add_robot
from tests.db.conftest import robot_record, sample
from tests.server.station_app import running, signed_in


@pytest.fixture(autouse=True)
def _known_fleet():
    """Begin with an empty database."""


@contextmanager
def locked(folder):
    other = sqlite3.connect(folder / "station.sqlite3", timeout=60, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    try:
        yield
    finally:
        other.execute("ROLLBACK")
        other.close()


async def eventually(condition, limit_s=60.0):
    async with asyncio.timeout(limit_s):
        while not await condition():  # noqa: ASYNC110 - it watches the station from outside
            await asyncio.sleep(0.02)


async def test_a_locked_database_raises_one_alarm_and_refuses_changes(tmp_path):
    async with running(tmp_path) as app, signed_in(app) as admin:
        store = app.state.foundation.store
        await store.write(lambda session: add_robot(session, robot_record()))

        async def open_alarms():
            return (await admin.get("/api/alarms")).json()["alarms"]

        with locked(tmp_path):
            waiting = asyncio.wrap_future(store.append([sample(0)]))
            refused = await admin.patch("/api/config/planner", json={"seed": 3})
            assert refused.status_code == 503
            assert refused.json()["detail"].startswith("The database stayed locked")
            await eventually(open_alarms)
            [alarm] = await open_alarms()
            assert (alarm["level"], alarm["state"]) == ("critical", "unacknowledged")

            async def is_on_the_disk():
                return store.bridged_rows == 1

            await eventually(is_on_the_disk)
            health = (await admin.get("/api/health")).json()
            assert (health["status"], health["ready"]) == ("degraded", False)
            storage = health["storage"]
            assert (storage["waiting_rows"], storage["bridged_rows"]) == (1, 1)
            assert datetime.fromisoformat(storage["since"]) == datetime.fromisoformat(
                alarm["raised_at"]
            )
            assert "It fails since " in storage["message"]
            assert storage["message"].endswith("1 rows wait on the disk.")
            assert alarm["text"].endswith("telemetry waits on the disk.")
            assert (await admin.get("/api/config/planner")).status_code == 200
        await asyncio.wait_for(waiting, 60)

        async def returned():
            return [alarm["state"] for alarm in await open_alarms()] == ["returned"]

        await eventually(returned)
        assert (await admin.get("/api/health")).json()["status"] == "ok"
        assert (await admin.patch("/api/config/planner", json={"seed": 3})).status_code == 200
        acknowledged = (await admin.post(f"/api/alarms/{alarm['id']}/ack")).json()
        assert (acknowledged["state"], acknowledged["acknowledged_by"]) == ("closed", "ann")
        closed = (await admin.get("/api/alarms?state=closed")).json()["alarms"]
        assert [item["id"] for item in closed] == [alarm["id"]]


async def test_the_station_notices_by_itself_that_storage_works_again(tmp_path):
    """Nothing else is written meanwhile."""
    async with running(tmp_path) as app, signed_in(app) as admin:
        with locked(tmp_path):
            await admin.patch("/api/config/planner", json={"seed": 3})
            assert app.state.foundation.store.fault is not None

        async def works():
            return app.state.foundation.store.fault is None

        await eventually(works)


async def test_an_alarm_survives_a_restart_until_somebody_has_seen_it(tmp_path):
    async with running(tmp_path) as app:
        await app.state.foundation.alarms.raise_("leak", "Water inside.", level="critical")
    async with running(tmp_path) as app, signed_in(app) as admin:
        [alarm] = (await admin.get("/api/alarms")).json()["alarms"]
        assert alarm["text"] == "Water inside."
        assert app.state.foundation.alarms.unacknowledged == 1


@pytest.fixture
async def board(tmp_path):
    async with running(tmp_path) as app:
        yield app.state.foundation.alarms


async def test_one_cause_never_floods_the_list(board):
    for _ in range(3):
        await board.raise_("battery", "Low.", level="warning")
        await board.clear("battery")
    await board.raise_("battery", "Very low.", level="critical")
    [alarm] = board.open
    assert (alarm.text, alarm.state) == ("Very low.", "unacknowledged")


async def test_a_cause_that_comes_back_stands_since_then(board):
    first = await board.raise_("target", "Lost.")
    await board.clear("target")
    [over] = board.open
    again = await board.raise_("target", "Lost.")
    assert again.id == first.id
    assert first.raised_at < over.cleared_at < again.raised_at


async def test_a_cause_that_returns_after_it_was_seen_and_over_is_a_new_alarm(board):
    first = await board.raise_("battery", "Low.")
    await board.acknowledge(first.id, "ann")
    assert board.open[0].state == "acknowledged"
    await board.clear("battery")
    assert board.open == []
    second = await board.raise_("battery", "Low.")
    assert second.id != first.id


async def test_an_alarm_that_is_over_says_how_it_ended_where_that_is_known(board):
    await board.raise_("target", "Lost; it circles.")
    await board.clear("target", text="Lost; found again.")
    await board.clear("target", text="Never mind.")
    [alarm] = board.open
    assert (alarm.text, alarm.state) == ("Lost; found again.", "returned")
    await board.raise_("target", "Lost; it circles.")
    await board.clear("target")
    assert [one.text for one in board.open] == ["Lost; it circles."]


async def test_clearing_what_never_was_does_nothing(board):
    await board.clear("battery")
    assert board.open == []


async def test_a_part_that_dies_is_seen(tmp_path, caplog):
    async with running(tmp_path) as app:
        foundation = app.state.foundation

        async def broken():
            raise ZeroDivisionError("on purpose")

        foundation.background.start("pump", broken())

        async def raised():
            return [alarm.text for alarm in foundation.alarms.open]

        await eventually(raised)
        assert "pump: ZeroDivisionError" in foundation.alarms.open[0].text
        assert "on purpose" in caplog.text


async def test_no_task_outlives_the_station(tmp_path):
    before = asyncio.all_tasks()
    async with running(tmp_path):
        assert len(asyncio.all_tasks()) > len(before)
    assert asyncio.all_tasks() == before


async def test_each_step_of_an_alarm_is_its_own_sentence_in_the_log(tmp_path):
    async with running(tmp_path) as app, signed_in(app) as admin:
        board = app.state.foundation.alarms
        await board.raise_("battery", "mini-1 has 18% of its battery left.", level="warning")
        await board.raise_("battery", "mini-1 has 9% of its battery left.", level="critical")
        [alarm] = board.open
        await admin.post(f"/api/alarms/{alarm.id}/ack")
        await board.clear("battery")
        await board.raise_("clock", "Its clock is wrong.", level="watch")
        await board.clear("clock")
        await board.save_waiting()
        events = (await admin.get("/api/events")).json()["events"]
        told = [
            (event["kind"], event["level"], event["text"])
            for event in sorted(events, key=lambda one: one["cursor"])
            if event["kind"].startswith("alarm.")
        ]
        closed = (await admin.get("/api/alarms?state=closed")).json()["alarms"]
        who = closed[0]["acknowledged_by"]
    assert told == [
        ("alarm.raised", "warning", "mini-1 has 18% of its battery left."),
        ("alarm.changed", "critical", "Now critical: mini-1 has 9% of its battery left."),
        ("alarm.acknowledged", "info", f"{who} acknowledged: mini-1 has 9% of its battery left."),
        ("alarm.closed", "info", "Back to normal: mini-1 has 9% of its battery left."),
        ("alarm.raised", "watch", "Its clock is wrong."),
        ("alarm.returned", "info", "Back to normal: Its clock is wrong."),
    ]
    assert who


async def test_nobody_acknowledges_what_has_changed_since_it_was_seen(tmp_path):
    async with running(tmp_path) as app, signed_in(app) as admin:
        board = app.state.foundation.alarms
        seen = await board.raise_("battery", "Low.", level="warning")
        what = {"raised_at": seen.raised_at.isoformat(), "level": seen.level}
        path = f"/api/alarms/{seen.id}/ack"
        await board.raise_("battery", "Very low.", level="critical")
        refused = await admin.post(path, params=what)
        assert refused.status_code == 409
        assert refused.json()["detail"].endswith("it says now: Very low.")
        await board.clear("battery")
        await board.raise_("battery", "Low.", level="warning")
        assert (await admin.post(path, params=what)).status_code == 409
        [alarm] = board.open
        assert alarm.state == "unacknowledged"
        naive = {"raised_at": alarm.raised_at.replace(tzinfo=None).isoformat()}
        assert (await admin.post(path, params=naive)).status_code == 422
        what["raised_at"] = alarm.raised_at.isoformat()
        assert (await admin.post(path, params=what)).json()["state"] == "acknowledged"


async def test_an_alarm_that_gets_worse_after_it_was_seen_is_to_be_seen_anew(board):
    first = await board.raise_("battery", "Low.", level="warning")
    await board.acknowledge(first.id, "ann")
    await board.raise_("battery", "Lower.", level="warning")
    assert board.open[0].acknowledged_by == "ann"
    await board.raise_("battery", "Very low.", level="critical")
    [alarm] = board.open
    assert (alarm.state, alarm.acknowledged_by) == ("unacknowledged", None)
