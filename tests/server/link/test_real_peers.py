"""Vehicles that others made, as robots of the station: one by mavutil, one by MAVSDK."""

import asyncio
import json
import socket
import sys
from contextlib import asynccontextmanager, suppress
from types import SimpleNamespace

import pytest

from autonomy.frames import wgs84_from_ned
from autonomy.site import LAKE
from server.access.role import Role
from server.link.radios import open_link
from tests.free_port import free_port
from tests.robot_link.test_mavsdk import ROOT
from tests.server.conftest import api_client, open_station, until

pytestmark = [pytest.mark.process, pytest.mark.timeout(300)]

ORIGIN = (LAKE.origin_latitude_deg, LAKE.origin_longitude_deg)
PLACE_NE_M = (160.0, 120.0)
ROBOT = "/api/robots/other-1"
PX4_MISSION = 4 << 24 | 4 << 16


class Peer:
    """The process of a vehicle."""

    def __init__(self, process):
        self.process = process

    async def said(self, **expected):
        """Wait until it writes an object that holds this."""
        while line := await self.process.stdout.readline():
            with suppress(ValueError):
                heard = json.loads(line)
                if isinstance(heard, dict) and expected.items() <= heard.items():
                    return heard
        raise AssertionError(f"the peer ended before it said {expected}")

    def go_on(self):
        self.process.stdin.write(b"\n")


@asynccontextmanager
async def peer(module, *arguments):
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        f"tests.robot_link.{module}",
        *map(str, arguments),
        cwd=ROOT,
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    try:
        yield Peer(process)
    finally:
        with suppress(ProcessLookupError):
            process.kill()
        await process.communicate()


class Router(asyncio.DatagramProtocol):
    """Hands what several vehicles say to a station, as one caller."""

    def __init__(self, station_port):
        self.station_port = station_port
        self.transport = None

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, addr):
        if addr[1] != self.station_port:
            self.transport.sendto(data, ("127.0.0.1", self.station_port))


@asynccontextmanager
async def router_to(station_port):
    """Yield the port at which vehicles call the router."""
    loop = asyncio.get_running_loop()
    transport, _ = await loop.create_datagram_endpoint(
        lambda: Router(station_port), local_addr=("127.0.0.1", 0)
    )
    try:
        yield transport.get_extra_info("sockname")[1]
    finally:
        transport.close()


@asynccontextmanager
async def station_for(tmp_path, port, system):
    """A station with its real links, and the vehicle added to it as a person would."""
    async with (
        open_station(tmp_path, SimpleNamespace(make_link=open_link)) as station,
        api_client(station, Role.ADMIN) as client,
    ):
        body = {
            "id": "other-1",
            "name": "other-1",
            "protocol": "mavlink",
            "system_id": system,
            "links": [f"udp://127.0.0.1:{port}?listen=1"],
            "site": LAKE.model_dump(mode="json"),
        }
        assert (await client.post("/api/robots", json=body)).status_code == 201
        yield client


async def state_of(client, holds):
    """Wait for a state that holds something."""

    async def found():
        state = (await client.get(f"{ROBOT}/state")).json()
        return state if state["vehicle"] is not None and holds(state) else None

    return await until(found)


def has_said_all(state):
    """Tell whether a vehicle has said where it is and, in another message, how it is."""
    return state["position"] is not None and state["vehicle"]["is_armed"] is not None


def depth_m(state):
    return state["channels"]["depth_m"]["value"]


async def alarm_of(client):
    async def found():
        alarms = (await client.get("/api/alarms")).json()["alarms"]
        texts = [one["text"] for one in alarms if "under its system id" in one["text"]]
        return texts[0] if texts else None

    return await until(found)


async def newest_command(client, level):
    async def found():
        (newest, *_) = (await client.get(f"{ROBOT}/commands")).json()
        return newest if newest["level"] == level else None

    return await until(found)


def place_1e7(place_ne_m=PLACE_NE_M):
    latitude, longitude = wgs84_from_ned(place_ne_m, *ORIGIN)
    return round(float(latitude) * 1e7), round(float(longitude) * 1e7)


async def test_a_submarine_of_mavutil_is_shown_and_comes_up_when_it_says_so(tmp_path):
    port = free_port(socket.SOCK_DGRAM)
    async with (
        peer("mavutil_peer", port, 41, *place_1e7()) as submarine,
        station_for(tmp_path, port, 41) as client,
    ):
        await submarine.said(ready=True)
        told = {"pressure", "battery_fraction", "temperature"}
        state = await state_of(
            client, lambda one: has_said_all(one) and told <= one["channels"].keys()
        )
        assert state["activity"] == "Armed, in ALT_HOLD (holds its depth)"
        assert (state["vehicle"]["autopilot"], state["vehicle"]["kind"]) == ("ArduSub", "submarine")
        assert depth_m(state) == 6.0
        assert state["position"]["ned_m"] == pytest.approx([*PLACE_NE_M, 6.0], abs=0.02)
        assert state["channels"]["battery_fraction"]["value"] == pytest.approx(0.63)
        assert state["channels"]["temperature"]["value"] == pytest.approx(11.4)

        async def kept():
            told = await client.get(f"{ROBOT}/samples?channel=pressure")
            return told.json()["value"]

        assert (await until(kept))[0] == pytest.approx(5.874, abs=0.001)
        await client.post(f"{ROBOT}/commands", json={"kind": "arm"})
        assert (await newest_command(client, "applied"))["kind"] == "arm", "it is armed already"
        answer = await client.post(f"{ROBOT}/commands", json={"kind": "surface"})
        assert answer.status_code == 202
        await submarine.said(command=176, result=0)
        heard = await newest_command(client, "radio")
        assert "has not answered yet" in heard["text"], "its acknowledgement alone proves nothing"
        state = await state_of(client, lambda one: one["vehicle"]["mode_name"] == "ALT_HOLD")
        assert depth_m(state) == 6.0
        submarine.go_on()
        await newest_command(client, "applied")
        await client.post(f"{ROBOT}/commands", json={"kind": "disarm"})
        disarmed = await newest_command(client, "applied")
        assert disarmed["text"] == "other-1 obeys: it is disarmed, its motors stand."
        state = await state_of(client, lambda one: depth_m(one) == 0.0)
        assert state["activity"] == "Disarmed, in SURFACE (comes up)"


async def test_a_vehicle_of_mavsdk_is_shown_and_comes_up_by_a_mode_of_px4(tmp_path):
    port = free_port(socket.SOCK_DGRAM)
    latitude, longitude = wgs84_from_ned(PLACE_NE_M, *ORIGIN)
    url = f"udpout://127.0.0.1:{port}"
    async with (
        station_for(tmp_path, port, 41) as client,
        peer("mavsdk_peer", "vessel", url, 41, float(latitude), float(longitude)) as vessel,
    ):
        orders = {"surface_by": "mode", "surface_number": PX4_MISSION}
        config = await client.patch("/api/config/standard_commands?robot=other-1", json=orders)
        assert config.status_code == 200
        await vessel.said(ready=True)
        state = await state_of(client, has_said_all)
        assert state["position"]["ned_m"] == pytest.approx([*PLACE_NE_M, 4.0], abs=0.02)
        assert depth_m(state) == pytest.approx(4.0)
        assert state["vehicle"]["is_armed"] is False
        await client.post(f"{ROBOT}/commands", json={"kind": "surface"})
        await vessel.said(mode=4)
        await newest_command(client, "applied")
        state = await state_of(client, lambda one: depth_m(one) == 0.0)
        assert state["vehicle"]["mode_number"] == PX4_MISSION


async def test_a_second_vehicle_that_calls_under_one_system_id_is_alarmed_and_not_shown(tmp_path):
    port = free_port(socket.SOCK_DGRAM)
    async with (
        station_for(tmp_path, port, 41) as client,
        peer("mavutil_peer", port, 41, *place_1e7()),
    ):
        await state_of(client, lambda one: one["position"] is not None)
        async with peer("mavutil_peer", port, 41, *place_1e7((20.0, 30.0))):
            text = await alarm_of(client)
            assert text.startswith("other-1 is not alone under its system id: 127.0.0.1 port ")
            assert "speaks as system 41, too; it is not obeyed" in text
            link = (await client.get(f"{ROBOT}/links")).json()[0]
            before = link["frames_received"]
            state = await state_of(client, lambda one: one["link"]["frames_received"] > before)
            assert state["position"]["ned_m"] == pytest.approx([*PLACE_NE_M, 6.0], abs=0.02)


async def test_two_vehicles_behind_one_router_under_one_system_id_are_alarmed(tmp_path):
    port = free_port(socket.SOCK_DGRAM)
    async with (
        station_for(tmp_path, port, 41) as client,
        router_to(port) as routed,
        peer("mavutil_peer", routed, 41, *place_1e7()),
        peer("mavutil_peer", routed, 41, *place_1e7((20.0, 30.0))),
    ):
        text = await alarm_of(client)
        assert "two robots speak as system 41 on udp://127.0.0.1" in text
        assert "what is shown may be of both: give one of them another system id" in text


async def test_a_second_robot_under_the_system_id_of_a_vehicle_is_refused(tmp_path):
    async with station_for(tmp_path, free_port(socket.SOCK_DGRAM), 41) as client:
        body = {
            "id": "other-2",
            "name": "other-2",
            "protocol": "mavlink",
            "system_id": 41,
            "links": [f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}?listen=1"],
            "site": LAKE.model_dump(mode="json"),
        }
        answer = await client.post("/api/robots", json=body)
        assert answer.status_code in (409, 422)
        assert "other-1" in answer.text
        changed = await client.patch("/api/robots/mini-1", json={"system_id": 41})
        assert changed.status_code in (409, 422)
        assert "other-1" in changed.text
        assert len((await client.get("/api/robots")).json()) == 3
