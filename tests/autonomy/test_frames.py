import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod

from autonomy import frames

ANGLE = st.floats(-3.1, 3.1)
LATITUDE = st.floats(-80.0, 80.0)
LONGITUDE = st.floats(-179.0, 179.0)
METRES = st.floats(-20_000.0, 20_000.0)
EARTH = Geod(ellps="WGS84")
PAIRS = Path(__file__).parents[1] / "data" / "geodesic_pairs.json"
"""Places in frames of drawn origins; the app's conversion is held against the same file."""
REACH_M = 50_000.0


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


def placed(origin, azimuth_deg, distance_m):
    """Return latitude and longitude at the end of a geodesic."""
    longitude, latitude, _ = EARTH.fwd(origin[1], origin[0], azimuth_deg, distance_m)
    return latitude, longitude


def north_east(azimuth_deg, distance_m):
    azimuth = math.radians(azimuth_deg)
    return distance_m * np.array([math.cos(azimuth), math.sin(azimuth)])


def ahead(origin, place_m, heading_deg):
    """Return azimuth from a place to one 10 m ahead of it in the frame, all by geodesics."""
    there = place_m + north_east(heading_deg, 10.0)
    ends = [
        placed(origin, math.degrees(math.atan2(e, n)), math.hypot(n, e))
        for n, e in (place_m, there)
    ]
    return EARTH.inv(ends[0][1], ends[0][0], ends[1][1], ends[1][0])[0]


def test_places_and_headings_within_50_km_are_those_of_geodesics():
    generator = np.random.default_rng()
    worst_m, worst_back_m, worst_deg = 0.0, 0.0, 0.0
    for _ in range(1000):
        origin = (generator.uniform(-80.0, 80.0), generator.uniform(-180.0, 180.0))
        azimuth, distance = generator.uniform(0.0, 360.0), generator.uniform(0.0, REACH_M)
        heading = generator.uniform(0.0, 360.0)
        place, true = north_east(azimuth, distance), placed(origin, azimuth, distance)
        latitude, longitude = frames.wgs84_from_ned(place, *origin)
        worst_m = max(worst_m, EARTH.inv(true[1], true[0], longitude, latitude)[2])
        back = frames.ned_from_wgs84(*true, *origin)
        worst_back_m = max(worst_back_m, math.hypot(*(back - place)))
        lead = math.degrees(frames.convergence_rad(place, origin[0]))
        off = math.remainder(heading + lead - ahead(origin, place, heading), 360.0)
        worst_deg = max(worst_deg, abs(off))
    figures = f"{worst_m:.2g} m, back {worst_back_m:.2g} m, {worst_deg:.2g} deg"
    print(f"worst of 1000 within 50 km: {figures}")  # noqa: T201 - the figures of the bar
    assert worst_m < 1e-3
    assert worst_back_m < 1e-3
    assert worst_deg < 0.01


def test_the_app_is_held_against_true_geodesics():
    pairs = json.loads(PAIRS.read_text())
    assert len(pairs) == 200
    for pair in pairs:
        origin, place = pair["origin"], np.array(pair["north_east_m"])
        azimuth, distance = math.degrees(math.atan2(place[1], place[0])), math.hypot(*place)
        assert distance <= REACH_M
        latitude, longitude = placed(origin, azimuth, distance)
        assert pair["wgs84"] == pytest.approx([latitude, longitude], abs=1e-9)
        assert pair["heading_deg"] == pytest.approx(
            ahead(origin, place, pair["frame_heading_deg"]) % 360.0, abs=1e-6
        )


def test_a_frame_reaches_over_the_antimeridian():
    latitude, longitude = frames.wgs84_from_ned([0.0, 20_000.0], -17.0, 179.95)
    assert longitude == pytest.approx(-179.862, abs=1e-3)
    assert frames.ned_from_wgs84(latitude, longitude, -17.0, 179.95) == pytest.approx(
        [0.0, 20_000.0], abs=1e-6
    )


def test_true_north_follows_a_robot_on_its_way():
    north = frames.TrueNorth(60.0)
    for east in np.arange(0.0, 50_000.0, 40.0):
        exact = float(frames.convergence_rad([1000.0, east], 60.0))
        assert math.degrees(abs(north.convergence_rad(1000.0, float(east)) - exact)) < 1e-3


def test_a_robot_on_its_way_is_placed_as_a_single_point_is():
    generator = np.random.default_rng()
    for latitude, longitude in ((43.0, 5.0), (-79.0, 179.9999), (0.0, -180.0)):
        geodetic = frames.LocalGeodetic()
        way = np.cumsum(generator.normal(0.0, 5.0, (300, 2)), axis=0)
        found = np.array([geodetic.at(*place, latitude, longitude) for place in way.tolist()])
        assert frames.ned_from_wgs84(*found.T, latitude, longitude) == pytest.approx(way, abs=2e-3)
        assert ((found[:, 1] >= -180.0) & (found[:, 1] < 180.0)).all()
    elsewhere = geodetic.at(*way[-1].tolist(), 60.0, 10.0)
    assert elsewhere == pytest.approx(tuple(frames.wgs84_from_ned(way[-1], 60.0, 10.0)), abs=1e-12)
