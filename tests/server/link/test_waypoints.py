"""Waypoints to the simulated submarine by REST: on board only when every item was read back."""

import asyncio
import socket
from contextlib import asynccontextmanager
from types import SimpleNamespace

import pytest

from autonomy.site import LAKE
from db.query.station.settings import get_setting
from robot_link.clock import SystemClock
from robot_link.transport.opening import open_transport
from server.access.role import Role
from server.link.radios import Radios, open_link
from server.link.waypoints import (
    Waypoint,
    WaypointMission,
    keep_mission,
    restored_mission,
    setting_name,
)
from simulator.sub.autopilot import MODES
from simulator.sub.definition import SUB_1
from simulator.sub.endpoint import SubVehicle
from tests.free_port import free_port
from tests.server.conftest import api_client, open_station, until


def place(north_m, east_m, depth_m):
    return {"north_m": north_m, "east_m": east_m, "depth_m": depth_m}


MISSION = [place(160.0, 120.0, 3.0), place(170.0, 120.0, 6.0), place(170.0, 130.0, 2.0)]


@asynccontextmanager
async def afloat(tmp_path):
    """A station with a real link, and the submarine that it has added."""
    port = free_port(socket.SOCK_DGRAM)
    transport = open_transport(f"udp://127.0.0.1:{port}?listen=1")
    vehicle = SubVehicle(SUB_1, transport, SystemClock())
    life = asyncio.create_task(vehicle.run())
    try:
        async with (
            open_station(tmp_path, SimpleNamespace(make_link=open_link)) as station,
            api_client(station, Role.ADMIN) as client,
        ):
            body = {
                "id": "sub-1",
                "name": "sub-1",
                "protocol": "mavlink",
                "system_id": SUB_1.system_id,
                "links": [f"udp://127.0.0.1:{port}"],
                "site": LAKE.model_dump(mode="json"),
            }
            assert (await client.post("/api/robots", json=body)).status_code == 201

            async def is_seen():
                state = (await client.get("/api/robots/sub-1/state")).json()
                return state["position"] is not None and state["link"]["state"] == "live"

            await until(is_seen)
            yield client, vehicle
    finally:
        life.cancel()
        await asyncio.gather(life, return_exceptions=True)


async def ended(client, answer):
    assert answer.status_code == 202, answer.text

    async def over():
        job = (await client.get(f"/api/jobs/{answer.json()['id']}")).json()
        return job if job["state"] not in ("running", "waiting") else None

    return await until(over)


async def test_waypoints_are_on_board_once_each_was_read_back(tmp_path):
    async with afloat(tmp_path) as (client, vehicle):
        path = "/api/robots/sub-1/waypoints"
        job = await ended(client, await client.put(path, json={"waypoints": MISSION}))
        assert job["state"] == "done"
        told = (await client.get(path)).json()
        assert (told["state"], len(told["sha256"]), told["item"]) == ("on_board", 64, None)
        assert "each was read back" in told["message"]
        assert len(vehicle.autopilot.items) == 4
        # Somebody else's station puts another mission on board.
        vehicle.autopilot.take(vehicle.autopilot.items[:3])
        await ended(client, await client.post(f"{path}/read"))
        told = (await client.get(path)).json()
        assert told["state"] == "unknown"
        assert [round(one["depth_m"], 2) for one in told["on_vehicle"]] == [3.0, 6.0]
        assert told["on_vehicle"][0]["north_m"] == pytest.approx(160.0, abs=0.05)
        assert told["on_vehicle"][0]["command"] == "waypoint"


async def test_what_is_known_of_a_mission_outlives_the_station(tmp_path):
    path = "/api/robots/sub-1/waypoints"
    async with afloat(tmp_path) as (client, _):
        await ended(client, await client.put(path, json={"waypoints": MISSION}))
        before = (await client.get(path)).json()
        assert before["state"] == "on_board"
    world = SimpleNamespace(make_link=open_link)
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        assert (await client.get(path)).json() == before
        origin = LAKE.model_copy(update={"origin_latitude_deg": 10.0}).model_dump(mode="json")
        await client.patch("/api/robots/sub-1", json={"site": origin})
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        elsewhere = (await client.get(path)).json()
        assert (elsewhere["state"], elsewhere["on_vehicle"]) == ("none", [])


async def test_an_upload_that_the_station_did_not_outlive_is_not_known(station):
    site = station.fleet.status("mini-1").record.site
    mission = WaypointMission((Waypoint(1.0, 2.0, 3.0),), "uploading", sha256="ab")

    def keep(session):
        keep_mission(session, "mini-1", mission, site)
        return restored_mission(get_setting(session, setting_name("mini-1")), site)

    kept = await station.foundation.store.write(keep)
    assert (kept.state, kept.waypoints) == ("unknown", mission.waypoints)
    assert "stopped while it sent them" in kept.message


async def test_a_cancelled_upload_is_not_known_until_the_mission_is_read(tmp_path, monkeypatch):
    path = "/api/robots/sub-1/waypoints"
    async with afloat(tmp_path) as (client, _):
        real, has_all = Radios.upload_waypoints, asyncio.Event()

        async def goes_on(radios, robot, items, report):
            await real(radios, robot, items, report)
            has_all.set()
            await asyncio.Event().wait()

        monkeypatch.setattr(Radios, "upload_waypoints", goes_on)
        begun = await client.put(path, json={"waypoints": MISSION})
        job = f"/api/jobs/{begun.json()['id']}"
        await until(has_all.is_set)
        assert (await client.get(job)).json()["progress"] >= 0.9
        assert (await client.get(path)).json()["state"] == "uploading"
        assert (await client.delete(job)).is_success
        await ended(client, begun)
        told = (await client.get(path)).json()
        assert (told["state"], told["proved_at"]) == ("unknown", None)
        assert "cancelled" in told["message"]

        read = await ended(client, await client.post(f"{path}/read"))
        assert read["state"] == "done", read["message"]
        assert (await client.get(path)).json()["state"] == "on_board"


async def test_waypoints_are_refused_while_others_are_read(tmp_path, monkeypatch):
    path = "/api/robots/sub-1/waypoints"
    async with afloat(tmp_path) as (client, _):
        real, may_end = Radios.read_waypoints, asyncio.Event()

        async def late(radios, robot, report):
            await may_end.wait()
            return await real(radios, robot, report)

        monkeypatch.setattr(Radios, "read_waypoints", late)
        read = await client.post(f"{path}/read")
        refused = await client.put(path, json={"waypoints": MISSION})
        assert (read.status_code, refused.status_code) == (202, 409)
        assert "wait for that" in refused.json()["detail"]
        may_end.set()
        assert (await ended(client, read))["state"] == "done"
        sent = await ended(client, await client.put(path, json={"waypoints": MISSION}))
        assert sent["state"] == "done", sent["message"]


async def test_a_mission_refused_at_item_three_says_item_and_words(tmp_path):
    async with afloat(tmp_path) as (client, vehicle):
        take = vehicle.autopilot.take

        def shallow(items):
            verdict = take(items)
            return verdict if len(items) < 4 else type(verdict)(14, "item 3: too deep for me")

        vehicle._missions._take = shallow
        path = "/api/robots/sub-1/waypoints"
        job = await ended(client, await client.put(path, json={"waypoints": MISSION}))
        assert job["state"] == "failed"
        told = (await client.get(path)).json()
        assert (told["state"], told["item"]) == ("refused", 3)
        assert "item 3: too deep for me" in told["message"]
        assert told["message"].startswith("sub-1 refused at waypoint 3:")


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (place(160.0, 120.0, -10.0), "waypoint 2 is 10 m above the surface"),
        (place(-50.0, 120.0, 1.0), "waypoint 2 lies outside of Practice lake"),
        (place(160.0, 120.0, 60.0), "waypoint 2 at 60 m is below the floor"),
    ],
)
async def test_waypoints_that_no_vehicle_can_reach_never_leave(tmp_path, wrong, words):
    async with afloat(tmp_path) as (client, vehicle):
        body = {"waypoints": [MISSION[0], wrong]}
        answer = await client.put("/api/robots/sub-1/waypoints", json=body)
        assert answer.status_code == 422
        assert answer.json()["errors"][0]["msg"].startswith(words)
        assert answer.json()["errors"][0]["loc"][:3] == ["body", "waypoints", 1]
        assert vehicle.autopilot.items == ()


async def test_its_parameters_come_with_what_its_maker_says_of_them(tmp_path):
    async with afloat(tmp_path) as (client, _vehicle):
        path = "/api/robots/sub-1/parameters"
        job = await ended(client, await client.post(f"{path}/read"))
        assert job["state"] == "done"
        table = (await client.get(path)).json()
        assert table["is_described"]
        known = {one["name"]: one for one in table["parameters"]}
        speed = known["WPNAV_SPEED"]
        assert (speed["value"], speed["unit"], speed["title"]) == (60.0, "cm/s", "Waypoint speed")
        assert (speed["default"], speed["minimum"], speed["maximum"]) == (60.0, 10.0, 90.0)
        assert known["FS_LEAK_ENABLE"]["values"][2] == {"value": 2.0, "text": "Enter surface mode"}
        changed = await client.put(f"{path}/WPNAV_SPEED", json={"value": 45})
        assert (changed.json()["is_default"], changed.json()["default"]) == (False, 60.0)
        saved = {"text": "WPNAV_SPEED,60\nNEW_ONE,3\nWPNAV_RADIUS,200\n"}
        different = (await client.post(f"{path}/compare", json=saved)).json()
        told = {one["name"]: (one["robot"], one["file"]) for one in different}
        assert told["WPNAV_SPEED"] == (45.0, 60.0)
        assert told["NEW_ONE"] == (None, 3.0)
        assert "WPNAV_RADIUS" not in told
        of_maker = f"{path}/compare?against=defaults"
        (other,) = [
            one
            for one in (await client.post(of_maker, json={"text": "WPNAV_SPEED 45\nNEW 1"})).json()
            if one["file"] is not None
        ]
        assert other == {"name": "WPNAV_SPEED", "robot": 60.0, "file": 45.0}
        wrong = await client.post(f"{path}/compare", json={"text": "A 1\nB\n"})
        assert wrong.status_code == 422
        assert wrong.json()["detail"].startswith("line 2")
        beside = (await client.get(f"{path}?against=sub-1")).json()["parameters"]
        assert all(one["other"] == one["value"] for one in beside)


async def test_a_file_describes_the_parameters_of_a_vehicle_that_does_not(client):
    text = '{"parameters": [{"name": "SAT_BYTES", "units": "B", "default": 205}]}'
    path = "/api/robots/mini-1/parameters-description"
    assert (await client.put(path, json={"text": text})).json() == {"parameters": 1}
    assert (await client.get("/api/robots/mini-1/parameters")).json()["is_described"]
    refused = await client.put(path, json={"text": "{"})
    assert refused.status_code == 422
    assert "no JSON" in refused.json()["detail"]


async def test_our_robots_take_no_waypoints(client):
    answer = await client.put("/api/robots/mini-1/waypoints", json={"waypoints": [MISSION[0]]})
    assert answer.status_code == 409
    assert answer.json()["detail"] == "mini-1 flies plans, which say more than waypoints can."


async def test_surface_now_is_proved_by_its_mode_and_by_another_setting_by_another(tmp_path):
    async with afloat(tmp_path) as (client, vehicle):
        vehicle.autopilot.arm(True)

        async def surfaced():
            commands = (await client.get("/api/robots/sub-1/commands")).json()
            return commands[0]["level"] if commands[0]["level"] in ("applied", "refused") else None

        answer = await client.post("/api/robots/sub-1/commands", json={"kind": "surface"})
        assert answer.status_code == 202, answer.text
        assert await until(surfaced) == "applied"
        assert vehicle.autopilot.mode == MODES["SURFACE"]
        value = {"surface_by": "mode", "surface_number": MODES["MOTOR_DETECT"]}
        path = "/api/config/standard_commands?robot=sub-1"
        assert (await client.patch(path, json=value)).status_code == 200

        async def refused():
            await client.post("/api/robots/sub-1/commands", json={"kind": "surface"})
            return await until(surfaced) == "refused"

        assert await until(refused)
