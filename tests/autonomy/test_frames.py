import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from autonomy import frames

ANGLE = st.floats(-3.1, 3.1)
LATITUDE = st.floats(-80.0, 80.0)
LONGITUDE = st.floats(-179.0, 179.0)
METRES = st.floats(-20_000.0, 20_000.0)


@given(st.lists(st.tuples(METRES, METRES, METRES), min_size=1))
def test_turning_to_the_view_twice_changes_nothing(points):
    ned = np.array(points)
    assert np.array_equal(frames.ned_to_enu(frames.ned_to_enu(ned)), ned)


def test_depth_points_down_in_the_view():
    assert frames.ned_to_enu(np.array([1.0, 2.0, 3.0])).tolist() == [2.0, 1.0, -3.0]


@given(st.floats(-1e4, 1e4))
def test_wrapped_angle_is_the_same_direction_within_half_a_turn(angle):
    wrapped = float(frames.wrap_angle(angle))
    assert -math.pi <= wrapped < math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0, abs=1e-9)


def test_angle_just_below_minus_half_a_turn_stays_in_range():
    assert float(frames.wrap_angle(np.nextafter(-math.pi, -4.0))) == -math.pi


@given(ANGLE, ANGLE, ANGLE)
def test_rotation_is_orthonormal_and_right_handed(roll, pitch, heading):
    rotation = frames.rotation_ned_from_body(roll, pitch, heading)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0, abs=1e-12)


def test_nose_up_moves_forward_and_up_and_heading_east_moves_east():
    climbing = frames.rotation_ned_from_body(0.0, math.radians(30.0), math.radians(90.0))
    forward = climbing @ [1.0, 0.0, 0.0]
    assert forward == pytest.approx([0.0, math.cos(math.pi / 6), -0.5], abs=1e-12)


@given(ANGLE, ANGLE, ANGLE)
def test_view_quaternion_turns_like_the_matrix(roll, pitch, heading):
    w, x, y, z = frames.quaternion_enu_from_body(roll, pitch, heading)
    assert w * w + x * x + y * y + z * z == pytest.approx(1.0, abs=1e-12)
    turned = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    expected = frames.ned_to_enu(frames.rotation_ned_from_body(roll, pitch, heading).T).T
    assert turned == pytest.approx(expected, abs=1e-12)


@given(LATITUDE, LONGITUDE, METRES, METRES)
def test_a_point_keeps_its_place_on_the_map_and_back(latitude, longitude, north, east):
    place = frames.wgs84_from_ned([north, east], latitude, longitude)
    back = frames.ned_from_wgs84(place[0], place[1], latitude, longitude)
    assert back == pytest.approx([north, east], abs=1e-6)


def test_a_degree_north_is_as_long_as_the_meridian_says():
    # 111,132.954 m - 559.822 cos(2 lat) + 1.175 cos(4 lat): length of a degree of latitude
    latitude = 45.0
    north, east = frames.ned_from_wgs84(latitude + 0.01, -84.0, latitude, -84.0)
    assert north == pytest.approx(0.01 * (111_132.954 - 1.175), rel=2e-6)
    assert east == pytest.approx(0.0, abs=1e-9)


def test_many_points_are_placed_at_once():
    offsets = np.zeros((4, 5, 2))
    assert frames.wgs84_from_ned(offsets, 42.0, -84.0).shape == (4, 5, 2)
    assert frames.ned_from_wgs84(np.full(7, 42.0), np.full(7, -84.0), 42.0, -84.0) == pytest.approx(
        np.zeros((7, 2)), abs=1e-9
    )
