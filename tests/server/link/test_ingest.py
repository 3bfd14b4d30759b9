import errno
import math
import sqlite3
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from db.frame_file import FrameFile
from db.query.measured.samples import newest_samples, sample_columns
from db.query.station.events import newest_events
from db.sample_tables import SampleRow
from db.tables import RawFrameRow, StateRow
from db.tag_tables import DetectionRow
from robot_link.messages import OnboardPlanState, PlanReport
from robot_link.report import Detection, ReceiverReport
from server.link.event import SamplesStored
from tests.server.conftest import MINI, open_station, until
from tests.server.fake_link import state_report


async def count(foundation, table):
    return await foundation.store.query(lambda session: session.query(table).count())


async def stored_samples(foundation):
    return await foundation.store.query(lambda session: sample_columns(session, MINI, "blue_light"))


async def test_sample_is_acknowledged_only_after_it_was_committed(station, foundation, world):
    world.robots[MINI].sample((1.0, 0.5, 0.2))
    assert world.acknowledged == []
    await until(lambda: world.acknowledged)
    assert world.acknowledged == [(MINI, 1, 0)]
    assert len(await stored_samples(foundation)) == 1


async def test_sample_that_comes_twice_is_stored_once_and_acknowledged_again(
    station, foundation, world
):
    sample = world.robots[MINI].sample((1.0, 0.5, 0.2))
    await until(lambda: world.acknowledged)
    world.tell(sample)
    await until(lambda: len(world.acknowledged) == 2)
    assert await count(foundation, SampleRow) == 1


@pytest.fixture
def locked(tmp_path):
    """Another program that holds the write lock; closing it sets the database free."""
    other = sqlite3.connect(tmp_path / "station.sqlite3", timeout=60, isolation_level=None)
    yield other
    other.close()


async def test_a_sample_is_acknowledged_from_the_disk_while_the_database_is_locked(
    station, foundation, world, locked
):
    stored = []
    foundation.bus.subscribe(SamplesStored, lambda event: stored.extend(event.samples))
    locked.execute("BEGIN EXCLUSIVE")
    world.robots[MINI].sample((1.0, 0.5, 0.2))
    await until(lambda: world.acknowledged == [(MINI, 1, 0)])
    assert foundation.store.bridged_rows > 0
    assert stored == []
    locked.close()
    await until(lambda: [one.sequence for one in stored] == [0])
    assert foundation.store.bridged_rows == 0
    assert len(await stored_samples(foundation)) == 1
    assert set(world.acknowledged) == {(MINI, 1, 0)}


async def test_no_sample_is_acknowledged_that_neither_database_nor_disk_takes(
    station, foundation, world, locked, monkeypatch
):
    def no_room(self, payload):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(FrameFile, "append", no_room)
    locked.execute("BEGIN EXCLUSIVE")
    world.robots[MINI].sample((1.0, 0.5, 0.2))
    await until(lambda: foundation.store.bridge_fault is not None)
    assert world.acknowledged == []
    locked.close()
    await until(lambda: world.acknowledged)
    assert len(await stored_samples(foundation)) == 1


async def test_raw_frames_of_both_directions_are_journaled(station, foundation, world):
    world.frame(MINI, b"\x01")
    world.frame(None, b"garbage")
    station.ingest.flush()

    async def both():
        return await count(foundation, RawFrameRow) == 2

    await until(both)


IMPOSSIBLE = {
    "depth": {"position_ned": (1.0, 0.5, 9.0)},
    "above the surface": {"position_ned": (1.0, 0.5, -3.0)},
    "far away": {"position_ned": (900.0, 0.5, 0.2)},
    "not a number": {"pitch_rad": math.nan},
    "battery": {"battery_fraction": 7.0},
}


@pytest.mark.parametrize("changes", IMPOSSIBLE.values(), ids=IMPOSSIBLE)
async def test_impossible_state_reaches_no_gauge_and_no_track(station, foundation, world, changes):
    before = station.fleet.status(MINI).state
    world.tell(state_report(MINI, **changes))
    assert station.fleet.status(MINI).state is before
    assert station.fleet.status(MINI).refused == 1
    assert await count(foundation, StateRow) <= 1


async def test_impossible_values_are_told_once_until_a_good_one_came(station, foundation, world):
    for _ in range(5):
        world.tell(state_report(MINI, (1.0, 0.5, 9.0)))

    async def told():
        events = await foundation.store.query(newest_events)
        return [event.text for event in events if event.kind == "state.refused"]

    texts = await until(told)
    assert len(texts) == 1
    assert "9.00 m in 1.2 m of water" in texts[0]
    world.tell(state_report(MINI))
    world.tell(state_report(MINI, (1.0, 0.5, 9.0)))

    async def told_again():
        return len(await told()) == 2

    await until(told_again)


async def test_impossible_sample_stays_out_of_the_map_but_is_not_sent_for_ever(
    station, foundation, world
):
    world.robots[MINI].sample((1.0, 0.5, 0.2), value=math.inf)
    world.robots[MINI].sample((1.0, 0.5, 0.2))
    await until(lambda: len(world.acknowledged) == 2)
    assert len(await stored_samples(foundation)) == 1


async def test_word_of_a_robot_that_is_not_of_the_fleet_is_ignored(station, foundation, world):
    await station.ingest.settle()
    before = await count(foundation, StateRow)
    world.tell(state_report("stranger-9"))
    await station.ingest.settle()
    assert await count(foundation, StateRow) == before


async def test_late_report_is_stored_but_moves_no_gauge_back(station, foundation, world):
    newest = state_report(MINI, (1.4, 0.5, 0.3))
    world.tell(newest)
    world.tell(replace(newest, measured_at=newest.measured_at - timedelta(seconds=30)))
    assert station.fleet.status(MINI).state is newest

    async def all_stored():
        return await count(foundation, StateRow) == 3

    await until(all_stored)


WRONG_CLOCKS = {
    "years behind": (datetime(1980, 1, 6, tzinfo=UTC), "years behind the station's"),
    "days ahead": (datetime.now(UTC) + timedelta(days=30), "30 days ahead of the station's"),
}


@pytest.mark.parametrize(("said_at", "words"), WRONG_CLOCKS.values(), ids=WRONG_CLOCKS)
async def test_robot_with_a_wrong_clock_is_shown_as_such_and_ordered_by_arrival(
    client, station, world, said_at, words
):
    now = datetime.now(UTC)
    for later_s, depth_m in enumerate((0.2, 0.3, 0.1)):
        arrived = now + timedelta(seconds=later_s)
        at = said_at - timedelta(seconds=later_s)
        world.tell(state_report(MINI, (1.0, 0.5, depth_m), at=arrived, measured_at=at))
    found = (await client.get("/api/robots/mini-1/state")).json()
    assert words in found["clock_fault"]
    assert "mini-1" in found["clock_fault"]
    assert found["channels"]["depth_m"]["value"] == 0.1, "the newest by arrival"
    assert station.fleet.status(MINI).state.measured_at == now + timedelta(seconds=2)
    world.tell(state_report(MINI, at=now + timedelta(seconds=3)))
    assert (await client.get("/api/robots/mini-1/state")).json()["clock_fault"] is None


async def test_samples_of_a_robot_with_a_wrong_clock_are_kept_as_long_ago_as_it_says(
    foundation, world
):
    long_ago, now = datetime(1980, 1, 6, tzinfo=UTC), datetime.now(UTC)
    world.tell(state_report(MINI, at=now, measured_at=long_ago))
    under_water = long_ago - timedelta(seconds=10)
    world.robots[MINI].sample((1.0, 0.5, 0.2), measured_at=under_water)
    await until(lambda: world.acknowledged)
    kept = await foundation.store.query(lambda session: newest_samples(session, MINI))
    assert [sample.measured_at for sample in kept] == [now - timedelta(seconds=10)]


async def test_both_clocks_of_a_value_are_kept_apart(client, world):
    report = state_report(MINI)
    late = replace(report, received_at=report.measured_at + timedelta(seconds=0.8))
    world.tell(replace(late, measured_at=late.measured_at + timedelta(milliseconds=1)))
    depth = (await client.get("/api/robots/mini-1/state")).json()["channels"]["depth_m"]
    assert depth["measured_at"] < depth["received_at"]
    assert depth["unit"] == "m"


async def test_what_robots_said_is_there_after_a_restart(tmp_path, world):
    async with open_station(tmp_path, world) as station:
        world.tell(state_report(MINI, (1.3, 0.7, 0.4)))
        world.robots[MINI].sample((1.3, 0.7, 0.4), value=77.0)
        await until(lambda: world.acknowledged)
    async with open_station(tmp_path, world) as station:
        status = station.fleet.status(MINI)
        assert status.state.position_ned == (1.3, 0.7, 0.4)
        assert status.samples["blue_light"].value == 77.0
        assert len(status.track.since(0).position_ned) == 1


async def test_old_word_on_the_plan_that_is_said_again_takes_nothing_back(station, world):
    failed = PlanReport(
        robot=MINI,
        sha256=None,
        state=OnboardPlanState.FAILED,
        leg=0,
        legs=0,
        energy_used=0.0,
        reason="too deep",
        measured_at=datetime.now(UTC),
        received_at=datetime.now(UTC),
    )
    old = replace(
        failed,
        state=OnboardPlanState.RUNNING,
        measured_at=failed.measured_at - timedelta(hours=1),
    )
    world.tell(failed)
    world.tell(old)
    assert station.fleet.status(MINI).plan_report == failed


async def test_one_state_of_long_ago_is_no_state_of_now(station, world):
    now = datetime.now(UTC)
    world.tell(state_report(MINI, (1.0, 0.5, 0.2), at=now, battery_fraction=0.05))
    days_ago = now - timedelta(days=3)
    world.tell(state_report(MINI, at=now, measured_at=days_ago, battery_fraction=0.9))
    status = station.fleet.status(MINI)
    assert status.state.battery_fraction == 0.05
    assert status.clock_fault is None


def heard_tag(**changes):
    told = Detection(
        robot=MINI,
        log=1,
        sequence=500,
        receiver=480123,
        tag="A69-1601-179",
        sensor=None,
        position_ned=(1.0, 0.5, 0.2),
        position_std_m=0.1,
        measured_at=datetime.now(UTC),
        received_at=datetime.now(UTC),
    )
    return replace(told, **changes)


async def test_a_heard_tag_is_acknowledged_once_it_is_stored(station, foundation, world):
    heard = heard_tag()
    world.tell(heard)
    await until(lambda: world.acknowledged)
    world.tell(heard)
    await until(lambda: len(world.acknowledged) == 2)
    assert set(world.acknowledged) == {(MINI, 1, 500)}
    assert await count(foundation, DetectionRow) == 1


async def test_an_impossible_heard_tag_is_acknowledged_and_not_stored(station, foundation, world):
    world.frame(MINI, b"the detection")
    world.tell(heard_tag(position_ned=(900.0, 0.5, 0.2)))
    await until(lambda: world.acknowledged == [(MINI, 1, 500)])
    assert station.fleet.status(MINI).refused == 1
    assert await count(foundation, DetectionRow) == 0


async def test_a_receiver_whose_clock_is_wrong_is_said_once(station, foundation, world):
    now = datetime.now(UTC)
    for _ in range(3):
        world.tell(ReceiverReport(MINI, now, now, 480123, 1, 2, 0, 0, -75.0))

    async def told():
        events = await foundation.store.query(newest_events)
        return [event for event in events if event.kind == "receiver.clock"]

    await until(told)
    assert len(await told()) == 1
    assert "-75 s" in (await told())[0].text
