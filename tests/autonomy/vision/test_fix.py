"""Fixes of robots and cameras from corners drawn with stated noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.vision.camera import Camera, Rig
from autonomy.vision.fix import (
    Fix,
    NoFix,
    Sighting,
    Telemetry,
    find_camera,
    find_robot,
    sighting_fault,
)
from autonomy.vision.lens import Lens
from autonomy.vision.quality import Expectation, Water, judge
from autonomy.vision.reference.pose import robot_pose
from autonomy.vision.refraction import FlatPort
from autonomy.vision.rigid import Pose, rotation_of, turned_by_rad
from autonomy.vision.tag import Tag
from tests.autonomy.vision.tank import (
    DEPTH_M,
    LENGTH_M,
    ROBOT,
    WIDTH_M,
    looking,
    mounted,
    overhead_cameras,
    random_pose,
    see,
)

CAMERAS = overhead_cameras()
RIG = Rig(CAMERAS)
POSE = Pose.of_angles([2.1, 1.4, 0.5], 0.1, -0.3, 2.0)
WATER = Water((0.0, LENGTH_M), (0.0, WIDTH_M), DEPTH_M)


def exact(cameras=CAMERAS, pose=POSE, tags=ROBOT.tags, **water):
    rng = np.random.default_rng(0)
    return see(cameras, tags, pose, rng, noise=0.0, edge_share=0.0, **water)


def noisy(seed=0, cameras=CAMERAS, pose=POSE, **water):
    return see(cameras, ROBOT.tags, pose, np.random.default_rng(seed), **water)


def test_exact_corners_give_the_exact_pose_from_nothing():
    rng = np.random.default_rng(7)
    for depth in (-0.02, 0.05, 0.4, 0.8, 1.12):
        for _ in range(8):
            pose = random_pose(rng, depth)
            fix = find_robot(RIG, ROBOT.tags, exact(pose=pose))
            assert np.linalg.norm(fix.pose.position_m - pose.position_m) < 1e-6
            assert turned_by_rad(fix.pose.rotation, pose.rotation) < 1e-5
            assert fix.rms < 1e-3


def test_a_robot_that_points_north_nose_down_to_starboard_of_the_middle_says_so():
    pose = Pose.of_angles([2.3, 1.9, 0.3], 0.0, math.radians(-20.0), 0.0)
    fix = find_robot(RIG, ROBOT.tags, noisy(pose=pose))
    roll, pitch, heading = np.degrees(fix.pose.angles_rad)
    assert (roll, pitch, heading) == pytest.approx((0.0, -20.0, 0.0), abs=1.5)
    assert fix.position_ned_m == pytest.approx([2.3, 1.9, 0.3], abs=0.005)


@pytest.mark.parametrize(
    ("telemetry", "outlier_px"), [(None, 0.0), (Telemetry.of_tilt(0.12, -0.28, 0.51), 5.0)]
)
def test_kernel_does_what_the_readable_search_does(telemetry, outlier_px):
    sightings = noisy(3)
    wrong = sightings[1].corners_px.copy()
    wrong[0, 0] += outlier_px
    sightings[1] = replace(sightings[1], corners_px=wrong)
    rig = Rig(tuple(replace(camera, edge_px=0.1) for camera in CAMERAS), level_m=0.01)
    start = POSE.moved(np.full(3, 0.02), np.full(3, 0.05))
    wanted, covariance = robot_pose(rig, ROBOT.tags, sightings, start, telemetry)
    fix = find_robot(rig, ROBOT.tags, sightings, telemetry=telemetry)
    assert fix.pose.position_m == pytest.approx(wanted.position_m, abs=1e-6)
    assert turned_by_rad(fix.pose.rotation, wanted.rotation) < 1e-5
    if outlier_px == 0.0:
        size = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
        assert fix.noise_covariance / size == pytest.approx(covariance / size, abs=0.02)


def test_depth_is_told_below_the_real_surface():
    rig = replace(RIG, level_m=-0.05)
    fix = find_robot(rig, ROBOT.tags, exact(level_m=-0.05))
    assert fix.depth_m == pytest.approx(0.55, abs=1e-6)
    assert fix.position_ned_m[2] == pytest.approx(0.55, abs=1e-6)


def test_a_guess_gives_the_same_fix_as_none():
    sightings = noisy()
    guess = POSE.moved(np.array([0.05, -0.04, 0.03]), np.array([0.1, 0.0, 0.2]))
    one, other = (
        find_robot(RIG, ROBOT.tags, sightings, guess=guess),
        find_robot(RIG, ROBOT.tags, sightings),
    )
    assert one.pose.position_m == pytest.approx(other.pose.position_m, abs=1e-6)
    assert one.covariance == pytest.approx(other.covariance, rel=1e-3, abs=1e-12)


def test_a_false_guess_does_not_last():
    guess = Pose(POSE.rotation @ rotation_of(np.array([0.0, 0.0, 3.0])), np.array([0.1, 2.9, 0.0]))
    fix = find_robot(RIG, ROBOT.tags, noisy(), guess=guess)
    assert np.linalg.norm(fix.pose.position_m - POSE.position_m) < 0.01


def test_pictures_of_different_moments_are_brought_together():
    velocity = np.array([0.2, -0.1, 0.05])
    sightings = []
    for i, camera in enumerate(CAMERAS):
        after = 0.03 * (i - 1)
        moved = Pose(POSE.rotation, POSE.position_m + after * velocity)
        seen = exact((camera,), moved)
        sightings.extend(replace(s, after_s=after) for s in seen)
    fix = find_robot(RIG, ROBOT.tags, sightings, velocity_ned_m_s=velocity)
    assert fix.pose.position_m == pytest.approx(POSE.position_m, abs=1e-6)
    still = find_robot(RIG, ROBOT.tags, [replace(s, after_s=0.0) for s in sightings])
    assert np.linalg.norm(still.pose.position_m - POSE.position_m) > 1e-3
    assert np.trace(fix.position_covariance) > np.trace(still.position_covariance)


def test_one_wrong_corner_does_little():
    sightings = noisy()
    wrong = sightings[0].corners_px.copy()
    wrong[2] += [6.0, -4.0]
    sightings[0] = replace(sightings[0], corners_px=wrong)
    fix = find_robot(RIG, ROBOT.tags, sightings)
    assert np.linalg.norm(fix.pose.position_m - POSE.position_m) < 0.006


def test_one_tag_in_one_camera_is_turned_over_only_without_telemetry():
    rng = np.random.default_rng(11)
    turned, off, sure, sure_turned = 0, [], 0, 0
    for _ in range(200):
        pose = random_pose(rng, float(rng.uniform(0.0, 1.12)))
        seen = see(CAMERAS, mounted(ROBOT, rng, 0.0003, 0.2).tags, pose, rng, least_side_px=14.0)
        if not seen:
            continue
        alone = [seen[int(rng.integers(len(seen)))]]
        roll, pitch, _ = pose.angles_rad
        says = Telemetry.of_tilt(
            roll + rng.normal(0.0, 0.035),
            pitch + rng.normal(0.0, 0.035),
            pose.position_m[2] + rng.normal(0.0, 0.005),
        )
        fix = find_robot(RIG, ROBOT.tags, alone, telemetry=says)
        assert turned_by_rad(fix.pose.rotation, pose.rotation) < math.radians(15.0)
        off.append(np.linalg.norm(fix.pose.position_m - pose.position_m))
        assert judge(fix).quality == "good"
        bare = find_robot(RIG, ROBOT.tags, alone)
        is_turned = turned_by_rad(bare.pose.rotation, pose.rotation) > math.radians(15.0)
        turned += is_turned
        if judge(bare).quality == "position_only":
            sure += 1
            sure_turned += is_turned
    assert len(off) > 150
    assert np.mean(off) < 0.008
    assert turned > 5
    assert sure > 10
    assert sure_turned == 0


def test_the_claimed_angles_are_honest():
    surprise = []
    rng = np.random.default_rng(3)
    for _ in range(60):
        pose = random_pose(rng, 0.6)
        fix = find_robot(RIG, ROBOT.tags, see(CAMERAS, ROBOT.tags, pose, rng))
        stds = np.array(fix.angle_stds_rad)
        off = np.subtract(fix.pose.angles_rad, pose.angles_rad)
        surprise.append(((off + np.pi) % (2.0 * np.pi) - np.pi) / stds)
    assert 0.1 < np.mean(np.square(surprise)) < 1.3  # tags are not mounted wrong here


def test_angle_stds_are_those_of_many_small_turns():
    fix = find_robot(RIG, ROBOT.tags, noisy())
    rng = np.random.default_rng(5)
    turns = rng.multivariate_normal(np.zeros(3), fix.covariance[3:, 3:], 4000)
    angles = np.array([fix.pose.moved(np.zeros(3), turn).angles_rad for turn in turns])
    assert angles.std(axis=0) == pytest.approx(fix.angle_stds_rad, rel=0.1)


@pytest.mark.parametrize("port", [FlatPort(), None], ids=["wet", "dry"])
def test_a_camera_is_found_from_fixed_tags(port):
    pitch = 90.0 if port else 45.0
    tags = [
        Tag(100, 0.15, (4.0, 1.2, 0.5), pitch_deg=pitch),
        Tag(101, 0.15, (4.0, 1.9, 0.7), pitch_deg=pitch),
        Tag(102, 0.15, (3.9, 1.4, 1.0), pitch_deg=pitch - 20.0),
    ]
    place = (2.0, 1.5, 0.5) if port else (3.0, 1.5, -1.5)
    true = Camera("own", CAMERAS[0].lens, looking(place, (4.0, 1.5, 0.6)), port=port)
    sightings = see([true], tags, Pose.identity(), np.random.default_rng(1))
    assert len(sightings) == 3
    fix = find_camera(Rig((replace(true, pose=Pose.identity()),)), tags, sightings)
    assert np.linalg.norm(fix.pose.position_m - true.pose.position_m) < 0.02
    assert turned_by_rad(fix.pose.rotation, true.pose.rotation) < 0.02
    sure = find_camera(
        Rig((true,)), tags, sightings, guess=true.pose,
        telemetry=Telemetry(tuple(true.pose.rotation[2]), place[2]),
    )  # fmt: skip
    assert np.trace(sure.covariance) < np.trace(fix.covariance)


def test_the_lens_of_the_air_is_far_off_under_water():
    tags = [Tag(100 + i, 0.15, (4.0, 1.2 + 0.5 * i, 0.6), pitch_deg=90.0) for i in range(2)]
    wet = Camera("own", CAMERAS[0].lens, looking((2.0, 1.5, 0.5), (4.0, 1.5, 0.6)), port=FlatPort())
    sightings = see([wet], tags, Pose.identity(), np.random.default_rng(1))
    port = find_camera(Rig((wet,)), tags, sightings)
    assert np.linalg.norm(port.pose.position_m - wet.pose.position_m) < 0.015
    in_air = Camera("own", wet.lens, wet.pose, port=FlatPort(glass_index=1.0, distance_m=0.0))
    air = find_camera(Rig((in_air,), index=1.30), tags, sightings)
    assert np.linalg.norm(air.pose.position_m - wet.pose.position_m) > 0.01


def test_the_robot_is_where_its_camera_says():
    tags = [Tag(100 + i, 0.15, (4.0, 1.0 + 0.4 * i, 0.5), pitch_deg=90.0) for i in range(3)]
    mount = Pose.of_angles([0.05, 0.02, -0.3], 0.2, -0.1, 1.4)  # robot's axes into the camera's
    wet = Camera("own", CAMERAS[0].lens, looking((2.0, 1.5, 0.5), (4.0, 1.5, 0.6)), port=FlatPort())
    fix = find_camera(Rig((wet,)), tags, exact((wet,), Pose.identity(), tags))
    robot = fix.of_carrier(mount)
    wanted = wet.pose @ mount
    assert robot.pose.position_m == pytest.approx(wanted.position_m, abs=1e-6)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(np.zeros(6), fix.covariance, 3000)
    moved = [fix.pose.moved(d[:3], d[3:]) @ mount for d in draws]
    spread = np.cov(np.array([pose.position_m for pose in moved]).T)
    assert np.diag(robot.position_covariance) == pytest.approx(np.diag(spread), rel=0.15)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"camera": "tank-9"}, "not calibrated"),
        ({"corners_px": np.full((4, 2), np.nan)}, "not finite"),
        ({"corners_px": np.zeros((3, 2))}, "not finite"),
        ({"sigma_px": 0.0}, "noise"),
        ({"after_s": np.inf}, "time"),
        ({"corners_px": np.array([[0.0, 0], [0, 9], [9, 9], [9, 0]])}, "mirrored"),
        ({"corners_px": np.array([[0.0, 0], [30, 0], [10, 10], [0, 30]])}, "convex"),
        ({"corners_px": np.array([[0.0, 0], [7, 0], [7, 7], [0, 7]])}, "too small"),
    ],
)
def test_an_impossible_sighting_is_passed_over_in_words(change, words):
    good = exact()
    wrong = replace(good[0], **change)
    assert words in sighting_fault(wrong, RIG)
    answer = find_robot(RIG, ROBOT.tags, [wrong])
    assert isinstance(answer, NoFix)
    assert words in answer.reason
    assert isinstance(find_robot(RIG, ROBOT.tags, [wrong, *good[1:]]), Fix)


def test_a_level_above_a_camera_is_no_fix():
    answer = find_robot(replace(RIG, level_m=-3.0), ROBOT.tags, exact())
    assert answer == NoFix("the camera is under water")
    assert find_robot(RIG, ROBOT.tags, []) == NoFix("no tag of it is seen")


def test_what_no_pose_can_show_is_no_fix():
    lens = Lens("pinhole", 1280, 720, (600.0, 600.0), (640.0, 360.0), (-0.6,))
    rig = Rig((Camera("a", lens, CAMERAS[0].pose),))
    beyond = Sighting("a", 0, np.array([[1200.0, 10], [1240, 10], [1240, 50], [1200, 50]]), 0.1)
    assert isinstance(find_robot(rig, ROBOT.tags, [beyond]), NoFix)


def test_fixes_are_judged():
    fix = find_robot(RIG, ROBOT.tags, noisy())
    assert judge(fix, water=WATER).quality == "good"
    cases = [
        (replace(fix, rms=4.1), {}, "fit together"),
        (
            replace(fix, considered_covariance=0.02 * np.eye(6)),
            {},
            "not known well enough (0.14 m)",
        ),
        (
            replace(fix, pose=Pose(POSE.rotation, np.array([6.0, 1, 0.5]))),
            {"water": WATER},
            "outside",
        ),
        (replace(fix, cameras=("a",), tags=(1,), margin=3.0), {}, "turned over"),
    ]
    for changed, known, words in cases:
        verdict = judge(changed, **known)
        assert verdict.quality == "refused"
        assert words in verdict.reason
    alone = judge(replace(fix, cameras=("a",), tags=(1,), margin=30.0))
    assert alone.quality == "position_only"
    helped = replace(fix, cameras=("a",), tags=(1,), margin=0.0, has_telemetry=True)
    assert judge(helped).quality == "good"


def test_a_surprise_is_refused_until_it_lasts():
    fix = find_robot(RIG, ROBOT.tags, noisy())
    near = Expectation(fix.position_ned_m + np.array([0.05, 0.0, 0.0]), 0.01**2 * np.eye(3), 0)
    verdict = judge(fix, near)
    assert verdict.is_surprise
    assert "0.05 m from" in verdict.reason
    assert judge(fix, replace(near, surprises=4)).quality == "good"
    assert judge(fix, replace(near, covariance_m2=0.05**2 * np.eye(3))).quality == "good"
