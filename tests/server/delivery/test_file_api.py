"""Files of deployments by REST: refused by field, written in the background, fetched whole."""

import asyncio
import hashlib
from datetime import UTC, datetime, timedelta

import netCDF4

from server.access.role import Role
from server.base.worker import WorkerTaskError
from server.delivery import file_task
from tests.server.conftest import MINI, api_client, until
from tests.server.deployment.shore import answered, sample_at

METADATA = {
    "principal_investigator": {"name": "Ann", "email": "ann@example.org"},
    "operating_agency": "A lake station",
    "license": "CC-BY-4.0",
}


async def write(client, path, **body):
    job = await answered(client.post(f"{path}/files", json=body), 202)

    async def ended():
        told = await answered(client.get(f"/api/jobs/{job['id']}"))
        return told["state"] not in ("queued", "running") and told

    return await until(ended, timeout_s=280.0)


async def test_what_the_metadata_lack_is_named_and_no_file_is_written(client, deployment):
    known = await answered(client.get(f"{deployment}/files"))
    assert (known["mode"], known["files"]) == ("R", [])
    refused = await answered(client.post(f"{deployment}/files"), 422)
    paths = [".".join(one["loc"]) for one in refused["errors"]]
    assert paths == [f"metadata.{one['path']}" for one in known["missing"]]
    assert paths == [
        "metadata.principal_investigator.name",
        "metadata.principal_investigator.email",
        "metadata.operating_agency",
        "metadata.license",
    ]
    comma = {"principal_investigator": {"name": "Ann, Ben"}}
    refused = await answered(client.patch("/api/config/delivery", json=comma), 422)
    assert refused["errors"][0]["loc"] == ["principal_investigator", "name"]
    assert "no comma" in refused["errors"][0]["msg"]


async def test_a_file_is_written_checked_listed_and_fetched(
    client, deployment, monkeypatch, tmp_path
):
    """In the station's own process: what the checkers say is asked elsewhere."""
    monkeypatch.setattr(file_task, "field_checks", lambda *_: [])

    async def run_here(pool, task, payload, *, on_progress=None, processor_limit_s=None):
        return file_task.run(payload, on_progress or (lambda _: None), lambda: False)

    monkeypatch.setattr("server.base.worker.WorkerPool.run", run_here)
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    told = await write(client, deployment)
    assert told["state"] == "done", told["message"]
    (file,) = (await answered(client.get(f"{deployment}/files")))["files"]
    assert file["id"] == told["result"]["file"]
    assert file["name"].startswith("SIMULATION_mini-1_")
    assert file["name"].endswith("_R.nc")
    (own,) = file["checks"]
    assert (own["suite"], own["state"]) == ("own", "passed"), own
    answer = await client.get(f"{deployment}/files/{file['id']}")
    assert hashlib.sha256(answer.content).hexdigest() == file["sha256"]
    assert file["name"] in answer.headers["content-disposition"]
    await answered(client.get(f"{deployment}/files/file-99"), 404)
    when = {"started_at": "2026-01-01T00:00:00Z"}
    refused = await answered(client.patch(deployment, json=when), 409)
    assert "keeps its times" in refused["detail"]
    await answered(client.post(f"{deployment}/end"))
    await answered(client.post(f"{deployment}/review"))
    refused = await answered(client.post(f"{deployment}/files"), 422)
    assert refused["errors"][0]["loc"] == ["no_better_data"]
    assert (await write(client, deployment, no_better_data=True))["state"] == "done"
    newest, _ = (await answered(client.get(f"{deployment}/files")))["files"]
    assert newest["mode"] == "D"
    path = tmp_path / "newest.nc"
    path.write_bytes((await client.get(f"{deployment}/files/{newest['id']}")).content)
    with netCDF4.Dataset(path) as found:
        first, second = found.history.splitlines()
    assert "wrote mode R of deployment-1" in first
    assert "wrote mode D of deployment-1, signed by" in second


async def test_a_file_of_a_deployment_that_was_opened_anew_meanwhile_is_not_kept(
    client, station, deployment, monkeypatch
):
    monkeypatch.setattr(file_task, "field_checks", lambda *_: [])
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    await answered(client.post(f"{deployment}/end"))
    await answered(client.post(f"{deployment}/review"))

    async def run_meanwhile(pool, task, payload, *, on_progress=None, processor_limit_s=None):
        await answered(client.post(f"{deployment}/reopen", json={"reason": "A spike was seen."}))
        return file_task.run(payload, on_progress or (lambda _: None), lambda: False)

    monkeypatch.setattr("server.base.worker.WorkerPool.run", run_meanwhile)
    told = await write(client, deployment, no_better_data=True)
    assert told["state"] == "failed"
    assert "was changed while its file was written" in told["message"]
    assert (await answered(client.get(f"{deployment}/files")))["files"] == []


async def test_a_signed_file_says_what_came_after_the_signature(
    client, station, world, deployment, monkeypatch
):
    monkeypatch.setattr(file_task, "field_checks", lambda *_: [])

    async def run_here(pool, task, payload, *, on_progress=None, processor_limit_s=None):
        return file_task.run(payload, on_progress or (lambda _: None), lambda: False)

    monkeypatch.setattr("server.base.worker.WorkerPool.run", run_here)
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    await answered(client.post(f"{deployment}/end"))
    await answered(client.post(f"{deployment}/review"))
    at = datetime.now(UTC) - timedelta(minutes=25)
    world.tell(sample_at(MINI, at, 1000, "temperature"))
    station.ingest.flush()

    async def said():
        assert (await write(client, deployment, no_better_data=True))["state"] == "done"
        newest, *_ = (await answered(client.get(f"{deployment}/files")))["files"]
        return [one["message"] for one in newest["checks"][0]["findings"]]

    async def is_late():
        (found,) = await said() or [""]
        return found.startswith("1 value came after the signature of ")

    await until(is_late)
    await answered(client.post(f"{deployment}/reopen", json={"reason": "A late value."}))
    await answered(client.post(f"{deployment}/review"))
    assert await said() == []


async def test_one_file_of_a_deployment_is_written_at_a_time(client, deployment, monkeypatch):
    may_end = asyncio.Event()

    async def wait_and_break(*_, **__):
        await may_end.wait()
        raise WorkerTaskError("the disk did not take the file")

    monkeypatch.setattr("server.base.worker.WorkerPool.run", wait_and_break)
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    first = await answered(client.post(f"{deployment}/files"), 202)
    refused = await answered(client.post(f"{deployment}/files"), 409)
    assert refused["detail"].startswith("A file of deployment-1 is being written")
    may_end.set()

    async def failed():
        return (await answered(client.get(f"/api/jobs/{first['id']}")))["state"] == "failed"

    await until(failed)
    told = await write(client, deployment)
    assert (told["state"], told["message"]) == ("failed", "the disk did not take the file")
    assert (await answered(client.get(f"{deployment}/files")))["files"] == []


async def test_a_void_or_planned_deployment_has_no_file_and_a_viewer_only_looks(client, station):
    planned = await answered(client.post("/api/deployments", json={"robot": MINI}), 201)
    path = f"/api/deployments/{planned['id']}"
    assert await answered(client.post(f"{path}/files"), 409)
    await answered(client.post(f"{path}/void", json={"reason": "On the bench."}))
    refused = await answered(client.post(f"{path}/files"), 409)
    assert "is void: On the bench." in refused["detail"]
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.get(f"{path}/files")).status_code == 200
        assert (await viewer.post(f"{path}/files")).status_code == 403
