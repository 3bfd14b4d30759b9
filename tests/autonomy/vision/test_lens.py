"""Lenses: forward, back, where they fold over, and their derivatives."""

import numpy as np
import pytest

from autonomy.vision.lens import Lens
from autonomy.vision.reference import optics
from tests.autonomy.vision.slopes import finite_differences

PINHOLE = Lens(
    "pinhole", 1280, 720, (736.0, 731.0), (644.0, 355.0), (-0.21, 0.05, 0.0008, -0.0006, 0.004)
)
FISHEYE = Lens("fisheye", 1280, 960, (600.0, 598.0), (640.0, 470.0), (-0.02, 0.004, -0.001, 1e-4))
LENSES = pytest.mark.parametrize("lens", [PINHOLE, FISHEYE], ids=lambda lens: lens.kind)


def picture(lens, step=40):
    across, down = np.arange(0, lens.width_px, step), np.arange(0, lens.height_px, step)
    return np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2).astype(float)


@LENSES
def test_a_ray_leads_back_to_its_pixel(lens):
    pixels = picture(lens, 10)
    rays = lens.rays(pixels)
    assert np.linalg.norm(rays, axis=1) == pytest.approx(np.ones(len(rays)), abs=1e-14)
    assert np.abs(lens.project(rays * 3.7) - pixels).max() < 1e-9


@LENSES
def test_kernel_does_what_the_readable_lens_does(lens):
    points = lens.rays(picture(lens) + 0.3) * 0.3
    assert np.abs(lens.project(points) - optics.project(lens, points)).max() < 1e-9


@LENSES
def test_slopes_are_those_of_finite_differences(lens):
    points = lens.rays(picture(lens, 160) + 0.3) * 2.0
    _, by_point, by_lens = lens.project_with_slopes(points)
    for i, point in enumerate(points):
        assert by_point[i] == pytest.approx(finite_differences(lens.project, point), abs=1e-5)

    def by_parameters(parameters):
        changed = Lens.of_parameters(lens.kind, lens.width_px, lens.height_px, parameters)
        return changed.project(points)

    wanted = finite_differences(by_parameters, lens.parameters, 1e-4)
    assert np.abs(by_lens - wanted).max() < 1e-5


def test_the_optical_axis_meets_the_principal_point():
    for lens in (PINHOLE, FISHEYE):
        assert lens.project([0.0, 0.0, 2.0]) == pytest.approx(lens.principal_px)
        assert lens.rays(lens.principal_px) == pytest.approx([0.0, 0.0, 1.0])
        near = np.array([[1e-7, 2e-7, 1.0], [2e-6, -1e-6, 1.0]])
        assert lens.rays(lens.project(near)) == pytest.approx(near, rel=1e-6, abs=1e-15)


def test_a_fisheye_lens_without_distortion_counts_angles():
    lens = Lens("fisheye", 1000, 1000, (400.0, 400.0), (500.0, 500.0))
    angle = np.radians(70.0)
    assert lens.project([np.sin(angle), 0.0, np.cos(angle)]) == pytest.approx(
        [500.0 + 400.0 * angle, 500.0]
    )


def test_beyond_the_fold_there_is_neither_pixel_nor_ray():
    lens = Lens("pinhole", 1280, 720, (600.0, 600.0), (640.0, 360.0), (-0.3,))
    fold = np.sqrt(1.0 / 0.9)  # 1 - 0.9 r^2 = 0
    farthest = 640.0 + 600.0 * fold * (1.0 - 0.3 * fold**2)
    assert np.isfinite(lens.project([0.999 * fold, 0.0, 1.0])).all()
    assert np.isnan(lens.project([1.001 * fold, 0.0, 1.0])).all()
    assert np.isfinite(lens.rays([farthest - 0.01, 360.0])).all()
    assert np.isnan(lens.rays([farthest + 0.01, 360.0])).all()
    bent = Lens("fisheye", 1280, 720, (300.0, 300.0), (640.0, 360.0), (-0.3,))
    assert np.isnan(bent.rays([640.0 + 300.0, 360.0])).all()
    assert np.isnan(bent.project([5.0, 0.0, 1.0])).all()


@pytest.mark.parametrize("depth", [0.0, -1.0, np.nan])
def test_what_is_not_before_the_camera_has_no_pixel(depth):
    for lens in (PINHOLE, FISHEYE):
        assert np.isnan(lens.project([0.1, 0.1, depth])).all()
        assert np.isnan(lens.rays([np.nan, 3.0])).all()


def test_strong_decentring_does_not_fool_the_inverse():
    lens = Lens("pinhole", 1280, 720, (600.0, 600.0), (640.0, 360.0), (-0.25, 0.0, 0.02, -0.015))
    pixels = picture(lens, 20)
    rays = lens.rays(pixels)
    is_ray = np.isfinite(rays).all(axis=1)
    assert 0.5 < is_ray.mean() <= 1.0
    assert np.abs(lens.project(rays[is_ray]) - pixels[is_ray]).max() < 1e-9


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"kind": "mirror"}, "kind"),
        ({"focal_px": (0.0, 700.0)}, "focal_px"),
        ({"focal_px": (np.nan, 700.0)}, "finite"),
        ({"width_px": 12}, "width_px"),
        ({"height_px": 9000}, "height_px"),
        ({"distortion": (0.0,) * 6}, "distortion"),
    ],
)
def test_an_impossible_lens_is_refused_by_the_field_that_is_wrong(changes, word):
    fields = {
        "kind": "pinhole", "width_px": 640, "height_px": 480, "focal_px": (500.0, 500.0),
        "principal_px": (320.0, 240.0),
    }  # fmt: skip
    with pytest.raises(ValueError, match=word):
        Lens(**{**fields, **changes})


def test_a_picture_ends_half_a_pixel_beyond_its_outer_centres():
    shown = PINHOLE.shows([[-0.4, -0.4], [1279.4, 719.4], [-0.6, 3.0], [3.0, 719.6]])
    assert shown.tolist() == [True, True, False, False]
    assert not PINHOLE.shows([5.0, 300.0], margin_px=8.0)
