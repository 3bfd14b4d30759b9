"""Lenses calibrated from boards drawn with noise."""

from dataclasses import replace

import numpy as np
import pytest

from autonomy.vision.calibration.board import BoardView, missing_views, pose_of_board
from autonomy.vision.calibration.lens_fit import LensCalibration, calibrate_lens
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.lens import Lens
from tests.autonomy.vision.boards import BOARD, drawn_views

PINHOLE = Lens(
    "pinhole", 1280, 720, (736.0, 735.0), (646.0, 352.0), (-0.15, 0.04, 0.0006, -0.0004, 0.0)
)
FISHEYE = Lens("fisheye", 1280, 960, (611.0, 611.0), (635.0, 486.0), (0.02, -0.01, 0.004, -0.001))
LENSES = pytest.mark.parametrize("lens", [PINHOLE, FISHEYE], ids=lambda lens: lens.kind)


def calibrated(lens, views):
    return calibrate_lens(lens.kind, lens.width_px, lens.height_px, views)


@LENSES
def test_twenty_boards_tell_a_lens(lens):
    found = calibrated(lens, drawn_views(lens, 20, 1))
    assert isinstance(found, LensCalibration)
    assert np.array(found.lens.focal_px) == pytest.approx(np.array(lens.focal_px), rel=1e-3)
    assert found.rms_px == pytest.approx(0.1, rel=0.1)
    assert np.abs(np.subtract(found.lens.principal_px, lens.principal_px)).max() < 0.6
    assert len(found.views) == len(found.view_rms_px) == 20
    assert found.focal_std_share < 1e-3


@LENSES
def test_the_covariance_of_a_lens_is_honest(lens):
    free = lens.is_free
    surprises = []
    for seed in range(8):
        found = calibrated(lens, drawn_views(lens, 12, 100 + seed))
        off = (found.lens.parameters - lens.parameters)[free]
        cov = found.covariance[np.ix_(free, free)]
        surprises.append(off @ np.linalg.solve(cov, off) / free.sum())
        assert not found.covariance[~free].any()
    assert 0.5 < np.mean(surprises) < 1.7


def test_exact_corners_give_the_exact_lens():
    found = calibrated(PINHOLE, drawn_views(PINHOLE, 12, 3, noise_px=0.0))
    assert found.lens.parameters == pytest.approx(PINHOLE.parameters, rel=1e-6, abs=1e-6)


def test_a_board_is_found_before_its_lens():
    for view in drawn_views(PINHOLE, 5, 8, noise_px=0.0):
        pose = pose_of_board(view, PINHOLE)
        assert PINHOLE.project(pose.of_points(view.points_m)) == pytest.approx(view.pixels)


def test_too_few_pictures_are_refused():
    views = drawn_views(PINHOLE, 12, 2)
    poor = [replace(v, points_m=v.points_m[:19], pixels=v.pixels[:19]) for v in views[:5]]
    answer = calibrated(PINHOLE, [*views[:7], *poor])
    assert isinstance(answer, Refusal)
    assert answer.reason.startswith("only 7 pictures")


def test_a_picture_that_is_wrong_is_named():
    views = drawn_views(PINHOLE, 14, 2)
    views[4] = replace(views[4], pixels=views[4].pixels + np.random.default_rng(0).normal(
        0.0, 1.5, views[4].pixels.shape))  # fmt: skip
    answer = calibrated(PINHOLE, views)
    assert isinstance(answer, Refusal)
    assert "picture view 4 does not fit" in answer.reason


@pytest.mark.parametrize("seed", range(4))
def test_a_few_corners_that_are_pixels_off_do_not_matter(seed):
    rng = np.random.default_rng(seed)
    views = drawn_views(PINHOLE, 16, 40 + seed)
    for i in rng.choice(len(views), 5, replace=False):
        pixels = views[i].pixels.copy()
        for j in rng.choice(len(pixels), 3, replace=False):
            pixels[j] += rng.uniform(1.0, 4.0) * np.array([np.cos(j), np.sin(j)])
        views[i] = replace(views[i], pixels=pixels)
    found = calibrated(PINHOLE, views)
    assert isinstance(found, LensCalibration), found.reason
    assert np.array(found.lens.focal_px) == pytest.approx(np.array(PINHOLE.focal_px), rel=1e-3)
    assert found.rms_px == pytest.approx(0.1, rel=0.1)


def test_corners_that_are_all_bad_are_refused():
    answer = calibrated(PINHOLE, drawn_views(PINHOLE, 12, 2, noise_px=1.5))
    assert isinstance(answer, Refusal)
    assert "px off" in answer.reason


def test_boards_that_are_never_tilted_are_refused():
    rng = np.random.default_rng(0)
    points = BOARD.points_m(np.arange(70))
    views = []
    for i in range(12):
        middle = points - points.mean(axis=0) + np.append(rng.uniform(-0.1, 0.1, 2), 0.8)
        pixels = PINHOLE.project(middle) + rng.normal(0.0, 0.1, (70, 2))
        views.append(BoardView(str(i), points, pixels))
    answer = calibrated(PINHOLE, views)
    assert isinstance(answer, Refusal)
    assert "tilt the board" in answer.reason


def test_what_is_no_board_is_refused():
    rng = np.random.default_rng(0)
    points = BOARD.points_m(np.arange(30))
    views = [BoardView(str(i), points, rng.uniform(0.0, 700.0, (30, 2))) for i in range(12)]
    assert isinstance(calibrated(PINHOLE, views), Refusal)
    nowhere = [BoardView(str(i), points, np.full((30, 2), 5.0)) for i in range(12)]
    assert isinstance(calibrated(PINHOLE, nowhere), Refusal)


def test_the_page_asks_for_the_views_that_are_missing():
    assert missing_views([], PINHOLE) == ("20 pictures of the board",)
    left = [v for v in drawn_views(PINHOLE, 60, 5) if v.pixels[:, 0].max() < 600.0]
    asked = missing_views(left[:5], PINHOLE)
    assert asked[0] == "15 more pictures"
    assert any("far right of the picture" in words for words in asked)
    assert missing_views(drawn_views(PINHOLE, 40, 6), PINHOLE) == ()
    flat = missing_views(drawn_views(PINHOLE, 40, 7, most_tilt_deg=0.0)[:1], PINHOLE)
    assert any("tilted" in words for words in flat)


def test_a_board_has_only_its_own_corners():
    assert BOARD.points_m([0, 9, 10]).tolist() == [[0.05, 0.05, 0], [0.5, 0.05, 0], [0.05, 0.1, 0]]
    with pytest.raises(ValueError, match="ids"):
        BOARD.points_m([70])
