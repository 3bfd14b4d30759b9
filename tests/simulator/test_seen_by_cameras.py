"""Simulated robots that cameras see have no sensor of their own that tells their place."""

from datetime import UTC, datetime
from pathlib import Path

import pytest
from pydantic import ValidationError

from robot_link.messages import RobotId
from simulator.fleet import FLEET
from simulator.robot import SimulatedBody
from simulator.settings import SimulatorSettings

MINI, GRACE = RobotId("mini-1"), RobotId("grace-1")
AT = datetime(2026, 11, 22, tzinfo=UTC)


def settings(**changes):
    values = {"robots": (MINI, GRACE), **changes}
    return SimulatorSettings(link_folder=Path(), wall_anchor=AT, time_anchor=AT, **values)


def fixes(definition):
    body = SimulatedBody(definition, 0)
    for _ in range(50):
        body.advance(0.1)
        yield body.read().fix_ne_m


def test_robot_before_cameras_never_reads_its_place_off_the_truth():
    assert not any(fixes(settings(fixed_by_cameras=(MINI,)).definition(MINI)))


def test_emulated_cameras_are_all_that_tells_a_robot_of_the_tank_its_place():
    below = settings(cameras=3, surface_depth_m=1.2)
    assert not any(fixes(below.definition(MINI)))
    assert below.definition(MINI).estimator.surface_depth_m == 1.2
    assert below.definition(GRACE) == FLEET[GRACE]


def test_robots_that_no_camera_sees_are_as_before():
    seen = settings(fixed_by_cameras=(MINI,), surface_depth_m=1.2)
    assert seen.definition(GRACE) == FLEET[GRACE]
    assert settings(surface_depth_m=1.2).definition(MINI) == FLEET[MINI]
    assert any(fixes(settings().definition(MINI)))


def test_depth_to_which_fixes_count_is_a_setting_of_the_robot_before_cameras():
    delivered = FLEET[MINI].estimator
    robot = settings(fixed_by_cameras=(MINI,), surface_depth_m=1.2).definition(MINI)
    assert robot.estimator == delivered.model_copy(update={"surface_depth_m": 1.2})
    assert settings(fixed_by_cameras=(MINI,)).definition(MINI).estimator == delivered


def test_robot_that_does_not_live_is_not_seen():
    with pytest.raises(ValidationError, match="fixed_by_cameras"):
        settings(robots=(GRACE,), fixed_by_cameras=(MINI,))
