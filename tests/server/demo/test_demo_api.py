"""Faults of simulated robots by REST: a pilot causes and undoes them, a viewer looks."""

from contextlib import asynccontextmanager

import pytest
from pydantic import ValidationError

from db.query.station.events import newest_events
from onboard.node.wire import NodeAddress
from robot_link.clock import SystemClock
from server.access.role import Role
from server.base.settings import Settings
from server.demo.demo import Demo
from server.station import Station, run_station
from simulator.fault_desk import FaultDesk
from simulator.fleet import GRACE_1
from simulator.robot import SimulatedBody
from tests.server.conftest import api_client, until
from tests.server.station_parts import OpenStation

LEAK = "/api/demo/faults/grace-1/leak"


@asynccontextmanager
async def demo(tmp_path, world):
    """Run a station beside a simulator's desk with one robot."""
    body = SimulatedBody(GRACE_1, 0)
    desk = FaultDesk(SystemClock())
    desk.meet(GRACE_1.robot, body)
    async with desk.server.serve() as address, station_at(tmp_path, world, address) as station:
        await until(lambda: station.foundation.services.get(Demo).robots)
        yield station, body


@asynccontextmanager
async def station_at(tmp_path, world, address):
    settings = Settings(
        data_dir=tmp_path, simulation=True, worker_processes=1, demo_port=address.port
    )
    async with run_station(settings, lambda found: Station(found, world.make_link)) as running:
        yield OpenStation(running.foundation)


async def leak_of(client):
    listed = (await client.get("/api/demo/faults")).json()
    return next(one for one in listed if one["name"] == "leak")


async def test_a_pilot_causes_a_leak_and_undoes_it_and_both_are_seen(tmp_path, world):
    async with demo(tmp_path, world) as (station, body), api_client(station, Role.PILOT) as pilot:
        assert (await leak_of(pilot))["since"] is None
        answer = await pilot.put(LEAK)
        assert answer.status_code == 204, answer.text
        body.advance(0.1)
        assert body.condition()["leak"] == 1.0

        async def seen():
            leak = await leak_of(pilot)
            return leak if leak["since"] else None

        leak = await until(seen)
        assert (leak["by"], leak["title"], leak["needs_hands"]) == ("test pilot", "Leak", True)
        assert (await pilot.delete(LEAK)).status_code == 204
        assert body.condition()["leak"] == 0.0


async def test_a_viewer_looks_and_causes_nothing(tmp_path, world):
    async with demo(tmp_path, world) as (station, body), api_client(station, Role.VIEWER) as viewer:
        assert (await leak_of(viewer))["robot"] == "grace-1"
        for answer in (await viewer.put(LEAK), await viewer.delete(LEAK)):
            assert answer.status_code == 403
        assert body.faults.leak_s == float("inf")


async def test_what_cannot_be_is_refused_with_a_sentence(tmp_path, world):
    async with demo(tmp_path, world) as (station, body), api_client(station, Role.PILOT) as pilot:
        hole = await pilot.put("/api/demo/faults/grace-1/hole")
        assert hole.status_code == 404
        assert "there are leak, pump" in hole.json()["detail"]
        nobody = await pilot.put("/api/demo/faults/mini-9/leak")
        assert nobody.status_code == 404
        assert "no robot mini-9 is simulated" in nobody.json()["detail"]
        assert (await pilot.put(LEAK)).status_code == 204
        body.plant.state[2] = 5.0
        deep = await pilot.delete(LEAK)
        assert deep.status_code == 409
        assert "under water" in deep.json()["detail"]


async def test_a_simulator_that_is_gone_is_named(tmp_path, world):
    async with (
        station_at(tmp_path, world, NodeAddress(port=9)) as station,
        api_client(station, Role.PILOT) as pilot,
    ):
        answer = await pilot.put(LEAK)
        assert answer.status_code == 503
        assert "simulator does not answer" in answer.json()["detail"]
        assert (await pilot.get("/api/demo/faults")).json() == []


async def test_without_a_demo_there_is_nothing_to_cause(client, station):
    assert (await client.get("/api/health")).json()["demo"] is False
    for answer in (
        await client.get("/api/demo/faults"),
        await client.put(LEAK),
        await client.delete(LEAK),
    ):
        assert answer.status_code == 404
        assert "runs no demo" in answer.json()["detail"]
    with station.foundation.store.read() as session:
        assert not [one for one in newest_events(session) if one.kind.startswith("fault.")]


def test_real_robots_are_given_no_faults(tmp_path):
    with pytest.raises(ValidationError, match="demo_port needs simulation"):
        Settings(data_dir=tmp_path, demo_port=9)
