"""What goes wrong around a map, and what an operator or a robot may hand it, end to end."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from db.fault import StoreUnavailableError
from server.link.event import SamplesStored
from server.map import rest
from server.map.field_maps import FieldMaps
from server.map.site_map import SiteMap
from tests.server.conftest import MINI, until

PATH = "/api/robots/mini-1/maps/blue_light"


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch):
    monkeypatch.setattr(rest, "REST_FACTOR", 0.0)
    monkeypatch.setattr(rest, "UNSEEN_FACTOR", 0.0)


async def grown(client, count, model=None):
    async def there():
        answer = await client.get(PATH)
        shown = answer.json()
        is_grown = answer.status_code == 200 and shown["samples"]["total"] == count
        return shown if is_grown and model in (None, shown["model"]) else None

    return await until(there)


async def outcome(client, station, of):
    job = (await client.post(f"{PATH}/{of}")).json()["id"]

    async def ended():
        found = await station.foundation.jobs.get(job)
        return found if found.state not in {"queued", "running"} else None

    return await until(ended)


def assert_is_a_map(shown):
    assert np.isfinite(np.array(shown["mean"], dtype=float)).all()
    assert (np.array(shown["std"], dtype=float) > 0.0).all()


async def test_samples_that_the_map_does_not_take_at_once_are_in_it_nevertheless(
    client, world, monkeypatch
):
    append, refused = SiteMap.append, []

    def refuse_first(self, samples):
        if not refused:
            refused.append(len(samples))
            raise ValueError("the matrix to factorize is not a covariance matrix")
        append(self, samples)

    monkeypatch.setattr(SiteMap, "append", refuse_first)
    for x in (0.4, 1.1, 1.9):
        world.robots[MINI].sample((x, 0.7, 0.3))
    await grown(client, 3)
    world.robots[MINI].sample((2.3, 0.7, 0.3))
    await grown(client, 4)
    assert refused


async def test_map_that_storage_kept_from_being_made_anew_is_made_anew_later(
    client, station, world, monkeypatch
):
    world.robots[MINI].sample((1.0, 0.7, 0.3))
    await grown(client, 1)
    condition, failed = FieldMaps._condition, []

    async def fail_first(self, group):
        if not failed:
            failed.append(group)
            raise StoreUnavailableError("the disk is full")
        await condition(self, group)

    monkeypatch.setattr(FieldMaps, "_condition", fail_first)
    group = station.maps.group(MINI)
    before = group.live
    group.is_stale = True
    station.maps.feed(SamplesStored([], []))
    await until(lambda: group.live is not before)
    assert failed
    assert not group.is_stale
    world.robots[MINI].sample((1.2, 0.7, 0.3))
    await grown(client, 2)


async def test_of_two_changes_of_the_settings_the_later_one_holds(client, station, monkeypatch):
    await until(lambda: station.maps.group(MINI))
    opened, first, go_on = FieldMaps.open, asyncio.Event(), asyncio.Event()

    async def slow_at_first(self, record, settings):
        if record.id == MINI and not first.is_set():
            first.set()
            await go_on.wait()
        await opened(self, record, settings)

    monkeypatch.setattr(FieldMaps, "open", slow_at_first)
    await client.patch("/api/config/field?robot=mini-1", json={"prior_mean": 4.0})
    await asyncio.wait_for(first.wait(), 60.0)
    answer = await client.patch("/api/config/field?robot=mini-1", json={"prior_mean": 6.0})
    assert answer.status_code == 200
    refresh = asyncio.create_task(station.refresh(MINI))
    await asyncio.sleep(0.1)
    go_on.set()
    await refresh
    await until(lambda: not station.opening._turn.locked())
    assert station.maps.group(MINI).config.prior_mean == 6.0
    assert (await client.get("/api/config/field?robot=mini-1")).json()["id"] == (
        station.maps.version(MINI)
    )


@pytest.mark.parametrize("model", ["single", "recursive", "joint", "position_noise"])
@pytest.mark.parametrize(
    "places", [[(1.0, 0.7, 0.3)] * 8, [(1.0, 0.7, 0.3)], [(0.1 * i, 0.5, 0.2) for i in range(12)]]
)
async def test_duplicate_single_and_constant_samples_make_a_map(client, world, model, places):
    changed = await client.patch("/api/config/field?robot=mini-1", json={"model": model})
    assert changed.status_code == 200
    first = world.robots[MINI].sample(places[0])
    for number, place in enumerate(places[1:], start=1):
        world.tell(replace(first, sequence=first.sequence + number, position_ned=place))
    assert_is_a_map(await grown(client, len(places), model))


async def test_constant_samples_are_compared_and_teach_nothing_with_a_sentence(
    client, station, world, in_threads
):
    sample = world.robots[MINI].sample((1.0, 0.7, 0.3))
    for number in range(1, 30):
        place = (0.05 * number, 0.5, 0.2)
        world.tell(replace(sample, sequence=sample.sequence + number, position_ned=place))
    await grown(client, 30)
    learned = await outcome(client, station, "learning")
    assert learned.state == "done"
    assert not learned.result["is_changed"]
    assert "same value" in learned.result["message"]
    assert (await outcome(client, station, "comparison")).state == "done"
    assert len((await client.get(f"{PATH}/comparison")).json()["models"]) == 4


@pytest.mark.parametrize(
    "broken",
    [
        {"value": float("nan")},
        {"value": float("inf")},
        {"position_std_m": float("nan")},
        {"position_std_m": -1.0},
        {"position_ned": (float("nan"), 0.5, 0.2)},
    ],
)
async def test_sample_that_is_no_number_changes_no_map(client, world, broken):
    sample = world.robots[MINI].sample((1.0, 0.7, 0.3))
    before = await grown(client, 1)
    world.tell(replace(sample, sequence=sample.sequence + 1, **broken))
    world.tell(replace(sample, sequence=sample.sequence + 2, value=2.0 * sample.value))
    after = await grown(client, 2)
    assert_is_a_map(after)
    assert after["mean"] != before["mean"]


async def test_domain_without_volume_is_refused_by_name(client, station):
    await until(lambda: station.maps.group(MINI))
    domain = station.maps.group(MINI).domain.model_dump()
    for name, value in (("x_max_m", domain["x_min_m"]), ("depth_max_m", 0.0)):
        answer = await client.patch(
            "/api/config/planner?robot=mini-1", json={"domain": domain | {name: value}}
        )
        assert answer.status_code == 422
        assert name in answer.text
