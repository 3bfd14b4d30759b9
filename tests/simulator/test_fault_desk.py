"""Faults that are caused and undone while robots live: who asks, what is told, what is refused."""

from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import UTC, datetime

import pytest

from onboard.node.client import NodeClient
from onboard.node.wire import NodeError
from robot_link.clock import SystemClock
from robot_link.transport.opening import open_transport
from simulator.background import alongside
from simulator.fault import RobotFaults
from simulator.fault_desk import FAULTS, FaultDesk
from simulator.fleet import GRACE_1, MINI_1, SUBS, fault_names_of
from simulator.robot import SimulatedBody
from simulator.sub.definition import SUB_1
from simulator.sub.endpoint import PERIOD_S, SubVehicle
from tests.server.conftest import until


@asynccontextmanager
async def desk(**robots):
    told = []

    async def tell(news):
        told.append(news)

    one = FaultDesk(SystemClock(), tell)
    for name, faulty in robots.items():
        one.meet(name.replace("_", "-"), faulty)
    async with one.server.serve() as address:
        client = NodeClient(address)
        heard = client.subscribe(FAULTS, 20)
        async with alongside(client.run(), "client"), alongside(one.run(), "desk"):
            await client.connected()
            yield client, heard, told


def body(definition=MINI_1, **faults):
    return SimulatedBody(replace(definition, faults=RobotFaults(**faults)), 0)


def sub():
    return SubVehicle(SUB_1, open_transport("udp://127.0.0.1:9?listen=1"), SystemClock())


async def test_a_fault_is_caused_seen_told_and_undone_with_who_asked():
    mini = body()
    async with desk(mini_1=mini) as (client, heard, told):
        assert (await heard.get())["robots"]["mini-1"]["leak"]["since"] is None
        await client.ask("cause", robot="mini-1", fault="leak", by="ann")
        told_now = await heard.get()
        leak = told_now["robots"]["mini-1"]["leak"]
        assert (leak["by"], told_now["kinds"][leak["kind"]]["title"]) == ("ann", "Leak")
        assert datetime.fromisoformat(leak["since"]) <= datetime.now(UTC)
        mini.advance(0.1)
        assert mini.condition()["leak"] == 1.0
        await client.ask("mend", robot="mini-1", fault="leak", by="bob")
        assert (await heard.get())["robots"]["mini-1"]["leak"]["since"] is None
        assert mini.condition()["leak"] == 0.0
    assert [(one.robot, one.text, one.is_over) for one in told] == [
        (
            "mini-1",
            "Caused in the simulator by ann: water gets into the hull (mini-1, leak).",
            False,
        ),
        (
            "mini-1",
            "Mended in the simulator by bob: the hull is dry and tight (mini-1, leak).",
            True,
        ),
    ]


async def test_a_fault_that_is_caused_twice_is_told_once():
    async with desk(mini_1=body()) as (client, _, told):
        for _ in range(2):
            await client.ask("cause", robot="mini-1", fault="pump")
            await client.ask("mend", robot="mini-1", fault="gps")
    assert [one.text for one in told] == [
        "Caused in the simulator: the buoyancy pump stands still (mini-1, pump)."
    ]


async def test_what_needs_hands_is_not_undone_under_water():
    grace = body(GRACE_1)
    async with desk(grace_1=grace) as (client, _, _):
        for name in ("leak", "gps"):
            await client.ask("cause", robot="grace-1", fault=name)
        grace.plant.state[2] = 5.0
        await client.ask("mend", robot="grace-1", fault="gps")
        with pytest.raises(NodeError, match="grace-1 is under water"):
            await client.ask("mend", robot="grace-1", fault="leak")
    assert grace.faults.leak_s == 0.0
    assert grace.faults.gps_lost_s == float("inf")


@pytest.mark.parametrize(
    ("robot", "fault", "sentence"),
    [
        ("mini-9", "leak", "no robot mini-9 is simulated; there are mini-1"),
        ("mini-1", "hole", "mini-1 has no fault hole; there are leak, pump"),
        ("mini-1", "optode", "mini-1 has no fault optode"),
        ("", "leak", "no robot"),
    ],
)
async def test_what_cannot_be_caused_is_refused_with_what_there_is(robot, fault, sentence):
    async with desk(mini_1=body()) as (client, _, told):
        with pytest.raises(NodeError, match=sentence):
            await client.ask("cause", robot=robot, fault=fault)
    assert not told


async def test_a_fault_that_comes_by_itself_is_told_as_well():
    mini = body(leak_s=0.05)
    async with desk(mini_1=mini) as (_, heard, told):
        await heard.get()
        mini.advance(0.1)
        assert (await heard.get())["robots"]["mini-1"]["leak"]["since"] is not None
        await until(lambda: told)
    assert "water gets into the hull" in told[0].text


def test_a_flat_battery_is_changed_for_a_full_one():
    mini = body()
    mini.cause("battery")
    mini.advance(0.1)
    assert mini.battery.fraction < 0.05
    mini.mend("battery")
    mini.advance(0.1)
    assert mini.battery.fraction > 0.99


def test_a_stuck_pump_runs_again():
    mini = body()
    mini.cause("pump")
    mini.actuate(replace(mini.sensors.driven_to(mini._set_points), net_buoyancy_kg=0.05))
    before = mini.plant.state[12]
    mini.advance(0.5)
    assert mini.plant.state[12] == before
    mini.mend("pump")
    mini.advance(0.5)
    assert mini.plant.state[12] > before


async def test_the_submarine_has_its_own_faults():
    vehicle = sub()
    assert fault_names_of(SUBS)["sub-1"] == ("leak", "sensor", "battery", "gps")
    told = vehicle._telemetry
    assert {one.name for one in told.messages("named_values")} == {"salinity", "turbidity", "ph"}
    (sound,) = told.messages("gps")
    for name in vehicle.fault_kinds:
        vehicle.cause(name)
    vehicle.step()
    assert vehicle.autopilot.is_leaking
    assert "Leak Detected" in vehicle.autopilot.words[0][1]
    assert vehicle.plant.charge < 0.05
    assert told.messages("named_values") == []
    (lost,) = told.messages("gps")
    assert (sound.satellites_visible, lost.satellites_visible) == (11, 0)
    for name in vehicle.fault_kinds:
        vehicle.mend(name)
    vehicle.step()
    assert not vehicle.autopilot.is_leaking
    assert vehicle.plant.charge > 0.99
    assert len(told.messages("named_values")) == 3


async def test_a_leaking_submarine_says_so_again_and_again():
    vehicle = sub()
    vehicle.cause("leak")
    for _ in range(round(45.0 / PERIOD_S)):
        vehicle.step()
    assert [text for _, text in vehicle.autopilot.words] == ["Leak Detected"] * 3


async def test_a_desk_stands_for_that_of_another_process():
    near, far = body(), body(GRACE_1)
    async with (
        desk(grace_1=far) as (elsewhere, _, told_elsewhere),
        first_desk(elsewhere, mini_1=near) as (client, heard, told),
    ):
        while set((await heard.get())["robots"]) != {"mini-1", "grace-1"}:
            pass
        await client.ask("cause", robot="grace-1", fault="leak", by="ann")
        far.advance(0.1)
        assert far.condition()["leak"] == 1.0
        assert near.condition()["leak"] == 0.0
        while (leak := (await heard.get())["robots"]["grace-1"]["leak"])["since"] is None:
            pass
        assert leak["by"] == "ann"
        await until(lambda: told and told_elsewhere)
        assert told == told_elsewhere
        with pytest.raises(NodeError, match="grace-1 has no fault itch"):
            await client.ask("cause", robot="grace-1", fault="itch")
        with pytest.raises(NodeError, match="there are mini-1, grace-1"):
            await client.ask("cause", robot="grace-9", fault="leak")


@asynccontextmanager
async def first_desk(elsewhere, **robots):
    """Run a desk that also stands for the one that a client reaches."""
    told = []

    async def tell(news):
        told.append(news)

    one = FaultDesk(SystemClock(), tell)
    for name, faulty in robots.items():
        one.meet(name.replace("_", "-"), faulty)
    async with one.server.serve() as address:
        client = NodeClient(address)
        heard = client.subscribe(FAULTS, 20)
        async with (
            alongside(client.run(), "client"),
            alongside(one.relay(elsewhere), "relay"),
        ):
            await client.connected()
            yield client, heard, told
