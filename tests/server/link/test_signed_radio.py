"""A station whose robot calls by UDP: only what the robot's present key signs is contact."""

import socket

import pytest_asyncio
from httpx import AsyncClient

from robot_link.clock import SystemClock
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.signing import MemorySigningMemory, Signing
from robot_link.mavlink.telemetry import state_message
from robot_link.messages import SystemId
from robot_link.transport.datagram import FAR_END
from robot_link.transport.opening import open_transport
from server.access.role import Role
from server.base.settings import Settings
from server.link.radios import open_link
from server.station import Station
from tests.free_port import free_port
from tests.robot_link.rig import running, state
from tests.server.conftest import MINI, OpenStation, api_client, run_station, until

NEW = {"id": "mini-2", "name": "mini-2", "model": "miniglider", "system_id": 7}


@pytest_asyncio.fixture
async def real(tmp_path):
    """A station with its real radios."""
    settings = Settings(data_dir=tmp_path, simulation=True, worker_processes=1)
    async with run_station(settings, lambda base: Station(base, open_link)) as app:
        yield OpenStation(app.foundation)


class Caller:
    """A robot's radio with a key, or without."""

    def __init__(self, transport, key: str | None):
        self.transport = transport
        self.take(key)

    def take(self, key: str | None):
        signing = None
        if key is not None:
            signing = Signing(bytes.fromhex(key), MemorySigningMemory(), SystemClock())
        self.codec = Codec(SystemId(7), ROBOT_COMPONENT, signing)

    async def says(self):
        await until(lambda: self.transport.max_payload)
        frame = self.codec.pack(state_message(state(SystemClock().now())))
        await self.transport.send(FAR_END, frame)


async def link_of(client: AsyncClient):
    return (await client.get("/api/robots/mini-2/links")).json()[0]


async def test_only_the_present_key_is_contact(real):
    port = free_port(socket.SOCK_DGRAM)
    site = real.fleet.status(MINI).record.site.model_dump(mode="json")
    body = {**NEW, "site": site, "links": [f"udp://127.0.0.1:{port}?listen=1"]}
    transport = open_transport(f"udp://127.0.0.1:{port}")
    async with api_client(real, Role.ADMIN) as client, running(transport.run):
        key = (await client.post("/api/robots", json=body)).json()["signing_key"]["key"]
        robot = Caller(transport, None)

        async def heard(count):
            await robot.says()
            link = await link_of(client)
            return link["is_signed"] and link["frames_received"] >= count

        async def refused():
            await robot.says()
            link = await link_of(client)
            return link if link["frames_bad"] >= 1 else None

        link = await until(refused)
        assert (link["state"], link["frames_received"]) == ("never_heard", 0)
        assert "is not signed with the key of mini-2" in link["text"]
        robot.take(key)
        await until(lambda: heard(1))

        new = (await client.post("/api/robots/mini-2/signing-key")).json()["key"]

        async def only_refused():
            """Tell whether the line that was opened anew takes nothing with the old key."""
            await robot.says()
            link = await link_of(client)
            return link["frames_bad"] > 0 and link["frames_received"] == 0

        await until(only_refused)
        robot.take(new)
        await until(lambda: heard(1))

        await client.delete("/api/robots/mini-2/signing-key")
        robot.take(None)

        async def heard_unsigned():
            await robot.says()
            link = await link_of(client)
            return link["frames_received"] and link["is_signed"] is False

        await until(heard_unsigned)
