"""Derived channels at the station: gauges, charts, exports and maps, marked as such."""

from datetime import UTC, datetime, timedelta

import gsw
import pytest

from tests.server.conftest import MINI, until

pytestmark = pytest.mark.usefixtures("in_threads")
ROBOT = f"/api/robots/{MINI}"
BEGIN = datetime.now(UTC) - timedelta(minutes=2)


def cast(robot, count=4, begin=BEGIN):
    """Tell conductivity and temperature, going down."""
    for number in range(count):
        at, place = begin + timedelta(seconds=0.1 * number), (1.0, 0.5, 0.1 + 0.1 * number)
        robot.sample(place, "conductivity", 40.0 - number, measured_at=at)
        robot.sample(place, "temperature", 15.0 - number, measured_at=at)


async def samples(client, key, **more):
    answer = await client.get(f"{ROBOT}/samples", params={"channel": key, **more})
    return answer.json()


async def told(client, key, count=4):
    async def found():
        answer = await samples(client, key)
        return answer if len(answer["value"]) == count else None

    return await until(found)


async def test_what_follows_of_a_ctd_is_charted_as_derived(client, world):
    cast(world.robots[MINI])
    found = await told(client, "salinity")
    assert found["is_derived"]
    pressure = gsw.p_from_z(-0.1, 42.7)
    assert found["value"][0] == pytest.approx(gsw.SP_from_C(40.0, 15.0, pressure), abs=1e-6)
    density = await samples(client, "density", positions=True)
    assert (density["unit"], len(density["depth_m"])) == ("kg/m3", 4)
    assert not (await samples(client, "temperature"))["is_derived"]
    listed = {one["key"]: one for one in (await client.get(f"{ROBOT}/channels")).json()}
    assert (listed["temperature"]["samples"], listed["temperature"]["is_derived"]) == (4, False)
    assert (listed["density"]["samples"], listed["density"]["is_derived"]) == (None, True)
    assert listed["salinity"]["is_derived"]
    assert "chlorophyll" not in listed


async def test_a_measured_salinity_is_not_derived(client, world):
    cast(world.robots[MINI])
    world.robots[MINI].sample((1.0, 0.5, 0.1), "salinity", 31.0, measured_at=BEGIN)
    assert not (await told(client, "salinity", 1))["is_derived"]
    assert (await samples(client, "density"))["is_derived"]


async def test_gauges_show_what_is_derived_and_its_age(client, world):
    cast(world.robots[MINI])

    async def shown():
        channels = (await client.get(f"{ROBOT}/state")).json()["channels"]
        return channels if "sound_speed" in channels else None

    channels = await until(shown)
    assert channels["sound_speed"]["is_derived"]
    assert not channels["temperature"]["is_derived"]
    assert 1400.0 < channels["sound_speed"]["value"] < 1550.0
    assert channels["density"]["measured_at"] == channels["temperature"]["measured_at"]
    assert "buoyancy_frequency_squared" not in channels


async def test_a_derived_channel_is_mapped(station, client, world):
    cast(world.robots[MINI], 12)
    await told(client, "density", 12)
    changed = await client.patch(f"/api/config/field?robot={MINI}", json={"variable": "density"})
    assert changed.status_code == 200

    def made():
        group = station.maps.group(MINI)
        is_density = group is not None and group.config.variable == "density"
        return is_density and group.live is not None and group.live.total == 12

    await until(made)
    view = (await client.get(f"{ROBOT}/maps/density")).json()
    assert (view["unit"], view["title"]) == ("kg/m3", "Density")


async def test_an_export_says_what_was_computed(client, world):
    cast(world.robots[MINI], begin=datetime.now(UTC))
    await told(client, "salinity")
    found = (await client.get("/api/deployments", params={"robot": MINI})).json()
    (deployment,) = found["deployments"]
    path = f"/api/deployments/{deployment['id']}/export"
    answer = await client.get(path, params={"format": "csv"})
    comment = next(line for line in answer.text.splitlines() if "time Unix" in line)
    header = next(line for line in answer.text.splitlines() if line.startswith("time,"))
    assert "derived_density kg/m3 (sea_water_density)" in comment
    assert "temperature degC (sea_water_temperature)" in comment
    assert header.split(",")[4:6] == ["conductivity", "temperature"]
    assert "derived_salinity" in header


async def test_nothing_follows_of_what_no_water_can_have(client, world):
    cast(world.robots[MINI])
    at = BEGIN + timedelta(seconds=0.15)
    world.robots[MINI].sample((1.0, 0.5, 0.2), "conductivity", 1e6, measured_at=at)
    world.robots[MINI].sample((1.0, 0.5, 0.2), "temperature", 14.0, measured_at=at)
    found = await told(client, "salinity", 5)
    assert max(found["value"]) < 45.0
