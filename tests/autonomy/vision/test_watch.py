"""Bumped cameras, the water's level, ripples, and accuracy on the spot."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.vision.calibration.accuracy import accuracy_on_the_spot
from autonomy.vision.calibration.adjustment import Adjustment, adjust, averaged
from autonomy.vision.calibration.readjustment import readjusted
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.calibration.watch import camera_stands
from autonomy.vision.calibration.water_level import fit_level, ripple_slope_rad
from autonomy.vision.fix import find_robot
from autonomy.vision.rigid import Pose, rotation_of, turned_by_rad
from tests.autonomy.vision.tank import (
    LENS,
    ROBOT,
    lens_covariance,
    see,
    see_means,
    true_tank,
)


@pytest.fixture(scope="module")
def tank():
    return true_tank(3, lens_covariance(LENS))


@pytest.fixture(scope="module")
def means(tank):
    return see_means(tank, 5)


@pytest.fixture(scope="module")
def calibration(tank, means):
    found = adjust(tank.told_cameras, tank.lens_covariances, tank.told_layout, means)
    assert isinstance(found, Adjustment)
    return found


def pictures(tank, count, seed=0, cameras=None, **changes):
    """Return what single pictures of the fixed tags show, with one edge error for all."""
    rng = np.random.default_rng(seed)
    water = {"level_m": tank.level_m, "index": tank.index, **changes}
    cameras = tank.cameras if cameras is None else cameras
    shots = [
        see(cameras, tank.tags, Pose.identity(), rng, edge_share=0.0, **water) for _ in range(count)
    ]
    return [sighting for shot in shots for sighting in shot]


@pytest.mark.parametrize(
    ("change", "outcome"), [(0.002, "applied"), (0.01, "told"), (-0.02, "told"), (0.05, "alarm")]
)
def test_a_level_that_changed_is_found_within_two_millimetres(tank, calibration, change, outcome):
    seen = averaged(pictures(tank, 10, level_m=tank.level_m + change))
    found = fit_level(calibration.rig, calibration.layout, seen)
    assert found.change_m == pytest.approx(change, abs=0.002)
    assert found.level_m == pytest.approx(calibration.rig.level_m + change, abs=0.002)
    assert found.outcome == outcome
    assert ("fell" if change > 0.0 else "rose") in found.sentence
    assert found.std_m < 0.002
    assert set(found.by_camera_m) == {"tank-1", "tank-2", "tank-3"}


def test_cameras_that_disagree_on_the_level_are_an_alarm(tank, calibration):
    pose = tank.cameras[0].pose
    bumped = replace(
        tank.cameras[0], pose=Pose(pose.rotation, pose.position_m + np.array([0.0, 0.0, 0.03]))
    )
    seen = averaged(pictures(tank, 10, cameras=(bumped, *tank.cameras[1:])))
    found = fit_level(calibration.rig, calibration.layout, seen)
    assert found.outcome == "alarm"
    assert "disagree" in found.sentence


def test_without_tags_under_water_there_is_no_level(tank, calibration):
    dry = [s for s in pictures(tank, 1) if s.tag_id >= 120]
    assert isinstance(fit_level(calibration.rig, calibration.layout, dry), Refusal)
    assert ripple_slope_rad(calibration.rig, calibration.layout, dry) is None
    few = pictures(tank, 3)
    assert ripple_slope_rad(calibration.rig, calibration.layout, few) is None


@pytest.mark.parametrize("slope_deg", [0.0, 0.25, 0.5])
def test_ripples_are_told_by_scatter(tank, calibration, slope_deg):
    seen = pictures(tank, 30, slope_rad=math.radians(slope_deg))
    found = ripple_slope_rad(calibration.rig, calibration.layout, seen)
    assert math.degrees(found) == pytest.approx(slope_deg, rel=0.1, abs=0.03)


def test_a_new_level_keeps_what_goes_together(calibration):
    rig = calibration.rig.at_new_level(0.02, 0.001)
    assert rig.level_m == 0.02
    assert rig.covariance[-1, -1] == pytest.approx(calibration.rig.covariance[-1, -1] + 1e-6)
    assert rig.covariance[-1, :-1] == pytest.approx(calibration.rig.covariance[-1, :-1])


def bumped(tank, turn_deg=0.0, move_m=0.0):
    camera = tank.cameras[1]
    turn = rotation_of(np.array([math.radians(turn_deg), 0.0, 0.0]))
    pose = Pose(camera.pose.rotation @ turn, camera.pose.position_m + np.array([move_m, 0.0, 0.0]))
    return (tank.cameras[0], replace(camera, pose=pose), tank.cameras[2])


@pytest.mark.parametrize(
    ("bump", "stand"),
    [
        ({"turn_deg": 0.1}, "moved"),
        ({"move_m": 0.005}, "moved"),
        ({"turn_deg": 0.25}, "left_out"),
    ],
)
def test_a_bumped_camera_is_noticed_within_seconds(tank, calibration, bump, stand):
    seen = pictures(tank, 15, cameras=bumped(tank, **bump))
    stands = camera_stands(calibration.rig, calibration.layout, seen)
    assert [found.stand for found in stands] == ["holds", stand, "holds"]
    assert stands[1].sentence.startswith("tank-2 has moved, by about 0.")
    if "turn_deg" in bump:
        assert stands[1].turned_deg == pytest.approx(bump["turn_deg"], rel=0.25)
    else:
        assert stands[1].moved_m == pytest.approx(bump["move_m"], rel=0.35)
    assert stands[0].sentence == ""


@pytest.mark.parametrize("slope_deg", [0.0, 0.25])
def test_cameras_that_were_not_bumped_are_left_alone(tank, calibration, slope_deg):
    for seed in range(12):
        seen = pictures(tank, 12, seed, slope_rad=math.radians(slope_deg))
        stands = camera_stands(calibration.rig, calibration.layout, seen)
        assert max(found.shift_px for found in stands) < 0.45


def test_a_bumped_camera_is_adjusted_again_alone(tank, calibration):
    surprises = []
    for seed in range(5):
        cameras = bumped(tank, turn_deg=0.8, move_m=0.02)
        seen = averaged(pictures(tank, 20, seed, cameras=cameras))
        rig = readjusted(calibration.rig, calibration.layout, "tank-2", seen)
        off = rig.cameras[1].pose.position_m - cameras[1].pose.position_m
        assert np.linalg.norm(off) < 0.008
        assert turned_by_rad(rig.cameras[1].pose.rotation, cameras[1].pose.rotation) < 0.002
        surprises.append(off**2 / np.diag(rig.covariance)[16:19])
        assert rig.covariance[:16, :16] == pytest.approx(calibration.rig.covariance[:16, :16])
        stands = camera_stands(rig, calibration.layout, pictures(tank, 5, seed, cameras=cameras))
        assert [found.stand for found in stands] == ["holds"] * 3
    assert np.mean(surprises) < 3.0
    stds = [np.sqrt(np.diag(one.covariance)[16:19]) for one in (rig, calibration.rig)]
    assert (stds[0] > 0.5 * stds[1]).all()
    assert (stds[0] < 2.0 * stds[1]).all()


def test_a_camera_that_cannot_be_adjusted_again_stays(tank, calibration):
    seen = pictures(tank, 1)
    few = [s for s in seen if s.camera != "tank-2" or s.tag_id < 103]
    answer = readjusted(calibration.rig, calibration.layout, "tank-2", few)
    assert isinstance(answer, Refusal)
    assert "tank-2 sees 3 fixed tags" in answer.reason
    with pytest.raises(ValueError, match="no camera tank-9"):
        readjusted(calibration.rig, calibration.layout, "tank-9", seen)


def test_a_camera_that_sees_too_few_tags_is_unknown(tank, calibration):
    seen = [s for s in pictures(tank, 2) if s.camera != "tank-3" or s.tag_id == 108]
    stands = camera_stands(calibration.rig, calibration.layout, seen)
    assert stands[2].stand == "unknown"
    assert "nobody knows" in stands[2].sentence


def test_accuracy_is_measured_by_leaving_tags_out(tank, means):
    known = (tank.told_cameras, tank.lens_covariances, tank.told_layout)
    found = accuracy_on_the_spot(*known, means)
    assert len(found.planes) == 2
    rim, floor = found.planes
    assert rim.depth_m == pytest.approx(-0.15)
    assert floor.depth_m == pytest.approx(1.2)
    assert floor.tags == 12
    for plane in found.planes:
        assert plane.mean_m < 0.008
        assert plane.mean_m <= plane.p95_m <= plane.worst_m < 0.02
        assert 0.4 < plane.mean_m / plane.claimed_std_m < 2.0
    assert sum(plane.tags for plane in found.planes) == len(found.tags)


def test_tags_that_cannot_be_judged_are_named(tank, means):
    one = [s for s in means if not (s.tag_id == 104 and s.camera != "tank-1")]
    known = (tank.told_cameras, tank.lens_covariances, tank.told_layout)
    found = accuracy_on_the_spot(*known, one)
    assert "tag 104: one camera alone sees it" in found.left_out
    poor = [s for s in means if s.tag_id in {100, 101, 120, 122}]
    assert any("without it" in words for words in accuracy_on_the_spot(*known, poor).left_out)


def test_an_unnoticed_bump_is_noticed_by_the_fixes(tank, calibration):
    pose = Pose.of_angles([2.3, 1.5, 0.5], 0.0, 0.2, 0.7)
    rng = np.random.default_rng(0)
    water = {"level_m": tank.level_m, "index": tank.index}
    calm = find_robot(
        calibration.rig, ROBOT.tags, see(tank.cameras, ROBOT.tags, pose, rng, **water)
    )
    seen = see(bumped(tank, turn_deg=0.25), ROBOT.tags, pose, rng, **water)
    assert find_robot(calibration.rig, ROBOT.tags, seen).rms > 2.5 * calm.rms
