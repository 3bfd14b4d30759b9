"""Driving by hand through the station: who may, what is sent, and how it ends."""

import json
from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import UTC, datetime

import pytest
import pytest_asyncio
import websockets

from db.fault import StoreUnavailableError
from robot_link.drive import CENTRE, Stick
from robot_link.messages import LinkReport, LinkState, RobotMode
from server.access.role import Role
from server.drive import drives
from server.drive.route import REFUSED
from server.fleet.capability import SPEED_MAX, drive_refusal
from server.fleet.fleet import Fleet
from server.lease.hold import AutomationHold
from tests.server.conftest import GRACE, MINI, api_client, until
from tests.server.fake_link import state_report
from tests.server.lease.conftest import act, person_at
from tests.server.station_app import token_of

AHEAD = {"forward": 1.0, "turn": -0.5, "up": 0.0}


@pytest.fixture(autouse=True)
def _patient(monkeypatch):
    """Let a drive wait for its pilot on a machine that stands still."""
    monkeypatch.setattr(drives, "RELEASE_S", 600.0)


@pytest_asyncio.fixture
async def ready(world, station):
    """The robot is idle and in radio contact."""
    del station
    world.hear(MINI)
    world.tell(state_report(MINI))
    return world.link.drive(MINI)


async def header(client, role=Role.PILOT, name="bob"):
    return {"Authorization": f"Bearer {await token_of(client.app, role, name)}"}


@asynccontextmanager
async def cockpit(client, address, robot=MINI, headers=None, **who):
    uri = f"ws://{address}/api/robots/{robot}/drive"
    headers = headers or await header(client, **who)
    async with websockets.connect(
        uri, additional_headers=headers, compression=None, open_timeout=60
    ) as socket:
        yield socket


async def told(socket, holds):
    """The first word to the pilot of which something is true."""
    while not holds(word := json.loads(await socket.recv())):
        pass
    return word


async def steer(socket, n, **axes):
    await socket.send(json.dumps({"n": n, **axes}))


async def drive_of(client, robot=MINI):
    return (await client.get(f"/api/robots/{robot}/drive")).json()


async def events(client):
    answer = await client.get("/api/events", params={"robot": MINI})
    return [one["text"] for one in answer.json()["events"] if one["kind"].startswith("drive.")]


async def both(client):
    """What the log says of a drive that was begun and has ended."""
    said = await events(client)
    return said if len(said) == 2 else None


async def is_free(client):
    return (await drive_of(client))["state"] == "free"


async def test_pilot_drives_sees_the_answers_and_ends_by_leaving(client, address, ready):
    assert (await drive_of(client))["reason"] == ""
    async with cockpit(client, address) as socket:
        await told(socket, lambda word: word["state"] == "driving")
        assert ready.is_driven
        await steer(socket, 3, **AHEAD)
        word = await told(socket, lambda word: word["newest"])
        assert word["newest"]["n"] == 3
        assert word["newest"]["acts_on"] == AHEAD
        assert word["p95_ms"] == pytest.approx(20.0)
        seen = await drive_of(client)
        assert (seen["state"], seen["driver"]) == ("driving", "bob")
    await until(lambda: is_free(client))
    assert ready.sticks == [(Stick(1.0, -0.5), 3), (CENTRE, 0)]
    assert not ready.is_driven
    begun, ended = await until(lambda: both(client))
    assert begun == f"bob drives {MINI} by hand."
    assert "The page was closed" in ended


async def test_driver_is_told_to_everybody_who_watches(client, address, ready, station):
    del ready
    fleet = station.foundation.services.get(Fleet)
    async with cockpit(client, address):
        await until(lambda: fleet.status(MINI).driver == "bob")
        state = fleet.status(MINI)
        assert drive_refusal(state, 1.0) == f"bob drives {MINI}; one person at a time can."
    await until(lambda: fleet.status(MINI).driver == "")


async def test_only_who_is_in_charge_drives_and_may_again(client, address, ready):
    bob = await header(client)
    async with cockpit(client, address, headers=bob) as first:
        await told(first, lambda word: word["state"] == "driving")
        async with cockpit(client, address, name="eve") as second:
            word = json.loads(await second.recv())
            assert word["state"] == "ended"
            assert "bob is in charge of mini-1" in word["reason"]
            with pytest.raises(websockets.ConnectionClosed):
                await second.recv()
            assert second.close_code == REFUSED
        await steer(first, 1, **AHEAD)
        await told(first, lambda word: word["newest"])
        assert ready.is_driven
    await until(lambda: is_free(client))
    async with cockpit(client, address, headers=bob) as again:
        await told(again, lambda word: word["state"] == "driving")
        async with cockpit(client, address, headers=bob) as second:
            assert "bob drives" in json.loads(await second.recv())["reason"]


async def test_a_drive_ends_once_somebody_else_is_in_charge(client, address, ready, station):
    """A script drives; a person takes charge at once, and it drives no more."""
    async with cockpit(client, address) as socket:
        await told(socket, lambda word: word["state"] == "driving")
        async with person_at(station, "ann") as ann:
            assert (await act(ann, "take")).json()["is_mine"]
        last = await told(socket, lambda word: word["state"] == "ended")
        assert last["reason"] == "bob is not in charge of mini-1 any more."
    await until(lambda: not ready.is_driven)


async def test_no_script_drives_while_automation_is_held(client, address, ready, station):
    switch = station.foundation.services.get(AutomationHold)
    async with cockpit(client, address) as socket:
        await told(socket, lambda word: word["state"] == "driving")
        await switch.set(held=True, by="ann")
        last = await told(socket, lambda word: word["state"] == "ended")
        assert last["reason"] == "ann holds the automation of the station."
    await until(lambda: not ready.is_driven)
    async with cockpit(client, address) as socket:
        word = json.loads(await socket.recv())
        assert (word["state"], word["driver"]) == ("ended", "")
        assert word["reason"].startswith("ann holds the automation")


async def test_old_sticks_are_dropped_while_the_radio_is_busy(client, address, ready):
    async with cockpit(client, address) as socket:
        await told(socket, lambda word: word["state"] == "driving")
        ready.is_free.clear()
        await steer(socket, 0, forward=0.1)
        await until(lambda: ready.sticks)
        for n in range(1, 30):
            await steer(socket, n, forward=n / 100.0)
        await told(socket, lambda word: word["dropped"] == 28)
        ready.is_free.set()
        await told(socket, lambda word: word["newest"] and word["newest"]["n"] == 29)
        assert [n for _, n in ready.sticks] == [0, 29]


async def test_stop_ends_it_with_the_last_word(client, address, ready):
    async with cockpit(client, address) as socket:
        await told(socket, lambda word: word["state"] == "driving")
        await socket.send("stop")
        word = await told(socket, lambda word: word["state"] == "ended")
        assert word["reason"] == "bob stopped."
        with pytest.raises(websockets.ConnectionClosed):
            await socket.recv()
    await until(lambda: is_free(client))
    assert ready.sticks[-1][0] == CENTRE


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ('{"n": 1, "forward": 1.5}', "forward: Input should be less than or equal to 1"),
        ('{"n": 1, "forward": NaN}', "forward"),
        ('{"n": -1}', "n: Input should be greater than or equal to 0"),
        ('{"n": 1, "throttle": 1}', "throttle"),
        ("ahead!", "message"),
        (json.dumps({"n": 1, "forward": 0.0}) + " " * 400, "at most 300"),
    ],
)
async def test_what_is_no_stick_ends_it_and_is_named(client, address, ready, text, names):
    async with cockpit(client, address) as socket:
        await told(socket, lambda word: word["state"] == "driving")
        await socket.send(text)
        word = await told(socket, lambda word: word["state"] == "ended")
        assert names in word["reason"]
    await until(lambda: is_free(client))
    assert [stick for stick, _ in ready.sticks] == [CENTRE]


async def test_order_to_surface_ends_it_for_whoever_drives(client, address, ready):
    del ready
    async with cockpit(client, address) as socket:
        await told(socket, lambda word: word["state"] == "driving")
        await client.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
        word = await told(socket, lambda word: word["state"] == "ended")
        assert word["reason"] == "It was told to surface."


async def test_robot_that_ends_it_by_itself_is_believed(client, address, ready):
    async with cockpit(client, address) as socket:
        await told(socket, lambda word: word["state"] == "driving")
        ready.is_driven = False
        await steer(socket, 1, forward=1.0)
        word = await told(socket, lambda word: word["state"] == "ended")
        assert f"{MINI} lets itself be driven no more" in word["reason"]


async def test_robot_that_refuses_is_not_driven(client, address, ready):
    ready.refusal = "the robot cannot do this now"
    async with cockpit(client, address) as socket:
        word = json.loads(await socket.recv())
        assert (word["state"], ready.sticks) == ("ended", [])
        assert "cannot be driven now: a mission runs" in word["reason"]
    assert await is_free(client)
    assert await events(client) == []


async def test_drive_that_cannot_be_written_down_leaves_the_robot_free(
    client, address, ready, station, monkeypatch
):
    store, is_full = station.foundation.store, True
    write = store.write

    async def failing(function):
        if is_full:
            raise StoreUnavailableError("the disk is full")
        return await write(function)

    header_of_bob = await header(client)
    monkeypatch.setattr(store, "write", failing)
    uri = f"ws://{address}/api/robots/{MINI}/drive"
    async with websockets.connect(
        uri, additional_headers=header_of_bob, compression=None
    ) as socket:
        word = json.loads(await socket.recv())
        assert (word["state"], word["reason"]) == ("ended", "The disk is full.")
    await until(lambda: is_free(client))
    assert not ready.is_driven
    is_full = False
    async with cockpit(client, address, name="eve") as socket:
        await told(socket, lambda word: word["state"] == "driving")


@pytest.mark.parametrize("role", [Role.VIEWER])
async def test_whoever_may_only_look_does_not_drive(client, address, ready, role, station):
    with pytest.raises(websockets.InvalidStatus):
        async with cockpit(client, address, role=role, name="guest"):
            pass
    assert not ready.is_driven
    async with api_client(station, role) as viewer:
        assert (await drive_of(viewer))["state"] == "free"


async def test_page_of_another_site_does_not_drive(client, address, ready):
    with pytest.raises(websockets.InvalidStatus):
        async with websockets.connect(
            f"ws://{address}/api/robots/{MINI}/drive", origin="http://elsewhere.example"
        ):
            pass
    assert not ready.is_driven


async def test_unknown_robot_is_refused_with_its_name(client, address):
    async with cockpit(client, address, robot="nobody") as socket:
        assert "nobody" in json.loads(await socket.recv())["reason"]
    assert (await client.get("/api/robots/nobody/drive")).status_code == 404


@pytest.mark.parametrize(
    ("link", "sentence"),
    [
        (LinkState.SUBMERGED, "is under water, where no radio reaches it"),
        (LinkState.STALE, "does not answer by radio"),
        (LinkState.DISABLED, "is unplugged"),
    ],
)
async def test_robot_out_of_reach_is_not_offered(client, world, ready, link, sentence):
    del ready
    world.hear(MINI, link)
    assert sentence in (await drive_of(client))["reason"]


async def test_robot_that_flies_a_mission_is_not_offered(client, world, ready):
    del ready
    world.tell(state_report(MINI, mode=RobotMode.GLIDING))
    assert "flies a mission" in (await drive_of(client))["reason"]
    world.tell(state_report(MINI, mode=RobotMode.DRIVEN))
    assert "another ground station" in (await drive_of(client))["reason"]


async def test_robot_with_satellite_links_alone_is_never_driven(station, world, ready):
    del ready
    status = station.foundation.services.get(Fleet).status(GRACE)
    status.record = replace(status.record, links=("rockblock://300234010753370",))
    status.links = {
        "s": LinkReport(
            GRACE, "rockblock", LinkState.LIVE, datetime.now(UTC), None, 1, 0, is_enabled=True
        )
    }
    assert "has no radio" in drive_refusal(status, 1.0)
    assert world.drives.keys() == {MINI}


async def test_clock_too_fast_for_a_person_is_said(station, ready):
    del ready
    status = station.foundation.services.get(Fleet).status(MINI)
    assert drive_refusal(status, SPEED_MAX) == ""
    assert "20 times as fast" in drive_refusal(status, 20.0)
