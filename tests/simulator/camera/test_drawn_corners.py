"""Pictures against the projection that the station uses: where the corners of plates are drawn."""

from dataclasses import replace

import numpy as np
import pytest

from autonomy.vision.corner import fit_corners, light_of_grey
from autonomy.vision.rigid import Pose
from autonomy.vision.sight import corners_seen
from autonomy.vision.tag import Bundle, Tag
from simulator.camera.laboratory import true_scene
from simulator.camera.painter import Painter
from simulator.camera.scene import Lighting, Motion, Scene, Sensor

pytest.importorskip("cv2", reason="the extra camera is not installed")

QUIET = Sensor(blur_px=0.4, shot_variance=0.0, read_std=0.0)
"""So sharp that the line fit's own bias is small, which grows with the blur in cells."""
PLAIN = Lighting(caustics_std=0.0, glare=0.0)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return replace(true_scene(["mini-1"], seed=3), sensor=QUIET, lighting=PLAIN)


@pytest.fixture(scope="module")
def large(scene) -> Scene:
    """The robot's upper plate is as large as those of the tank, for the line fit's sake."""
    return replace(scene, bundles=(Bundle("mini-1", (Tag(0, 0.15, (0.02, 0.0, -0.085)),)),))


def expected(scene, camera, tag, carrier):
    corners = carrier.of_points(tag.corners_m)
    return corners_seen(camera, corners, scene.level_m, scene.index)


def drawn_pose(rng, depth_m):
    place = [rng.uniform(0.2, 2.5), rng.uniform(0.0, 1.4), depth_m]
    roll, pitch = np.radians(rng.uniform(-15.0, 15.0, 2)).tolist()
    return Pose.of_angles(place, roll, pitch, float(rng.uniform(-np.pi, np.pi)))


def errors_px(painter, picture, tag, carrier):
    """Distances of the fitted corners from where they should be; none where not seen whole."""
    scene, camera = painter.scene, painter.camera
    truth = expected(scene, camera, tag, carrier)
    if not np.isfinite(truth).all() or not camera.lens.shows(truth, 8.0).all():
        return None
    if np.linalg.norm(truth[1:] - truth[:-1], axis=1).min() < 16.0:
        return None
    fit = fit_corners(picture, truth, light_of_grey(scene.sensor.gamma))
    assert fit.is_fitted
    return np.linalg.norm(fit.corners_px - truth, axis=1)


def robot_errors_px(painter, pose, turn=Motion):
    picture = painter.picture(0.0, {"mini-1": turn(pose)})
    tags = painter.scene.bundles[0].tags
    found = [errors_px(painter, picture, tag, pose) for tag in tags[:1]]
    return [one for one in found if one is not None]


@pytest.mark.parametrize("depth_m", [-0.1, 0.2, 0.45, 0.7, 1.05])
def test_corners_are_drawn_where_the_projection_has_them(large, depth_m):
    rng = np.random.default_rng(round(1000 * (1.0 + depth_m)))
    errors = []
    for camera in large.cameras:
        painter = Painter(large, camera)
        for _ in range(12):
            errors += robot_errors_px(painter, drawn_pose(rng, depth_m))
    errors = np.concatenate(errors)
    assert len(errors) >= 40
    assert np.median(errors) < 0.04
    assert np.quantile(errors, 0.98) < 0.15
    assert errors.max() < 0.20


def test_fixed_tags_are_drawn_where_the_projection_has_them(scene):
    for camera in scene.cameras:
        painter = Painter(scene, camera)
        picture = painter.picture(0.0)
        found = [errors_px(painter, picture, tag, Pose.identity()) for tag in scene.layout.tags]
        errors = [one for one in found if one is not None]
        assert len(errors) >= 8
        assert np.concatenate(errors).max() < 0.15


def test_noise_caustics_and_jpeg_leave_corners_within_a_quarter_of_a_pixel(scene):
    import cv2

    rng = np.random.default_rng(8)
    usual = replace(scene, sensor=Sensor(), lighting=Lighting())
    painter = Painter(usual, usual.cameras[1])
    errors = []
    for _ in range(20):
        pose = drawn_pose(rng, float(rng.uniform(0.1, 1.0)))
        jpeg = painter.jpeg(painter.picture(rng.uniform(0.0, 9.0), {"mini-1": Motion(pose)}))
        picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
        one = errors_px(painter, picture, usual.bundles[0].tags[0], pose)
        if one is not None:
            errors.append(one)
    errors = np.concatenate(errors)
    assert len(errors) >= 40
    assert np.sqrt((errors**2).mean()) < 0.25


def test_a_moving_plate_is_drawn_where_it_is_in_the_middle_of_the_exposure(large):
    slow = replace(large, sensor=replace(QUIET, exposure_s=0.03))
    painter = Painter(slow, slow.cameras[1])
    pose = Pose.of_angles([1.4, 0.7, 0.3], 0.0, 0.1, 0.7)
    moving = Motion(pose, np.array([0.3, -0.1, 0.0]), np.array([0.0, 0.0, 0.4]))
    (errors,) = robot_errors_px(painter, pose, lambda _: moving)
    assert errors.max() < 0.15
    rest, still, blurred = (
        painter.picture(0.0, robots).astype(float)
        for robots in ({}, {"mini-1": Motion(pose)}, {"mini-1": moving})
    )
    edges = [(np.diff(one, axis=1) ** 2).sum() for one in (rest, still, blurred)]
    assert edges[0] < edges[2] < edges[0] + 0.75 * (edges[1] - edges[0])


def test_every_camera_sees_four_fixed_tags_on_two_planes_and_all_see_shared_ones():
    for seed in range(20):
        scene = true_scene([], seed=seed)
        seen = []
        for camera in scene.cameras:
            corners = {tag.id: expected(scene, camera, tag, Pose.identity())
                       for tag in scene.layout.tags}  # fmt: skip
            seen.append({i for i, px in corners.items() if camera.lens.shows(px, 10.0).all()})
        for ids in seen:
            assert sum(i >= 120 for i in ids) >= 2
            assert sum(i < 120 for i in ids) >= 4
        assert len(set.intersection(*seen)) >= 4
