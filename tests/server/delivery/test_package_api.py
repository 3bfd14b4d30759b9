"""Deliveries by REST: refused by field, one at a time, fetched whole, gone when they expire."""

import asyncio
import hashlib
import io
import zipfile
from datetime import timedelta

import netCDF4
import pytest

from server.access.role import Role
from server.base.worker import WorkerTaskError
from server.delivery import file_task, quality_task
from server.delivery.package import packages
from server.delivery.package import task as package_task
from server.delivery.package.packages import DeliveryPackages, cleared
from tests.server.conftest import MINI, api_client, until
from tests.server.delivery.test_file_api import METADATA
from tests.server.delivery.test_quality_api import run as checked
from tests.server.deployment.shore import answered


@pytest.fixture
def worked_here(monkeypatch):
    """Work in the station's own process; what the checkers say is asked elsewhere."""
    monkeypatch.setattr(file_task, "field_checks", lambda *_: [])

    async def run(pool, task, payload, *, on_progress=None, processor_limit_s=None):
        work = {one.TASK: one.run for one in (file_task, package_task, quality_task)}[task]
        return work(payload, on_progress or (lambda _: None), lambda: False)

    monkeypatch.setattr("server.base.worker.WorkerPool.run", run)


async def ended(client, job):
    async def told():
        found = await answered(client.get(f"/api/jobs/{job['id']}"))
        return found["state"] not in ("queued", "running") and found

    return await until(told, timeout_s=280.0)


async def deliver(client, path, **body):
    return await ended(client, await answered(client.post(f"{path}/delivery", json=body), 202))


async def test_a_delivery_is_packed_listed_fetched_and_gone_when_it_expires(
    client, station, deployment, worked_here, monkeypatch
):
    none = await answered(client.get(f"{deployment}/delivery"))
    assert (none["state"], none["file"], none["packages"]) == ("none", None, [])
    refused = await answered(client.post(f"{deployment}/delivery"), 422)
    assert refused["errors"][0]["loc"] == ["metadata", "principal_investigator", "name"]
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    told = await deliver(client, deployment)
    assert told["state"] == "done", told["message"]
    ready = await answered(client.get(f"{deployment}/delivery"))
    assert (ready["state"], ready["own"], ready["job"]) == ("ready", [], None)
    (package,) = ready["packages"]
    assert (package["id"], package["sha256"]) == (
        told["result"]["package"],
        told["result"]["sha256"],
    )
    assert package["file"] == ready["file"]["id"]
    path = f"{deployment}/delivery/{package['id']}"
    answer = await client.get(path)
    assert hashlib.sha256(answer.content).hexdigest() == package["sha256"]
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
    monkeypatch.setattr(packages, "KEPT", timedelta(0))
    again = await deliver(client, deployment)
    assert again["result"]["sha256"] != package["sha256"]  # it still runs: its log went on
    path = f"{deployment}/delivery/{again['result']['package']}"
    expired = await answered(client.get(path), 410)
    assert "expired at" in expired["detail"]
    assert (await answered(client.get(f"{deployment}/delivery")))["state"] == "expired"


async def test_what_has_ended_is_delivered_twice_as_the_same_bytes(client, deployment, worked_here):
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    await answered(client.post(f"{deployment}/end"))
    first = await deliver(client, deployment)
    second = await deliver(client, deployment)
    assert first["result"]["sha256"] == second["result"]["sha256"]
    assert first["result"]["file"] == second["result"]["file"]
    await answered(client.patch("/api/config/delivery", json={"project": "Lakes"}))
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json={"project": "Lakes"}))
    third = await deliver(client, deployment)
    assert third["result"]["file"] != first["result"]["file"]


async def test_a_reviewed_file_is_flagged_by_the_rules_that_its_reviewer_saw(
    client, deployment, worked_here, tmp_path
):
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    await answered(client.post(f"{deployment}/end"))
    await answered(client.post(f"{deployment}/review"))
    strict = {
        "version": "2.0.0",
        "series": {"temperature": {"fail_low": 30.0, "suspect_low": None}},
    }
    await answered(client.patch(f"/api/config/quality?robot={MINI}", json=strict))
    told = await deliver(client, deployment, no_better_data=True)
    assert told["state"] == "done", told["message"]
    path = tmp_path / "reviewed.nc"
    answer = await client.get(f"{deployment}/files/{told['result']['file']}")
    path.write_bytes(answer.content)
    with netCDF4.Dataset(path) as file:
        assert file.rtqc_method == "IOOS QARTOD, rule set grace-qartod 1.0.0"


async def test_a_range_that_changes_after_the_review_changes_no_flag_under_a_hash(
    client, deployment, worked_here, tmp_path
):
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    open_rules = {"version": "1.1.0", "series": {"temperature": None}}
    await answered(client.patch(f"/api/config/quality?robot={MINI}", json=open_rules))
    run = (await checked(client, deployment))["run"]
    assert run["counts"]["temperature"]["all"]["fail"] == 0
    await answered(client.post(f"{deployment}/end"))
    await answered(client.post(f"{deployment}/review"))
    await answered(client.patch("/api/channels/temperature", json={"high": 30.0}))

    async def flags_of(name, **more):
        told = await deliver(client, deployment, **more)
        assert told["state"] == "done", told["message"]
        answer = await client.get(f"{deployment}/files/{told['result']['file']}")
        (tmp_path / name).write_bytes(answer.content)
        with netCDF4.Dataset(tmp_path / name) as file:
            found = file["TEMP_QC"]
            assert '"fail_low":-5.0' in found.rtqc_rules
            return found.rtqc_rule_set_sha256, found[:].compressed().tolist().count(4)

    assert await flags_of("signed.nc", no_better_data=True) == (run["sha256"], 0)
    await answered(client.post(f"{deployment}/reopen", json={"reason": "Too warm."}))
    sha256, failed = await flags_of("anew.nc")
    assert (sha256 != run["sha256"], failed) == (True, 1)


async def test_two_at_once_are_refused_and_a_failed_one_frees_the_deployment(
    client, deployment, monkeypatch
):
    may_end = asyncio.Event()

    async def wait_and_break(*_, **__):
        await may_end.wait()
        raise WorkerTaskError("the disk did not take the delivery")

    monkeypatch.setattr("server.base.worker.WorkerPool.run", wait_and_break)
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    first = await answered(client.post(f"{deployment}/delivery"), 202)
    assert (await answered(client.get(f"{deployment}/delivery")))["state"] == "being_made"
    for path in ("delivery", "files"):
        refused = await answered(client.post(f"{deployment}/{path}"), 409)
        assert refused["detail"].startswith("A file of deployment-1 is being written")
    assert (await client.delete(f"/api/jobs/{first['id']}")).is_success
    may_end.set()
    told = await deliver(client, deployment)
    assert (told["state"], told["message"]) == ("failed", "the disk did not take the delivery")
    assert (await answered(client.get(f"{deployment}/delivery")))["packages"] == []


async def test_the_same_request_twice_packs_once(client, deployment, worked_here):
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    headers = {"Idempotency-Key": "once"}
    jobs = [
        await answered(client.post(f"{deployment}/delivery", headers=headers), 202)
        for _ in range(2)
    ]
    assert jobs[0] == jobs[1]
    await ended(client, jobs[0])
    assert len((await answered(client.get(f"{deployment}/delivery")))["packages"]) == 1


async def test_what_a_killed_station_left_is_cleared_and_what_is_kept_stays(
    client, station, deployment, worked_here
):
    await answered(client.patch(f"/api/config/delivery?robot={MINI}", json=METADATA))
    await deliver(client, deployment)
    service = station.foundation.services.get(DeliveryPackages)
    folder = service.folder
    kept = sorted(folder.iterdir())
    (folder / ".0011.part").mkdir()
    (folder / ".0011.part" / "samples.csv").write_text("half")
    for name in (".0022.part.nc", f"{'0' * 64}.nc", f"{'1' * 64}.zip"):
        (folder / name).write_text("half")
    assert cleared(folder, (), (), 0.0) == 0
    await service.load()
    assert sorted(folder.iterdir()) == kept


async def test_a_viewer_looks_and_packs_nothing(client, station, deployment):
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.get(f"{deployment}/delivery")).status_code == 200
        assert (await viewer.post(f"{deployment}/delivery")).status_code == 403
    await answered(client.get(f"{deployment}/delivery/package-9"), 404)
