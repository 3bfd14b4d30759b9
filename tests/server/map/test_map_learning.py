import asyncio
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from autonomy.field.config import FieldConfig
from autonomy.field.synthetic import measure
from autonomy.site import TANK
from db.query.fleet.robots import add_robot
from db.query.station.configurations import configuration_history
from db.query.station.events import newest_events
from robot_link.messages import LogId, RobotId, Sample
from server.map import field_maps as mapping
from server.map import learning_task as learn_field
from server.map.event import DivesSmoothed
from tests.server.conftest import MINI, open_station, robot_record, until
from tests.server.fake_link import state_report

OTHER = RobotId("mini-2")
PATH = "/api/robots/mini-1/maps/blue_light"


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch):
    monkeypatch.setattr(mapping, "QUIET_S", 0.1)


def tell_samples(world, count, first=0, robot=MINI, at=None):
    """Let samples of one moment come: half a minute ago, unless said otherwise."""
    at = datetime.now(UTC) - timedelta(seconds=30) if at is None else at
    rng = np.random.default_rng(first + 5)
    domain = TANK.domain
    points = rng.random((count, 3)) * [domain.x_max_m, domain.y_max_m, domain.depth_max_m]
    values = measure("blue_light", points, rng).tolist()
    for i, (point, value) in enumerate(zip(points.tolist(), values, strict=True)):
        world.tell(
            Sample(robot, LogId(1), first + i, "blue_light", value, tuple(point), 0.02, at, at)
        )


async def mapped(station, count, robot=MINI):
    def there():
        group = station.maps.group(robot)
        return group is not None and group.live is not None and group.live.total == count

    await until(there)


async def opened(station):
    """Wait until the map is made with the newest settings."""

    async def is_newest():
        return station.maps.version(MINI) == (await versions(station))[0].id

    await until(is_newest)


async def versions(station, robot=MINI):
    return await station.foundation.store.query(
        lambda session: configuration_history(session, "field", robot)
    )


async def events_of(station, kind):
    events = await station.foundation.store.query(newest_events)
    return [event for event in events if event.kind == kind]


async def ended(station, job):
    async def there():
        found = await station.foundation.jobs.get(job)
        return found if found.state not in {"queued", "running"} else None

    return await until(there)


async def test_what_is_learned_becomes_a_version_and_the_map_is_made_anew(
    client, station, world, in_threads
):
    await client.patch("/api/config/field?robot=mini-1", json={"model": "single"})
    await opened(station)
    tell_samples(world, 60)
    await mapped(station, 60)
    before = station.maps.group(MINI).config
    answer = await client.post(f"{PATH}/learning")
    assert answer.status_code == 202
    job = await ended(station, answer.json()["id"])
    assert job.state == "done", job.message
    assert job.result["is_changed"]
    assert job.result["after_nll"] < job.result["before_nll"]
    newest = (await versions(station))[0]
    assert (newest.id, newest.changed_by) == (job.result["config"], "learning")
    learned = FieldConfig.model_validate(newest.value)
    assert learned.single != before.single
    assert learned.levels == before.levels
    await until(lambda: station.maps.group(MINI).config.single == learned.single)
    await mapped(station, 60)
    assert station.maps.version(MINI) == newest.id
    (told,) = await events_of(station, "map.learned")
    assert "60 samples" in told.text


async def test_robots_that_share_a_map_learn_together(client, station, world, in_threads):
    record = robot_record(OTHER, 12, "miniglider", TANK)
    await station.foundation.store.write(lambda session: add_robot(session, record))
    await station.refresh(OTHER)
    tell_samples(world, 40)
    await mapped(station, 40, OTHER)
    job = (await client.post(f"{PATH}/learning")).json()["id"]
    assert (await ended(station, job)).state == "done"
    mine, others = await versions(station), await versions(station, OTHER)
    assert mine[0].value == others[0].value
    await until(lambda: station.maps.version(OTHER) == others[0].id)
    await until(lambda: station.maps.group(MINI) is station.maps.group(OTHER))


async def test_settings_that_were_changed_meanwhile_are_not_overwritten(
    client, station, world, in_threads, monkeypatch
):
    tell_samples(world, 30)
    await mapped(station, 30)
    began, go_on = asyncio.Event(), []
    loop = asyncio.get_running_loop()
    run = learn_field.run

    def slow(problem, report, is_cancelled):
        loop.call_soon_threadsafe(began.set)
        while not go_on:
            pass
        return run(problem, report, is_cancelled)

    monkeypatch.setattr(learn_field, "run", slow)
    job = (await client.post(f"{PATH}/learning")).json()["id"]
    await began.wait()
    await client.patch("/api/config/field?robot=mini-1", json={"prior_mean": 4.0})
    go_on.append(True)
    found = await ended(station, job)
    assert found.state == "failed"
    assert "changed meanwhile" in found.message
    assert [one.changed_by for one in await versions(station)] == ["test admin"]


async def test_learning_that_is_cut_off_leaves_things_as_they_were(
    tmp_path, world, in_threads, monkeypatch
):
    """A station that stops in the middle of learning has changed nothing, nor has a dead one."""
    began = asyncio.Event()
    loop = asyncio.get_running_loop()

    def endless(problem, report, is_cancelled):
        loop.call_soon_threadsafe(began.set)
        while not is_cancelled():
            pass

    async with open_station(tmp_path, world) as station:
        tell_samples(world, 30)
        await mapped(station, 30)
        monkeypatch.setattr(learn_field, "run", endless)
        job = await station.learning.start(MINI, "blue_light", by="test")
        await began.wait()
        assert await station.learning.start(MINI, "blue_light", by="test") == job
    async with open_station(tmp_path, world) as station:
        await mapped(station, 30)
        assert await versions(station) == []
        assert (await station.foundation.jobs.get(job)).state == "cancelled"
        assert station.maps.version(MINI) == "preset"


async def test_station_learns_by_itself_between_dives(client, station, world, in_threads):
    learning = {"online": True, "least_new_samples": 25}
    await client.patch("/api/config/field?robot=mini-1", json={"learning": learning})
    await opened(station)
    looked = []
    station.foundation.bus.subscribe(
        DivesSmoothed,
        lambda dive: looked.append(station.maps.group(dive.robot).live.total),
    )

    async def surfaced_with(count, first):
        """Let samples come, and a fix; wait until the station has thought about learning."""
        tell_samples(world, count, first, at=datetime.now(UTC))
        await mapped(station, first + count)
        world.tell(state_report(MINI))
        await until(lambda: first + count in looked)
        await until(lambda: not station.learning.is_busy)
        return len(await events_of(station, "map.learned"))

    assert await surfaced_with(20, 0) == 0
    assert await surfaced_with(10, 20) == 1
    assert await surfaced_with(10, 30) == 1
    jobs = station.foundation.jobs.running
    assert jobs == []


async def test_map_with_too_few_samples_is_refused(client, station, world):
    await mapped(station, 0)
    refused = await client.post(f"{PATH}/learning")
    assert refused.status_code == 409
    assert "2 samples" in refused.json()["detail"]
