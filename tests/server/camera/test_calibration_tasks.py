"""What workers make of pictures: calibrations that are taken, and refused in words."""

from dataclasses import replace

import numpy as np
import pytest

from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.rigid import Pose
from autonomy.vision.tag import Layout
from robot_link.camera.sighting import Sighting, TagSeen
from server.camera.set_up.vision_task import adjust_all, lens
from server.camera.task import AdjustProblem, Found, KnownLens, LensProblem, WatchProblem
from server.camera.used_rig import UsedRig
from server.camera.vision import found_layout, lens_document
from server.camera.watch_task import watch
from tests.autonomy.vision.tank import LENS, overhead_cameras, see, surveyed, tank_layout
from tests.db.conftest import START

CAMERAS = overhead_cameras()
SIZE = (LENS.width_px, LENS.height_px)
NOTHING = (lambda _: None, lambda: False)


def pictures(tags, count=10, seed=1, cameras=CAMERAS, **water):
    rng = np.random.default_rng(seed)
    found = []
    for frame in range(count):
        for camera in cameras:
            seen = see([camera], tags, Pose.identity(), rng, **water)
            told = [
                TagSeen(
                    id=one.tag_id,
                    corners_px=tuple(map(tuple, one.corners_px.tolist())),
                    sigma_px=one.sigma_px,
                    margin=60.0,
                    hamming=0,
                    blur_px=0.8,
                )
                for one in seen
            ]
            found.append(Sighting(camera.name, frame, START, START, SIZE, "whole", told))
    return tuple(found)


def problem(layout, seen):
    known = tuple(
        KnownLens(camera.name, i + 1, lens_document(camera.lens), np.zeros((9, 9)))
        for i, camera in enumerate(CAMERAS)
    )
    return AdjustProblem(known, layout, seen, 0.0, 0.005, 1.333)


def swapped(layout, one, other):
    a, b = layout.tag(one), layout.tag(other)
    places = {
        one: replace(a, position_m=b.position_m, heading_deg=b.heading_deg),
        other: replace(b, position_m=a.position_m, heading_deg=a.heading_deg),
    }
    return Layout(tuple(places.get(tag.id, tag) for tag in layout.tags))


def test_swapped_plates_are_refused_with_a_tags_number():
    seen = pictures(swapped(tank_layout(), 104, 107).tags)
    found = adjust_all(problem(tank_layout(), seen), *NOTHING)
    assert isinstance(found, Refusal)
    assert "tag 104" in found.reason or "tag 107" in found.reason


def test_plates_of_one_plane_are_refused_in_words():
    floor = Layout(tuple(tag for tag in tank_layout().tags if tag.id < 120))
    found = adjust_all(problem(floor, pictures(floor.tags)), *NOTHING)
    assert isinstance(found, Refusal)
    assert "one plane" in found.reason


def test_a_mirrored_layout_is_refused():
    layout = tank_layout()
    mirrored = Layout(
        tuple(
            replace(tag, position_m=(tag.position_m[0], 3.1 - tag.position_m[1], tag.position_m[2]))
            for tag in layout.tags
        )
    )
    found = adjust_all(problem(mirrored, pictures(layout.tags)), *NOTHING)
    assert isinstance(found, Refusal)


def test_a_lens_without_pictures_is_refused():
    assert isinstance(lens(LensProblem("pinhole", ()), *NOTHING), Refusal)


@pytest.fixture(scope="module")
def calibrated():
    """The true tags, and what an adjustment by a survey of 2 mm found."""
    true = surveyed(tank_layout(), np.random.default_rng(5), 0.002, 0.3).tags
    found = adjust_all(problem(tank_layout(), pictures(true, 30)), *NOTHING)
    assert isinstance(found, Found)
    return true, found


def watched(found, newest, longer=(), left_out=frozenset(), cameras=None):
    names = tuple(camera.name for camera in CAMERAS) if cameras is None else cameras
    used = UsedRig(1, found.result, found.covariance, names, found.result["level_m"])
    layout = found_layout(found.result)
    return watch(WatchProblem(used, layout, newest, longer or newest, left_out), *NOTHING)


@pytest.mark.parametrize("slope_deg", [0.0, 0.25])
def test_cameras_that_hang_still_hold_in_calm_water_and_in_ripples(calibrated, slope_deg):
    true, found = calibrated
    slope_rad = np.radians(slope_deg)
    shifts, levels = [], []
    for seed in range(12):
        seen = pictures(true, 30, seed, slope_rad=slope_rad)
        answer = watched(found, seen, pictures(true, 60, seed + 100, slope_rad=slope_rad))
        shifts += [stand.shift_px for stand in answer.stands.values()]
        levels.append(abs(answer.level.change_m))
        assert answer.level.spread_m <= 0.002 or slope_deg > 0.0
    assert max(shifts) < 0.7
    assert max(levels) < 0.002
    assert np.degrees(answer.ripple_slope_rad) == pytest.approx(slope_deg, abs=0.06)


def test_one_bumped_camera_does_not_move_the_water(calibrated):
    true, found = calibrated
    bumped = CAMERAS[1].pose.moved(np.zeros(3), np.radians([0.25, 0.0, 0.0]))
    cameras = (CAMERAS[0], replace(CAMERAS[1], pose=bumped), CAMERAS[2])
    answer = watched(found, pictures(true, 30, cameras=cameras))
    assert answer.stands["tank-2"].shift_px > 2.0
    assert answer.stands["tank-1"].shift_px < 0.7
    assert answer.stands["tank-3"].shift_px < 0.7
    assert answer.level.cameras == 2
    assert abs(answer.level.change_m) < 0.002


@pytest.mark.parametrize("level_m", [-0.02, -0.01, 0.01, 0.02])
def test_the_level_is_found_and_no_camera_is_suspected(calibrated, level_m):
    true, found = calibrated
    answer = watched(found, pictures(true, 30, level_m=level_m))
    assert answer.level.level_m - found.result["level_m"] == pytest.approx(level_m, abs=0.002)
    assert answer.level.spread_m <= 0.002
    assert max(stand.shift_px for stand in answer.stands.values()) < 0.7


def test_a_plate_that_was_moved_is_off_in_every_camera(calibrated):
    true, found = calibrated
    moved = tuple(
        replace(tag, position_m=(tag.position_m[0] + 0.03, *tag.position_m[1:]))
        if tag.id == 104
        else tag
        for tag in true
    )
    answer = watched(found, pictures(moved, 30))
    off = [np.hypot(*stand.off_px[104]) for stand in answer.stands.values() if 104 in stand.off_px]
    assert off
    assert min(off) > 2.0
    others = [
        np.hypot(*px)
        for stand in answer.stands.values()
        for tag, px in stand.off_px.items()
        if tag != 104
    ]
    assert max(others) < 2.0
