"""Pictures are kept where a pilot says so, for a while, and are gone with their deployment."""

import asyncio
import shutil
from datetime import timedelta

import pytest

from server.access.role import Role
from server.camera.picture.keeping import FOLDER, KeptPictures
from server.camera.picture.newest import Pictures
from tests.server.camera.test_supervision import added, pictures_in
from tests.server.conftest import MINI, api_client, until


@pytest.fixture
async def deployment(client):
    found = await client.post("/api/deployments", json={"robot": MINI, "started_at": None})
    assert found.status_code == 201, found.text
    return found.json()["id"]


async def test_pictures_are_kept_on_purpose_and_deleted(client, foundation, deployment):
    await added(client)
    body = {"deployment": deployment, "minutes": 1.0}
    begun = await client.post("/api/camera-pictures", json=body)
    assert begun.status_code == 200, begun.text
    assert begun.json()["cameras"] == ["tank-1"]
    assert (await client.post("/api/camera-pictures", json=body)).status_code == 409
    folder = foundation.settings.data_dir
    await until(lambda: pictures_in(folder))
    assert {file.parent for file in pictures_in(folder)} == {folder / FOLDER / deployment}
    ended = await client.delete("/api/camera-pictures")
    assert ended.json()["deployment"] is None
    assert ended.json()["kept"][0]["count"] >= 1
    events = (await client.get("/api/events")).text
    assert "keeps pictures of tank-1" in events
    assert "Pictures of tank-1 are kept no more" in events
    assert (await client.delete(f"/api/camera-pictures/{deployment}")).status_code == 200
    assert pictures_in(folder) == []


async def test_pictures_of_a_deployment_that_is_gone_go_too(foundation, deployment):
    folder = foundation.settings.data_dir / FOLDER
    for name in (deployment, "deployment-999"):
        (folder / name).mkdir(parents=True)
        (folder / name / "tank-1-x.jpg").write_bytes(b"\xff\xd8\xff")
    await foundation.services.get(KeptPictures).clean()
    assert [one.name for one in folder.iterdir()] == [deployment]
    shutil.rmtree(folder)


async def test_of_two_who_keep_pictures_at_once_one_is_refused(client, foundation, deployment):
    await added(client)
    body = {"deployment": deployment, "minutes": 1.0}
    asked = [client.post("/api/camera-pictures", json=body) for _ in range(2)]
    answers = await asyncio.gather(*asked)
    assert sorted(one.status_code for one in answers) == [200, 409]
    await client.delete("/api/camera-pictures")
    assert not foundation.services.get(Pictures).is_wanted("tank-1")


async def test_a_refused_order_keeps_nobody_from_the_next(client, deployment):
    await added(client)
    unknown = {"deployment": "deployment-999", "minutes": 1.0}
    assert (await client.post("/api/camera-pictures", json=unknown)).status_code == 404
    body = {"deployment": deployment, "minutes": 1.0}
    assert (await client.post("/api/camera-pictures", json=body)).status_code == 200


async def test_keeping_ends_by_itself_and_says_so(client, deployment):
    await added(client)
    body = {"deployment": deployment, "minutes": 0.005}
    assert (await client.post("/api/camera-pictures", json=body)).status_code == 200

    async def is_told():
        return "Pictures of tank-1 are kept no more" in (await client.get("/api/events")).text

    await until(is_told)
    assert (await client.get("/api/camera-pictures")).json()["deployment"] is None


async def test_pictures_of_a_void_deployment_are_deleted(client, foundation, deployment):
    await added(client)
    body = {"deployment": deployment, "minutes": 1.0}
    await client.post("/api/camera-pictures", json=body)
    folder = foundation.settings.data_dir
    await until(lambda: pictures_in(folder))
    path = f"/api/deployments/{deployment}/void"
    assert (await client.post(path, json={"reason": "a mistake"})).status_code == 200
    assert pictures_in(folder) == []
    assert (await client.get("/api/camera-pictures")).json()["deployment"] is None
    assert (await client.post("/api/camera-pictures", json=body)).status_code == 409


async def test_pictures_of_a_delivered_deployment_are_deleted(client, foundation):
    start, end = (foundation.clock.now() - timedelta(days=days) for days in (40, 39))
    times = {"started_at": start.isoformat(), "ended_at": end.isoformat()}
    past = (await client.post("/api/deployments", json={"robot": MINI, **times})).json()["id"]
    folder = foundation.settings.data_dir / FOLDER / past
    folder.mkdir(parents=True)
    (folder / "tank-1-x.jpg").write_bytes(b"\xff\xd8\xff")
    assert (await client.post(f"/api/deployments/{past}/review")).status_code == 200
    assert folder.exists()
    delivered = await client.post(f"/api/deployments/{past}/deliver", json={"to": "the archive"})
    assert delivered.status_code == 200, delivered.text
    assert not folder.exists()


@pytest.mark.parametrize("minutes", [0, -1, 10.5])
async def test_pictures_are_kept_ten_minutes_at_most(client, deployment, minutes):
    body = {"deployment": deployment, "minutes": minutes}
    assert (await client.post("/api/camera-pictures", json=body)).status_code == 422


async def test_a_viewer_keeps_nothing(station, deployment):
    body = {"deployment": deployment, "minutes": 1.0}
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.post("/api/camera-pictures", json=body)).status_code == 403
        assert (await viewer.delete("/api/camera-pictures")).status_code == 403
