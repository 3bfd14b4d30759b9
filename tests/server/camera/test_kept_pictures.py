"""Pictures are kept where a pilot says so, for a while, and are gone with their deployment."""

import shutil

import pytest

from server.access.role import Role
from server.camera.picture.keeping import FOLDER, KeptPictures
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


@pytest.mark.parametrize("minutes", [0, -1, 10.5])
async def test_pictures_are_kept_ten_minutes_at_most(client, deployment, minutes):
    body = {"deployment": deployment, "minutes": minutes}
    assert (await client.post("/api/camera-pictures", json=body)).status_code == 422


async def test_a_viewer_keeps_nothing(station, deployment):
    body = {"deployment": deployment, "minutes": 1.0}
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.post("/api/camera-pictures", json=body)).status_code == 403
        assert (await viewer.delete("/api/camera-pictures")).status_code == 403
