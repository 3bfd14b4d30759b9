"""Surfaced, contact, dive begun, dive ended: told once each, in order, and none lost."""

import asyncio
import random
from datetime import UTC, datetime, timedelta

import pytest

from db.query.station.events import newest_events
from robot_link.messages import LinkState, RobotMode
from server.base.event_log import EventLog
from server.link.moments import CONTACT, DIVE_BEGUN, DIVE_ENDED, SURFACED, is_down
from tests.server.conftest import GRACE, MINI, open_station, until
from tests.server.fake_link import state_report

KINDS = [SURFACED, CONTACT, DIVE_BEGUN, DIVE_ENDED]
DIVES = [DIVE_BEGUN, DIVE_ENDED, SURFACED]
SEEDS = random.Random(3).sample(range(10**6), 4)


async def moments(client, robot=MINI, **query):
    """Return the moments of dives that were told."""
    found = await client.get(
        "/api/events", params={"robot": robot, "kind": DIVES, "limit": 1000, **query}
    )
    assert found.status_code == 200, found.text
    return found.json()["events"]


def state(robot, at, mode, depth_m=0.0):
    return state_report(robot, (1.0, 0.5, depth_m), at=at, mode=mode)


def word(world, at, mode, depth_m=0.0, robot=MINI):
    world.tell(state(robot, at, mode, depth_m))


def start():
    """Return a moment after what was told before; the steps of a story are milliseconds."""
    return datetime.now(UTC) + timedelta(milliseconds=5)


@pytest.mark.parametrize(
    ("mode", "depth_m", "told"),
    [
        (RobotMode.GLIDING, 0.0, True),
        (RobotMode.IDLE, 0.0, False),
        (RobotMode.SURFACED, 0.1, False),
        (RobotMode.SWIMMING, 0.1, None),
        (RobotMode.ABORTING, 0.1, None),
        (RobotMode.ABORTING, 0.9, True),
    ],
)
def test_mode_and_depth_say_whether_a_robot_is_in_a_dive(mode, depth_m, told):
    assert is_down(state(MINI, start(), mode, depth_m)) is told


async def test_dive_is_told_to_begin_and_to_end_with_both_times(client, world):
    at = start()
    for second, mode in enumerate(
        [RobotMode.IDLE, RobotMode.GLIDING, RobotMode.GLIDING, RobotMode.SURFACED, RobotMode.IDLE]
    ):
        word(world, at + timedelta(milliseconds=second), mode)

    async def told():
        found = await moments(client)
        return found if len(found) == 3 else None

    found = await until(told)
    assert [one["kind"] for one in found] == [DIVE_BEGUN, DIVE_ENDED, SURFACED]
    data = found[2]["data"]
    assert datetime.fromisoformat(data["measured_at"]) == at + timedelta(milliseconds=3)
    assert datetime.fromisoformat(data["received_at"]) >= at
    assert data["by"] == "radio"


@pytest.mark.parametrize("seed", SEEDS)
async def test_moments_are_told_once_however_words_are_doubled_and_overtaken(client, world, seed):
    drawn, at = random.Random(seed), start()
    dives = 6
    words = []
    for number in range(dives):
        begun = at + timedelta(milliseconds=60 * number)
        words.append((begun, RobotMode.GLIDING, 0.5))
        words.append((begun + timedelta(milliseconds=30), RobotMode.SURFACED, 0.0))
    heard = []
    for one in words:
        heard.append(one)
        if drawn.random() < 0.5:
            heard.append(drawn.choice(heard))  # doubled, or an older one that took longer
    for when, mode, depth_m in heard:
        word(world, when, mode, depth_m)

    async def told():
        found = await moments(client)
        return found if len(found) >= 3 * dives else None

    found = await until(told)
    assert [one["kind"] for one in found] == DIVES * dives
    measured = [datetime.fromisoformat(one["data"]["measured_at"]) for one in found]
    assert measured == sorted(measured)


async def test_script_that_goes_on_from_its_cursor_misses_none(client, world):
    first = (await client.get("/api/events", params={"kind": DIVES})).json()["next"]
    at, cursor, seen, drawn = start(), first, [], random.Random(5)
    told = 0
    for number in range(12):
        word(world, at + timedelta(milliseconds=20 * number), RobotMode.GLIDING, 0.6)
        word(world, at + timedelta(milliseconds=20 * number + 10), RobotMode.SURFACED)
        told += 3
        if drawn.random() < 0.6:
            continue  # it was not connected
        page = await client.get(
            "/api/events", params={"after": cursor, "kind": DIVES, "wait_s": 0.1, "limit": 4}
        )
        seen += page.json()["events"]
        cursor = page.json()["next"]
    while len(seen) < told:
        page = await client.get(
            "/api/events", params={"after": cursor, "kind": DIVES, "wait_s": 5, "limit": 4}
        )
        seen += page.json()["events"]
        cursor = page.json()["next"]
    assert [one["kind"] for one in seen] == DIVES * 12
    cursors = [one["cursor"] for one in seen]
    assert cursors == sorted(set(cursors))


async def test_answer_comes_when_something_happens_and_not_after_the_wait(
    client, world, monkeypatch
):
    grown = EventLog.grown_beyond
    monkeypatch.setattr(EventLog, "grown_beyond", lambda log, cursor, _: grown(log, cursor, 600.0))
    cursor = (await client.get("/api/events", params={"kind": DIVES})).json()["next"]
    query = {"after": cursor, "kind": SURFACED, "wait_s": 25}
    asked = asyncio.ensure_future(client.get("/api/events", params=query))
    await asyncio.sleep(0.3)
    assert not asked.done()
    at = start()
    word(world, at, RobotMode.GLIDING, 0.6)
    word(world, at + timedelta(milliseconds=1), RobotMode.SURFACED)
    answer = (await asked).json()
    assert [one["kind"] for one in answer["events"]] == [SURFACED]


async def test_robot_that_is_heard_again_is_in_contact(client, station, world, monkeypatch):
    monkeypatch.setattr("server.link.moments._SILENCE", timedelta(0))

    async def contacts():
        found = await client.get("/api/events", params={"robot": GRACE, "kind": CONTACT})
        return [one["data"]["carrier"] for one in found.json()["events"]]

    world.hear(GRACE)
    await until(lambda: station.foundation is not None)

    async def so_often(count):
        return len(await contacts()) == count or None

    await until(lambda: so_often(1))
    world.hear(GRACE)
    world.hear(GRACE, LinkState.STALE)
    world.hear(GRACE)
    await until(lambda: so_often(2))
    assert await contacts() == ["xbee", "xbee"]


@pytest.mark.parametrize(
    ("lost", "cause"),
    [
        (LinkState.STALE, None),
        (LinkState.SUBMERGED, "it was under water"),
        (LinkState.DISABLED, "its link was unplugged"),
        (LinkState.PORT_CLOSED, "the station's radio could not be opened"),
        (LinkState.MUTE, "the station's radio did not answer"),
    ],
)
async def test_contact_says_how_long_it_was_lost_and_why(client, world, monkeypatch, lost, cause):
    monkeypatch.setattr("server.link.moments._SILENCE", timedelta(0))

    async def told():
        found = await client.get("/api/events", params={"robot": GRACE, "kind": CONTACT})
        return [one for one in found.json()["events"] if one["data"].get("silent_since")] or None

    for link in (LinkState.LIVE, lost, LinkState.LIVE):
        world.hear(GRACE, link)
    [contact] = await until(told)
    assert contact["data"]["cause"] == cause
    silent_s = contact["data"]["silent_s"]
    why = cause or "why it was not is not known"
    assert contact["text"] == f"{GRACE} is heard again by XBee after {silent_s} s; {why}."


async def test_surfacing_that_a_killed_station_had_not_told_is_told_by_the_next(tmp_path, world):
    at = start()
    async with open_station(tmp_path, world) as station:
        word(world, at, RobotMode.GLIDING, 0.6)

        async def begun():
            found = await _kinds(station)
            return DIVE_BEGUN in found or None

        await until(begun)
        # The state is stored; what follows from it is lost.
        store = station.foundation.store
        from db.ingest import append_telemetry

        up = state(MINI, at + timedelta(milliseconds=5), RobotMode.SURFACED)
        await store.write(lambda session: append_telemetry(session, [up]))
    async with open_station(tmp_path, world) as station:

        async def told():
            return SURFACED in await _kinds(station) or None

        await until(told)
        assert (await _kinds(station)).count(SURFACED) == 1
        found = await station.foundation.store.query(newest_events)
        # What carried the word is not kept with it.
        assert [one.data["by"] for one in found if one.kind == SURFACED] == [None]


async def test_robot_that_is_heard_as_soon_as_a_station_runs_again_was_not_silent(
    tmp_path, world, monkeypatch
):
    monkeypatch.setattr("server.link.moments._SILENCE", timedelta(hours=1))

    async def kinds(station):
        found = await station.foundation.store.query(newest_events)
        return [one.kind for one in found]

    async with open_station(tmp_path, world):
        word(world, start(), RobotMode.IDLE)
        world.hear(MINI)
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        at = start()
        word(world, at, RobotMode.GLIDING, 0.6)

        async def begun():
            return DIVE_BEGUN in await kinds(station) or None

        await until(begun)
        assert (await kinds(station)).count(CONTACT) <= 1  # of before alone


async def _kinds(station):
    found = await station.foundation.store.query(newest_events)
    return [one.kind for one in found if one.kind in DIVES]
