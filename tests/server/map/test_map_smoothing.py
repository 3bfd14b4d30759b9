import asyncio
import shutil
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from autonomy.channel import CHANNELS
from autonomy.field.config import FIELD_PRESETS
from autonomy.field.samples import FieldSamples
from autonomy.site import TANK
from db.fault import StoreUnavailableError
from db.query.measured import smoothing as query
from db.query.measured.samples import sample_columns
from db.query.station.events import newest_events
from db.store import Store
from robot_link.clock import SystemClock
from robot_link.messages import Sample
from server.map import comparison_task as compare_maps
from server.map import field_maps as mapping
from server.map import smoothing
from server.map.samples import field_samples, site_samples
from server.map.smoothing import Smoothing
from server.map.task import ComparisonProblem
from tests.server.conftest import MINI, open_station, until
from tests.server.dive import DRIFT_M_S, STEP_S, begin_of, dive


@pytest.fixture
def store(prepared_database, tmp_path):
    """A database alone: a station's own smoothing would look at the same samples."""
    opened = Store.open(f"sqlite:///{shutil.copy(prepared_database, tmp_path)}")
    yield opened
    opened.close()


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch):
    monkeypatch.setattr(mapping, "QUIET_S", 0.1)


def columns(store):
    with store.read() as session:
        return sample_columns(session, MINI, "blue_light")


def is_smoothed(store):
    found = columns(store)
    return len(found) > 0 and found.is_smoothed.all()


def samples_of(told):
    return [one for one in told if isinstance(one, Sample)]


async def kept(store, told):
    await asyncio.wrap_future(store.append(told))


async def test_dive_that_a_fix_ended_moves_towards_where_it_was(client, station, world):
    for one in dive(MINI, begin_of(1)):
        world.tell(one)

    async def smoothed():
        shown = (await client.get("/api/robots/mini-1/maps/blue_light")).json()
        return shown if shown.get("smoothed_samples") == 20 else None

    shown = await until(smoothed)
    assert shown["samples"]["total"] == 20
    found = columns(station.foundation.store)
    carried = DRIFT_M_S * STEP_S * np.arange(1, 21)
    assert found.position_ned[:, 1].tolist() == [0.5] * 20
    moved = found.smoothed_ned[:, 1] - found.position_ned[:, 1]
    np.testing.assert_allclose(moved, carried, atol=0.01)
    assert (found.smoothed_std_m < found.position_std_m).all()
    samples = station.maps.samples(MINI)
    assert samples.is_smoothed.all()
    np.testing.assert_array_equal(samples.position_ned, found.smoothed_ned)
    events = await station.foundation.store.query(newest_events)
    told = next(event for event in reversed(events) if event.kind == "dive.smoothed")
    assert "moved 20 samples of mini-1" in told.text
    assert told.data["drift_ne_m"][1] == pytest.approx(carried[-1] + DRIFT_M_S * STEP_S, abs=0.01)


async def test_dive_that_nobody_smoothed_is_caught_up_after_a_restart(tmp_path, world, monkeypatch):
    async def never(self, robot):
        del self, robot
        return 0

    with monkeypatch.context() as patched:
        patched.setattr(Smoothing, "look", never)
        async with open_station(tmp_path, world) as station:
            told = dive(MINI, begin_of(1))
            for one in told:
                world.tell(one)
            await until(lambda: len(columns(station.foundation.store)) == 20)
            assert not columns(station.foundation.store).is_smoothed.any()
    async with open_station(tmp_path, world) as station:
        world.tell(told[-1])
        await until(lambda: is_smoothed(station.foundation.store))
        await until(
            lambda: (
                station.maps.samples(MINI) is not None
                and station.maps.samples(MINI).is_smoothed.all()
            )
        )


async def test_looking_again_changes_nothing(store):
    looker = Smoothing(store, SystemClock())
    told = dive(MINI, begin_of(1))
    await kept(store, told)
    assert await looker.look(MINI) == 20
    before = columns(store)
    assert await looker.look(MINI) == 0
    looker.feed(samples_of(told))
    await looker.look(MINI)
    assert await Smoothing(store, SystemClock()).look(MINI) == 0
    np.testing.assert_array_equal(columns(store).smoothed_ned, before.smoothed_ned)


async def test_samples_that_come_late_lead_to_the_same_places(store):
    begin = begin_of(2)
    told = dive(MINI, begin)
    late = samples_of(told)[8:]
    await kept(store, [one for one in told if one not in late])
    looker = Smoothing(store, SystemClock())
    await looker.look(MINI)
    await kept(store, late)
    looker.feed(late)
    await looker.look(MINI)
    piecewise = columns(store)
    events = await store.query(newest_events)
    assert len([one for one in events if one.kind == "dive.smoothed"]) == 1, "told of once"

    again = dive(MINI, begin + timedelta(seconds=100), first=20)
    await kept(store, again)
    looker.feed(samples_of(again))
    await looker.look(MINI)
    at_once = columns(store)
    moved = piecewise.smoothed_ned - piecewise.position_ned
    np.testing.assert_allclose(moved, (at_once.smoothed_ned - at_once.position_ned)[20:], atol=1e-9)


async def test_of_many_dives_the_newest_are_known_to_have_been_told_of(store, monkeypatch):
    monkeypatch.setattr(smoothing, "TOLD_MAX", 1)
    looker, begin = Smoothing(store, SystemClock()), begin_of(3)
    for number in range(2):
        told = dive(MINI, begin + number * timedelta(seconds=100), first=20 * number)
        await kept(store, told)
        looker.feed(samples_of(told))
        await looker.look(MINI)
    events = [one for one in await store.query(newest_events) if one.kind == "dive.smoothed"]
    assert looker._announced[MINI] == {max(one.data["fix_s"] for one in events)}
    assert len(events) == 2


async def test_dive_whose_keeping_fails_stays_as_it_was_and_is_tried_again(store, monkeypatch):
    """What a killed station leaves is what a failed transaction leaves: all or nothing."""
    looker = Smoothing(store, SystemClock())
    await kept(store, dive(MINI, begin_of(1)))

    def torn(session, robot, places):
        query.keep_smoothed(session, robot, places[:7])
        session.flush()
        raise StoreUnavailableError("The disk is full.")

    with monkeypatch.context() as patched:
        patched.setattr(smoothing, "keep_smoothed", torn)
        with pytest.raises(StoreUnavailableError):
            await looker.look(MINI)
    assert not columns(store).is_smoothed.any()
    assert await looker.look(MINI) == 20
    assert columns(store).is_smoothed.all()


async def test_long_track_is_looked_at_piece_by_piece(store, monkeypatch):
    begin = begin_of(4)
    for number in range(4):
        start = begin + timedelta(seconds=100 * number)
        await kept(store, dive(MINI, start, first=20 * number))
    monkeypatch.setattr(smoothing, "ROWS_PER_LOOK", 40)
    assert await Smoothing(store, SystemClock()).look(MINI) == 80
    found = columns(store)
    assert found.is_smoothed.all()
    moved = (found.smoothed_ned - found.position_ned)[:, 1].reshape(4, 20)
    np.testing.assert_allclose(moved, moved[:1].repeat(4, axis=0), atol=1e-6)


async def test_dive_that_has_not_ended_waits(store):
    await kept(store, dive(MINI, begin_of(1))[:-1])
    assert await Smoothing(store, SystemClock()).look(MINI) == 0
    assert not columns(store).is_smoothed.any()


async def test_smoothed_samples_reach_whoever_asks_for_the_samples_of_the_water(store):
    await kept(store, dive(MINI, begin_of(1)))
    await Smoothing(store, SystemClock()).look(MINI)
    with store.read() as session:
        samples = site_samples(session, MINI, CHANNELS["blue_light"])
    assert (samples.position_std_m < samples.filtered_std_m).all()
    assert len(np.unique(samples.dive)) == 1


async def test_each_sample_says_its_fidelity_and_whether_it_was_smoothed(client, station, world):
    store = station.foundation.store
    path = "/api/robots/mini-1/samples?channel=blue_light&positions=true"
    told = dive(MINI, datetime.now(UTC) + timedelta(seconds=2))
    for one in told[:-1]:
        world.tell(one)
    await until(lambda: len(columns(store)) == 20)
    before = (await client.get(path)).json()
    assert before["smoothed"] == [False] * 20
    assert (max(before["fidelity"]), min(before["fidelity"])) == (2, 0)
    world.tell(told[-1])
    await until(lambda: is_smoothed(store))
    after = (await client.get(path)).json()
    assert after["smoothed"] == [True] * 20
    assert after["fidelity"] > before["fidelity"]
    assert sum(after["fidelity"]) > sum(before["fidelity"])
    assert after["east_m"][-1] - before["east_m"][-1] == pytest.approx(0.16, abs=0.01)
    assert (after["value"], after["decimated"]) == (before["value"], False)
    thinned = (await client.get(f"{path}&max_points=6")).json()
    assert thinned["decimated"]
    assert len(thinned["north_m"]) == len(thinned["value"]) <= 6
    plain = (await client.get("/api/robots/mini-1/samples?channel=blue_light")).json()
    assert plain["north_m"] is None


async def test_smoothed_samples_make_the_better_map_on_the_same_seeds(store):
    begin = begin_of(12)
    for number in range(12):
        start = begin + timedelta(seconds=100 * number)
        north_m, east_m = 0.3 + 0.45 * (number % 4), 0.3 + 0.35 * (number // 4)
        drift_m_s = DRIFT_M_S if number % 2 else -DRIFT_M_S
        await kept(
            store,
            dive(
                MINI,
                start,
                first=20 * number,
                north_m=north_m,
                east_m=east_m,
                drift_m_s=drift_m_s,
            ),
        )
    await Smoothing(store, SystemClock()).look(MINI)
    found = columns(store)
    smoothed = field_samples(found)
    as_said = FieldSamples.of(found.position_ned, found.value, found.position_std_m)
    scores = [
        {
            one.model: one.scores
            for one in compare_maps.run(
                ComparisonProblem(
                    FIELD_PRESETS["blue_light"], TANK.domain, TANK, samples, True, with_maps=False
                ),
                lambda news: None,
                lambda: False,
            ).models
        }
        for samples in (as_said, smoothed)
    ]
    for model in ("single", "position_noise"):
        before, after = scores[0][model], scores[1][model]
        assert after.rmse < before.rmse
        assert after.nlpd < before.nlpd


async def test_robot_that_never_stops_sampling_is_smoothed_nevertheless(
    client, station, world, monkeypatch
):
    monkeypatch.setattr(mapping, "QUIET_S", 1e9)
    monkeypatch.setattr(mapping, "QUIET_LIMIT_S", 0.2)
    for one in dive(MINI, begin_of(1)):
        world.tell(one)
    await until(lambda: is_smoothed(station.foundation.store))


async def test_dive_whose_fix_was_told_before_its_samples_were_committed_is_smoothed(
    station, world
):
    store = station.foundation.store
    for number in range(2):
        begin = begin_of(2) + timedelta(seconds=100 * number)
        for one in dive(MINI, begin, first=20 * number):
            world.tell(one)
        await until(
            lambda number=number: np.count_nonzero(columns(store).is_smoothed) == 20 * (number + 1)
        )
