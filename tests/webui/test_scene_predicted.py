"""Where a robot that is not heard should be, as the scene draws it."""

import numpy as np
import pytest

from autonomy.frames import ned_to_enu
from tests.webui.fake_source import FakeSource
from webui.scene.server import RobotScene
from webui.scene.source import PredictedView

SILENT = PredictedView(
    position_ned=(1.2, 0.6, 0.3),
    ellipse_m=(0.3, 0.1),
    ellipse_rad=0.5,
    way_ned=np.array([[1.0, 0.5, 0.0], [1.1, 0.5, 0.2], [1.2, 0.6, 0.3]]),
    label="predicted; last heard 08:12:05Z",
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


def layer(scene):
    return next(one for one in scene.state.layers if one.key == "predicted")


def test_nothing_is_predicted_of_a_robot_that_is_heard(scene):
    assert not layer(scene).has_content
    assert "predicted/way" not in scene._stage._nodes


def test_silent_robot_has_its_way_its_ellipse_and_a_label_of_their_own(scene, source):
    pose = scene._robot._shown
    source.silent = SILENT
    scene.update()
    assert layer(scene).has_content
    stage = scene._stage
    ellipse = stage._nodes["predicted/ellipse"].points.reshape(-1, 3)
    off = ellipse - ned_to_enu(np.array(SILENT.position_ned))
    reach = np.hypot(off[:, 0], off[:, 1])
    assert reach.max() == pytest.approx(0.3, abs=0.01)
    assert reach.min() == pytest.approx(0.1, abs=0.01)
    east, north = off[reach.argmax(), :2]
    assert abs(np.arctan2(east, north) % np.pi - 0.5) < 0.1
    label, _ = stage._labels["predicted/name"]
    assert label.text == SILENT.label
    assert scene._robot._shown == pose, "what the robot said stays where it said it"
    source.silent = None
    scene.update()
    assert not layer(scene).has_content
    assert "predicted/name" not in stage._labels


def test_predicted_place_can_be_hidden(scene, source):
    source.silent = SILENT
    scene.update()
    scene._predicted.show(False)
    assert not scene._stage._nodes["predicted/ellipse"].visible
    source.silent = PredictedView(
        SILENT.position_ned, (0.4, 0.2), 0.5, SILENT.way_ned, SILENT.label
    )
    scene.update()
    assert not scene._stage._nodes["predicted/ellipse"].visible
