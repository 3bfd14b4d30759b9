"""What robots announce of their channels: kept, shown, and by which table a value is judged."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from autonomy.channel import CHANNELS
from db.query.station.events import newest_events
from robot_link.channel_table import ChannelPage, ChannelTable, TableRow, TableVersion
from robot_link.messages import LogId, RobotId, Sample
from robot_link.report import Reading
from server.access.role import Role
from tests.server.conftest import MINI, api_client, open_station, until

pytestmark = pytest.mark.usefixtures("in_threads")
PLACE = (1.0, 0.5, 0.2)


def row(key, unit=None, period_s=1.0):
    channel = CHANNELS[key]
    return TableRow(channel.wire_number, key, unit or channel.unit, channel.kind, period_s)


def page(rows, log=1, sequence=0, at=None):
    table = ChannelTable.of(rows)
    at = at or datetime.now(UTC)
    return ChannelPage(
        RobotId(MINI), table.version, LogId(log), sequence, 0, 1, table.rows, False, at, at
    )


def sample(sequence, variable="dissolved_oxygen", value=8.0, log=1):
    at = datetime.now(UTC)
    return Sample(RobotId(MINI), LogId(log), sequence, variable, value, PLACE, 0.05, at, at)


async def events(foundation, kind):
    async def found():
        told = await foundation.store.query(newest_events)
        return [event.text for event in told if event.kind == kind]

    return await until(found)


async def told(client):
    answer = await client.get(f"/api/robots/{MINI}/channels")
    assert answer.status_code == 200
    return {one["key"]: one for one in answer.json()}


async def stored(client, channel="dissolved_oxygen"):
    found = await client.get(f"/api/robots/{MINI}/samples", params={"channel": channel})
    return found.json()["value"]


async def test_what_was_announced_is_shown_beside_what_was_told(client, world, foundation):
    announced = page([row("dissolved_oxygen"), row("leak", period_s=30.0)])
    world.tell(announced)
    world.tell(sample(0))
    await until(lambda: world.acknowledged)
    shown = await told(client)
    oxygen, leak = shown["dissolved_oxygen"], shown["leak"]
    assert (oxygen["samples"], oxygen["problem"]) == (1, "")
    assert oxygen["announced"]["version"] == f"{announced.version:08x}"
    assert (leak["samples"], leak["announced"]["period_s"]) == (0, 30.0)
    assert shown["depth_m"]["announced"] is None
    (text,) = await events(foundation, "channels.announced")
    assert "announced 2 channels" in text


async def test_a_robot_that_announces_nothing_is_understood_by_the_catalogue(client, world):
    world.tell(sample(0))
    await until(lambda: world.acknowledged)
    assert (await told(client))["dissolved_oxygen"]["announced"] is None
    assert await stored(client) == [8.0]


async def test_values_in_another_unit_are_acknowledged_and_used_for_nothing(
    station, client, world, foundation
):
    world.tell(page([row("dissolved_oxygen", "umol/L"), row("humidity", "1")]))
    world.frame(MINI, b"the sample")
    world.tell(sample(0, value=250.0))
    at = datetime.now(UTC)
    world.tell(Reading(RobotId(MINI), "humidity", 0.4, at, at))
    await until(lambda: world.acknowledged == [(MINI, 1, 0)])
    shown = await told(client)
    assert shown["dissolved_oxygen"]["samples"] == 0
    assert shown["humidity"]["samples"] == 0
    assert "umol/L" in shown["dissolved_oxygen"]["problem"]
    assert "mg/L" in shown["dissolved_oxygen"]["problem"]
    status = station.fleet.status(MINI)
    assert "dissolved_oxygen" not in status.samples
    assert "humidity" not in status.readings
    assert any("umol/L" in text for text in await events(foundation, "sample.refused"))

    async def alarmed():
        found = (await client.get("/api/alarms")).json()
        texts = [one["text"] for one in found["alarms"]]
        return [text for text in texts if "announces its channels" in text]

    assert "umol/L; the catalogue has mg/L" in (await until(alarmed))[0]


async def test_values_are_judged_by_the_table_that_held_when_they_were_measured(
    client, world, foundation
):
    world.tell(page([row("dissolved_oxygen")]))
    await events(foundation, "channels.announced")
    world.tell(page([row("dissolved_oxygen", "umol/L")], sequence=2))
    world.tell(sample(2, value=250.0))
    world.tell(sample(1, value=8.5))
    world.tell(page([row("dissolved_oxygen", "mg L-1")], sequence=4))
    world.tell(sample(3, value=251.0))
    world.tell(sample(4, value=8.7))
    world.tell(sample(0, value=8.1, log=2))
    await until(lambda: len(world.acknowledged) == 5)
    assert sorted(await stored(client)) == [8.1, 8.5, 8.7]

    async def both():
        texts = await events(foundation, "channels.changed")
        return len(texts) == 2 and texts

    texts = await until(both)
    assert any("is dissolved_oxygen (umol/L)" in text for text in texts)


async def test_an_announcement_outlives_the_station(tmp_path, world):
    announced = page([row("dissolved_oxygen", "umol/L")])
    async with open_station(tmp_path, world) as station:
        world.tell(announced)
        await events(station.foundation, "channels.contradict")
    async with open_station(tmp_path, world) as station, api_client(station, Role.VIEWER) as viewer:
        shown = (await told(viewer))["dissolved_oxygen"]
        assert shown["announced"]["version"] == f"{announced.version:08x}"
        before = len(world.acknowledged)
        world.frame(MINI, b"the sample")
        world.tell(sample(0, value=250.0))
        await until(lambda: len(world.acknowledged) > before)
        assert await stored(viewer) == []


async def test_the_same_table_again_is_no_news(client, world, foundation):
    first = page([row("dissolved_oxygen")])
    world.tell(first)
    await events(foundation, "channels.announced")
    later = first.received_at + timedelta(seconds=50)
    world.tell(replace(first, received_at=later))
    assert (await told(client))["dissolved_oxygen"]["announced"]["heard_at"] > (
        first.received_at.isoformat()
    )
    world.tell(replace(first, log=LogId(2)))
    world.tell(page([row("dissolved_oxygen"), row("leak")], log=2, sequence=5))
    changed = await events(foundation, "channels.changed")
    assert len(changed) == 1
    assert "leak came" in changed[0]


async def test_values_that_came_before_their_table_are_counted(client, world, foundation):
    world.tell(sample(0))
    world.tell(sample(1))
    world.tell(sample(2))
    await until(lambda: len(world.acknowledged) == 3)
    world.tell(page([row("dissolved_oxygen", "umol/L")], sequence=1))
    (text,) = await events(foundation, "channels.contradict")
    assert "2 of them were stored before" in text


async def test_a_channel_that_the_catalogue_lacks_is_named(client, world):
    world.tell(page([TableRow(200, "methane", "nmol/L")]))
    shown = (await told(client))["#200"]
    assert (shown["title"], shown["unit"], shown["samples"]) == ("methane", "nmol/L", 0)
    assert "add it in Settings" in shown["problem"]
    new = {"key": "methane", "title": "Methane", "unit": "nmol L-1", "wire_number": 200}
    assert (await client.post("/api/channels", json=new)).status_code == 201
    shown = await told(client)
    assert "#200" not in shown
    assert (shown["methane"]["problem"], shown["methane"]["samples"]) == ("", 0)
    world.tell(sample(0, "#200", 3.5))
    await until(lambda: world.acknowledged)
    assert await stored(client, "methane") == [3.5]


async def test_pages_that_do_not_make_the_announced_table_are_said_once(world, foundation, station):
    wrong = replace(page([row("leak")]), version=1)
    for _ in range(3):
        world.tell(wrong)
    (text,) = await events(foundation, "channels.refused")
    assert "as put together" in text
    assert station.fleet.status(MINI).announced is None


async def test_a_table_that_has_not_come_is_said_once(world, foundation, client):
    at = datetime.now(UTC)
    known = page([row("leak")])
    world.tell(known)
    world.tell(TableVersion(RobotId(MINI), known.version, at, at))
    for _ in range(3):
        world.tell(TableVersion(RobotId(MINI), 0xDEADBEEF, at, at))
    (text,) = await events(foundation, "channels.missing")
    assert "deadbeef" in text
    assert (await told(client))["leak"]["announced"]["version"] == f"{known.version:08x}"


async def test_a_table_that_came_by_satellite_is_the_one_of_the_radio(world, client):
    by_radio = page([row("dissolved_oxygen", "umol/L"), row("leak")])
    half = (
        replace(by_radio, rows=by_radio.rows[:1], pages=2, is_short=True),
        replace(by_radio, rows=by_radio.rows[1:], page=1, pages=2, is_short=True),
    )
    world.tell(half[1])
    assert (await told(client)).get("leak") is None
    world.tell(half[0])
    shown = await told(client)
    assert shown["leak"]["announced"]["version"] == f"{by_radio.version:08x}"
    assert "umol/L" in shown["dissolved_oxygen"]["problem"]
