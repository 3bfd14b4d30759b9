from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
import pytest_asyncio

from autonomy.channel import CHANNELS
from autonomy.field.config import FIELD_PRESETS
from autonomy.site import TANK, Area, Bathymetry
from db.query.fleet.robots import add_robot, change_robot
from db.query.measured.samples import sample_columns
from robot_link.messages import LogId, RobotId, Sample
from server.fleet.water import site_robots
from server.link.event import SamplesStored
from server.map.samples import field_samples, site_samples
from tests.server.conftest import MINI, open_station, robot_record, until
from tests.server.fake_link import current_report, state_report

OTHER = RobotId("mini-2")
REAL = RobotId("mini-3")
LIVE = ("blue_light", FIELD_PRESETS["blue_light"].model)


def sample(robot, sequence, north_m, std_m, value=200.0, after_s=0.0):
    at = datetime.now(UTC) - timedelta(seconds=60.0 - after_s)
    return Sample(
        robot, LogId(1), sequence, "blue_light", value, (north_m, 0.6, 0.3), std_m, at, at
    )


def in_map(station, robot):
    view = station.maps.views(robot).get(LIVE)
    return 0 if view is None else sum(view.samples_per_level)


@pytest_asyncio.fixture
async def pair(station, world):
    """Let a second robot work in the tank of the first."""
    record = robot_record(OTHER, 12, "miniglider", TANK)
    await station.foundation.store.write(lambda session: add_robot(session, record))
    await station.refresh(OTHER)
    await until(lambda: LIVE in station.maps.views(MINI))
    return station


async def test_robots_of_one_water_fill_one_map(pair, world):
    world.tell(sample(MINI, 0, 0.4, 0.02))
    world.tell(sample(OTHER, 0, 2.3, 0.02, after_s=1.0))
    await until(lambda: in_map(pair, MINI) == 2)
    assert pair.maps.views(OTHER)[LIVE] is pair.maps.views(MINI)[LIVE]
    assert pair.maps.samples(MINI).position_ned[:, 0].tolist() == [0.4, 2.3]


async def test_dives_of_two_robots_are_never_one(pair):
    store = pair.foundation.store
    told = [
        sample(MINI, 0, 0.1, 0.1, after_s=0),
        sample(OTHER, 0, 0.2, 0.2, after_s=1),
        sample(MINI, 1, 0.3, 0.2, after_s=2),
        sample(OTHER, 1, 0.4, 0.3, after_s=3),
        sample(MINI, 2, 0.5, 0.05, after_s=4),
    ]
    store.append(told).result(60)
    with store.read() as session:
        samples = site_samples(session, OTHER, CHANNELS["blue_light"])
        columns = sample_columns(session, (MINI, OTHER), "blue_light")
    assert samples.points[:, 0].tolist() == [0.1, 0.2, 0.3, 0.4, 0.5]
    a, b, c, d, e = samples.dive.tolist()
    assert a == c
    assert b == d
    assert len({a, b, e}) == 3
    np.testing.assert_array_equal(field_samples(columns).dive, samples.dive)


async def test_shared_map_is_the_same_after_a_restart(tmp_path, world):
    record = robot_record(OTHER, 12, "miniglider", TANK)
    told = [
        sample(robot, number, 0.3 * number + shift, 0.02 + 0.02 * number, 150 + 40 * number, number)
        for number in range(5)
        for robot, shift in ((MINI, 0.2), (OTHER, 0.9))
    ]
    async with open_station(tmp_path, world) as station:
        await station.foundation.store.write(lambda session: add_robot(session, record))
        await station.refresh(OTHER)
        for one in told:
            world.tell(one)
        await until(lambda: in_map(station, OTHER) == 10)
        before = station.maps.views(OTHER)[LIVE]
    async with open_station(tmp_path, world) as station:
        await until(lambda: in_map(station, MINI) == 10)
        after = station.maps.views(MINI)[LIVE]
    np.testing.assert_allclose(after.mean, before.mean, atol=0.05)
    np.testing.assert_allclose(after.std, before.std, atol=0.05)


async def test_simulated_samples_never_enter_the_map_of_a_real_robot(pair, world):
    record = replace(robot_record(REAL, 13, "miniglider", TANK), kind="real")
    await pair.foundation.store.write(lambda session: add_robot(session, record))
    await pair.refresh(REAL)
    world.tell(sample(MINI, 0, 0.4, 0.02))
    world.tell(sample(REAL, 0, 2.3, 0.02))
    await until(lambda: in_map(pair, MINI) == in_map(pair, REAL) == 1)
    assert pair.maps.samples(REAL).position_ned[0, 0] == 2.3
    with pair.foundation.store.read() as session:
        assert site_robots(session, REAL) == (REAL,)
        assert site_robots(session, MINI) == (MINI, OTHER)


async def test_robot_that_leaves_takes_its_samples_along(pair, world):
    world.tell(sample(MINI, 0, 0.4, 0.02))
    world.tell(sample(OTHER, 0, 2.3, 0.02))
    await until(lambda: in_map(pair, MINI) == 2)
    elsewhere = TANK.model_copy(update={"name": "Second tank"})
    await pair.foundation.store.write(
        lambda session: change_robot(session, OTHER, site=elsewhere.model_dump())
    )
    await pair.refresh(OTHER)
    assert in_map(pair, MINI) == in_map(pair, OTHER) == 1
    assert pair.maps.samples(OTHER).position_ned[0, 0] == 2.3


async def test_settings_of_one_robot_give_it_a_map_of_its_own_of_all_samples(client, pair, world):
    world.tell(sample(MINI, 0, 0.4, 0.02))
    world.tell(sample(OTHER, 0, 2.3, 0.02))
    await until(lambda: in_map(pair, OTHER) == 2)
    patch = {"model": "joint", "grid": {"x": 5, "y": 4, "z": 3}}
    assert (await client.patch("/api/config/field?robot=mini-2", json=patch)).status_code == 200
    await until(lambda: ("blue_light", "joint") in pair.maps.views(OTHER))
    own = pair.maps.views(OTHER)["blue_light", "joint"]
    assert own.mean.shape == (5, 4, 3)
    assert sum(own.samples_per_level) == 2
    assert LIVE in pair.maps.views(MINI)


async def test_sample_that_is_no_number_is_left_out_and_logged(pair, caplog):
    samples = [sample(MINI, 0, float("nan"), 0.02), sample(MINI, 1, 0.4, 0.02)]
    pair.maps.feed(SamplesStored(samples, []))
    await until(lambda: in_map(pair, MINI) == 1)
    assert "left out of the map" in caplog.text
    assert np.isfinite(pair.maps.views(MINI)[LIVE].mean).all()


async def test_map_shows_nothing_where_there_is_no_water(client, pair, world):
    shore = Area(name="shore", corners_m=((-1.0, -1.0), (-1.0, 3.0), (1.4, 3.0), (1.4, -1.0)))
    floor = Bathymetry(north_m=(-1.0, 4.0), east_m=(-1.0, 3.0), depth_m=((0.4, 0.4), (0.4, 0.4)))
    site = TANK.model_copy(update={"shoreline": shore, "bathymetry": floor})
    for robot in (MINI, OTHER):
        await pair.foundation.store.write(
            lambda session, robot=robot: change_robot(session, robot, site=site.model_dump())
        )
        await pair.refresh(robot)
    world.tell(sample(MINI, 0, 0.4, 0.02))
    await until(lambda: in_map(pair, MINI) == 1)
    shown = (await client.get("/api/robots/mini-1/maps/blue_light")).json()
    axes, mask = shown["axes"], shown["mask"]
    wet = [
        north_m <= 1.4 and depth_m <= 0.4
        for north_m in axes["x_m"]
        for _ in axes["y_m"]
        for depth_m in axes["z_m"]
    ]
    assert mask == wet
    for name in ("mean", "std"):
        assert [value is not None for value in shown[name]] == wet
    rows = (await client.get("/api/robots/mini-1/maps/blue_light?format=csv")).text.splitlines()
    assert len([row for row in rows if not row.startswith("#")]) == sum(wet) + 1


@pytest.mark.parametrize("model", ["single", "recursive", "joint", "position_noise"])
async def test_map_of_one_sample_works(client, pair, world, model):
    await client.patch("/api/config/field?robot=mini-1", json={"model": model})
    await until(lambda: ("blue_light", model) in pair.maps.views(MINI))
    world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
    world.tell(current_report(MINI))
    world.tell(sample(MINI, 0, 0.4, 0.02))

    def there():
        view = pair.maps.views(MINI)["blue_light", model]
        return view if sum(view.samples_per_level) == 1 else None

    view = await until(there)
    assert np.isfinite(view.mean).all()
    assert (view.std > 0.0).all()
