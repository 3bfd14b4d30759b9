"""Cameras and tags by REST: added, changed, refused, remembered."""

import json
from pathlib import Path

import numpy as np
import pytest

from autonomy.vision.camera import Rig
from autonomy.vision.constants import CAMERA_ERRORS
from db.query.camera.calibrations import add_calibration
from db.query.camera.cameras import change_camera
from server.access.role import Role
from server.camera.calibrations import Calibrations
from server.camera.cameras import Cameras
from server.camera.rig import CameraRig, origin_of
from server.camera.set_up.jobs import CalibrationJobs
from server.camera.task import Found
from server.camera.vision import lens_document, rig_document, rig_of
from tests.autonomy.vision.tank import LENS, overhead_cameras, tank_layout
from tests.server.camera.test_supervision import holders_of
from tests.server.conftest import api_client, until

URI = "http://127.0.0.1:9/camera/1?fps=10"
OTHER_URI = "http://127.0.0.1:9/camera/2?fps=10"
PASSWORD = "the camera's own secret"
FLOOR = {"id": 100, "size_m": 0.15, "position_m": [0.5, 0.5, 1.2]}
FIT = {"rms_px": 0.1, "focal_std_share": 1e-4, "views": [], "view_rms_px": []}
TOP = {"id": 0, "size_m": 0.1, "position_m": [0.02, 0.0, -0.085]}


def tags(*layout, bundles=()):
    return {"layout": {"tags": list(layout)}, "bundles": list(bundles)}


async def added(client, camera="tank-1", uri=URI):
    answer = await client.post("/api/cameras", json={"id": camera, "uri": uri})
    assert answer.status_code == 201, answer.text
    return answer.json()


async def test_a_new_camera_says_what_its_set_up_lacks(client):
    camera = await added(client)
    assert camera["step"] == "lens"
    assert not camera["is_used"]
    assert [one["id"] for one in (await client.get("/api/cameras")).json()] == ["tank-1"]
    again = await client.post("/api/cameras", json={"id": "tank-1", "uri": URI})
    assert again.status_code == 409


async def test_a_change_from_an_older_version_is_refused(client):
    await added(client)
    tag = (await client.get("/api/cameras/tank-1")).headers["ETag"]
    first = await client.patch(
        "/api/cameras/tank-1", json={"latency_s": 0.05}, headers={"If-Match": tag}
    )
    assert first.json()["latency_s"] == 0.05
    second = await client.patch(
        "/api/cameras/tank-1", json={"latency_s": 0.06}, headers={"If-Match": tag}
    )
    assert second.status_code == 412
    gone = await client.delete("/api/cameras/tank-1", headers={"If-Match": tag})
    assert gone.status_code == 412
    assert (await client.delete("/api/cameras/tank-1")).status_code == 204
    assert (await client.get("/api/cameras/tank-1")).status_code == 404


@pytest.mark.parametrize(
    "uri",
    [
        "file:///etc/passwd",
        "http://ada:hunter2@127.0.0.1/video",
        "rtsp://:hunter2@127.0.0.1/video",
        "/dev/video0",
        "http://127.0.0.1:99999/",
        "http://ada:hunter2",
        "http://127.0.0.1/?password=hunter2",
        "http://127.0.0.1/\nX: 1",
        "",
    ],
)
async def test_an_address_that_no_camera_has_is_refused_and_not_repeated(client, uri):
    answer = await client.post("/api/cameras", json={"id": "tank-1", "uri": uri})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["loc"][-1] == "uri"
    assert "hunter2" not in answer.text


async def test_only_administrators_say_where_pictures_come_from(client, station):
    await added(client)
    async with api_client(station, Role.PILOT) as pilot:
        for answer in (
            await pilot.post("/api/cameras", json={"id": "tank-2", "uri": URI}),
            await pilot.patch("/api/cameras/tank-1", json={"uri": URI}),
            await pilot.put("/api/cameras/tank-1/account", json={"user": "a", "password": "b"}),
            await pilot.delete("/api/cameras/tank-1"),
        ):
            assert answer.status_code == 403
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.get("/api/cameras/tank-1")).status_code == 200
        assert (await viewer.put("/api/tags", json=tags())).status_code == 403


async def test_a_password_is_in_the_secret_folder_alone(client, station, caplog):
    await added(client)
    answer = await client.put(
        "/api/cameras/tank-1/account", json={"user": "ada", "password": PASSWORD}
    )
    assert answer.status_code == 204
    camera = await client.get("/api/cameras/tank-1")
    assert camera.json()["has_account"]
    events = await client.get("/api/events")
    assert PASSWORD not in camera.text + events.text + caplog.text
    folder: Path = station.foundation.settings.data_dir
    assert holders_of(PASSWORD.encode(), folder) == [folder / "secret/camera-tank-1"]
    await client.delete("/api/cameras/tank-1")
    assert not (folder / "secret/camera-tank-1").exists()


async def test_a_password_does_not_go_to_another_host(client):
    await added(client)
    await client.put("/api/cameras/tank-1/account", json={"user": "ada", "password": PASSWORD})
    same = await client.patch("/api/cameras/tank-1", json={"uri": URI.replace("fps=10", "fps=5")})
    assert same.json()["has_account"]
    other = await client.patch("/api/cameras/tank-1", json={"uri": "http://192.0.2.7/video"})
    assert not other.json()["has_account"]


async def test_a_refused_change_leaves_the_account_with_its_camera(client, foundation):
    await added(client)
    await client.put("/api/cameras/tank-1/account", json={"user": "ada", "password": PASSWORD})
    at = foundation.clock.now()
    await foundation.store.write(
        lambda session: change_camera(session, "tank-1", {"latency_s": 0.1}, at=at)
    )
    elsewhere = {"uri": "http://127.0.0.2:9/camera/1"}
    assert (await client.patch("/api/cameras/tank-1", json=elsewhere)).status_code == 412
    assert (await client.delete("/api/cameras/tank-1")).status_code == 412
    assert (await client.get("/api/cameras/tank-1")).json()["has_account"]


async def test_tags_come_back_as_they_were_told_also_after_a_restart(client, station):
    body = tags({**FLOOR, "position_std_m": 0.004}, bundles=[{"robot": "mini-1", "tags": [TOP]}])
    put = await client.put("/api/tags", json=body, headers={"If-Match": '"0"'})
    assert put.status_code == 200, put.text
    got = await client.get("/api/tags")
    assert got.json()["layout"]["tags"][0]["position_std_m"] == 0.004
    assert got.json()["bundles"][0]["tags"][0]["position_m"] == TOP["position_m"]
    assert got.headers["ETag"] == put.headers["ETag"]
    stale = await client.put("/api/tags", json=body, headers={"If-Match": '"0"'})
    assert stale.status_code == 412
    rig = station.foundation.services.get(CameraRig)
    assert rig.registry.robot_of(0).robot == "mini-1"
    assert rig.registry.is_stranger(1)


@pytest.mark.parametrize(
    ("body", "loc", "words"),
    [
        (tags(FLOOR, FLOOR), ["layout", "tags", 1, "id"], "100 is there twice"),
        (tags({**FLOOR, "size_m": 0.0}), ["layout", "tags", 0, "size_m"], "not above 0"),
        (tags({**FLOOR, "id": 3}), ["layout", "tags", 0, "id"], "not one of the tank"),
        (
            tags(bundles=[{"robot": "mini-1", "tags": [TOP, {**TOP, "id": 4}]}]),
            ["bundles", 0, "tags", 1, "id"],
            "not one of 0 to 2",
        ),
        (
            tags(bundles=[{"robot": "mini-1", "tags": [TOP]}, {"robot": "grace-1", "tags": [TOP]}]),
            ["bundles", "grace-1", "tags", 0, "id"],
            "belongs to mini-1",
        ),
        (
            tags(bundles=[{"robot": "mini-9", "tags": [TOP]}]),
            ["bundles", 0, "robot"],
            "no robot mini-9",
        ),
        (tags(bundles=[{"robot": "mini-1", "tags": []}]), ["bundles", 0, "tags"], "there is none"),
    ],
)
async def test_a_wrong_tag_is_refused_with_its_path(client, body, loc, words):
    answer = await client.put("/api/tags", json=body)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["loc"] == loc
    assert words in error["msg"]
    assert (await client.get("/api/tags")).json()["version"] == 0


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999"])
async def test_a_number_that_is_none_is_refused(client, number):
    text = json.dumps(tags(FLOOR)).replace("0.15", number)
    answer = await client.put(
        "/api/tags", content=text, headers={"Content-Type": "application/json"}
    )
    assert answer.status_code in {400, 422}
    assert (await client.get("/api/tags")).json()["version"] == 0


@pytest.fixture
async def calibrated(client, foundation):
    """Two cameras of the tank with two calibrations of the rig, the second one in use."""
    cameras = foundation.services.get(Cameras)
    await added(client, "tank-1")
    await added(client, "tank-2")
    keys = {record.id: record.key for record in cameras.records}
    made = []
    for north_m in (0.0, 0.1):
        rig = Rig(overhead_cameras()[:2], level_m=north_m)
        size = 2 * CAMERA_ERRORS + 1
        record = await foundation.store.write(
            lambda session, rig=rig, size=size: add_calibration(
                session,
                "rig",
                result=rig_document(rig, keys, tank_layout(), 1.0, {100: 0.1}),
                covariance=1e-6 * np.eye(size),
                inputs={},
                at=foundation.clock.now(),
                by="ann",
            )
        )
        made.append(record)
    await foundation.services.get(Calibrations).take(made[1], None, by="ann")
    return made


async def test_an_older_calibration_can_be_chosen_again(client, foundation, calibrated):
    history = (await client.get("/api/cameras/tank-1/calibrations")).json()
    assert [one["is_used"] for one in history] == [True, False]
    assert "tank-1, tank-2 within 1 mm" in history[0]["summary"]
    rig = foundation.services.get(CameraRig)
    assert rig.rig.level_m == 0.1
    path = f"/api/cameras/tank-1/calibrations/{history[1]['id']}/use"
    chosen = await client.post(path)
    assert chosen.status_code == 200, chosen.text
    assert chosen.json()["place"]["position_std_m"] == pytest.approx(1e-3)
    assert rig.rig.level_m == 0.0
    assert rig.calibration == calibrated[0].key
    assert (
        await client.post("/api/cameras/tank-1/calibrations/calibration-99/use")
    ).status_code == 404


async def test_a_camera_at_another_address_or_with_another_lens_is_not_done(
    client, foundation, calibrated
):
    cameras, calibrations = (foundation.services.get(one) for one in (Cameras, Calibrations))

    async def kept(kind, result, covariance, **more):
        at = foundation.clock.now()
        more = {"inputs": {}, **more, "at": at, "by": "ann"}
        return await foundation.store.write(
            lambda session: add_calibration(
                session, kind, result=result, covariance=covariance, **more
            )
        )

    async def lens_anew():
        result = {"lens": lens_document(LENS), **FIT}
        key = cameras.get("tank-1").key
        record = await kept("lens", result, 1e-6 * np.eye(9), camera_key=key)
        await calibrations.take(record, "tank-1", by="ann")

    async def step(**changes):
        answer = await client.patch("/api/cameras/tank-1", json=changes)
        return answer.json()["step"]

    await lens_anew()
    await client.put("/api/tags", json=tags(FLOOR))
    inputs = {"origins": {one.id: origin_of(one) for one in cameras.records}}
    before = calibrated[1]
    placed = await kept("rig", before.result, before.covariance, inputs=inputs)
    await calibrations.take(placed, None, by="ann")
    assert await step(latency_s=0.1) == "done"
    assert await step(uri=URI.replace("10", "5")) == "done"
    await lens_anew()
    assert await step(latency_s=0.2) == "pose"
    assert await step(uri="http://127.0.0.1:7/camera/1") == "lens"
    assert foundation.services.get(CameraRig).rig.cameras == ("tank-2",)


async def test_a_removed_camera_leaves_the_rig_and_comes_back_uncalibrated(
    client, foundation, calibrated
):
    rig = foundation.services.get(CameraRig)
    await client.delete("/api/cameras/tank-1")
    assert rig.rig.cameras == ("tank-2",)
    again = await added(client, "tank-1")
    assert again["place"] is None
    assert rig.rig.cameras == ("tank-2",)
    assert [camera.name for camera in rig_of(rig.rig).cameras] == ["tank-2"]
    assert rig_of(rig.rig).covariance.shape == (CAMERA_ERRORS + 1, CAMERA_ERRORS + 1)
    assert (await client.get("/api/cameras/tank-1/calibrations")).json() == []


async def test_a_camera_that_is_left_out_is_known_but_not_used(client, foundation, calibrated):
    rig = foundation.services.get(CameraRig)
    rig.leave_out({"tank-2"})
    camera = (await client.get("/api/cameras/tank-2")).json()
    assert not camera["is_used"]
    assert camera["place"] is not None
    assert rig.rig.cameras == ("tank-1",)


async def test_a_lens_that_was_worked_out_for_another_camera_is_not_used(client, monkeypatch):
    await added(client)

    async def slow(*_):
        moved = await client.patch("/api/cameras/tank-1", json={"uri": OTHER_URI})
        assert moved.status_code == 200, moved.text
        return Found(lens_document(LENS), np.zeros((9, 9)), FIT)

    monkeypatch.setattr(CalibrationJobs, "_worked", slow)
    begun = (await client.post("/api/cameras/tank-1/lens", json={})).json()

    async def ended():
        job = (await client.get(f"/api/jobs/{begun['id']}")).json()
        return job if job["state"] not in {"queued", "running"} else None

    job = await until(ended)
    assert job["state"] == "failed"
    assert "tank-1 is another camera by now" in job["message"]
    assert (await client.get("/api/cameras/tank-1")).json()["step"] == "lens"
