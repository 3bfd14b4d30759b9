"""Missions that follow a target under water, without fixes or by a beacon."""

import math

import numpy as np
import pytest

from robot_link.messages import CommandKind, OnboardPlanState, RobotMode
from robot_link.mission import Mission, MissionSettings
from robot_link.target_settings import TargetSettings
from simulator.fleet import GRACE_1, MINI_1
from tests.simulator.flight import Life, horizontal
from tests.simulator.pursuit_flight import (
    LAKE,
    TANK,
    begin,
    changed,
    report,
)


@pytest.mark.parametrize(
    ("config", "definition", "depth_m", "off_m"),
    [(TANK, MINI_1, 0.3, 0.02), (changed(LAKE, target={"kind": "virtual"}), GRACE_1, 3.0, 0.2)],
    ids=["tank", "lake"],
)
def test_pursuit_under_water_keeps_its_depth_with_little_work_of_the_pump(
    config, definition, depth_m, off_m
):
    life = begin(changed(config, motion={"depth_m": depth_m}), definition=definition)
    plant, limits = life.robot.body.plant, life.robot.definition.vehicle.limits
    assert life.live_until(lambda: plant.state[2] > depth_m - off_m, 300.0)
    life.live(30.0)
    depths_m, pumped_kg = [], 0.0
    for _ in range(600):
        before_kg = plant.state[12]
        life.live(0.1)
        depths_m.append(plant.state[2])
        pumped_kg += abs(plant.state[12] - before_kg)
    assert np.all(np.abs(np.array(depths_m) - depth_m) < off_m)
    assert pumped_kg < 0.2 * 60.0 * limits.m0_rate_kg_s
    assert life.executive.mode is RobotMode.TRACKING


def test_ranges_to_a_beacon_hold_the_position_of_a_robot_under_water():
    beacon = {"kind": "beacon", "north_m": 1.375, "east_m": 0.685, "depth_m": 0.3}
    config = changed(
        TANK,
        target=beacon,
        ranging={"variance_m2": 0.01},
        filter={"target_velocity": "known"},
        motion={"depth_m": 0.3},
    )
    stds, errors = {}, {}
    for does_answer in (True, False):
        life = begin(config, seed=3)
        for n in range(1200):
            if n % 5 == 0 and (does_answer or life.estimate.has_fix):
                at = life.robot.body.plant.position_ned
                life.robot.program.hear_range(math.dist(at, (1.375, 0.685, 0.3)), 0.0)
            life.live(0.1)
        stds[does_answer] = life.estimate.position_std_m
        errors[does_answer] = horizontal(
            life.estimate.position_ned, life.robot.body.plant.position_ned
        )
    assert stds[True] < stds[False]
    assert errors[True] < 4.0 * stds[True]


def test_robot_under_water_comes_up_for_a_fix_when_it_is_unsure_and_goes_on():
    settings = MissionSettings(2.0, 0.15, 80000.0, 0.5, 0.5)
    config = changed(TANK, motion={"depth_m": 0.3})
    life = Life()
    life.start(Mission.for_target(settings, TargetSettings.of(config)))
    life.live(240.0)
    after = life.notebook.modes[life.notebook.modes.index(RobotMode.TRACKING) :]
    ups = [RobotMode.TRACKING, RobotMode.ABORTING, RobotMode.SURFACED, RobotMode.TRACKING]
    assert after[:4] == ups
    # in a current of about 1 cm/s that nobody told, the way up of half a minute adds as much again
    assert life.track[:, 4].max() < 0.15 + 1.5 * 0.01 * 30.0
    assert life.executive.plan_state is OnboardPlanState.RUNNING


def test_robot_swims_as_deep_as_the_floor_lets_it():
    life = begin(changed(TANK, motion={"depth_m": 1.15}))
    life.live(90.0)
    began = len(life.track)
    life.live(30.0)
    floor_m = life.robot.definition.site.water.depth_max_m
    assert np.all(life.track[began:, 7] < floor_m - 0.1)
    assert np.all(life.track[began:, 7] > 0.6)
    assert life.executive.mode is RobotMode.TRACKING


def test_beacon_stays_where_the_mission_says_after_a_hold():
    where = (1.375, 0.685)
    beacon = {"kind": "beacon", "north_m": where[0], "east_m": where[1], "guess_std_m": 0.35}
    life = begin(changed(TANK, target=beacon))
    program = life.robot.program

    def hear_wrongly() -> None:
        for _ in range(50):
            own = life.robot.body.plant.position_ned
            program.hear_range(horizontal(own, (where[0] + 0.4, where[1] + 0.4)), 0.0)
            life.live(0.2)

    hear_wrongly()
    program.obey(CommandKind.HOLD, "")
    assert life.live_until(lambda: life.executive.mode is RobotMode.HOLDING, 20.0)
    program.obey(CommandKind.RESUME, "")
    assert life.live_until(lambda: life.executive.mode is RobotMode.TRACKING, 5.0)
    program.hear_range(horizontal(life.robot.body.plant.position_ned, where), 0.0)
    life.live(0.2)
    assert horizontal(report(life).hypotheses[0].position_ne_m, where) < 0.1
