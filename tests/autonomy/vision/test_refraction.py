"""Light through the water's surface and through a flat port."""

import numpy as np
import pytest

from autonomy.vision.lens import Lens
from autonomy.vision.reference import optics
from autonomy.vision.refraction import FlatPort, deepened, surface_sights, underwater_rays
from tests.autonomy.vision.slopes import finite_differences

EYE = np.array([0.4, -0.3, -2.5])
PORT = FlatPort()


def wet_points(n=1000, level=0.0):
    """Return points that are seen up to 60 deg from straight down."""
    rng = np.random.default_rng(1)
    depth = rng.uniform(1e-4, 3.0, n)
    angle, azimuth = np.radians(rng.uniform(0.0, 60.0, n)), rng.uniform(0.0, 2.0 * np.pi, n)
    reach = (level - EYE[2]) * np.tan(angle) + depth * np.tan(np.arcsin(np.sin(angle) / 1.333))
    return EYE + np.column_stack(
        [reach * np.cos(azimuth), reach * np.sin(azimuth), level - EYE[2] + depth]
    )


def test_a_ray_that_is_followed_back_meets_its_point():
    for level in (0.0, 0.12, -0.05):
        points = wet_points(level=level)
        sights, _ = surface_sights(EYE, points, level)
        directions = sights / np.linalg.norm(sights, axis=1, keepdims=True)
        entries, inside = underwater_rays(EYE, directions, level)
        below = (points[:, 2] - level) / inside[:, 2]
        assert np.abs(entries + below[:, None] * inside - points).max() < 1e-6


def test_snells_law_holds_where_the_light_leaves_the_water():
    points = wet_points()
    sights, _ = surface_sights(EYE, points)
    above = np.hypot(sights[:, 0], sights[:, 1]) / np.linalg.norm(sights, axis=1)
    rest = points - (EYE + sights)
    under = np.hypot(rest[:, 0], rest[:, 1]) / np.linalg.norm(rest, axis=1)
    assert np.abs(above - 1.333 * under).max() < 1e-12


def test_kernel_does_what_the_readable_surface_does_even_at_grazing_sight():
    rng = np.random.default_rng(2)
    distance, depth = rng.uniform(0.0, 60.0, 500), 10.0 ** rng.uniform(-6.0, 1.5, 500)
    points = EYE + np.column_stack([distance, np.zeros(500), 2.5 + depth])
    sights, _ = surface_sights(EYE, points)
    wanted = optics.surface_way_m(distance, np.full(500, 2.5), depth, 1.333)
    assert np.abs(sights[:, 0] - wanted).max() < 1e-9


def test_water_with_the_index_of_air_is_no_water():
    points = wet_points()
    lens = Lens("pinhole", 1280, 720, (736.0, 736.0), (640.0, 360.0))
    sights, _ = surface_sights(EYE, points, 0.0, 1.0)
    assert np.abs(lens.project(sights) - lens.project(points - EYE)).max() < 1e-9


def test_a_point_that_crosses_the_surface_moves_steadily():
    depths = np.linspace(-1e-3, 1e-3, 2001)
    points = np.column_stack([np.full(2001, 2.0), np.full(2001, 1.0), depths])
    sights, _ = surface_sights(EYE, points)
    slope = sights[:, :2] / sights[:, 2:]
    moved = np.linalg.norm(np.diff(slope, axis=0), axis=1)
    assert moved.max() < 1e-6


def test_surface_slopes_are_those_of_finite_differences():
    points = np.vstack([wet_points(20, 0.1), EYE + np.array([[0.0, 0.0, 3.1], [0.5, 0.2, 1.3]])])
    _, slopes = surface_sights(EYE, points, 0.1)
    for point, found in zip(points, slopes, strict=True):

        def sight(all_of, dry=point[2] < 0.1):
            assert dry == (all_of[5] < all_of[6])
            return surface_sights(all_of[:3], all_of[3:6], all_of[6], all_of[7])[0]

        at = np.array([*EYE, *point, 0.1, 1.333])
        assert found == pytest.approx(finite_differences(sight, at), abs=1e-7)


def test_an_eye_under_water_sees_nothing_through_the_surface():
    sights, _ = surface_sights([0.0, 0.0, 0.2], [[1.0, 0.0, 0.5]])
    assert np.isnan(sights).all()
    entries, inside = underwater_rays(EYE, [[0.6, 0.0, -0.8], [1.0, 0.0, 0.0]])
    assert np.isnan(entries).all()
    assert np.isnan(inside).all()


def test_a_thing_below_the_eye_is_deepened_to_where_it_is():
    there = EYE + np.array([0.02, 0.0, 2.5 + 0.8])
    looks = EYE + (there - EYE) * (2.5 + 0.8 / 1.333) / 3.3
    assert deepened(EYE, looks) == pytest.approx(there, abs=0.002)
    dry = EYE + np.array([0.1, 0.0, 1.0])
    assert deepened(EYE, dry) == pytest.approx(dry)


def points_behind_the_port(n=300):
    rng = np.random.default_rng(3)
    forward = rng.uniform(0.05, 4.0, n)
    return np.column_stack([rng.uniform(-1.5, 1.5, (n, 2)) * forward[:, None], forward])


def test_a_port_whose_media_are_all_air_is_the_pinhole():
    points = points_behind_the_port()
    sights, _ = FlatPort(glass_index=1.0).sights(points, index=1.0)
    assert np.abs(sights - points / points[:, 2:]).max() < 1e-12


def test_kernel_does_what_the_readable_port_does():
    points = points_behind_the_port()
    sights, _ = PORT.sights(points)
    wanted = optics.port_slope(PORT, np.hypot(points[:, 0], points[:, 1]), points[:, 2], 1.333)
    assert np.hypot(sights[:, 0], sights[:, 1]) == pytest.approx(wanted, rel=1e-9)


def test_a_ray_through_the_port_meets_the_point_that_is_seen_along_it():
    points = points_behind_the_port()
    points = points[np.hypot(points[:, 0], points[:, 1]) < 0.8 * points[:, 2]]
    sights, _ = PORT.sights(points)
    exits, inside = PORT.rays(sights / np.linalg.norm(sights, axis=1, keepdims=True))
    reach = (points[:, 2] - exits[:, 2]) / inside[:, 2]
    assert np.abs(exits + reach[:, None] * inside - points).max() < 1e-9
    assert np.isnan(PORT.rays([0.0, 0.6, -0.8])[0]).all()


def test_port_slopes_are_those_of_finite_differences():
    points = np.array([[0.0, 0.0, 1.0], [0.3, -0.2, 1.0], [-0.9, 0.4, 0.8], [0.02, 0.05, 0.1]])
    _, slopes = PORT.sights(points)
    for point, found in zip(points, slopes, strict=True):
        wanted = finite_differences(
            lambda at: PORT.sights(at[:3], at[3])[0], np.array([*point, 1.333]), 1e-4
        )
        assert found == pytest.approx(wanted, abs=1e-6)


def test_what_is_not_behind_the_window_is_not_seen():
    sights, _ = PORT.sights([[0.0, 0.0, 0.012], [0.0, 0.0, -1.0]])
    assert np.isnan(sights).all()


@pytest.mark.parametrize("wrong", [{"distance_m": -0.1}, {"glass_index": 0.9}])
def test_an_impossible_port_is_refused(wrong):
    with pytest.raises(ValueError, match="port"):
        FlatPort(**wrong)
