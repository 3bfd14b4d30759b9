"""The watch over cameras goes on whatever fails, and what it decided outlives the station."""

import asyncio

import pytest

from autonomy.vision.rigid import Pose
from db.fault import StoreUnavailableError
from db.query.camera.calibrations import left_out
from robot_link.camera import extra
from server.camera import watch as watching
from server.camera.rig import CameraRig
from server.camera.status import CameraStatuses
from server.camera.task import LevelFound, Watched
from server.camera.watch import CameraWatch
from tests.autonomy.vision.tank import tank_layout
from tests.server.conftest import open_station, until
from tests.server.fix.sighted import Cameraman, calibrate

FELL = Watched({}, LevelFound(0.02, 0.001, 0.02, 0.0, 3), None)


@pytest.fixture
async def rig(client, foundation):
    await calibrate(foundation, client)
    return foundation.services.get(CameraRig)


async def test_the_watch_goes_on_when_storage_fails(rig, client, foundation, monkeypatch):
    watch, looks = foundation.services.get(CameraWatch), []

    async def seen(*_):
        looks.append(1)
        return FELL

    async def fails(_):
        raise StoreUnavailableError("the disk is full")

    monkeypatch.setattr(watching, "PERIOD_S", 0.01)
    monkeypatch.setattr(watch._pool, "run", seen)
    filming = Cameraman(foundation)

    async def looked(count):
        filming.shoot((tank_layout().tags, Pose.identity()))
        return len(looks) >= count

    with monkeypatch.context() as failing:
        failing.setattr(foundation.store, "write", fails)
        await until(lambda: looked(3))

    async def is_logged():
        filming.shoot((tank_layout().tags, Pose.identity()))
        await asyncio.sleep(0.05)
        return "The water fell by 20 mm" in (await client.get("/api/events")).text

    await until(is_logged)


async def test_a_camera_that_was_moved_is_left_out_after_a_restart(
    rig, foundation, tmp_path, world, monkeypatch
):
    rig.leave_out({"tank-1"})

    async def is_kept():
        return await foundation.store.query(left_out) == {"tank-1"}

    await until(is_kept)
    text = "tank-1 has moved, by about 0.3 deg or 9 mm."
    await foundation.alarms.raise_("camera-moved:tank-1", text, level="warning")
    await foundation.alarms.save_waiting()
    monkeypatch.setattr(extra, "find_spec", lambda _: None)  # no picture tells anything else
    async with open_station(tmp_path, world) as again:
        services = again.foundation.services
        assert services.get(CameraRig).rig.cameras == ("tank-2", "tank-3")
        assert services.get(CameraStatuses).of("tank-1").stand.stand == "left_out"
        assert again.foundation.alarms.standing("camera-moved:tank-1", None) is not None
        await services.get(CameraRig).use(services.get(CameraRig).record)
        assert len(services.get(CameraRig).rig.cameras) == 3
