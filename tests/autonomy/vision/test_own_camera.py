"""A robot's own camera under water: how far off it is, what it refuses, how its mount is found."""

import math

import numpy as np
import pytest

from autonomy.vision.calibration.board import BoardView
from autonomy.vision.calibration.lens_fit import LensCalibration
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.fix import Fix, NoFix
from autonomy.vision.onboard.mount_fit import FittedMount, TurnView, fit_mount
from autonomy.vision.onboard.own_camera import (
    AIR_LENS_REFUSED,
    Mount,
    OwnCamera,
    lens_under_water,
    own_camera_of,
)
from autonomy.vision.onboard.own_fix import TankWater, find_eye, find_self
from autonomy.vision.rigid import Pose, turned_by_rad
from tests.autonomy.vision.own_camera_tank import (
    LAYOUT,
    LENS,
    MOUNT,
    TrueEye,
    drawn_eyes,
    facing_wall,
    look,
    said_by,
    wet_board_views,
)

WATER = TankWater()
DISTANCES_M = (0.5, 1.0, 1.5, 2.0, 3.0)


@pytest.fixture(scope="module")
def eyes() -> list[TrueEye]:
    return drawn_eyes(40, 7)


def errors_m(eyes, camera_of, distance_m, seed):
    rng = np.random.default_rng(seed)
    errors = []
    for eye in eyes:
        body = facing_wall(rng, distance_m)
        seen = look(eye, body, rng, ids=(100, 101))
        found = find_self(camera_of(eye), LAYOUT, WATER, seen, telemetry=said_by(body, rng))
        errors.append(float(np.linalg.norm(found.pose.position_m - body.position_m)))
    return np.array(errors)


def test_with_two_tags_at_2_m_the_port_model_is_at_most_15_mm_off(eyes):
    errors = errors_m(eyes, lambda eye: eye.told, 2.0, 1)
    assert errors.mean() <= 0.015
    assert np.quantile(errors, 0.95) <= 0.035


def test_a_lens_of_the_air_is_refused_under_water_in_words(eyes):
    told = eyes[0].told
    bare = OwnCamera(told.lens, "air", told.mount)
    seen = look(eyes[0], facing_wall(np.random.default_rng(0), 1.0), np.random.default_rng(1))
    answer = find_self(bare, LAYOUT, WATER, seen)
    assert isinstance(answer, NoFix)
    assert answer.reason == AIR_LENS_REFUSED
    assert "under water" in answer.reason


def test_a_lens_of_the_air_would_be_a_quarter_of_the_distance_off(eyes):
    def as_if_fitted_in_water(eye):
        return OwnCamera(eye.told.lens, "water", eye.told.mount)

    errors = errors_m(eyes[:10], as_if_fitted_in_water, 2.0, 2)
    assert errors.min() > 0.4


def test_a_pinhole_fitted_to_boards_under_water_sees_straight_and_is_honest_of_it(eyes):
    eye = eyes[0]
    found = lens_under_water(LENS.width_px, LENS.height_px, wet_board_views(eye, 20, 3))
    assert isinstance(found, LensCalibration)
    assert found.lens.focal_px[0] / LENS.focal_px[0] == pytest.approx(1.333, rel=0.03)
    wet = OwnCamera(found.lens, "water", MOUNT, lens_covariance=found.covariance)
    for distance_m in DISTANCES_M:
        errors = errors_m([eye] * 10, lambda _: wet, distance_m, 4)
        assert errors.mean() < 0.015 + 0.01 * distance_m


def test_few_boards_under_water_are_refused_in_words(eyes):
    answer = lens_under_water(LENS.width_px, LENS.height_px, wet_board_views(eyes[0], 4, 3))
    assert isinstance(answer, Refusal)
    assert "10 are needed" in answer.reason
    nothing = [BoardView("dark", np.zeros((0, 3)), np.zeros((0, 2)))]
    assert isinstance(lens_under_water(640, 480, nothing), Refusal)


def test_the_robot_is_where_its_camera_says_and_claims_what_it_errs(eyes):
    rng = np.random.default_rng(5)
    squares, inside = [], 0
    for eye in eyes * 3:
        body = facing_wall(rng, rng.uniform(0.6, 2.5))
        seen = look(eye, body, rng)
        fix = find_self(eye.told, LAYOUT, WATER, seen, telemetry=said_by(body, rng))
        assert isinstance(fix, Fix)
        assert fix.has_telemetry
        off = fix.pose.position_m - body.position_m
        square = float(off @ np.linalg.solve(fix.tank_covariance[:3, :3], off))
        squares.append(square)
        inside += square <= 7.815
        assert turned_by_rad(fix.pose.rotation, body.rotation) < math.radians(4.0)
    assert 1.0 <= np.mean(squares) <= 4.5
    assert inside >= 0.9 * len(squares)


def test_one_tag_with_the_robots_own_tilt_is_never_turned_over(eyes):
    rng = np.random.default_rng(6)
    for eye in eyes:
        body = facing_wall(rng, rng.uniform(0.6, 2.0))
        seen = look(eye, body, rng, ids=(100,))
        if seen:
            fix = find_self(eye.told, LAYOUT, WATER, seen, telemetry=said_by(body, rng))
            assert turned_by_rad(fix.pose.rotation, body.rotation) < math.radians(10.0)


def test_a_depth_is_counted_from_the_real_surface(eyes):
    rng = np.random.default_rng(8)
    body = facing_wall(rng, 1.0)
    seen = look(eyes[0], body, rng)
    still = find_self(eyes[0].told, LAYOUT, WATER, seen)
    lower = find_self(eyes[0].told, LAYOUT, TankWater(0.1, 0.02), seen)
    assert still.depth_m - lower.depth_m == pytest.approx(0.1, abs=1e-6)
    assert lower.position_covariance[2, 2] - still.position_covariance[2, 2] == pytest.approx(
        0.02**2 - 0.005**2, rel=1e-3
    )


def test_a_camera_out_of_the_water_and_tags_above_it_give_no_fix(eyes):
    rng = np.random.default_rng(9)
    seen = look(eyes[0], facing_wall(rng, 1.0), rng)
    answer = find_self(eyes[0].told, LAYOUT, TankWater(0.9), seen)
    assert isinstance(answer, NoFix)
    assert isinstance(find_self(eyes[0].told, LAYOUT, TankWater(1.2), seen), NoFix)


def test_a_turn_before_wall_tags_makes_a_rough_drawing_better():
    """Judged over draws: what the turn can tell is nearer, and claimed honestly."""
    rng = np.random.default_rng(11)
    before, after, squares = [], [], []
    for eye in drawn_eyes(20, 12):
        drawn = Mount.of_angles(
            eye.mount.position_m + rng.normal(0.0, 0.01, 3),
            *rng.normal(0.0, math.radians(3.0), 3).tolist(),
            position_std_m=0.01,
            angle_std_rad=math.radians(3.0),
        )
        fitted = fit_mount(drawn, turn(eye, rng))
        assert isinstance(fitted, FittedMount)
        truth = eye.mount.pose
        before.append(turned_by_rad(drawn.pose.rotation, truth.rotation))
        after.append(turned_by_rad(fitted.mount.pose.rotation, truth.rotation))
        turned = truth.rotation.T @ fitted.mount.pose.rotation
        small = 0.5 * np.array(
            [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
        )
        off = np.append(fitted.mount.pose.position_m - truth.position_m, small)
        squares.append(float(off @ np.linalg.solve(fitted.mount.covariance, off)))
    assert np.mean(after) < 0.6 * np.mean(before)
    assert 3.0 <= np.mean(squares) <= 9.0  # 6 is right


def turn(eye: TrueEye, rng: np.random.Generator) -> list[TurnView]:
    compass = rng.normal(0.0, math.radians(3.0))
    views = []
    for heading in np.linspace(-0.6, 0.6, 25):
        place = [*rng.normal([3.0, 1.5], 0.02), 0.5]
        roll, pitch = rng.normal(0.0, 0.05, 2)
        body = Pose.of_angles(place, roll, pitch, heading)
        found = find_eye(eye.told, LAYOUT, WATER, look(eye, body, rng))
        if isinstance(found, Fix):
            said = rng.normal([roll, pitch, heading + compass], [0.035, 0.035, 0.035]).tolist()
            views.append(TurnView(found, *said, 0.5 + rng.normal(0.0, 0.005)))
    return views


def test_a_turn_that_is_too_small_or_of_another_place_is_refused_in_words(eyes):
    rng = np.random.default_rng(13)
    views = turn(eyes[0], rng)
    few = fit_mount(MOUNT, views[:5])
    assert isinstance(few, Refusal)
    assert "pictures" in few.reason
    small = [view for view in views if abs(view.heading_rad) < 0.3]
    refused = fit_mount(MOUNT, small * 2)
    assert isinstance(refused, Refusal)
    assert "deg" in refused.reason
    upside_down = Mount.of_angles((0.2, 0.0, 0.0), roll_rad=math.pi)
    assert isinstance(fit_mount(upside_down, views), Refusal)


GOOD = {
    "lens": {
        "width_px": 1296,
        "height_px": 972,
        "focal_px": [745.0, 745.0],
        "principal_px": [648.0, 486.0],
        "measured_in": "air",
    },
    "port": {"distance_m": 0.01},
    "mount": {"position_m": [0.2, 0.0, 0.0]},
}


def test_a_document_tells_a_camera_that_looks_forward():
    camera = own_camera_of(GOOD)
    assert camera.refusal == ""
    ahead = camera.mount.pose.of_points([1.2, 0.0, 0.0])
    np.testing.assert_allclose(ahead, [0.0, 0.0, 1.0], atol=1e-12)
    below = camera.mount.pose.of_points([1.2, 0.0, 0.1])
    np.testing.assert_allclose(below, [0.0, 0.1, 1.0], atol=1e-12)
    starboard = camera.mount.pose.of_points([1.2, 0.1, 0.0])
    np.testing.assert_allclose(starboard, [0.1, 0.0, 1.0], atol=1e-12)


def test_a_port_and_a_lens_fitted_under_water_are_not_taken_together():
    camera = own_camera_of({**GOOD, "lens": {**GOOD["lens"], "measured_in": "water"}})
    assert "port" in camera.refusal


@pytest.mark.parametrize(
    ("wrong", "path"),
    [
        ({"lens": {**GOOD["lens"], "measured_in": "ice"}}, "lens.measured_in"),
        ({"lens": {**GOOD["lens"], "width_px": 12}}, "lens: width_px"),
        ({"lens": {**GOOD["lens"], "focal_px": [745.0, float("nan")]}}, "lens.focal_px.1"),
        ({"mount": {"position_m": [0.2, 0.0]}}, "mount.position_m.2"),
        ({"mount": {"position_m": [0, 0, 0], "angle_std_deg": 90}}, "mount.angle_std_deg"),
        ({"port": {"glass_index": 0.5}}, "port.glass_index"),
        ({"index": 1.0}, "index"),
        ({"windows": 2}, "windows"),
    ],
)
def test_a_wrong_document_is_refused_with_its_path(wrong, path):
    with pytest.raises(ValueError, match=path):
        own_camera_of({**GOOD, **wrong})
