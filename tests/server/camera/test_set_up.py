"""Three cameras are set up from nothing by REST, then bumped, and the water is let out."""

import asyncio
import json
import math
import sys
from datetime import datetime

import numpy as np
import pytest

from autonomy.vision.rigid import turned_by_rad
from server.camera import child
from server.camera.rig import CameraRig
from server.camera.vision import rig_of
from tests.autonomy.vision.tank import overhead_cameras, tank_layout
from tests.server.camera.tank_stand_in import LATENCY_S
from tests.server.conftest import until

NAMES = ("tank-1", "tank-2", "tank-3")
TANK = (sys.executable, "-m", "tests.server.camera.tank_stand_in")
pytestmark = [pytest.mark.process, pytest.mark.timeout(900)]


@pytest.fixture
def tank(tmp_path, monkeypatch):
    """What really is; a change is seen in the next picture."""
    monkeypatch.setattr(child, "COMMAND", TANK)
    file = tmp_path / "world.json"

    def put(**changes):
        fresh = file.with_suffix(".new")
        fresh.write_text(json.dumps(changes))
        fresh.replace(file)

    put()
    put.file = file
    return put


async def ended(client, answer):
    assert answer.status_code == 202, answer.text
    body = answer.json()
    path = f"/api/jobs/{body['id']}"
    async with asyncio.timeout(240):
        while True:
            job = (await client.get(path)).json()
            if job["state"] not in {"queued", "running"}:
                return job
            await asyncio.sleep(0.1)


async def done(client, answer):
    job = await ended(client, answer)
    assert job["state"] == "done", job["message"]
    return job["result"]


def told_tags(layout):
    return [
        {
            "id": tag.id,
            "size_m": tag.size_m,
            "position_m": list(tag.position_m),
            "heading_deg": tag.heading_deg,
        }
        for tag in layout.tags
    ]


async def set_up(client, tank):
    """Go through all steps for three cameras."""
    for name in NAMES:
        body = {"id": name, "uri": f"http://127.0.0.1:9/camera?world={tank.file}"}
        assert (await client.post("/api/cameras", json=body)).status_code == 201
    refused = await ended(client, await client.post("/api/cameras/adjust", json={}))
    assert refused["message"] == "Tell where the fixed tags of the tank are first."
    body = {"layout": {"tags": told_tags(tank_layout())}, "bundles": []}
    assert (await client.put("/api/tags", json=body)).status_code == 200
    refused = await ended(client, await client.post("/api/cameras/adjust", json={}))
    assert refused["message"] == "No camera's lens is calibrated yet."
    await asyncio.gather(*(lens(client, name) for name in NAMES))
    adjusted = await client.post("/api/cameras/adjust", json={"level_m": 0.0})
    return await done(client, adjusted)


async def lens(client, name):
    path = f"/api/cameras/{name}"

    async def running():
        return (await client.get(path)).json()["state"] == "running"

    await until(running)
    boards = (await client.get(f"{path}/boards")).json()
    assert boards["missing"] == ["20 pictures of the board"]
    for _ in range(20):
        await done(client, await client.post(f"{path}/boards", json={}))
    boards = (await client.get(f"{path}/boards")).json()
    assert len(boards["shots"]) == 20
    assert all(count > 0 for row in boards["cells"] for count in row) == (
        not any("of the picture" in words for words in boards["missing"])
    )
    await done(client, await client.post(f"{path}/lens", json={}))
    found = (await client.get(path)).json()
    assert found["step"] == "pose"
    assert found["lens"]["focal_std_share"] <= 0.001
    assert found["lens"]["rms_px"] <= 0.2


def standing(foundation, cause):
    return lambda: foundation.alarms.standing(cause, None)


async def test_three_cameras_are_set_up_bumped_and_set_up_again(client, foundation, tank):
    calibration = (await set_up(client, tank))["calibration"]
    rig = foundation.services.get(CameraRig)
    found = rig_of(rig.rig)
    for camera, true in zip(found.cameras, overhead_cameras(), strict=True):
        off = np.linalg.norm(camera.pose.position_m - true.pose.position_m)
        turned = math.degrees(turned_by_rad(camera.pose.rotation, true.pose.rotation))
        assert off <= 0.008
        assert turned <= 0.15
    history = (await client.get("/api/cameras/tank-1/calibrations")).json()
    assert (history[0]["id"], history[0]["is_used"]) == (calibration, True)

    tank(**{"tank-2": {"turned_deg": 0.1}})
    moved, words = standing(foundation, "camera-moved:tank-2"), "tank-2 has moved, by about 0.1 deg"
    await until(lambda: (alarm := moved()) is not None and alarm.text.startswith(words))
    assert (await client.get("/api/cameras/tank-2")).json()["is_used"]

    tank(**{"tank-2": {"turned_deg": 0.25}})
    await until(lambda: "tank-2" in rig.left_out)
    assert rig.rig.cameras == ("tank-1", "tank-3")
    await until(lambda: (alarm := moved()) is not None and "left out" in alarm.text)
    again = await client.post("/api/cameras/adjust", json={"camera": "tank-2"})
    await done(client, again)
    await until(lambda: rig.rig is not None and rig.rig.cameras == NAMES)
    await until(lambda: moved() is None)
    assert (await client.get("/api/cameras/tank-2")).json()["stand"] in {"holds", "unknown"}

    level_m = rig.rig.level_m
    tank(level_m=0.02, **{"tank-2": {"turned_deg": 0.25}})
    await until(lambda: abs(rig.rig.level_m - level_m - 0.02) < 0.002)
    shown = (await client.get("/api/camera-rig")).json()
    assert shown["level_words"].startswith("The water fell by")
    assert shown["left_out"] == []
    # A camera whose pictures are older than the fall disagrees with the others at first.
    level = standing(foundation, "camera-level")
    await until(lambda: level() is None)

    tank(level_m=0.05, **{"tank-2": {"turned_deg": 0.25}})
    await until(lambda: (alarm := level()) is not None and "more than is counted" in alarm.text)
    assert abs(rig.rig.level_m - level_m) <= 0.031


async def test_a_screen_tells_how_late_pictures_come(client, tank):
    body = {"id": "tank-1", "uri": f"http://127.0.0.1:9/camera?world={tank.file}"}
    assert (await client.post("/api/cameras", json=body)).status_code == 201
    answer = await client.post("/api/cameras/tank-1/latency")
    assert (answer.status_code, answer.json()["kind"]) == (202, "camera")
    shown = (await client.get("/api/cameras/tank-1/latency")).json()
    begun_at = datetime.fromisoformat(shown["begun_at"])
    assert (shown["first_id"], shown["job"]) == (200, answer.json()["id"])
    tank(begun=begun_at.timestamp())
    result = await done(client, answer)
    assert abs(result["latency_s"] - LATENCY_S) < 0.02
    camera = (await client.get("/api/cameras/tank-1")).json()
    assert camera["latency_s"] == result["latency_s"]
    assert (await client.get("/api/cameras/tank-1/latency")).json()["job"] is None
