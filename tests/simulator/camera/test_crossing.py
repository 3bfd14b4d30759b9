"""Two robots that cross are never taken for each other, from drawn pictures on."""

import numpy as np
import pytest

pytest.importorskip("cv2", reason="the extra camera is not installed")

from autonomy.vision.rigid import Pose
from autonomy.vision.tag import Registry
from simulator.camera.laboratory import told_bundles, told_layout, true_scene
from simulator.camera.scene import Motion
from tests.simulator.camera.eyes import PERIOD_S, Eyes, rig_of_truth

ROBOTS = ("mini-1", "mini-2")
SPEED_M_S, SECONDS = 0.3, 6.0
REGISTRY = Registry(told_layout(), told_bundles(ROBOTS))


def crossing(time_s: float, middle_m: np.ndarray) -> dict[str, Motion]:
    """Return two robots that meet in the middle, one 25 cm below the other."""
    way = SPEED_M_S * (time_s - 0.5 * SECONDS)
    motions = {}
    for robot, heading, depth in zip(ROBOTS, (0.4, np.pi - 0.2), (0.15, 0.40), strict=True):
        ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
        place = middle_m + way * ahead + [0.0, 0.0, depth]
        pose = Pose.of_angles(place, 0.0, -0.2, heading)
        motions[robot] = Motion(pose, SPEED_M_S * ahead)
    return motions


def test_two_robots_that_cross_are_never_swapped():
    scene = true_scene(ROBOTS, seed=3)
    box = scene.water
    middle = np.array([0.5 * (box.x_min_m + box.x_max_m), 0.5 * (box.y_min_m + box.y_max_m), 0.0])
    eyes = Eyes(scene, rig_of_truth(scene), REGISTRY)
    found = dict.fromkeys(ROBOTS, 0)
    moments = np.arange(0.0, SECONDS, PERIOD_S)
    for time_s in moments:
        motions = crossing(time_s, middle)
        answer = eyes.look(time_s, motions)
        assert not eyes.strangers
        for one in answer.found:
            if one.fix is None or one.verdict.quality == "refused":
                continue
            truth = motions[one.robot].pose
            off_m = float(np.linalg.norm(one.fix.pose.position_m - truth.position_m))
            turned = float(one.fix.pose.angles_rad[2] - truth.angles_rad[2])
            assert off_m < 0.05, (one.robot, time_s)
            assert abs(np.angle(np.exp(1j * turned))) < np.radians(10.0), (one.robot, time_s)
            found[one.robot] += 1
    assert found["mini-1"] > 0.9 * len(moments)  # the upper one, which nothing hides
    assert found["mini-2"] > 0.5 * len(moments)


def test_plates_of_a_robot_that_is_not_there_are_strangers():
    scene = true_scene(ROBOTS, seed=4)
    box = scene.water
    middle = np.array([0.5 * (box.x_min_m + box.x_max_m), 0.5 * (box.y_min_m + box.y_max_m), 0.0])
    alone = Registry(told_layout(), REGISTRY.bundles[:1])
    theirs = {tag.id for tag in REGISTRY.bundles[1].tags}
    eyes = Eyes(scene, rig_of_truth(scene), alone)
    answer = eyes.look(0.0, crossing(0.0, middle))
    assert eyes.strangers
    assert eyes.strangers <= theirs
    assert {one.robot for one in answer.found} == {"mini-1"}
