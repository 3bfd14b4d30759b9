"""A station whose cameras are calibrated, and pictures that are drawn for it."""

import asyncio
from dataclasses import asdict
from datetime import timedelta

import numpy as np

from autonomy.vision.camera import Rig
from autonomy.vision.constants import CAMERA_ERRORS
from autonomy.vision.tag import Bundle
from db.query.camera.calibrations import add_calibration
from robot_link.camera.sighting import Sighting, TagSeen
from server.camera.calibrations import Calibrations
from server.camera.cameras import Cameras
from server.camera.event import PictureSeen
from server.camera.rig import origin_of
from server.camera.vision import rig_document
from tests.autonomy.vision.tank import ROBOT, overhead_cameras, see, tank_layout
from tests.autonomy.vision.test_tracker import dive
from tests.server.conftest import until

LINK = "cameras:///?tags=mini-1"
PERIOD_S = 0.2
CAMERAS = overhead_cameras()


async def calibrate(foundation, client, bundles=(ROBOT,)):
    """Add the three cameras of the tank and all tags, calibrated but for 1 mm."""
    cameras = foundation.services.get(Cameras)
    for camera in CAMERAS:
        uri = f"http://127.0.0.1:9/camera/{camera.name}"
        await client.post("/api/cameras", json={"id": camera.name, "uri": uri})
    keys = {record.id: record.key for record in cameras.records}
    size = CAMERA_ERRORS * len(CAMERAS) + 1
    errors = np.zeros(size)
    errors[:-1].reshape(len(CAMERAS), CAMERA_ERRORS)[:, :3] = 1e-6
    errors[-1] = 1e-6
    record = await foundation.store.write(
        lambda session: add_calibration(
            session,
            "rig",
            result=rig_document(Rig(CAMERAS), keys, tank_layout(), 1.0, {}),
            covariance=np.diag(errors),
            inputs={"origins": {record.id: origin_of(record) for record in cameras.records}},
            at=foundation.clock.now(),
            by="ann",
        )
    )
    await foundation.services.get(Calibrations).take(record, None, by="ann")
    await put_tags(client, bundles)


async def put_tags(client, bundles):
    body = {
        "layout": {"tags": [_told(tag) for tag in tank_layout().tags]},
        "bundles": [
            {"robot": bundle.robot, "tags": [_told(tag) for tag in bundle.tags]}
            for bundle in bundles
        ],
    }
    answer = await client.put("/api/tags", json=body)
    assert answer.status_code == 200, answer.text


async def give_link(client, robot="mini-1", links=("xbee://127.0.0.1:9", LINK)):
    answer = await client.patch(f"/api/robots/{robot}", json={"links": list(links)})
    assert answer.status_code == 200, answer.text


class Cameraman:
    """Draws what the cameras see, and tells it as their processes would."""

    def __init__(self, foundation, seed=0):
        self._foundation = foundation
        self._rng = np.random.default_rng(seed)
        self._frame = 0
        self.truth = {}
        """Where the robots really were, by the moment of the set."""

    def shoot(self, *robots, at=None, cameras=CAMERAS):
        """Tell one set of pictures of robots as ``(tags, pose)``; return its moment."""
        at = at or self._foundation.clock.now()
        self._frame += 1
        for i, camera in enumerate(cameras):
            taken_at = at + timedelta(milliseconds=i)
            tags = [
                TagSeen(
                    id=seen.tag_id,
                    corners_px=tuple(map(tuple, seen.corners_px.tolist())),
                    sigma_px=seen.sigma_px,
                    margin=60.0,
                    hamming=0,
                    blur_px=0.8,
                )
                for of, pose in robots
                for seen in see((camera,), of, pose, self._rng, least_side_px=14.0)
            ]
            sighting = Sighting(
                camera=camera.name,
                frame=self._frame,
                taken_at=taken_at,
                arrived_at=taken_at,
                size=(camera.lens.width_px, camera.lens.height_px),
                sought="whole",
                tags=tags,
            )
            self._foundation.bus.publish(PictureSeen(camera.name, sighting, taken_at))
        return at

    async def film(self, count, tags=ROBOT.tags, path=dive):
        """Tell sets of pictures of one robot, one after another in real time."""
        for i in range(count):
            self.shoot((tags, path(PERIOD_S * i)))
            await asyncio.sleep(PERIOD_S)

    async def until_found(self, tags, pose, is_found, timeout_s=120.0):
        """Tell sets of pictures of a robot that lies still until something is so."""

        async def look():
            found = is_found()
            if asyncio.iscoroutine(found):
                found = await found
            if not found:
                self.shoot((tags, pose))
                await asyncio.sleep(0.1)
            return found

        return await until(look, timeout_s)


def _told(tag):
    return {name: value for name, value in asdict(tag).items() if value is not None}


OTHER = Bundle(
    "grace-1", tuple(type(tag)(**{**asdict(tag), "id": tag.id + 3}) for tag in ROBOT.tags)
)
