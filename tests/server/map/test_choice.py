"""Which channel a map is of: offered by what robots told, chosen, and mapped at once."""

from datetime import UTC, datetime

import numpy as np
import pytest

from autonomy.channel import CHANNELS
from autonomy.field.config import FIELD_PRESETS
from robot_link.channel_table import ChannelPage, ChannelTable, TableRow
from robot_link.messages import LogId
from server.map.choice import settings_for
from tests.server.conftest import MINI, until

pytestmark = pytest.mark.usefixtures("in_threads")
MAPS = f"/api/robots/{MINI}/maps"


def cast(robot, count=20):
    for number in range(count):
        place = (0.3 + 0.08 * number, 0.6, 0.1 + 0.02 * number)
        robot.sample(place, "salinity", 34.0 + 0.05 * number)
        robot.sample(place, "temperature", 12.0)


async def offered(client):
    return {one["variable"]: one for one in (await client.get(f"{MAPS}/choices")).json()}


async def test_a_map_can_be_of_what_robots_of_the_water_told(station, client, world):
    assert list(await offered(client)) == ["blue_light"]
    cast(world.robots[MINI])
    world.robots[MINI].sample((1.0, 0.5, 0.2), "leak", 0.0)

    async def told():
        found = await offered(client)
        return found if found.get("salinity", {}).get("samples") == 20 else None

    found = await until(told)
    assert set(found) == {"blue_light", "salinity", "temperature", "absolute_salinity", "density",
                          "sound_speed"}  # fmt: skip
    assert found["density"]["is_derived"]
    assert found["blue_light"]["is_chosen"]
    chosen = await client.put(f"{MAPS}/choice/salinity")
    assert chosen.status_code == 200
    assert [one["variable"] for one in chosen.json() if one["is_chosen"]] == ["salinity"]

    def mapped():
        group = station.maps.group(MINI)
        is_it = group is not None and group.config.variable == "salinity"
        return is_it and group.live is not None and group.live.total == 20

    await until(mapped)
    view = (await client.get(f"{MAPS}/salinity")).json()
    assert (view["scale"], view["colour_map"]) == ("linear", "cividis")
    assert 33.9 < np.nanmean([one for one in view["mean"] if one is not None]) < 35.1
    archive = await client.get(f"{MAPS}/salinity", params={"format": "csv"})
    assert "# standard_name: sea_water_practical_salinity" in archive.text


async def test_a_map_can_be_of_what_a_robot_announced_before_it_told_it(station, client, world):
    oxygen, other = CHANNELS["dissolved_oxygen"], CHANNELS["nitrate"]
    rows = [
        TableRow(oxygen.wire_number, oxygen.key, oxygen.unit, oxygen.kind, 1.0),
        TableRow(other.wire_number, other.key, "mg/L", other.kind, 1.0),
        TableRow(CHANNELS["leak"].wire_number, "leak", "1", "switch", 1.0),
    ]
    table, at = ChannelTable.of(rows), datetime.now(UTC)
    world.tell(ChannelPage(MINI, table.version, LogId(1), 0, 0, 1, table.rows, False, at, at))

    async def told():
        found = await offered(client)
        return found if "dissolved_oxygen" in found else None

    found = await until(told)
    assert set(found) == {"blue_light", "dissolved_oxygen"}
    assert found["dissolved_oxygen"]["samples"] == 0
    assert (await client.put(f"{MAPS}/choice/dissolved_oxygen")).status_code == 200


async def test_settings_of_a_channel_come_back_with_it(client, world):
    cast(world.robots[MINI])
    path = f"/api/config/field?robot={MINI}"
    await client.patch(path, json={"prior_mean": 4.5})
    assert (await client.put(f"{MAPS}/choice/salinity")).status_code == 200
    await client.patch(path, json={"threshold": 34.2})
    assert (await client.put(f"{MAPS}/choice/blue_light")).status_code == 200
    light = (await client.get(path)).json()["value"]
    assert (light["variable"], light["prior_mean"], light["threshold"]) == ("blue_light", 4.5, None)
    assert (await client.put(f"{MAPS}/choice/salinity")).status_code == 200
    assert (await client.get(path)).json()["value"]["threshold"] == 34.2


async def test_what_cannot_be_mapped_is_refused(client):
    assert (await client.put(f"{MAPS}/choice/leak")).status_code == 422
    assert (await client.put(f"{MAPS}/choice/nothing")).status_code == 422
    assert (await client.get("/api/robots/nobody/maps/choices")).status_code == 404


def test_settings_follow_the_values_and_keep_how_far_the_field_stays_alike():
    rng = np.random.default_rng(3)
    now, salinity = FIELD_PRESETS["chlorophyll"], CHANNELS["salinity"]
    values = 34.0 + 0.3 * rng.standard_normal(500)
    found = settings_for(salinity, now, values)
    assert found.prior_mean == pytest.approx(34.0, abs=0.05)
    assert found.single.signal_variance == pytest.approx(0.09, rel=0.15)
    share = now.single.noise_variance / now.single.signal_variance
    assert found.single.noise_variance == pytest.approx(share * found.single.signal_variance)
    assert found.single.length_x_m == now.single.length_x_m
    assert settings_for(salinity, now, values[:3]).prior_mean == now.prior_mean
    par = settings_for(CHANNELS["par"], now, np.full(50, 100.0))
    assert par.for_channel(CHANNELS["par"]).scale == "log"
    assert par.prior_mean == pytest.approx(np.log(100.0))
