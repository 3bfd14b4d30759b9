"""Cameras, level and tags adjusted together, and what their fixes claim."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.vision.calibration.adjustment import Adjustment, adjust, averaged
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.fix import Sighting, Telemetry, find_robot
from autonomy.vision.lens import Lens
from autonomy.vision.refraction import underwater_rays
from autonomy.vision.rigid import Pose, turned_by_rad
from autonomy.vision.tag import Layout
from tests.autonomy.vision.tank import (
    LENGTH_M,
    LENS,
    ROBOT,
    WIDTH_M,
    lens_covariance,
    mounted,
    random_pose,
    see,
    see_means,
    true_tank,
)

DEPTHS_M = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.12)
CALIBRATIONS = 8
INSIDE_95 = 7.815
"""Of chi squared with three degrees of freedom."""


@pytest.fixture(scope="module")
def covariance():
    return lens_covariance(LENS)


def adjusted(tank, means, **level):
    return adjust(tank.told_cameras, tank.lens_covariances, tank.told_layout, means, **level)


@pytest.fixture(scope="module")
def tanks(covariance):
    """Return eight tanks, each told wrong in its own way, with its calibration."""
    found = []
    for seed in range(CALIBRATIONS):
        tank = true_tank(seed, covariance)
        calibration = adjusted(tank, see_means(tank, 100 + seed))
        assert isinstance(calibration, Adjustment)
        found.append((tank, calibration))
    return found


def far_points(camera, level_m, index, depth_m):
    """Return where rays all over the picture of a camera meet a depth."""
    pixels = np.stack(np.meshgrid(np.linspace(60, 1220, 9), np.linspace(60, 660, 6)), axis=-1)
    rays = camera.lens.rays(pixels.reshape(-1, 2)) @ camera.pose.rotation.T
    entries, inside = underwater_rays(camera.pose.position_m, rays, level_m, index)
    return entries + inside * ((depth_m - level_m) / inside[:, 2])[:, None]


def test_cameras_are_found_to_millimetres(tanks):
    for tank, calibration in tanks:
        assert calibration.rms < 1.5
        for found, true in zip(calibration.rig.cameras, tank.cameras, strict=True):
            assert np.linalg.norm(found.pose.position_m - true.pose.position_m) <= 0.008
            assert turned_by_rad(found.pose.rotation, true.pose.rotation) <= math.radians(0.15)


def test_a_ray_of_any_camera_meets_any_depth_within_millimetres(tanks):
    off = []
    for tank, calibration in tanks:
        rig = calibration.rig
        for found, true in zip(rig.cameras, tank.cameras, strict=True):
            for depth in (0.05, 0.6, 1.2):
                here = far_points(found, rig.level_m, rig.index, depth)
                there = far_points(true, tank.level_m, tank.index, depth)
                wet = (there[:, 0] > 0.0) & (there[:, 0] < LENGTH_M)
                wet &= (there[:, 1] > 0.0) & (there[:, 1] < WIDTH_M)
                off.extend(np.linalg.norm(here - there, axis=1)[wet])
    assert np.mean(off) <= 0.0015
    assert max(off) <= 0.003


def test_the_joint_covariance_is_honest(tanks):
    surprises = []
    for tank, calibration in tanks:
        rig = calibration.rig
        off = [rig.level_m - tank.level_m]
        stds = [math.sqrt(rig.covariance[-1, -1])]
        for i, (found, true) in enumerate(zip(rig.cameras, tank.cameras, strict=True)):
            off.extend(found.pose.position_m - true.pose.position_m)
            off.append(found.edge_px - true.edge_px)
            variances = np.diag(rig.covariance)[16 * i : 16 * i + 16]
            stds.extend(np.sqrt(variances[[0, 1, 2, 15]]))
        surprises.extend(np.divide(off, stds) ** 2)
    assert 0.4 < np.mean(surprises) < 2.0


def fixes(tank, rig, seed, kind, mount_m=0.0005, mount_deg=0.6, each=8, slope_rad=0.0):
    """Return of many fixes: depth, error below the surface (m), NEES, heading
    and turn (rad), and error in the tank (m)."""
    rng = np.random.default_rng(seed)
    rows = []
    for depth in DEPTHS_M * each:
        pose = random_pose(rng, depth + tank.level_m)
        tags = mounted(ROBOT, rng, mount_m, mount_deg).tags
        seen = see(
            tank.cameras, tags, pose, rng, level_m=tank.level_m, index=tank.index,
            least_side_px=14.0, slope_rad=slope_rad,
        )  # fmt: skip
        telemetry = None
        if kind != "three":
            camera = tank.cameras[int(rng.integers(3))].name
            seen = [s for s in seen if s.camera == camera]
            if len(seen) < 2:
                continue
        if kind == "tag":
            seen = [seen[int(rng.integers(len(seen)))]]
            roll, pitch, _ = pose.angles_rad
            tilt = roll + rng.normal(0.0, 0.035), pitch + rng.normal(0.0, 0.035)
            telemetry = Telemetry.of_tilt(*tilt, depth + rng.normal(0.0, 0.005))
        fix = find_robot(rig, ROBOT.tags, seen, telemetry=telemetry)
        off = fix.position_ned_m - [*pose.position_m[:2], depth]
        heading = fix.pose.angles_rad[2] - pose.angles_rad[2]
        rows.append(
            (
                depth,
                float(np.linalg.norm(off)),
                float(off @ np.linalg.solve(fix.position_covariance, off)),
                abs((heading + np.pi) % (2.0 * np.pi) - np.pi),
                turned_by_rad(fix.pose.rotation, pose.rotation),
                float(np.linalg.norm(fix.pose.position_m - pose.position_m)),
            )
        )
    return np.array(rows)


@pytest.mark.parametrize("kind", ["three", "one", "tag"])
def test_fixes_over_eight_calibrations_claim_what_is_true(tanks, kind):
    rows = np.vstack([fixes(tank, c.rig, 500 + i, kind) for i, (tank, c) in enumerate(tanks)])
    assert len(rows) > 300
    assert 1.0 < rows[:, 2].mean() < 4.5
    assert (rows[:, 2] <= INSIDE_95).mean() >= 0.9
    assert rows[:, 4].max() < math.radians(15.0)  # none turned over
    if kind == "tag":
        assert rows[:, 1].mean() <= 0.008


def test_three_cameras_know_a_robot_to_millimetres_at_every_depth(tanks):
    rows = np.vstack(
        [fixes(t, c.rig, 700 + i, "three", 0.0003, 0.2) for i, (t, c) in enumerate(tanks)]
    )
    for depth in DEPTHS_M:
        off = rows[rows[:, 0] == depth, 5]
        assert off.mean() <= 0.003
        assert np.percentile(off, 95) <= 0.008
    assert np.percentile(rows[:, 3], 95) <= math.radians(0.5)
    assert rows[:, 4].max() < math.radians(3.0)


def test_ripples_that_are_known_are_claimed(tanks):
    slope = math.radians(0.5)
    rows = np.vstack(
        [
            fixes(t, replace(c.rig, ripple_slope_rad=slope), i, "three", each=4, slope_rad=slope)
            for i, (t, c) in enumerate(tanks[:4])
        ]
    )
    assert np.percentile(rows[:, 1], 95) <= 0.020
    assert rows[:, 2].mean() < 4.5
    calm = np.vstack(
        [fixes(t, c.rig, i, "three", each=4, slope_rad=slope) for i, (t, c) in enumerate(tanks[:4])]
    )
    assert calm[:, 2].mean() > 1.5 * rows[:, 2].mean()


def test_a_centimetre_of_level_is_inside_what_is_claimed_when_it_may_be(tanks):
    tank, calibration = tanks[0]
    wrong = calibration.rig.at_level(tank.level_m + 0.01, 0.01)
    rows = fixes(tank, wrong, 1, "three")
    assert (rows[:, 2] <= INSIDE_95).mean() >= 0.9
    sure = calibration.rig.at_level(tank.level_m + 0.01, 0.0005)
    assert fixes(tank, sure, 1, "three")[:, 2].mean() > 9.0


def test_noise_alone_claims_too_little(tanks):
    tank, calibration = tanks[2]
    rng = np.random.default_rng(1)
    seen = see(tank.cameras, ROBOT.tags, random_pose(rng, 0.5), rng)
    fix = find_robot(calibration.rig, ROBOT.tags, seen)
    assert np.trace(fix.noise_covariance[:3, :3]) < 0.1 * np.trace(fix.position_covariance)


def test_exact_telling_gives_exact_cameras(covariance):
    tank = true_tank(
        1, 0.0 * covariance, level_std_m=0.0, index_std=0.0, edge_std_px=0.0, survey_std_m=0.0,
        survey_std_deg=0.0,
    )  # fmt: skip
    means = [
        replace(s, sigma_px=0.03)
        for s in see(tank.cameras, tank.tags, Pose.identity(), np.random.default_rng(0), noise=0.0,
                     edge_share=0.0)
    ]  # fmt: skip
    found = adjusted(tank, means, level_std_m=0.0)
    assert found.rms < 1e-6
    for camera, true in zip(found.rig.cameras, tank.cameras, strict=True):
        assert camera.pose.position_m == pytest.approx(true.pose.position_m, abs=1e-7)
    assert found.rig.covariance[-1, -1] == 0.0


def test_many_pictures_are_averaged_with_their_scatter():
    rng = np.random.default_rng(0)
    corners = np.array([[10.0, 10], [40, 10], [40, 40], [10, 40]])
    calm = [Sighting("a", 100, corners + rng.normal(0, 0.1, (4, 2)), 0.1) for _ in range(50)]
    rough = [Sighting("a", 101, corners + rng.normal(0, 0.5, (4, 2)), 0.1) for _ in range(50)]
    one, other = averaged([*calm, *rough])
    assert one.sigma_px == pytest.approx(math.hypot(0.1 / math.sqrt(50), 0.03), rel=0.1)
    assert other.sigma_px == pytest.approx(math.hypot(0.5 / math.sqrt(50), 0.03), rel=0.1)
    assert np.abs(one.corners_px - corners).max() < 0.1


def refusal(tank, means):
    answer = adjusted(tank, means)
    assert isinstance(answer, Refusal), answer
    return answer.reason


def test_what_cannot_be_calibrated_is_refused_in_words(tanks):
    tank = tanks[0][0]
    means = see_means(tank, 1)
    three = [s for s in means if s.camera != "tank-2" or s.tag_id in {100, 103, 121}]
    assert refusal(tank, three[:0]) == "tank-1 sees 0 fixed tags; 4 are needed"
    assert "tank-2 sees" in refusal(tank, [s for s in three if s.camera != "tank-2"])
    floor = [s for s in means if s.tag_id < 120]
    assert "tank-1 sees fixed tags of one plane alone" in refusal(tank, floor)


def test_swapped_turned_and_mirrored_plates_are_named(tanks):
    tank = tanks[0][0]
    means = see_means(tank, 1)
    names = {102: 105, 105: 102}
    swapped = [replace(s, tag_id=names.get(s.tag_id, s.tag_id)) for s in means]
    assert any(f"tag {i} in tank" in refusal(tank, swapped) for i in (102, 105))
    turned = [
        replace(s, corners_px=np.roll(s.corners_px, 1, axis=0)) if s.tag_id == 104 else s
        for s in means
    ]
    assert "tag 104 in tank-1" in refusal(tank, turned)
    mirrored = [
        replace(s, corners_px=s.corners_px[[1, 0, 3, 2]]) if s.tag_id == 101 else s for s in means
    ]
    assert refusal(tank, mirrored).startswith("tag 101 in tank-1: corners are not convex")


def test_a_plate_that_is_not_where_the_survey_says_is_named(tanks):
    tank = tanks[0][0]
    tags = tank.told_layout.tags
    north, east, down = tags[3].position_m
    moved = (*tags[:3], replace(tags[3], position_m=(north + 0.03, east, down)), *tags[4:])
    wrong = replace(tank, told_layout=Layout(moved))
    assert "tag 103 lies" in refusal(wrong, see_means(tank, 1))
    turned = (*tags[:3], replace(tags[3], heading_deg=tags[3].heading_deg + 5.0), *tags[4:])
    wrong = replace(tank, told_layout=Layout(turned))
    assert "tag 103 is turned by" in refusal(wrong, see_means(tank, 1))


def test_fisheye_cameras_are_adjusted_too():
    lens = Lens("fisheye", 1280, 960, (611.0, 611.0), (635.0, 476.0), (0.02, -0.01, 0.004, -0.001))
    tank = true_tank(4, lens_covariance(lens), lens=lens)
    found = adjusted(tank, see_means(tank, 9))
    assert isinstance(found, Adjustment)
    for camera, true in zip(found.rig.cameras, tank.cameras, strict=True):
        assert np.linalg.norm(camera.pose.position_m - true.pose.position_m) <= 0.008
        assert camera.lens.parameters[8] == 0.0
    rows = fixes(tank, found.rig, 5, "three", each=4)
    assert np.median(rows[:, 5]) <= 0.004  # small tags are missed by all cameras but one
    assert (rows[:, 2] <= INSIDE_95).mean() >= 0.9
