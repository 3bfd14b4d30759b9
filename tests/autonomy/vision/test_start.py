"""Both poses of a square, and where it is behind the surface."""

import numpy as np
import pytest

from autonomy.vision.camera import Camera
from autonomy.vision.refraction import FlatPort
from autonomy.vision.rigid import Pose, rotation_of, turned_by_rad
from autonomy.vision.sight import corners_seen
from autonomy.vision.start import both_poses, tag_poses
from autonomy.vision.tag import CORNERS
from tests.autonomy.vision.tank import LENS, looking, overhead_cameras


def squares(n=200, seed=4):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        axis = rng.normal(size=2)
        tilt = np.append(axis / np.linalg.norm(axis), 0.0) * rng.uniform(0.02, 1.2)
        turn = rotation_of(np.array([0.0, 0.0, rng.uniform(-3.0, 3.0)]))
        place = np.append(rng.uniform(-1.0, 1.0, 2), rng.uniform(1.5, 3.5))
        yield Pose(rotation_of(tilt) @ turn, place), rng.uniform(0.05, 0.3)


def test_one_of_both_poses_is_the_true_one_where_corners_are_exact():
    drawn = list(squares())
    points = np.array([pose.of_points(size * CORNERS) for pose, size in drawn])
    rotations, places = both_poses(
        points[..., :2] / points[..., 2:], np.array([s for _, s in drawn])
    )
    for (pose, _), two, there in zip(drawn, rotations, places, strict=True):
        off = [turned_by_rad(pose.rotation, rotation) for rotation in two]
        best = int(np.argmin(off))
        assert off[best] < 1e-6
        assert there[best] == pytest.approx(pose.position_m, abs=1e-6)
        for rotation in two:
            assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-9)
            assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_the_other_pose_shows_a_small_square_almost_alike():
    pose = Pose(rotation_of(np.array([0.3, 0.2, 0.0])), np.array([0.2, -0.1, 3.0]))
    points = pose.of_points(0.05 * CORNERS)
    slopes = points[:, :2] / points[:, 2:]
    rotations, places = both_poses(slopes[None], np.array([0.05]))
    for rotation, place in zip(rotations[0], places[0], strict=True):
        again = Pose(rotation, place).of_points(0.05 * CORNERS)
        assert again[:, :2] / again[:, 2:] == pytest.approx(slopes, abs=1e-4)
    assert turned_by_rad(rotations[0, 0], rotations[0, 1]) > 0.3


def test_a_tag_under_water_is_put_to_its_depth():
    camera = overhead_cameras()[0]
    tag = Pose.of_angles([1.6, 1.2, 0.9], 0.1, -0.2, 0.4)
    corners = corners_seen(camera, tag.of_points(0.15 * CORNERS), 0.0, 1.333)
    one = np.zeros(1, dtype=np.int64)
    _, places = tag_poses((camera,), one, corners[None], np.array([0.15]), 0.0, 1.333)
    assert np.abs(places[0] - tag.position_m).max() < 0.04
    _, shallow = tag_poses((camera,), one, corners[None], np.array([0.15]), None, 1.333)
    assert shallow[0, 0, 2] < 0.75


def test_a_tag_before_a_camera_under_water_is_found_behind_the_port():
    camera = Camera("own", LENS, looking((1.0, 1.0, 0.5), (1.8, 1.1, 0.9)), port=FlatPort())
    tag = camera.pose @ Pose(rotation_of(np.array([0.3, 0.2, 0.5])), np.array([0.2, -0.1, 1.5]))
    corners = corners_seen(camera, tag.of_points(0.15 * CORNERS), 0.0, 1.333)
    one = np.zeros(1, dtype=np.int64)
    turns, places = tag_poses((camera,), one, corners[None], np.array([0.15]), 0.0, 1.333)
    assert np.linalg.norm(places[0] - tag.position_m, axis=1).min() < 0.05
    assert min(turned_by_rad(turn, tag.rotation) for turn in turns[0]) < 0.05


def test_corners_without_rays_or_on_a_line_give_no_pose():
    camera = overhead_cameras()[0]
    one = np.zeros(1, dtype=np.int64)
    nowhere = np.full((1, 4, 2), np.nan)
    turns, places = tag_poses((camera,), one, nowhere, np.array([0.15]), 0.0, 1.333)
    assert np.isnan(turns).all()
    assert np.isnan(places).all()
