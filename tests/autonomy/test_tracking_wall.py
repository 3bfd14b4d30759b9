"""Walls and shores that a robot keeps off."""

import math

import numpy as np
import pytest

from autonomy.site import LAKE, TANK
from autonomy.tracking import unicycle
from autonomy.tracking.wall import turn_away

TURN_MAX_RAD_S = 0.05
MARGIN_M = 15.0


def test_clearance_is_the_distance_to_the_nearest_wall_or_shore():
    rng = np.random.default_rng(0)
    north, east = rng.uniform(-50.0, 550.0, (2, 500))
    box = LAKE.water
    walls = np.minimum.reduce(
        [north - box.x_min_m, box.x_max_m - north, east - box.y_min_m, box.y_max_m - east]
    )
    expected = np.minimum(walls, -LAKE.shoreline.distance_m(north, east))
    found = [LAKE.clearance_m(*place) for place in zip(north.tolist(), east.tolist(), strict=True)]
    assert found == pytest.approx(expected.tolist(), abs=1e-9)


def test_site_without_a_shoreline_ends_at_its_walls():
    assert TANK.clearance_m(0.0, 0.0) == pytest.approx(0.865)
    assert TANK.clearance_m(4.0, 0.0) == pytest.approx(-0.325)


@pytest.mark.parametrize("heading_rad", np.linspace(-math.pi, math.pi, 7, endpoint=False).tolist())
def test_robot_that_wants_straight_on_keeps_its_margin_from_a_shore(heading_rad):
    pose, turned = (250.0, 250.0, heading_rad, 0.15), 0
    for _ in range(4000):
        command = turn_away(pose[:2], *pose[2:], (0.0, 0.0), LAKE, MARGIN_M, TURN_MAX_RAD_S)
        turned += command is not None
        pose = unicycle.advance(pose, *(command or (0.0, 0.0)), 0.5)
        assert LAKE.clearance_m(*pose[:2]) > MARGIN_M - 0.1
    assert turned > 0


def test_robot_far_from_any_shore_does_what_it_wants():
    pose = (250.0, 250.0, 0.0, 0.15)
    assert turn_away(pose[:2], *pose[2:], (0.01, 0.0), LAKE, MARGIN_M, TURN_MAX_RAD_S) is None


def test_robot_that_begins_outside_of_the_margin_turns_inward():
    pose = (250.0, 20.0, -math.pi / 2.0, 0.15)
    before = LAKE.clearance_m(*pose[:2])
    for _ in range(300):
        command = turn_away(pose[:2], *pose[2:], (0.0, 0.0), LAKE, MARGIN_M, TURN_MAX_RAD_S)
        pose = unicycle.advance(pose, *(command or (0.0, 0.0)), 0.5)
    assert LAKE.clearance_m(*pose[:2]) > before
