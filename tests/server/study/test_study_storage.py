"""Studies while the storage fails: what is said of them is true, and what ended stays ended."""

import asyncio
from datetime import timedelta

import pytest

from db.fault import StoreUnavailableError
from db.query.mission import studies
from server.base import study
from tests.server.conftest import MINI, until
from tests.server.fake_link import state_report
from tests.server.study import test_identification_api as searches
from tests.server.study import test_whatif_api as runs

pytestmark = pytest.mark.usefixtures("in_threads")


@pytest.fixture(scope="module")
def recording():
    return searches.flown()


go_on = searches.go_on
"""Fixture of the searches' own tests."""


@pytest.fixture(autouse=True)
def _soon(monkeypatch):
    monkeypatch.setattr(study, "RETRY_S", 0.02)


def failing(*_, **__):
    raise StoreUnavailableError("The disk is full.")


async def test_a_run_whose_row_does_not_learn_its_job_is_begun_once_and_knows_it(
    client, monkeypatch
):
    with monkeypatch.context() as broken:
        broken.setattr(studies, "set_job", failing)
        begun = await runs.start(client, runs.LONG)
        assert (await client.get(f"/api/whatifs/{begun['id']}")).json()["job"] == begun["job"]
        (listed,) = (await client.get("/api/robots/mini-1/whatifs")).json()["whatifs"]
        assert (listed["state"], listed["job"]) == ("running", begun["job"])
    await client.delete(f"/api/jobs/{begun['job']}")
    found = (await client.get(f"/api/whatifs/{begun['id']}")).json()
    assert (found["state"], found["job"]) == ("cancelled", begun["job"])


async def test_a_search_whose_row_does_not_learn_its_job_can_be_called_off(
    client, station, recording, monkeypatch
):
    body = await searches.deployed(station, recording)
    monkeypatch.setattr(studies, "set_job", failing)
    begun = await searches.start(client, body, searches.SLOW)
    assert (await searches.get(client, begun))["job"] == begun["job"]
    monkeypatch.undo()
    answer = await client.post(f"/api/identifications/{begun['id']}/cancel")
    assert (answer.json()["state"], answer.json()["job"]) == ("cancelled", begun["job"])


async def test_a_run_that_was_called_off_while_nothing_could_be_kept_is_cancelled(
    client, station, monkeypatch
):
    begun = await runs.start(client, runs.LONG)
    with monkeypatch.context() as broken:
        broken.setattr(studies, "end_study", failing)
        await client.delete(f"/api/jobs/{begun['job']}")
        found = (await client.get(f"/api/whatifs/{begun['id']}")).json()
        assert (found["state"], found["message"]) == ("cancelled", "Cancelled.")
        stored = await station.foundation.store.query(
            lambda s: studies.get_study(s, "whatif", begun["id"])
        )
        assert stored.state == "running"

    async def is_kept():
        return await station.foundation.store.query(
            lambda s: studies.get_study(s, "whatif", begun["id"]).state == "cancelled"
        )

    await until(is_kept)
    events = (await client.get("/api/events?after=0&limit=1000")).json()["events"]
    assert [event["kind"] for event in events].count("whatif.cancelled") == 1


async def test_a_search_that_was_called_off_while_nothing_could_be_kept_goes_on_later(
    client, station, recording, monkeypatch, go_on
):
    body = await searches.deployed(station, recording)
    config = {**searches.SLOW, "iterations": 80, "particles": 10}
    go_on.clear()
    begun = await searches.start(client, body, config)
    await searches.checkpointed(client, begun)
    path = f"/api/identifications/{begun['id']}"
    with monkeypatch.context() as broken:
        broken.setattr(studies, "end_study", failing)
        assert (await client.post(f"{path}/cancel")).json()["state"] == "cancelled"
        again = await client.post(f"{path}/cancel")
        assert "is cancelled already" in again.json()["detail"]
        refused = await client.post(f"{path}/resume")
        assert refused.status_code == 503
    go_on.set()
    resumed = await client.post(f"{path}/resume")
    assert resumed.status_code == 202
    found = await searches.ended(client, begun)
    assert (found["state"], found["message"]) == ("done", "")


async def test_a_checkpoint_that_fits_no_longer_is_dropped_and_the_search_begins_anew(
    client, station, recording, go_on
):
    body = await searches.deployed(station, recording)
    config = {**searches.SLOW, "iterations": 80, "particles": 10}
    go_on.clear()
    begun = await searches.start(client, body, config)
    await searches.checkpointed(client, begun)
    path = f"/api/identifications/{begun['id']}"
    await client.post(f"{path}/cancel")
    go_on.set()
    late = state_report(MINI, at=searches.BEGIN + timedelta(seconds=10.1))
    await asyncio.wrap_future(station.foundation.store.append([late]))
    await client.post(f"{path}/resume")
    found = await searches.ended(client, begun)
    assert found["state"] == "failed"
    assert found["message"].endswith("Resume it to begin anew.")
    assert (found["has_checkpoint"], found["convergence"]) == (False, [])
    await client.post(f"{path}/resume")
    assert (await searches.ended(client, begun))["state"] == "done"
