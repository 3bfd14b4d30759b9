"""Studies in processes of their own: side by side, called off, killed, and over a restart."""

import asyncio

from server.access.role import Role
from tests.server.conftest import api_client, open_station, until
from tests.server.study import test_identification_api as identification
from tests.server.study.test_whatif_api import LONG, ended, start


async def test_a_run_is_called_off_by_its_job(client):
    begun = await start(client, LONG)

    async def running():
        return (await client.get(f"/api/jobs/{begun['job']}")).json()["state"] == "running"

    await until(running)
    answer = await client.delete(f"/api/jobs/{begun['job']}")
    assert answer.json()["state"] == "cancelled"
    found = (await client.get(f"/api/whatifs/{begun['id']}")).json()
    assert (found["state"], found["result"]) == ("cancelled", None)
    after = await ended(client, await start(client))
    assert after["state"] == "done"


async def test_two_runs_at_once_do_not_disturb_each_other(client, station):
    station.study_workers._places = asyncio.Semaphore(2)
    alone = await ended(client, await start(client))
    neighbour = await start(client, {**LONG, "seed": 7})
    await until(lambda: len(station.study_workers._busy) == 1)
    begun = await start(client)
    await until(lambda: len(station.study_workers.process_ids()) == 2)
    same = await ended(client, begun)
    assert begun["id"] != neighbour["id"]
    assert same["result"] == alone["result"]
    running = (await client.get(f"/api/jobs/{neighbour['job']}")).json()
    assert running["state"] == "running", "the long one goes on beside it"
    await client.delete(f"/api/jobs/{neighbour['job']}")
    assert (await ended(client, neighbour))["state"] == "cancelled"


async def test_a_worker_that_dies_fails_the_run_in_words(client, station):
    begun = await start(client, LONG)
    (process,) = await until(lambda: list(station.study_workers._busy))
    process.process.kill()
    found = await ended(client, begun)
    assert found["state"] == "failed"
    assert "ended unexpectedly" in found["message"]


async def test_a_search_goes_on_after_a_restart_of_the_station(tmp_path, world):
    recording = identification.flown()
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        begun = await identification.start(
            pilot, await identification.deployed(station, recording), identification.SLOW
        )
        before = await identification.checkpointed(pilot, begun)
    async with open_station(tmp_path, world) as station, api_client(station, Role.PILOT) as pilot:
        found = await identification.get(pilot, begun)
        assert (found["state"], found["has_checkpoint"]) == ("interrupted", True)
        assert len(found["convergence"]) >= 1
        resumed = (await pilot.post(f"/api/identifications/{begun['id']}/resume")).json()

        async def further():
            now = await identification.get(pilot, begun)
            return now["state"] == "running" and now["progress"] > before["progress"]

        await until(further)
        await pilot.delete(f"/api/jobs/{resumed['id']}")
        assert (await identification.get(pilot, begun))["state"] == "cancelled"
