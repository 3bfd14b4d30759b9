"""Robots followed through drawn tanks: dives, hidden stretches, crossings, odd moments."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.vision.calibration.adjustment import Adjustment, adjust
from autonomy.vision.camera import Rig
from autonomy.vision.quality import Water
from autonomy.vision.rigid import Pose, turned_by_rad
from autonomy.vision.tag import Bundle, Registry
from autonomy.vision.tracker import (
    FORGET_S,
    MARGIN_PX,
    ROBOTS_MAX,
    Picture,
    Said,
    follow,
    regions,
    telemetry_of,
)
from tests.autonomy.vision.tank import (
    DEPTH_M,
    LENGTH_M,
    LENS,
    ROBOT,
    WIDTH_M,
    lens_covariance,
    mounted,
    overhead_cameras,
    see,
    see_means,
    tank_layout,
    true_tank,
)

CAMERAS = overhead_cameras()
RIG = Rig(CAMERAS)
OTHER = Bundle("mini-2", tuple(replace(tag, id=tag.id + 3) for tag in ROBOT.tags))
REGISTRY = Registry(tank_layout(), (ROBOT, OTHER))
WATERS = {"mini-1": Water((0.0, LENGTH_M), (0.0, WIDTH_M), DEPTH_M)}
CALIBRATIONS = 8
INSIDE_95 = 7.815
"""Of chi squared with three degrees of freedom."""
PERIOD_S, APART_S = 0.2, 0.02
"""Between sets of pictures, and between the cameras of a set."""


def dive(t_s, phase=0.0):
    """Return a robot that glides through the tank, down and up again, and turns."""
    along = 0.5 * t_s / 15.0 * 2.0 * math.pi + phase
    place = [
        2.3 + 1.3 * math.cos(along),
        1.55 + 0.7 * math.sin(along),
        0.55 - 0.5 * math.cos(2.0 * along),
    ]
    return Pose.of_angles(
        place, 0.1 * math.sin(along), -0.4 * math.sin(2.0 * along), along + math.pi / 2.0
    )


def pictures(at_s, robots, rng, cameras=CAMERAS, **water):
    """Return what cameras see that look one after the other, of robots as ``(tags, path)``."""
    taken = []
    for i, camera in enumerate(cameras):
        taken_s = at_s + APART_S * i
        seen = [
            sighting
            for tags, path in robots
            for sighting in see((camera,), tags, path(taken_s), rng, least_side_px=14.0, **water)
        ]
        taken.append(Picture(camera.name, taken_s, tuple(seen)))
    return taken


def off_m(found, path):
    return float(np.linalg.norm(found.fix.position_ned_m - path(found.at_s).position_m))


@pytest.fixture(scope="module")
def tanks():
    """Return eight tanks, each told wrong in its own way, with its calibration."""
    covariance = lens_covariance(LENS)
    made = []
    for seed in range(CALIBRATIONS):
        tank = true_tank(seed, covariance)
        means = see_means(tank, 100 + seed)
        found = adjust(tank.told_cameras, tank.lens_covariances, tank.told_layout, means)
        assert isinstance(found, Adjustment)
        made.append((tank, found.rig))
    return made


def test_a_dive_is_followed_to_millimetres_and_claims_what_is_true(tanks):
    off, surprises, qualities, wet = [], [], [], {}
    for seed, (tank, rig) in enumerate(tanks):
        rng = np.random.default_rng(40 + seed)
        tags, tracks = mounted(ROBOT, rng, 0.0003, 0.2).tags, {}
        wet = {"level_m": tank.level_m, "index": tank.index}
        for at_s in np.arange(0.0, 15.0, PERIOD_S):
            taken = pictures(at_s, [(tags, dive)], rng, tank.cameras, **wet)
            answer = follow(tracks, taken, rig, REGISTRY, waters=WATERS)
            tracks = answer.tracks
            for found in answer.found:
                true = dive(found.at_s)
                error = found.fix.position_ned_m - true.position_m + [0.0, 0.0, tank.level_m]
                off.append(np.linalg.norm(found.fix.pose.position_m - true.position_m))
                surprises.append(error @ np.linalg.solve(found.fix.position_covariance, error))
                qualities.append(found.verdict.quality)
                assert turned_by_rad(found.fix.pose.rotation, true.rotation) < math.radians(5.0)
    assert len(off) > 0.95 * CALIBRATIONS * 75
    assert np.mean([quality == "good" for quality in qualities]) > 0.98
    assert np.mean(off) <= 0.003
    assert np.percentile(off, 95) <= 0.008
    assert 0.5 < np.mean(surprises) < 4.5
    assert np.mean(np.array(surprises) <= INSIDE_95) >= 0.9


def test_one_camera_and_one_tag_with_what_the_robot_says_is_good_and_honest(tanks):
    off, surprises, turned = [], [], 0
    for seed, (tank, rig) in enumerate(tanks):
        rng = np.random.default_rng(80 + seed)
        wet = {"level_m": tank.level_m, "index": tank.index}
        for _ in range(40):
            tags, at_s = mounted(ROBOT, rng, 0.0005, 0.6).tags, float(rng.uniform(0.0, 15.0))
            taken = pictures(at_s, [(tags, dive)], rng, tank.cameras, **wet)
            taken = [picture for picture in taken if picture.sightings]
            if not taken:
                continue
            one = taken[int(rng.integers(len(taken)))]
            one = replace(one, sightings=(one.sightings[int(rng.integers(len(one.sightings)))],))
            true = dive(one.taken_s)
            roll, pitch, _ = true.angles_rad
            tilt = rng.normal([roll, pitch], 0.035)
            depth_m = true.position_m[2] - tank.level_m + rng.normal(0.0, 0.005)
            said = {"mini-1": Said(0.0, *tilt.tolist(), depth_m)}
            (found,) = follow({}, [one], rig, REGISTRY, said=said).found
            assert found.verdict.quality == "good"
            error = found.fix.position_ned_m - true.position_m + [0.0, 0.0, tank.level_m]
            off.append(np.linalg.norm(error))
            surprises.append(error @ np.linalg.solve(found.fix.position_covariance, error))
            turned += turned_by_rad(found.fix.pose.rotation, true.rotation) > math.radians(15.0)
    assert len(off) > 200
    assert turned == 0
    assert np.mean(off) <= 0.008
    assert 1.0 < np.mean(surprises) < 4.5
    assert np.mean(np.array(surprises) <= INSIDE_95) >= 0.9


def test_two_robots_that_cross_are_never_swapped():
    rng = np.random.default_rng(3)

    def east(t_s):
        return Pose.of_angles([2.3, 0.8 + 0.2 * t_s, 0.30], 0.0, 0.0, math.pi / 2.0)

    def west(t_s):
        return Pose.of_angles([2.32, 2.2 - 0.2 * t_s, 0.45], 0.0, 0.0, -math.pi / 2.0)

    paths, tracks, met = {"mini-1": east, "mini-2": west}, {}, []
    for at_s in np.arange(0.0, 7.0, PERIOD_S):
        taken = pictures(at_s, [(ROBOT.tags, east), (OTHER.tags, west)], rng)
        answer = follow(tracks, taken, RIG, REGISTRY, waters=WATERS)
        tracks = answer.tracks
        assert [found.robot for found in answer.found] == ["mini-1", "mini-2"]
        for found in answer.found:
            assert off_m(found, paths[found.robot]) < 0.01
            assert found.verdict.quality == "good"
        met.append(np.linalg.norm(tracks["mini-1"].state[:2] - tracks["mini-2"].state[:2]))
    assert min(met) < 0.1


def test_a_robot_that_takes_the_others_place_in_the_pictures_is_not_believed():
    rng, tracks = np.random.default_rng(3), {}
    here, there = dive, (lambda t: dive(t, math.pi))
    for at_s in np.arange(0.0, 1.0, PERIOD_S):
        taken = pictures(at_s, [(ROBOT.tags, here), (OTHER.tags, there)], rng)
        tracks = follow(tracks, taken, RIG, REGISTRY).tracks
    swapped = pictures(1.0, [(OTHER.tags, here), (ROBOT.tags, there)], rng)
    answer = follow(tracks, swapped, RIG, REGISTRY)
    assert [found.verdict.quality for found in answer.found] == ["refused", "refused"]
    assert all("not where it should be" in found.verdict.reason for found in answer.found)
    assert [answer.tracks[robot].surprises for robot in ("mini-1", "mini-2")] == [1, 1]
    for at_s in np.arange(1.2, 2.0, PERIOD_S):  # told so five times, it is believed
        taken = pictures(at_s, [(OTHER.tags, here), (ROBOT.tags, there)], rng)
        answer = follow(answer.tracks, taken, RIG, REGISTRY)
    assert [found.verdict.quality for found in answer.found] == ["good", "good"]


def test_the_filter_learns_the_velocity_and_never_claims_less_than_the_considered_part(tanks):
    tank, rig = tanks[0]
    rng, tracks = np.random.default_rng(5), {}
    wet = {"level_m": tank.level_m, "index": tank.index}
    surprises = []
    for at_s in np.arange(0.0, 15.0, PERIOD_S):
        taken = pictures(at_s, [(ROBOT.tags, dive)], rng, tank.cameras, **wet)
        answer = follow(tracks, taken, rig, REGISTRY)
        tracks = answer.tracks
        (found,), track = answer.found, tracks["mini-1"]
        rest = track.position_covariance - found.fix.considered_covariance[:3, :3]
        assert np.linalg.eigvalsh(rest)[0] >= -1e-15
        before, after = (dive(found.at_s + dt).position_m for dt in (-0.01, 0.01))
        if at_s > 1.0:
            error = track.velocity_ned_m_s - (after - before) / 0.02
            surprises.append(np.linalg.norm(error) / track.velocity_std_m_s)
    assert np.percentile(surprises, 95) < 3.0


def test_a_robot_that_was_hidden_is_lost_then_found_again_in_the_next_set():
    rng, tracks = np.random.default_rng(8), {}
    for at_s in np.arange(0.0, 2.0, PERIOD_S):
        tracks = follow(tracks, pictures(at_s, [(ROBOT.tags, dive)], rng), RIG, REGISTRY).tracks
    for at_s in np.arange(2.0, 3.6, PERIOD_S):
        answer = follow(tracks, pictures(at_s, [], rng), RIG, REGISTRY)
        tracks = answer.tracks
        assert answer.found == ()
        assert tracks["mini-1"].standing == "lost"
    answer = follow(tracks, pictures(3.6, [(ROBOT.tags, dive)], rng), RIG, REGISTRY)
    assert answer.tracks["mini-1"].standing == "found"
    assert answer.found[0].verdict.quality == "good"
    assert off_m(answer.found[0], dive) < 0.01


def test_a_robot_out_of_every_picture_is_unseen_not_lost():
    rng, tracks = np.random.default_rng(8), {}

    def leaving(t_s):
        return Pose.of_angles([4.0 + 0.4 * t_s, 1.5, 0.2], 0.0, 0.0, 0.0)

    standings = set()
    for at_s in np.arange(0.0, 8.0, PERIOD_S):
        answer = follow(tracks, pictures(at_s, [(ROBOT.tags, leaving)], rng), RIG, REGISTRY)
        tracks = answer.tracks
        if not answer.found:
            standings.add(tracks["mini-1"].standing)
    assert tracks["mini-1"].standing == "unseen"
    assert at_s - tracks["mini-1"].fixed_s > 1.0


def test_a_track_is_forgotten_and_begun_anew():
    rng = np.random.default_rng(2)
    tracks = follow({}, pictures(0.0, [(ROBOT.tags, dive)], rng), RIG, REGISTRY).tracks
    late_s = FORGET_S + 1.0
    far = pictures(late_s, [(ROBOT.tags, lambda t: dive(t, math.pi))], rng)
    (found,) = follow(tracks, far, RIG, REGISTRY).found
    assert found.verdict.quality == "good"


def test_regions_hold_the_tags_of_the_next_pictures():
    rng, tracks, inside, seen = np.random.default_rng(9), {}, 0, 0
    for at_s in np.arange(0.0, 15.0, PERIOD_S):
        taken = pictures(at_s, [(ROBOT.tags, dive)], rng)
        if tracks:
            expected = regions(tracks, RIG, REGISTRY, at_s)
            for picture in taken:
                for sighting in picture.sightings:
                    seen += 1
                    low, high = sighting.corners_px.min(axis=0), sighting.corners_px.max(axis=0)
                    inside += any(
                        (low >= [place.left, place.top]).all()
                        and (high <= [place.right, place.bottom]).all()
                        for place in expected[picture.camera]
                    )
        tracks = follow(tracks, taken, RIG, REGISTRY).tracks
    assert seen > 300
    assert inside / seen > 0.99
    (region, *_) = (place for places in expected.values() for place in places)
    assert region.right - region.left < 300
    assert region.right - region.left > 2 * MARGIN_PX
    assert not any(regions(tracks, RIG, REGISTRY, 20.0).values())


def test_a_plate_that_nobody_knows_is_a_stranger_and_no_robot():
    rng = np.random.default_rng(1)
    taken = pictures(0.0, [(OTHER.tags, dive)], rng)
    registry = Registry(tank_layout(), (ROBOT,))
    answer = follow({}, taken, RIG, registry)
    seen = {one.tag_id for picture in taken for one in picture.sightings}
    assert seen
    assert all(registry.is_stranger(tag) for tag in seen)
    assert answer.found == ()
    assert answer.tracks == {}


def test_of_more_robots_than_can_be_followed_the_nearest_are():
    bundles = [Bundle(f"r-{k}", (replace(ROBOT.tags[0], id=3 * k),)) for k in range(ROBOTS_MAX + 2)]
    rng = np.random.default_rng(4)
    robots = [
        (
            bundle.tags,
            lambda t, k=k: Pose.of_angles(
                [0.9 + 0.55 * (k % 6), 0.7 + 0.45 * (k // 6), 1.1 if k < 2 else 0.1], 0, 0, 0
            ),
        )
        for k, bundle in enumerate(bundles)
    ]
    answer = follow({}, pictures(0.0, robots, rng), RIG, Registry(tank_layout(), tuple(bundles)))
    assert len(answer.found) == ROBOTS_MAX
    assert set(answer.left_out) == {"r-0", "r-1"}


def test_pictures_that_are_not_newer_say_nothing():
    rng = np.random.default_rng(1)
    taken = pictures(1.0, [(ROBOT.tags, dive)], rng)
    first = follow({}, taken, RIG, REGISTRY)
    again = follow(first.tracks, taken, RIG, REGISTRY)
    assert again.found == ()
    assert again.tracks["mini-1"].fixed_s == first.tracks["mini-1"].fixed_s


def test_what_a_robot_said_counts_less_with_its_age_and_nothing_after_a_second():
    fresh = telemetry_of(Said(0.0, 0.1, 0.2, 0.4), None)
    late = telemetry_of(Said(0.9, 0.1, 0.2, 0.4), None)
    assert fresh.depth_std_m == pytest.approx(0.005)
    assert late.depth_std_m > 5.0 * fresh.depth_std_m
    assert late.tilt_std_rad > fresh.tilt_std_rad
    assert telemetry_of(Said(1.1, 0.1, 0.2, 0.4), None) is None
    assert telemetry_of(Said(0.1), None) is None
    assert telemetry_of(Said(0.1, 0.1, 0.2), None).depth_m is None
    assert telemetry_of(Said(0.1, None, None, 0.4), None).down is None


def test_what_cannot_be_explained_is_told():
    rng = np.random.default_rng(1)
    taken = pictures(0.0, [(ROBOT.tags, dive)], rng)
    nowhere = [replace(picture, camera="tank-9") for picture in taken]
    nowhere = [
        replace(p, sightings=tuple(replace(s, camera="tank-9") for s in p.sightings))
        for p in nowhere
    ]
    (found,) = follow({}, nowhere, RIG, REGISTRY).found
    assert found.fix is None
    assert found.verdict.reason == "the camera is not calibrated"
