"""Rotations and poses."""

import numpy as np
import pytest

from autonomy.vision.rigid import (
    Pose,
    fitted,
    nearest_rotation,
    rotation_of,
    skew,
    turn_of,
    turned_by_rad,
)


def test_a_turn_and_its_rotation_are_the_same():
    rng = np.random.default_rng(0)
    for length in (0.0, 1e-9, 1e-3, 1.0, 3.0, np.pi - 1e-3):
        axis = rng.normal(size=3)
        turn = length * axis / np.linalg.norm(axis)
        rotation = rotation_of(turn)
        assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
        assert turn_of(rotation) == pytest.approx(turn, abs=1e-6)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -1, 0), (0.6, -0.8, 0), (0.48, 0.6, -0.64)])
def test_half_a_turn_keeps_its_axis(axis):
    found = turn_of(rotation_of(np.pi * np.array(axis)))
    assert abs(found @ np.array(axis)) == pytest.approx(np.pi)


def test_poses_go_there_and_back():
    pose = Pose.of_angles([1.0, 2.0, 3.0], 0.1, -0.4, 2.5)
    assert pose.angles_rad == pytest.approx((0.1, -0.4, 2.5))
    points = np.random.default_rng(1).normal(size=(5, 3))
    assert (pose.inverse @ pose).of_points(points) == pytest.approx(points)
    assert Pose.identity().of_points(points) == pytest.approx(points)
    moved = pose.moved(np.array([0.1, 0.0, 0.0]), np.array([0.0, 0.0, 0.2]))
    assert turned_by_rad(pose.rotation, moved.rotation) == pytest.approx(0.2)
    assert skew(points[0]) @ points[1] == pytest.approx(np.cross(points[0], points[1]))


def test_a_pose_is_found_from_points_and_their_places():
    pose = Pose.of_angles([1.0, 2.0, 3.0], 0.1, -0.4, 2.5)
    points = np.random.default_rng(1).normal(size=(4, 3))
    points[:, 2] = 0.0
    found = fitted(points, pose.of_points(points))
    assert found.rotation == pytest.approx(pose.rotation)
    assert found.position_m == pytest.approx(pose.position_m)
    mirrored = nearest_rotation(np.diag([1.0, 1.0, -1.0]))
    assert np.linalg.det(mirrored) == pytest.approx(1.0)
