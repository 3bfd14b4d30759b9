"""Plans by satellite: no level before it is proved, one plan on board, never twice."""

import pytest_asyncio

from tests.server.service.conftest import until
from tests.server.service.far import draft, far_station, in_state, place_under, settled, transfer_of
from tests.server.service.sky import ManualClock, Sky


@pytest_asyncio.fixture
async def sky():
    return Sky(ManualClock())


@pytest_asyncio.fixture
async def robot(sky, tmp_path):
    return place_under(sky, tmp_path)


@pytest_asyncio.fixture
async def far(tmp_path, world, sky, robot, monkeypatch):
    async with far_station(tmp_path, world, sky, monkeypatch) as (station, client):
        await robot.call()
        await settled(station)
        yield station, client


async def test_far_plan_climbs_level_by_level_as_each_is_proved(far, sky, robot):
    station, client = far
    plan = await draft(client)
    path = await transfer_of(client, plan)
    queued = await in_state(client, path, "sending")
    await until(lambda: len(sky.calls) == len(queued["parts"]))
    await settled(station)
    queued = (await client.get(path)).json()
    assert queued["level"] == "queued"
    assert {part["level"] for part in queued["parts"]} == {"queued"}
    assert queued["carrier"] == "rockblock"
    await robot.call(len(queued["parts"]))
    await settled(station)
    assert (await client.get(f"/api/plans/{plan['id']}")).json()["state"] == "sent"
    await robot.call()
    done = await in_state(client, path, "on_board")
    assert done["level"] == "applied"
    assert (await in_state(client, f"/api/plans/{plan['id']}", "on_board"))["sha256"] == (
        robot.applied[0][0].sha256()
    )
    assert len(robot.applied) == 1
