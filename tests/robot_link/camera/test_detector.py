"""Which tags are found in drawn pictures, and where their corners are.

Patches are drawn anew each time; bars are those of the specification, counts are moderate.
"""

import sys

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_link.camera.board import find_board
from robot_link.camera.detector import TagDetector, search, search_region
from robot_link.camera.sighting import Region
from tests.robot_link.camera.drawn import board_picture, patch, pattern, scene

DETECTOR = TagDetector()
PATCHES = 80
PICTURES = 10
BOARDS = 7


def everywhere(grey):
    return Region(0, 0, grey.shape[1], grey.shape[0])


@pytest.fixture
def rng():
    seed = int(np.random.default_rng().integers(2**31))
    sys.stdout.write(f"seed {seed}\n")
    return np.random.default_rng(seed)


def drawn_and_found(rng, side_px, **light):
    """Return how many patches of a tag were found, wrong ids, and the rms of corners of each."""
    rms, wrong = [], 0
    for tag_id in rng.integers(0, 587, PATCHES).tolist():
        grey, corners = patch(rng, tag_id, side_px, **light)
        for tag in DETECTOR.find(grey, [everywhere(grey)]).tags:
            wrong += tag.id != tag_id
            rms.append(float(np.sqrt(np.mean((np.array(tag.corners_px) - corners) ** 2))))
    return len(rms) - wrong, wrong, np.array(rms)


@pytest.mark.parametrize(
    ("side_px", "noise", "share", "most_px"),
    [(20, 3.0, 0.95, 0.15), (16, 3.0, 0.60, 0.25), (24, 15.0, 0.95, 0.25), (48, 3.0, 0.95, 0.07)],
)
def test_tags_are_found_and_their_corners_are_right(rng, side_px, noise, share, most_px):
    found, wrong, rms = drawn_and_found(rng, side_px, noise=noise)
    assert wrong == 0
    # Three standard deviations below the bar: that many patches are drawn at random.
    assert found >= share * PATCHES - 3.0 * np.sqrt(share * (1.0 - share) * PATCHES)
    assert np.median(rms) <= most_px


def test_in_noise_no_tag_is_found(rng):
    for _ in range(3):
        noise = np.clip(rng.normal(128.0, 60.0, (240, 320)), 0, 255).astype(np.uint8)
        assert DETECTOR.find(noise, [everywhere(noise)], 1.0).tags == []


def test_pictures_fix_order_half_pixel_and_half_turn_for_both_libraries(rng):
    """As printed, upright: top left is up and to the left of all others."""
    values = cv2.aruco.DetectorParameters()
    values.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    theirs = cv2.aruco.ArucoDetector(dictionary, values)
    offs = {"fitted": [], "whole": [], "region": [], "OpenCV": []}
    for _ in range(PICTURES):
        grey, corners = patch(rng, 7, 60.0, tilt_deg=0.0, turn_rad=0.0, noise=1.0)
        assert (corners[0] < corners[2]).all()
        (fitted,) = DETECTOR.find(grey, [everywhere(grey)]).tags
        (whole,), (region,) = search(grey), search_region(grey, everywhere(grey))
        found, ids, _ = theirs.detectMarkers(grey)
        assert ids.ravel().tolist() == [7]
        told = (
            fitted.corners_px,
            whole.corners_px,
            region.corners_px,
            np.reshape(found[0], (4, 2)),
        )
        for name, one in zip(offs, told, strict=True):
            offs[name].append(np.array(one) - corners)
    # Of one picture the corners lie by chance within a pixel: the mean of several is judged.
    for name, each_px, all_px in (
        ("fitted", 0.15, 0.1),
        ("whole", 0.45, 0.1),
        ("region", 0.45, 0.1),
        ("OpenCV", 1.0, 0.25),
    ):
        assert np.abs(offs[name]).max() < 1.0, name
        assert np.mean(offs[name], axis=0) == pytest.approx(np.zeros((4, 2)), abs=each_px), name
        assert np.mean(offs[name]) == pytest.approx(0.0, abs=all_px), name


def test_a_turned_tag_keeps_its_corners_in_order(rng):
    for turn in rng.uniform(0.0, 2.0 * np.pi, 8):
        grey, corners = patch(rng, 102, 40.0, turn_rad=turn)
        (tag,) = DETECTOR.find(grey, [], 1.0).tags
        assert np.array(tag.corners_px) == pytest.approx(corners, abs=0.5)


def test_regions_and_whole_picture_tell_each_tag_once(rng):
    places = {1: (90, 100, 30), 4: (300, 150, 30), 101: (520, 300, 60)}
    grey, corners = scene(rng, (640, 400), places)
    regions = [Region(20, 30, 170, 180), Region(-50, 60, 130, 700), Region(220, 70, 390, 240)]
    in_regions = DETECTOR.find(grey, regions)
    assert sorted(tag.id for tag in in_regions.tags) == [1, 4]
    found = DETECTOR.find(grey, regions, 1.0)
    assert sorted(tag.id for tag in found.tags) == [1, 4, 101]
    assert found.twice == []
    for tag in found.tags:
        assert np.array(tag.corners_px) == pytest.approx(corners[tag.id], abs=0.6)
        assert tag.is_fitted
        assert tag.hamming == 0


def test_an_id_that_is_there_twice_is_told_and_left_out(rng):
    one, _ = scene(rng, (500, 200), {6: (100, 100, 40), 9: (380, 100, 40)})
    one[:, 180:330] = one[:, 25:175]
    found = DETECTOR.find(one, [], 1.0)
    assert [tag.id for tag in found.tags] == [9]
    assert found.twice == [6]


@settings(max_examples=60, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    box=st.tuples(*(st.integers(-60, 100) for _ in range(4))),
)
def test_no_region_and_no_small_picture_brings_the_library_down(shape, box):
    grey = np.full(shape, 200, dtype=np.uint8)
    grey[::2] = 10
    DETECTOR.find(grey, [Region(*box)], 2.0)
    assert search(grey[:2]) == []
    assert search(grey[:, :15]) == []


def test_corners_of_the_board_are_those_of_its_drawing(rng):
    counts = []
    for turn_rad in rng.uniform(-0.15, 0.15, BOARDS):
        grey, wanted = board_picture(50.0, (720, 560), float(turn_rad))
        found = find_board(grey)
        counts.append(len(found))
        off = np.array([corner.pixel for corner in found]) - wanted[[corner.id for corner in found]]
        assert np.sqrt(np.mean(off**2)) < 0.15
    # At some turns a marker is missed, and with it two corners or four; of 340 turns at most eight.
    assert np.median(counts) >= 60
    assert find_board(np.zeros((480, 640), dtype=np.uint8)) == []
    assert find_board(grey[:20]) == []


def test_the_boards_markers_are_of_no_family_that_robots_carry():
    grey, _ = board_picture(60.0, (800, 600), 0.0)
    assert DETECTOR.find(grey, [], 1.0).tags == []
    assert pattern(0).shape == (6, 6)
