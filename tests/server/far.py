"""A station with a robot that is out of radio's reach, under satellites that tests command."""

from contextlib import asynccontextmanager

from db.query.fleet.robots import change_robot
from db.store import Store
from robot_link.messages import LinkState
from server.access.role import Role
from server.base import foundation, wakeups
from server.base.secret import SecretStore
from server.base.settings import Settings
from server.station import Station, run_station
from tests.server.conftest import GRACE, OpenStation, api_client, until
from tests.server.fake_link import state_report
from tests.server.sky import URI

RADIO = "xbee://127.0.0.1:9"
ORDERS = "/api/robots/grace-1/commands"
PLUG = "/api/robots/grace-1/links/plug"
LINKS = [RADIO, URI]
DIVE = {
    "kind": "primitives",
    "legs": [
        {"kind": "dive", "end_ned": [0, 0, number * 1.37 % 5], "speed_m_s": 0.05 + number / 1e3}
        for number in (*range(1, 40), 0)
    ],
    "config": {"round_budget": 400.0, "total_budget": 400.0, "max_uncertainty_m": 60.0},
}
"""Long enough to need two messages. Its robot never told what it knows of the current."""


def give_links(tmp_path, links):
    """Change the robot's links in the database of a station that does not run."""
    store = Store.open(Settings(data_dir=tmp_path).resolved_database_url)
    store.change(lambda session: change_robot(session, GRACE, links=links)).result(60)
    store.close()


def place_under(sky, tmp_path):
    """Return the robot under a sky, with the key that the station has for it."""
    key = SecretStore(Settings(data_dir=tmp_path).secret_dir).robot_key(GRACE)
    return sky.robot(GRACE, 2, key)


@asynccontextmanager
async def far_station(tmp_path, world, sky, monkeypatch, links=LINKS):
    """Run a station on the sky's clock whose lake robot was heard by satellite just now."""
    monkeypatch.setattr(foundation, "read_clock", lambda _: sky.clock)
    monkeypatch.setattr(wakeups, "LONGEST_S", 0.02)  # of a clock that tests turn
    give_links(tmp_path, links)
    settings = Settings(data_dir=tmp_path, simulation=True, worker_processes=1)
    async with run_station(
        settings, lambda base: Station(base, world.make_link, sky.make_gateways)
    ) as running:
        station = OpenStation(running.foundation)
        async with api_client(station, Role.ADMIN) as client:
            yield station, client


async def settled(station):
    """Wait until nothing is on its way inside the station."""
    for _ in range(4):
        await station.satellite.outbox.step()
        await station.satellite.outbox.settle()

    async def done():
        found = await station.satellite.inbox.unsettled()
        return not found

    await until(done)


async def draft(client, body=DIVE):
    answer = await client.post("/api/robots/grace-1/plans", json=body)
    assert answer.status_code == 202, answer.text
    plan = answer.json()["id"]
    return await in_state(client, f"/api/plans/{plan}", "draft")


async def in_state(client, path, *states):
    async def there():
        found = (await client.get(path)).json()
        return found if found["state"] in states else None

    return await until(there)


async def transfer_of(client, plan, **body):
    answer = await client.post(f"/api/plans/{plan['id']}/upload", json=body)
    assert answer.status_code == 202, answer.text
    return f"/api/transfers/{answer.json()['id']}"


def lose_radio(world):
    world.hear(GRACE, LinkState.STALE)


def hear_radio(world, sky):
    world.hear(GRACE)
    world.tell(state_report(GRACE, (150.0, 150.0, 0.0), at=sky.clock.now()))


async def order(client, kind="hold"):
    """Tell the robot something; return where to ask what became of it."""
    answer = await client.post(ORDERS, json={"kind": kind})
    assert answer.status_code == 202, answer.text
    return f"/api/commands/{answer.json()['id']}"


async def queued(station, client, sky, plan, **body):
    """Send a plan by satellite and wait until the gateway has it all."""
    path = await transfer_of(client, plan, **body)
    await until(lambda: sky.calls)
    await settled(station)
    found = (await client.get(path)).json()
    assert found["level"] == "queued", found
    return path, found
