"""A link is tried before a robot has it: what is heard, or the plain reason why nothing is."""

import asyncio
import socket
from contextlib import asynccontextmanager, closing

import pytest

from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.messages import SystemId
from server.access.role import Role
from tests.free_port import free_port
from tests.robot_link.far_end import heartbeat
from tests.server.conftest import api_client


@asynccontextmanager
async def calling(port, *systems):
    """Let systems call a port of the station again and again."""
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as caller:
        codecs = [Codec(SystemId(system), ROBOT_COMPONENT) for system in systems]

        async def call():
            while True:
                for codec in codecs:
                    caller.sendto(heartbeat(1, codec), ("127.0.0.1", port))
                await asyncio.sleep(0.02)

        task = asyncio.create_task(call())
        yield
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def tried(client, uri, system=None, status=200, seconds=0.5):
    body = {"uri": uri, "system_id": system, "seconds": seconds}
    answer = await client.post("/api/links/test", json=body)
    assert answer.status_code == status, answer.text
    return answer.json()


@pytest.mark.parametrize(
    ("wanted", "words"),
    [(7, "Heard system 7"), (None, "Heard system 7"), (9, "but not system 9")],
)
async def test_who_is_heard_is_named_with_the_age(client, wanted, words):
    port = free_port(socket.SOCK_DGRAM)
    async with calling(port, 7):
        for seconds in (0.5, 2.0, 8.0):
            uri = f"udp://127.0.0.1:{port}?listen=1"
            told = await tried(client, uri, wanted, seconds=seconds)
            if told["heard"]:
                break
    assert words in told["text"]
    assert (told["state"], told["shown"][:24]) == ("live", "The station will show sy")
    (heard,) = told["heard"]
    assert (heard["system_id"], heard["robot"]) == (7, None)
    assert heard["age_s"] < 30.0


async def test_a_system_id_that_a_robot_has_already_is_named(client):
    port = free_port(socket.SOCK_DGRAM)
    async with calling(port, 2):
        for seconds in (0.5, 2.0, 8.0):
            told = await tried(client, f"udp://127.0.0.1:{port}?listen=1", 7, seconds=seconds)
            if told["heard"]:
                break
    assert told["heard"][0]["robot"] == "grace-1"
    assert "(of grace-1), but not system 7" in told["text"]


async def test_a_port_that_is_not_there_is_told_plainly(client, tmp_path):
    told = await tried(client, f"serial://{tmp_path}/ttyUSB9")
    assert (told["is_well"], told["heard"]) == (False, [])
    assert told["state"] == "port_closed"
    assert "ttyUSB9" in told["text"]
    assert told["shown"] == "The station will show the port as closed."


async def test_a_link_in_use_is_left_alone(client):
    told = await tried(client, "xbee://127.0.0.1:9", 7)
    assert told["used_by"] == ["mini-1", "grace-1"]
    assert "uses this port already" in told["text"]


async def test_a_gateway_without_an_account_is_told(client):
    told = await tried(client, "rockblock://300234010753370")
    assert not told["is_well"]
    assert any("has no account with rockblock" in line for line in told["lines"])
    assert told["shown"] == "The station will show that the gateway does not answer."


async def test_what_is_no_link_is_refused_by_its_field(client):
    told = await tried(client, "carrier-pigeon://loft", status=422)
    assert told["errors"][0]["loc"] == ["uri"]


async def test_only_an_admin_opens_ports(station):
    async with api_client(station, Role.PILOT) as pilot:
        await tried(pilot, "tcp://127.0.0.1:9", status=403)
