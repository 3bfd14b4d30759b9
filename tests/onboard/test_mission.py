"""Whole missions, flown headless: what the robot does, and what it says of it."""

from itertools import pairwise

import numpy as np
import pytest

from autonomy.planner.leg import primitive
from autonomy.planner.leg.edge import legs_duration_s, legs_energy
from autonomy.planner.plan import Leg, PrimitiveKind
from onboard.link.robot_link import CommandOutcome
from robot_link.messages import CommandKind, OnboardPlanState, RobotMode
from simulator.fleet import GRACE_1
from tests.simulator.flight import (
    LAKE_PLANNER,
    TANK_PLANNER,
    Life,
    horizontal,
    mission,
    two_dives,
    vee,
)

UNDER_WATER = (RobotMode.GLIDING, RobotMode.SPIRALLING, RobotMode.DIVING)


def dive_until(life: Life, depth_m: float) -> None:
    assert life.live_until(lambda: life.estimate.depth_m > depth_m, 120.0)


def test_robot_without_mission_floats_at_the_surface():
    life = Life()
    life.live(60.0)
    assert life.track[:, 7].max() < 0.03
    assert life.notebook.modes == [RobotMode.IDLE]
    assert life.estimate.has_fix


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_dive_reaches_its_depth_and_ends_near_its_node(seed):
    life = Life(seed=seed)
    plan = mission(*vee())
    track = life.fly(plan)
    assert life.executive.plan_state is OnboardPlanState.DONE
    assert 0.85 * 0.5 < track[:, 7].max() < 1.2 * 0.5
    assert horizontal(track[-1, 5:7], plan.legs[-1].end_ned) < 0.45


def test_mission_of_every_primitive_comes_home():
    north, east = 0.6, 0.6
    down = primitive.glide(TANK_PLANNER, (north, east, 0.0), (north + 0.4, east, 0.4))
    bend = primitive.spiral(TANK_PLANNER, down.end_ned, 0.0, 0.3, 0.5, 0.0)
    swim = primitive.swim(TANK_PLANNER, bend.end_ned, (1.7, bend.end_ned[1], 0.0))
    sink = primitive.dive(TANK_PLANNER, swim.end_ned, 0.35)
    rise = primitive.dive(TANK_PLANNER, sink.end_ned, 0.0)
    life = Life()
    track = life.fly(mission(down, bend, swim, sink, rise))
    assert life.executive.plan_state is OnboardPlanState.DONE
    assert {
        RobotMode.GLIDING,
        RobotMode.SPIRALLING,
        RobotMode.SWIMMING,
        RobotMode.DIVING,
    } <= set(life.notebook.modes)
    assert horizontal(track[-1, 5:7], rise.end_ned) < 0.7
    assert life.estimate.depth_m < 0.03


def test_lake_robot_dives_deep_and_comes_up_near_its_node():
    life = Life(GRACE_1)
    legs = vee((120.0, 120.0), 0.8, 12.0, config=LAKE_PLANNER)
    track = life.fly(mission(*legs, max_uncertainty_m=20.0))
    assert life.executive.plan_state is OnboardPlanState.DONE
    assert 0.85 * 12.0 < track[:, 7].max() < 1.1 * 12.0
    assert horizontal(track[-1, 5:7], legs[-1].end_ned) < 12.0


def test_next_dive_begins_where_the_robot_surfaced_and_leads_to_the_planned_node():
    first = vee((0.5, 0.4), 0.2, 0.4)
    second = vee(first[-1].end_ned[:2], 0.9, 0.4)
    life = Life(seed=5)
    track = life.fly(mission(*first, *second))
    assert horizontal(track[-1, 5:7], second[-1].end_ned) < 0.45


def test_swim_under_water_keeps_its_depth():
    down = primitive.dive(TANK_PLANNER, (0.5, 0.5, 0.0), 0.3)
    swim = primitive.swim(TANK_PLANNER, down.end_ned, (1.8, 0.7, 0.3))
    up = primitive.dive(TANK_PLANNER, swim.end_ned, 0.0)
    life = Life()
    plan = mission(down, swim, up)
    life.start(plan)
    assert life.live_until(lambda: life.executive.mode is RobotMode.SWIMMING, 120.0)
    began = len(life.track)
    assert life.live_until(lambda: life.executive.mode is not RobotMode.SWIMMING, 120.0)
    depths = life.track[began + 80 :, 7]
    assert np.all(np.abs(depths - 0.3) < 0.15)


def test_done_is_reported_with_the_energy_of_the_plan_and_the_price_of_delays():
    life = Life()
    plan = mission(*vee())
    track = life.fly(plan)
    state, leg, energy, reason = life.notebook.plans[-1]
    planned = sum(leg.energy for leg in plan.legs)
    delay_s = len(track) * 0.1 - sum(leg.duration_s for leg in plan.legs)
    assert (state, leg, reason) == (OnboardPlanState.DONE, 2, "")
    assert energy == pytest.approx(planned + 0.005 * delay_s, abs=0.02)


def test_flown_time_and_energy_are_the_planned_ones_because_surfacings_are_counted():
    there = two_dives()
    north, east, _ = there[-1].end_ned
    bend = primitive.spiral(TANK_PLANNER, (north, east, 0.0), 0.4, 0.35, 0.9, 0.45)
    rise = primitive.dive(TANK_PLANNER, bend.end_ned, 0.0)
    legs = (*there, bend, rise, *vee(rise.end_ned[:2], 0.2, 0.4))
    flown_s = energy = 0.0
    for seed in (1, 2, 3):
        life = Life(seed=seed)
        flown_s += 0.1 * len(life.fly(mission(*legs))) / 3.0
        assert life.executive.plan_state is OnboardPlanState.DONE
        energy += life.executive.energy_used / 3.0
    assert flown_s == pytest.approx(legs_duration_s(TANK_PLANNER, legs), rel=0.2)
    assert flown_s > 1.2 * sum(leg.duration_s for leg in legs)
    assert energy == pytest.approx(legs_energy(TANK_PLANNER, legs), rel=0.02)


def test_energy_of_a_leg_falls_due_as_it_is_flown():
    life = Life()
    plan = mission(*vee())
    life.start(plan)
    dive_until(life, 0.25)
    share = life.executive.energy_used / plan.legs[0].energy
    assert 0.3 < share < 0.8


def test_samples_come_at_the_period_on_legs_and_nowhere_else():
    life = Life()
    life.fly(mission(*vee(), sample_period_s=1.5))
    times = [at for _, _, _, at in life.notebook.samples]
    gaps = [(b - a).total_seconds() for a, b in pairwise(times)]
    assert len(times) > 20
    assert all(1.45 < gap < 1.65 for gap in gaps)
    taken = len(times)
    life.live(10.0)
    assert len(life.notebook.samples) == taken


def test_position_is_less_and_less_certain_under_water_and_fixed_at_the_surface():
    life = Life()
    track = life.fly(mission(*vee()))
    life.live(3.0)
    deep = track[track[:, 3] > 0.1]
    assert np.all(np.diff(deep[:, 4]) > 0.0)
    assert deep[-1, 4] > 0.05
    assert life.estimate.position_std_m < 0.01


def test_estimate_is_wrong_by_about_what_the_robot_says():
    errors = []
    for seed in range(12):
        life = Life(seed=seed)
        life.start(mission(*vee(depth_m=0.6)))
        dive_until(life, 0.5)
        row = life.track[-1]
        errors += [(row[5] - row[1]) / row[4], (row[6] - row[2]) / row[4]]
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.7


def test_surface_now_aborts_a_dive_and_the_robot_stays_up():
    life = Life()
    life.start(mission(*two_dives()))
    dive_until(life, 0.3)
    assert life.robot.program.obey(CommandKind.SURFACE, "") is CommandOutcome.DONE
    life.live(0.1)
    assert life.notebook.modes[-1] is RobotMode.ABORTING
    assert life.live_until(lambda: life.executive.mode is RobotMode.IDLE, 40.0)
    state, _, _, reason = life.notebook.plans[-1]
    assert (state, reason) == (OnboardPlanState.FAILED, "surfaced by command")
    life.live(30.0)
    assert life.track[-300:, 7].max() < 0.05
    assert life.robot.program.obey(CommandKind.SURFACE, "") is CommandOutcome.DONE


def test_uncertainty_limit_brings_the_robot_up_and_the_next_dive_follows():
    life = Life()
    life.start(mission(*two_dives(), max_uncertainty_m=0.04))
    assert life.live_until(lambda: life.executive.mode is RobotMode.ABORTING, 120.0)
    assert life.estimate.position_std_m == pytest.approx(0.04, abs=0.003)
    assert life.live_until(lambda: life.executive.mode is not RobotMode.ABORTING, 60.0)
    assert life.estimate.depth_m < 0.05
    assert life.executive.leg == 2
    assert life.executive.plan_state is OnboardPlanState.RUNNING


def test_robot_comes_up_before_the_floor():
    life = Life()
    deep = primitive.dive(TANK_PLANNER, (0.5, 0.5, 0.0), 1.19)
    back = primitive.dive(TANK_PLANNER, deep.end_ned, 0.0)
    track = life.fly(mission(deep, back))
    assert RobotMode.ABORTING in life.notebook.modes
    assert track[:, 7].max() < 1.2


def test_robot_comes_up_near_a_wall():
    life = Life(seed=2)
    there = primitive.glide(TANK_PLANNER, (0.5, 1.3, 0.0), (0.5, 2.2, 0.9))
    back = primitive.glide(TANK_PLANNER, there.end_ned, (0.5, 1.4, 0.0))
    track = life.fly(mission(there, back))
    assert RobotMode.ABORTING in life.notebook.modes
    assert track[:, 6].max() < 2.25


def test_timeout_ends_the_mission():
    life = Life()
    life.fly(mission(*vee(), timeout_s=30.0))
    state, _, _, reason = life.notebook.plans[-1]
    assert state is OnboardPlanState.FAILED
    assert reason == "the mission took longer than 30 s"


def test_hold_suspends_at_the_next_surfacing_and_resume_continues():
    life = Life()
    life.start(mission(*two_dives()))
    dive_until(life, 0.2)
    assert life.robot.program.obey(CommandKind.HOLD, "") is CommandOutcome.DONE
    assert life.live_until(lambda: life.executive.mode is RobotMode.HOLDING, 120.0)
    life.live(30.0)
    assert life.executive.mode is RobotMode.HOLDING
    assert life.robot.program.obey(CommandKind.RESUME, "") is CommandOutcome.DONE
    assert life.live_until(lambda: life.executive.plan_state is OnboardPlanState.DONE, 300.0)


def test_hold_before_a_dive_keeps_the_robot_up():
    life = Life()
    life.start(mission(*vee(heading_rad=2.0)))
    life.live(1.0)
    assert life.executive.mode is RobotMode.TURNING
    life.robot.program.obey(CommandKind.HOLD, "")
    life.live(60.0)
    assert life.executive.mode is RobotMode.HOLDING
    assert life.track[:, 7].max() < 0.05


def test_hold_and_resume_mean_nothing_without_a_mission():
    life = Life()
    assert life.robot.program.obey(CommandKind.HOLD, "") is CommandOutcome.NOT_NOW
    assert life.robot.program.obey(CommandKind.RESUME, "") is CommandOutcome.NOT_NOW


def test_start_needs_the_hash_of_the_plan_on_board():
    life = Life()
    plan = mission(*vee())
    program = life.robot.program
    assert program.obey(CommandKind.START, plan.sha256()[:12]) is CommandOutcome.WRONG_PLAN
    program.take_plan(plan)
    assert program.obey(CommandKind.START, "0" * 12) is CommandOutcome.WRONG_PLAN
    assert program.obey(CommandKind.START, "") is CommandOutcome.WRONG_PLAN
    assert program.obey(CommandKind.START, plan.sha256()[:12]) is CommandOutcome.DONE


def test_start_twice_does_not_begin_again():
    life = Life()
    plan = mission(*vee())
    life.start(plan)
    dive_until(life, 0.2)
    digits = plan.sha256()[:12]
    assert life.robot.program.obey(CommandKind.START, digits) is CommandOutcome.DONE
    life.live(1.0)
    assert life.executive.mode is RobotMode.GLIDING


def test_no_plan_is_taken_while_one_is_flown():
    life = Life()
    assert life.robot.program.plan_refusal() == ""
    life.start(mission(*vee()))
    life.live(1.0)
    assert "running" in life.robot.program.plan_refusal()
    life.robot.program.obey(CommandKind.SURFACE, "")
    assert life.live_until(lambda: life.robot.program.plan_refusal() == "", 30.0)


def test_plan_that_leaves_the_water_is_not_flown():
    life = Life()
    outside = primitive.glide(TANK_PLANNER, (0.5, 0.5, 0.0), (9.0, 0.5, 0.5))
    assert life.start(mission(outside)) is CommandOutcome.NOT_NOW
    life.live(1.0)
    state, _, _, reason = life.notebook.plans[-1]
    assert state is OnboardPlanState.FAILED
    assert "leg 1 leaves the water" in reason


def test_plan_without_speed_is_not_flown():
    life = Life()
    still = Leg(PrimitiveKind.DIVE, (0.5, 0.5, 0.0), (0.5, 0.5, 0.3), 0.0, 10.0, 1.0)
    assert life.start(mission(still)) is CommandOutcome.NOT_NOW


def test_empty_battery_ends_the_mission_and_allows_no_other():
    life = Life()
    plan = mission(*vee())
    life.start(plan)
    dive_until(life, 0.2)
    life.robot.body.battery.fraction = 0.04
    assert life.live_until(lambda: life.executive.mode is RobotMode.IDLE, 60.0)
    assert life.notebook.plans[-1][3] == "the battery is below 5%"
    assert life.start(plan) is CommandOutcome.NOT_NOW


def test_robot_waits_at_the_surface_for_acknowledgements_but_not_for_long():
    life = Life()
    life.start(mission(*two_dives()))
    dive_until(life, 0.2)
    life.notebook.unacknowledged_samples = 7
    assert life.live_until(lambda: life.executive.leg == 2, 120.0)
    waited_from_s = life.robot.program.time_s
    assert life.live_until(lambda: life.executive.mode is RobotMode.GLIDING, 120.0)
    waited_s = life.robot.program.time_s - waited_from_s
    assert 28.0 < waited_s < 60.0
    assert RobotMode.SURFACED in life.notebook.modes


def test_robot_far_from_the_start_swims_there_first():
    life = Life()
    life.start(mission(*vee((2.0, 0.7), 2.8)))
    life.live(1.0)
    assert life.executive.mode is RobotMode.SWIMMING
    assert life.live_until(lambda: life.executive.mode is RobotMode.GLIDING, 120.0)
    assert horizontal(life.estimate.position_ned, (2.0, 0.7)) < 0.8


def test_idle_robot_swims_back_into_its_domain():
    life = Life()
    life.robot.body.plant.state[0:2] = (-0.7, 1.9)
    life.live(90.0)
    north, east, _ = life.robot.body.plant.position_ned
    assert -0.3 < north < 1.5
    assert east < 1.8


def test_same_seed_lives_the_same_life():
    one, same, other = (Life(seed=seed) for seed in (7, 7, 8))
    for life in (one, same, other):
        life.start(mission(*vee()))
        life.live(40.0)
    assert np.array_equal(one.track, same.track)
    assert one.notebook.samples == same.notebook.samples
    assert not np.array_equal(one.track, other.track)
