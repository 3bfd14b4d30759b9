"""Patterns, over areas and lines that are drawn at run time."""

import math

import numpy as np
import pytest

from autonomy.design import pattern
from autonomy.site import Area


@pytest.fixture
def rng():
    return np.random.default_rng()


def ragged(rng, corners=9, radius_m=100.0):
    """Return a polygon around the origin that may be hollow, in order of its angles."""
    angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, corners))
    while np.diff(angles, append=angles[0] + 2.0 * math.pi).max() > 2.5:
        angles = np.sort(rng.uniform(0.0, 2.0 * math.pi, corners))
    reach = radius_m * rng.uniform(0.4, 1.0, corners)
    return [(r * math.cos(a), r * math.sin(a)) for r, a in zip(reach, angles, strict=True)]


def test_lines_of_a_lawnmower_cover_any_area_within_half_a_spacing_of_its_width(rng):
    for _ in range(40):
        corners = ragged(rng)
        spacing_m, heading = rng.uniform(6.0, 25.0), rng.uniform(-4.0, 4.0)
        ends = pattern.lawnmower(corners, spacing_m, heading)
        area = Area(name="area", corners_m=tuple(corners))
        side = np.array([-math.sin(heading), math.cos(heading)])
        for point in rng.uniform(-100.0, 100.0, (60, 2)):
            if not area.contains(*point):
                continue
            across = [abs((np.array(end) - point) @ side) for end in ends]
            assert min(across) <= 0.5 * spacing_m + 1e-9
        for end in ends:
            assert float(area.distance_m(*end)) <= 1e-6


def test_lawnmower_goes_to_and_fro(rng):
    ends = pattern.lawnmower([(0, 0), (100, 0), (100, 60), (0, 60)], 20.0, 0.0)
    assert np.allclose(ends, [(0, 10), (100, 10), (100, 30), (0, 30), (0, 50), (100, 50)])


def test_square_expands_by_a_spacing_each_half_turn(rng):
    spacing, heading, turns = rng.uniform(1, 50), rng.uniform(-3, 3), int(rng.integers(1, 8))
    corners = np.array(pattern.expanding_square((3.0, 4.0), spacing, turns, heading))
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    assert np.allclose(lengths, spacing * (np.arange(4 * turns) // 2 + 1))


def test_turns_of_a_spiral_lie_a_spacing_apart(rng):
    spacing, radius = rng.uniform(5, 20), rng.uniform(60, 120)
    points = np.array(pattern.spiral_out((0.0, 0.0), spacing, radius))
    reach = np.hypot(*points.T)
    angles = np.unwrap(np.arctan2(points[1:, 1], points[1:, 0]))
    assert reach[-1] == pytest.approx(radius)
    assert np.allclose(np.diff(reach[1:]) / np.diff(angles), spacing / (2.0 * math.pi))


def test_lines_of_a_star_go_through_its_centre_and_alternate(rng):
    centre, lines = rng.uniform(-50, 50, 2), int(rng.integers(2, 12))
    ends = np.array(pattern.star(tuple(centre), 30.0, lines, rng.uniform(-3, 3)))
    assert np.allclose(0.5 * (ends[::2] + ends[1::2]), centre)
    crossing = np.hypot(*(ends[2::2] - ends[1:-1:2]).T)
    assert (crossing < 60.0 * math.sin(math.pi / lines / 2.0) + 1e-9).all()


def test_a_line_beside_a_line_keeps_its_distance(rng):
    for _ in range(30):
        bends = np.cumsum(rng.uniform(-0.9, 0.9, 6))
        steps = rng.uniform(30.0, 60.0, 6)[:, None] * np.column_stack(
            [np.cos(bends), np.sin(bends)]
        )
        line = [(0.0, 0.0), *map(tuple, np.cumsum(steps, axis=0))]
        offset = rng.uniform(-8.0, 8.0)
        beside = np.array(pattern.beside_line(line, offset))
        for a, b, c, d in zip(line, line[1:], beside, beside[1:], strict=False):
            along = (np.array(b) - a) / math.dist(a, b)
            starboard = np.array([-along[1], along[0]])
            assert (c - a) @ starboard == pytest.approx(offset)
            assert (d - a) @ starboard == pytest.approx(offset)


def test_a_line_with_a_corner_twice_is_refused_by_its_number():
    with pytest.raises(ValueError, match="corners 2 and 3"):
        pattern.passes([(0, 0), (1, 0), (1, 0)], 2, 5.0)


def test_an_isobath_is_followed_at_its_depth_with_shallow_water_to_starboard(rng):
    for _ in range(20):
        top, widths = rng.uniform(10, 30), rng.uniform(60, 120, 2)

        def floor_m(north, east, top=top, widths=widths):
            return top * (1.0 - (north / widths[0]) ** 2 - (east / widths[1]) ** 2)

        depth = rng.uniform(0.3, 0.8) * top
        near = tuple(rng.uniform(-40, 40, 2))
        points = np.array(
            pattern.isobath(floor_m, depth, near, 150.0, 5.0, is_reversed=False, reach_m=200.0)
        )
        assert len(points) == 31
        assert np.abs(floor_m(*points.T) - depth).max() < 0.1
        steps = np.diff(points, axis=0)
        middle = 0.5 * (points[1:] + points[:-1])
        starboard = np.column_stack([-steps[:, 1], steps[:, 0]])
        starboard *= (4.0 / np.hypot(*starboard.T))[:, None]
        assert (floor_m(*(middle + starboard).T) < floor_m(*middle.T)).all()


def test_an_isobath_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match="no such depth within 50 m"):
        pattern.isobath(
            lambda north, east: 5.0 + 0.0 * north * east,
            9.0, (0.0, 0.0), 10.0, 5.0, is_reversed=False, reach_m=50.0,
        )  # fmt: skip
