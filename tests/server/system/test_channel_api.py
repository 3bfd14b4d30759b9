"""The catalogue of channels by REST: delivered ones, the team's own, and what is refused."""

import asyncio

import pytest

from autonomy.channel import CHANNELS, ChannelCatalogue
from db.fault import StoreUnavailableError
from db.query.fleet.channels import ChannelRecord, save_channel
from db.store import Store
from robot_link.messages import STATE
from server.access.role import Role
from tests.server.conftest import MINI, api_client, open_station, until

pytestmark = pytest.mark.usefixtures("in_threads")
PLACE = (1.0, 0.5, 0.2)
METHANE = {"key": "methane", "title": "Methane", "unit": "nmol/L", "low": 0.0, "high": 1e5}
RADON = METHANE | {"key": "radon", "title": "Radon"}


def by_key(answer):
    return {one["key"]: one for one in answer.json()}


async def test_one_list_has_every_channel_once(client):
    listed = (await client.get("/api/channels")).json()
    keys = [one["key"] for one in listed]
    assert keys == [*STATE.gauges, *CHANNELS]
    assert len(set(keys)) == len(keys)
    known = {one["key"]: one for one in listed}
    assert known["battery_v"]["origin"] == "state"
    assert (known["pitch_rad"]["unit"], known["pitch_rad"]["display_unit"]) == ("rad", "deg")
    assert (known["salinity"]["origin"], known["salinity"]["wire_number"]) == ("delivered", 8)
    assert known["density"]["is_derived"]
    assert known["density"]["wire_number"] is None
    assert known["leak"]["alarms"] == [{"level": "critical", "low": None, "high": 0.5}]


async def test_a_channel_of_the_team_is_kept_over_a_restart(tmp_path, world):
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        added = await pilot.post("/api/channels", json=METHANE)
        assert (added.status_code, added.json()["wire_number"]) == (201, 128)
        assert added.json()["changed_by"] == "test pilot"
        second = await pilot.post("/api/channels", json=RADON)
        assert second.json()["wire_number"] == 129
    async with open_station(tmp_path, world) as station, api_client(station, Role.VIEWER) as viewer:
        known = by_key(await viewer.get("/api/channels"))
        assert (known["methane"]["origin"], known["methane"]["high"]) == ("own", 1e5)
        catalogue = station.foundation.channels.catalogue
        assert isinstance(catalogue, ChannelCatalogue)
        assert catalogue.numbered(129) is catalogue["radon"]


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        ({"key": "Methane!"}, "key", "pattern"),
        ({"unit": "bananas"}, "unit", "bananas"),
        ({"wire_number": 3}, "wire_number", "128"),
        ({"wire_number": 240}, "wire_number", "239"),
        ({"low": 10.0, "high": 10.0}, "low", "10"),
        ({"standard_name": "Mole Fraction"}, "standard_name", "lower-case"),
        ({"decimals": 12}, "decimals", "0 to 9"),
        ({"alarms": [{"level": "warning", "high": 2e5}]}, "alarms", "100000"),
        ({"alarms": [{"level": "warning"}]}, "alarms", "low or a high end"),
        ({"scale": "log", "low": -5.0, "high": -1.0}, "scale", "positive"),
        ({"title": "Meth\u202eane"}, "title", "seen"),
        ({"colour_map": "jet"}, "colour_map", "viridis"),
    ],
)
async def test_a_wrong_field_is_named_with_its_limit(client, change, field, words):
    refused = await client.post("/api/channels", json=METHANE | change)
    assert refused.status_code == 422
    errors = {error["loc"][0]: error["msg"] for error in refused.json()["errors"]}
    assert words in errors[field]
    assert "methane" not in by_key(await client.get("/api/channels"))


@pytest.mark.parametrize("key", ["salinity", "depth_m", "methane"])
async def test_two_channels_never_share_a_name_or_a_number(client, key):
    assert (await client.post("/api/channels", json=METHANE)).status_code == 201
    taken = await client.post("/api/channels", json={**METHANE, "key": key})
    assert taken.status_code == 409
    assert key in taken.json()["detail"]
    number = await client.post("/api/channels", json=RADON | {"wire_number": 128})
    assert number.status_code == 409
    assert "Methane" in number.json()["detail"]


async def test_what_stored_values_mean_is_fixed(client, world):
    assert (await client.post("/api/channels", json=METHANE)).status_code == 201
    free = await client.patch("/api/channels/methane", json={"unit": "umol/L", "wire_number": 130})
    assert (free.status_code, free.json()["unit"]) == (200, "umol/L")
    world.robots[MINI].sample(PLACE, "#130", 3.0)
    told = await newest(client, "methane")
    assert (told["value"], told["unit"]) == (3.0, "umol/L")

    async def stored():  # a value is shown before it is stored
        path = f"/api/robots/{MINI}/samples"
        return (await client.get(path, params={"channel": "methane"})).json()["value"]

    assert await until(stored) == [3.0]
    fixed = await client.patch("/api/channels/methane", json={"unit": "nmol/L"})
    assert fixed.status_code == 409
    assert "unit of Methane is fixed" in fixed.json()["detail"]
    assert (await client.patch("/api/channels/methane", json={"title": "CH4"})).status_code == 200
    retired = await client.patch("/api/channels/methane", json={"is_retired": True})
    assert retired.json()["is_retired"]
    # What was measured of it stays readable, and its number is not given again.
    samples = await client.get(f"/api/robots/{MINI}/samples", params={"channel": "methane"})
    assert samples.json()["value"] == [3.0]
    back = await client.patch("/api/channels/methane", json={"is_retired": False})
    assert not back.json()["is_retired"]


async def newest(client, key):
    """Return the newest value of a channel once it is told."""

    async def told():
        state = (await client.get(f"/api/robots/{MINI}/state")).json()
        return state["channels"].get(key)

    return await until(told)


async def test_a_station_has_limits_of_its_own_for_a_delivered_channel(client):
    limits = [{"level": "watch", "low": 5.0}, {"level": "critical", "low": 2.0}]
    changed = await client.patch(
        "/api/channels/dissolved_oxygen", json={"alarms": limits, "colour_map": "magma"}
    )
    assert changed.status_code == 200
    assert [one["level"] for one in changed.json()["alarms"]] == ["critical", "watch"]
    assert set(changed.json()["changed"]) == {"alarms", "colour_map"}
    unit = await client.patch("/api/channels/dissolved_oxygen", json={"unit": "umol/L"})
    assert unit.status_code == 409
    retired = await client.patch("/api/channels/dissolved_oxygen", json={"is_retired": True})
    assert retired.status_code == 409
    assert (await client.patch("/api/channels/nothing", json={})).status_code == 404


async def test_nothing_is_known_of_a_channel_that_could_not_be_kept(client, monkeypatch):
    def fail(*_):
        raise StoreUnavailableError("The disk is full.")

    with monkeypatch.context() as patched:
        patched.setattr(Store, "write", fail)
        assert (await client.post("/api/channels", json=METHANE)).status_code == 503
    assert "methane" not in by_key(await client.get("/api/channels"))


async def test_values_that_cannot_be_true_are_kept_and_used_for_nothing(station, client, world):
    for variable, value in (("salinity", 34.0), ("salinity", 99.0), ("#200", 1.0)):
        world.robots[MINI].sample(PLACE, variable, value)
    # What is kept, and what is not, is acknowledged: the robot forgets both.
    await until(lambda: len(world.acknowledged) == 3)
    told = await newest(client, "salinity")
    assert told["value"] == 34.0
    samples = await client.get(f"/api/robots/{MINI}/samples", params={"channel": "salinity"})
    assert samples.json()["value"] == [34.0, 99.0]
    assert station.fleet.status(MINI).impossible == {"salinity": 1}

    async def said():
        found = (await client.get("/api/events")).json()
        texts = [one["text"] for one in found["events"]]
        is_range = any("99" in text and "45" in text for text in texts)
        return is_range and any("#200" in text and "Settings" in text for text in texts)

    await until(said)


async def test_only_what_the_catalogue_maps_can_be_mapped(client):
    refused = await client.patch("/api/config/field", json={"variable": "leak"})
    assert refused.status_code == 422
    assert "salinity" in refused.json()["errors"][0]["msg"]
    assert (await client.post("/api/channels", json=METHANE)).status_code == 201
    assert (
        await client.patch("/api/config/field", json={"variable": "methane"})
    ).status_code == 200


async def test_channels_that_are_added_at_once_get_numbers_of_their_own(tmp_path, world):
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        posts = (pilot.post("/api/channels", json=one) for one in (METHANE, RADON))
        answers = await asyncio.gather(*posts)
        assert {one.status_code for one in answers} == {201}
        assert {one.json()["wire_number"] for one in answers} == {128, 129}


async def test_changes_at_once_of_one_channel_are_both_kept(tmp_path, world):
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        await pilot.post("/api/channels", json=METHANE)
        changes = ({"high": 5.0}, {"title": "Methane, dissolved"})
        await asyncio.gather(*(pilot.patch("/api/channels/methane", json=one) for one in changes))
        known = by_key(await pilot.get("/api/channels"))["methane"]
        assert (known["high"], known["title"]) == (5.0, "Methane, dissolved")


async def test_an_own_channel_whose_key_a_release_brings_along_is_left_out(tmp_path, world, caplog):
    document = {**METHANE, "key": "salinity", "wire_number": 128}
    async with open_station(tmp_path, world) as station:
        record = ChannelRecord("salinity", document, True, None, station.foundation.clock.now(), "")
        await station.foundation.store.write(lambda session: save_channel(session, record))
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        assert station.foundation.channels.catalogue["salinity"] == CHANNELS["salinity"]
        assert "salinity is left out" in caplog.text
        added = await pilot.post("/api/channels", json=METHANE)
        assert added.json()["wire_number"] == 128
