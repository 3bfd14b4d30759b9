"""The station with the cameras' own process and a camera in the network."""

import os

import numpy as np
import pytest

from robot_link.camera.process import COMMAND
from server.camera import child
from server.camera.processes import CameraProcesses
from tests.robot_link.camera.camera_server import jpeg, serving
from tests.robot_link.camera.drawn import scene
from tests.server.conftest import until

pytestmark = pytest.mark.process
PASSWORD = "secret"


@pytest.fixture(autouse=True)
def _own_process(monkeypatch):
    monkeypatch.setattr(child, "COMMAND", COMMAND)


@pytest.fixture
def camera():
    rng = np.random.default_rng(3)
    still, _ = scene(rng, (640, 480), {0: (160, 160, 50), 101: (420, 300, 60)})

    def picture():
        noise = rng.normal(0.0, 2.0, still.shape)
        return jpeg(np.clip(still + noise, 0, 255).astype(np.uint8))

    with serving(picture, 0.1) as server:
        yield server


async def added(client, uri):
    answer = await client.post("/api/cameras", json={"id": "tank-1", "uri": uri})
    assert answer.status_code == 201, answer.text


async def shown(client):
    return (await client.get("/api/cameras/tank-1")).json()


async def test_a_camera_in_the_network_shows_its_tags(client, foundation, camera):
    await added(client, f"{camera.address}/stream")
    found = await until(lambda: _with_tags(client))
    assert found["state"] == "running"
    assert found["frames_per_s"] >= 0.0
    picture = await until(lambda: _picture(client))
    assert picture.content[:3] == b"\xff\xd8\xff"
    process_id = foundation.services.get(CameraProcesses).process_id("tank-1")
    os.kill(process_id, 9)
    await until(lambda: _restarted(client))
    await until(lambda: _with_tags(client))


async def _with_tags(client):
    found = await shown(client)
    return found if found["tags"] and found["state"] == "running" else None


async def _restarted(client):
    return (await shown(client))["restarts"] >= 1


async def _picture(client):
    answer = await client.get("/api/cameras/tank-1/picture.jpg?marks=1")
    return answer if answer.status_code == 200 else None


async def test_a_password_opens_a_camera_and_is_told_nobody(client, camera):
    await added(client, f"{camera.address}/closed")
    body = {"user": "tank", "password": PASSWORD}
    assert (await client.put("/api/cameras/tank-1/account", json=body)).status_code == 204
    await until(lambda: _with_tags(client))
    told = (await client.get("/api/cameras")).text + (await client.get("/api/events")).text
    assert PASSWORD not in told
    assert not any(PASSWORD in path for path in camera.asked)


@pytest.mark.parametrize("path", ["elsewhere", "page"])
async def test_a_camera_that_is_none_says_why(client, camera, path):
    await added(client, f"{camera.address}/{path}")

    async def failed():
        found = await shown(client)
        return found if found["state"] in {"failed", "silent"} and found["words"] else None

    found = await until(failed)
    assert found["pictures"] == 0
    assert not found["tags"]


async def test_a_camera_is_looked_through_before_it_is_added(client, camera):
    uri = f"{camera.address}/stream"
    body = {"uri": uri, "seconds": 3.0}
    answer = await client.post("/api/cameras/test", json=body)
    assert answer.status_code == 200, answer.text
    lines = answer.json()["lines"]
    assert lines[0].startswith("Pictures of 640 x 480 px come")
    assert any(line.startswith("Tag 0 (a robot's) is found") for line in lines)
    assert (await client.get("/api/cameras")).json() == []
    await added(client, uri)
    used = (await client.post("/api/cameras/test", json=body)).json()
    assert used["lines"] == ["tank-1 has this address already; what it sees stands with it."]


async def test_a_camera_that_cannot_be_opened_is_told_with_what_to_try(client, camera):
    body = {"uri": f"{camera.address}/closed", "user": "ann", "password": PASSWORD}
    answer = await client.post("/api/cameras/test", json=body)
    assert answer.status_code == 200, answer.text
    assert not answer.json()["is_well"]
    assert answer.json()["lines"]
    assert PASSWORD not in answer.text
    refused = await client.post("/api/cameras/test", json={"uri": "file:///etc/passwd"})
    assert refused.status_code == 422
