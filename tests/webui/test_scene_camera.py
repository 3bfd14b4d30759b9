"""Where cameras saw the robot, and what they look at, as the scene draws it."""

import numpy as np
import pytest

from autonomy.frames import ned_to_enu
from tests.webui.fake_source import FakeSource
from webui.scene.server import RobotScene
from webui.scene.source import CameraFixView, CameraView

SEEN = CameraFixView((1.2, 0.6, 0.3), (0.3, 0.1), 0.5, "seen by 3 cameras")
LOOKS = CameraView(
    "tank-1",
    (1.0, 0.5, -2.5),
    np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [2.0, 1.0, 0.0], [2.0, 0.0, 0.0]]),
)


@pytest.fixture
def source():
    return FakeSource()


@pytest.fixture
def scene(source):
    scene = RobotScene(source)
    scene.update()
    yield scene
    scene.stop()


def layer(scene, key):
    return next(one for one in scene.state.layers if one.key == key)


def test_a_robot_that_no_camera_saw_has_no_mark(scene):
    assert not layer(scene, "camera_fix").has_content
    assert not layer(scene, "cameras").has_content


def test_the_place_by_cameras_is_beside_the_robots_own_with_its_ellipse(scene, source):
    pose = scene._robot._shown
    source.seen = SEEN
    scene.update()
    assert layer(scene, "camera_fix").has_content
    stage, place = scene._stage, ned_to_enu(np.array(SEEN.position_ned))
    off = stage._nodes["camera_fix/ellipse"].points.reshape(-1, 3) - place
    assert np.hypot(off[:, 0], off[:, 1]).max() == pytest.approx(0.3, abs=0.01)
    cross = stage._nodes["camera_fix/cross"].points.reshape(-1, 3)
    assert cross.mean(axis=0) == pytest.approx(place, abs=1e-6)
    assert stage._labels["camera_fix/name"][0].text == "seen by 3 cameras"
    assert scene._robot._shown == pose
    source.seen = None
    scene.update()
    assert "camera_fix/cross" not in stage._nodes


def test_what_a_camera_looks_at_is_drawn_once_somebody_wants_it(scene, source):
    source.cameras = (LOOKS,)
    scene.update()
    stage = scene._stage
    assert layer(scene, "cameras").has_content
    assert not layer(scene, "cameras").visible
    lines = stage._nodes["cameras/tank-1"].points.reshape(-1, 2, 3)
    assert lines.shape[0] == 8
    assert lines[:4, 0] == pytest.approx(
        np.tile(ned_to_enu(np.array(LOOKS.eye_ned)), (4, 1)), abs=1e-6
    )
    scene.change({"layers": {"cameras": True}})
    assert stage._nodes["cameras/tank-1"].visible
    source.cameras = ()
    scene.update()
    assert "cameras/tank-1" not in stage._nodes
