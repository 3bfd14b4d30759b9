"""Walls and shores that a robot keeps off."""

import math

import numpy as np
import pytest

from autonomy.site import LAKE, TANK
from autonomy.tracking.control.wall import Helm, Motion, WallGuard
from reproduction.tracking import unicycle

TURN_MAX_RAD_S = 0.05
MARGIN_M = 15.0
HELM = Helm(TURN_MAX_RAD_S)


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
    pose, turned, guard = (250.0, 250.0, heading_rad, 0.15), 0, WallGuard(HELM, MARGIN_M)
    for _ in range(4000):
        command = guard.step(Motion(pose[:2], *pose[2:]), (0.0, 0.0), LAKE)
        turned += command is not None
        pose = unicycle.advance(pose, *(command or (0.0, 0.0)), 0.5)
        assert LAKE.clearance_m(*pose[:2]) > MARGIN_M - 0.1
    assert turned > 0


def test_robot_far_from_any_shore_does_what_it_wants():
    now = Motion((250.0, 250.0), 0.0, 0.15)
    assert WallGuard(HELM, MARGIN_M).step(now, (0.01, 0.0), LAKE) is None


def test_robot_that_begins_outside_of_the_margin_turns_inward():
    pose = (250.0, 20.0, -math.pi / 2.0, 0.15)
    guard = WallGuard(HELM, MARGIN_M)
    before = LAKE.clearance_m(*pose[:2])
    for _ in range(300):
        command = guard.step(Motion(pose[:2], *pose[2:]), (0.0, 0.0), LAKE)
        pose = unicycle.advance(pose, *(command or (0.0, 0.0)), 0.5)
    assert LAKE.clearance_m(*pose[:2]) > before


@pytest.mark.parametrize("course_error_rad", [0.0, 0.1, -0.1])
def test_robot_that_answers_its_helm_late_turns_early_and_to_one_side(course_error_rad):
    helm = Helm(0.11, lag_s=4.0, speed_m_s=0.03)
    guard = WallGuard(helm, 0.5)
    north, east, rate, speed = 1.4, 1.0, 0.0, 0.05
    course = 0.5 * math.pi + course_error_rad
    turns = []
    for n in range(400):
        # a course that is known badly must not change the robot's mind
        seen = Motion((north, east), course + 0.3 * math.sin(0.5 * n), speed, rate)
        command = guard.step(seen, (0.0, 0.0), TANK)
        turns += [0.0 if command is None else command[0]]
        rate += (turns[-1] - rate) * 0.1 / helm.lag_s
        speed += ((helm.speed_m_s if command else 0.05) - speed) * 0.1 / helm.lag_s
        course += rate * 0.1
        north, east = north + speed * 0.1 * math.cos(course), east + speed * 0.1 * math.sin(course)
        assert TANK.clearance_m(north, east) > 0.4
    first = int(np.flatnonzero(turns)[0])
    assert len({math.copysign(1.0, turn) for turn in turns[first : first + 100] if turn}) == 1
