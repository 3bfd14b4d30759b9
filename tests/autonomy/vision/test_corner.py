"""Corners of drawn tags."""

import numpy as np
import pytest

from autonomy.vision.corner import (
    area_px2,
    corner_sigma_px,
    fit_corners,
    light_of_grey,
    mean_side_px,
)
from autonomy.vision.reference import corner as reference
from tests.autonomy.vision.drawn_tag import draw, tilted_square


def patches(side, n=50, seed=5, tilt_deg=20.0, **light):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        size = int(1.6 * side) + 24
        middle = size / 2 + rng.uniform(-0.5, 0.5, 2)
        truth = tilted_square(side, np.radians(tilt_deg), rng.uniform(0.0, 6.3), middle)
        yield truth, draw(truth, size, rng, **light), truth + rng.normal(0.0, 0.3, (4, 2))


def errors(side, **light):
    """Return the rms of the corners' coordinates in each patch."""
    off = []
    for truth, picture, start in patches(side, **light):
        fit = fit_corners(picture, start)
        assert fit.is_fitted
        off.append(np.sqrt(np.mean((fit.corners_px - truth) ** 2)))
    return np.array(off)


@pytest.mark.parametrize(("side", "most"), [(16, 0.25), (20, 0.15), (24, 0.12), (48, 0.06)])
def test_fitted_corners_lie_within_a_fraction_of_a_pixel(side, most):
    assert np.median(errors(side)) <= most


def test_a_curve_that_is_not_undone_makes_the_square_smaller():
    for truth, picture, _ in patches(32, n=5, tilt_deg=0.0):
        right = fit_corners(picture, truth).corners_px
        wrong = fit_corners(picture, truth, light_of_grey(1.0)).corners_px
        assert area_px2(wrong) < area_px2(right) - 8.0
        assert area_px2(right) == pytest.approx(area_px2(truth), rel=0.01)


def test_kernel_does_what_the_readable_fit_does():
    for side in (18, 40):
        for _, picture, start in patches(side, n=4):
            wanted, width2 = reference.fit_corners(picture, start, light_of_grey())
            fit = fit_corners(picture, start)
            assert fit.corners_px == pytest.approx(wanted, abs=1e-6)
            assert width2 > 0.0


def test_blur_is_told_by_the_edges():
    for blur in (0.6, 0.9, 1.2):
        seen = [fit_corners(p, t).blur_px for t, p, _ in patches(48, n=5, blur_px=blur)]
        assert np.mean(seen) == pytest.approx(blur, abs=0.12)


def test_noise_grows_with_smallness_and_blur():
    assert corner_sigma_px(40.0, 0.5) == 0.05
    assert corner_sigma_px(16.0, 0.5) == pytest.approx(0.05 * 2.0**1.7)
    assert corner_sigma_px(40.0, 1.6) == pytest.approx(0.2)


def test_where_no_edge_is_the_detectors_corners_are_kept_with_more_noise():
    grey = np.full((64, 64), 90, dtype=np.uint8)
    start = tilted_square(24.0, 0.0, 0.3, 32.0)
    fit = fit_corners(grey, start)
    assert not fit.is_fitted
    assert fit.corners_px == pytest.approx(start)
    assert fit.sigma_px == pytest.approx(3.0 * corner_sigma_px(mean_side_px(start), 0.0))


def test_corners_beside_the_picture_or_of_no_area_are_kept():
    _, picture, start = next(patches(24))
    for wrong in (start - 30.0, np.zeros((4, 2)), start[::-1], np.full((4, 2), np.nan)):
        assert not fit_corners(picture, wrong).is_fitted
    assert not fit_corners(np.zeros((1, 1), dtype=np.uint8), start).is_fitted


def test_a_fit_that_runs_away_is_not_taken():
    _, picture, start = next(patches(40))
    fit = fit_corners(picture, start + np.array([[9.0, 9.0], [0, 0], [0, 0], [0, 0]]))
    assert fit.is_fitted is False or np.abs(fit.corners_px - start).max() < 1.5
