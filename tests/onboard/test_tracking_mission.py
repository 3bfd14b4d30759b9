"""Missions that follow a target, swum by the whole simulated robot."""

import math
from dataclasses import astuple, replace

import numpy as np
import pytest

from autonomy.planner.leg import primitive
from autonomy.planner.plan import PrimitiveKind
from autonomy.tracking.phase import TargetPhase
from onboard.link.robot_link import CommandOutcome
from robot_link.messages import CommandKind, OnboardPlanState, RobotMode
from simulator.fleet import GRACE_1, MINI_1
from tests.simulator.flight import TANK_PLANNER, Life, horizontal
from tests.simulator.pursuit_flight import (
    LAKE,
    TANK,
    begin,
    changed,
    end,
    error_m,
    order,
    phase,
    report,
)


def test_robot_orbits_a_virtual_target_one_way_round_and_knows_where_it_is():
    life = begin(TANK)
    life.live(60.0)
    told = []
    for _ in range(180):
        life.live(1.0)
        told.append(report(life))
    distances = [horizontal(one.position_ne_m, one.true_ne_m) for one in told]
    assert all(0.1 < distance < 1.4 for distance in distances)
    assert max(error_m(one) for one in told) < 0.5
    assert len({math.copysign(1.0, one.determinant_m2_s) for one in told}) == 1
    bearings = np.unwrap(
        [
            math.atan2(
                one.position_ne_m[1] - one.true_ne_m[1], one.position_ne_m[0] - one.true_ne_m[0]
            )
            for one in told
        ]
    )
    assert abs(bearings[-1] - bearings[0]) > 2.0 * math.pi
    assert life.executive.mode is RobotMode.TRACKING


def test_estimate_diverges_where_the_teaching_switch_takes_the_barrier_off():
    wrong = 0
    lesson = changed(TANK, target={"speed_m_s": 0.01}, barrier={"controller": "nominal"})
    for seed in (1, 4, 5):
        life = begin(lesson, seed)
        wrong += life.live_until(lambda life=life: is_wrong(life), 400.0)
        assert not report(life).is_barrier_on
    assert wrong >= 2


def test_robot_that_teaches_says_of_no_silence_that_it_searches():
    life = begin(changed(TANK, barrier={"controller": "nominal"}), seed=1)
    life.live(20.0)
    assert life.robot.program.obey(CommandKind.QUIET, "") is CommandOutcome.DONE
    assert life.live_until(lambda: phase(life) is TargetPhase.LOST, 30.0)
    assert life.executive.mode is RobotMode.TRACKING


def is_wrong(life: Life) -> bool:
    told = life.robot.program.target_report()
    return told is not None and len(told.hypotheses) > 0 and error_m(told) > 1.0


def test_target_that_falls_silent_is_lost_and_found_again():
    life = begin(TANK, seed=1)
    life.live(40.0)
    program = life.robot.program
    assert program.obey(CommandKind.QUIET, "") is CommandOutcome.DONE
    heard = report(life).ranges_heard
    assert life.live_until(lambda: phase(life) is TargetPhase.COASTING, 10.0)
    assert life.live_until(lambda: phase(life) is TargetPhase.LOST, 30.0)
    assert life.executive.mode is RobotMode.SEARCHING
    assert report(life).is_quiet
    life.live(20.0)
    assert report(life).ranges_heard == heard
    assert program.obey(CommandKind.PING, "") is CommandOutcome.DONE
    assert life.live_until(lambda: phase(life) is TargetPhase.TRACKING, 60.0)
    life.live(60.0)
    assert error_m(report(life)) < 0.6


def test_mission_is_done_after_its_duration_and_the_report_falls_silent_soon_after():
    life = begin(changed(TANK, motion={"duration_s": 20.0}))
    assert end(life, 25.0) == (OnboardPlanState.DONE, "")
    assert phase(life) is TargetPhase.ENDED
    life.live(30.0)
    assert phase(life) is TargetPhase.ENDED
    life.live(40.0)
    assert life.robot.program.target_report() is None
    assert life.executive.mode is RobotMode.IDLE


def test_surface_now_ends_the_pursuit():
    life = begin(TANK)
    life.live(10.0)
    life.robot.program.obey(CommandKind.SURFACE, "")
    assert end(life, 20.0) == (OnboardPlanState.FAILED, "surfaced by command")


def test_held_robot_floats_without_pinging_and_goes_on_where_it_was():
    life = begin(TANK)
    life.live(30.0)
    program = life.robot.program
    program.obey(CommandKind.HOLD, "")
    assert life.live_until(lambda: life.executive.mode is RobotMode.HOLDING, 20.0)
    assert program.target_report() is None
    assert program.wants_range() is None
    life.live(10.0)
    program.obey(CommandKind.RESUME, "")
    assert life.live_until(lambda: life.executive.mode is RobotMode.TRACKING, 5.0)
    life.live(45.0)
    assert error_m(report(life)) < 0.6


@pytest.mark.parametrize("held_s", [1.0, 30.0])
def test_held_robot_grows_in_doubt_and_goes_on_with_what_it_believed(held_s):
    patience = {"coast_after_s": 2.0, "lost_after_s": 5.0, "give_up_after_s": 10.0}
    life = begin(changed(TANK, target={"kind": "tag"}, ranging=patience))
    program = life.robot.program
    where = (1.2, 0.7)

    def pings(seconds: float) -> None:
        for _ in range(round(seconds / 0.5)):
            program.hear_range(horizontal(life.robot.body.plant.position_ned, where), 0.0)
            life.live(0.5)

    pings(60.0)
    before = report(life)
    program.obey(CommandKind.HOLD, "")
    assert life.live_until(lambda: life.executive.mode is RobotMode.HOLDING, 20.0)
    life.live(held_s)
    program.obey(CommandKind.RESUME, "")
    assert life.live_until(lambda: program.wants_range() is not None, 5.0)
    life.live(0.2)
    after = report(life)
    assert after.ranges_heard == before.ranges_heard
    doubt, guessed = (one.hypotheses[0].covariance_m2 for one in (after, before))
    assert guessed[0] + guessed[2] < doubt[0] + doubt[2]
    assert horizontal(after.hypotheses[0].position_ne_m, where) < 0.4
    pings(0.5)
    assert report(life).ranges_heard == before.ranges_heard + 1
    pings(20.0)
    assert life.executive.mode is RobotMode.TRACKING


def test_range_from_before_a_hold_is_not_taken_for_a_new_one():
    life = begin(changed(TANK, target={"kind": "tag"}))
    life.live(1.0)
    program = life.robot.program
    program.hear_range(0.7, 0.1)
    life.live(0.5)
    program.obey(CommandKind.HOLD, "")
    program.hear_range(0.7, 0.1)
    assert life.live_until(lambda: life.executive.mode is RobotMode.HOLDING, 20.0)
    program.obey(CommandKind.RESUME, "")
    assert life.live_until(lambda: life.executive.mode is RobotMode.TRACKING, 5.0)
    life.live(0.5)
    assert report(life).ranges_heard == 1
    program.hear_range(0.7, 0.1)
    life.live(0.5)
    assert report(life).ranges_heard == 2


def test_virtual_target_is_never_pinged_and_a_tag_is_until_the_robot_shall_be_quiet():
    virtual, real = begin(TANK), begin(changed(TANK, target={"kind": "tag", "address": 12}))
    virtual.live(1.0)
    real.live(1.0)
    assert virtual.robot.program.wants_range() is None
    assert real.robot.program.wants_range() == 12
    real.robot.program.obey(CommandKind.QUIET, "")
    assert real.robot.program.wants_range() is None


def test_tag_that_never_answers_is_given_up_without_swimming_away():
    patience = {"coast_after_s": 1.0, "lost_after_s": 2.0, "give_up_after_s": 15.0}
    life = begin(changed(TANK, target={"kind": "tag"}, ranging=patience))
    where = life.robot.body.plant.position_ned
    life.live(10.0)
    life.robot.program.hear_range(None, 0.2)
    assert phase(life) is TargetPhase.WAITING
    state, reason = end(life, 20.0)
    assert state is OnboardPlanState.FAILED
    assert "no range of the target was heard" in reason
    assert horizontal(where, life.robot.body.plant.position_ned) < 0.5


def test_target_that_swims_off_faster_than_the_robot_ends_the_mission():
    swift = {"path": "line", "speed_m_s": 0.3, "heading_rad": 0.0}
    life = begin(changed(TANK, target=swift))
    state, reason = end(life, 200.0)
    assert state is OnboardPlanState.FAILED
    assert "the target is faster than the robot" in reason


def test_track_that_stays_lost_is_given_up():
    life = begin(changed(TANK, ranging={"give_up_after_s": 20.0}))
    life.live(10.0)
    life.robot.program.obey(CommandKind.QUIET, "")
    state, reason = end(life, 60.0)
    assert state is OnboardPlanState.FAILED
    assert reason.startswith("track lost for 20 s")


def test_empty_battery_ends_the_pursuit():
    life = begin(TANK)
    life.live(5.0)
    life.robot.body.battery.fraction = 0.04
    assert end(life, 30.0)[1] == "the battery is below 5%"


@pytest.mark.parametrize("ashore_ne_m", [(-60.0, 120.0), (20.0, 30.0)])
def test_robot_that_drifted_out_of_its_water_says_so(ashore_ne_m):
    assert not GRACE_1.site.shoreline.contains(*ashore_ne_m)
    life = begin(LAKE, definition=GRACE_1)
    life.live(5.0)
    life.robot.body.plant.state[:2] = ashore_ne_m
    state, reason = end(life, 120.0)
    assert state is OnboardPlanState.FAILED
    assert "left the water" in reason


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 0.0, -1.0, 1e300])
def test_bad_ranges_are_counted_and_move_nothing_but_finite_set_points(bad):
    life = begin(changed(TANK, target={"kind": "tag"}))
    program = life.robot.program
    life.live(0.5)
    sent = []
    actuate = life.robot.body.actuate
    life.robot.body.actuate = lambda command: (sent.append(command), actuate(command))[1]
    for n in range(60):
        program.hear_range(bad if n % 2 else 0.9, math.nan if n % 5 == 0 else 0.1)
        life.live(0.1)
    assert np.isfinite([astuple(command) for command in sent]).all()
    told = report(life)
    assert told.ranges_heard == 60
    assert told.ranges_rejected >= 30 - (bad == 0.0) * 30
    assert np.isfinite(told.command).all()


@pytest.mark.parametrize(
    ("config", "definition", "target"),
    [
        (TANK, MINI_1, {"north_m": 50.0}),
        (TANK, MINI_1, {"kind": "tag", "depth_m": 1.5}),
        (LAKE, GRACE_1, {"north_m": 20.0, "east_m": 30.0}),
    ],
)
def test_target_outside_of_the_water_is_refused_by_name(config, definition, target):
    life = Life(definition)
    assert life.start(order(changed(config, target=target))) is CommandOutcome.NOT_NOW
    life.live(0.2)
    assert "the target is not in the water" in life.notebook.plans[-1][3]


def test_velocity_of_a_tag_cannot_be_known():
    life = Life()
    config = changed(TANK, target={"kind": "tag"}, filter={"target_velocity": "known"})
    assert life.start(order(config)) is CommandOutcome.NOT_NOW


def test_same_plan_and_seed_track_the_same():
    one, same = begin(TANK, seed=4), begin(TANK, seed=4)
    for life in (one, same):
        life.live(30.0)
    assert report(one) == report(same)
    assert np.array_equal(one.track, same.track)


def test_pursuit_keeps_its_distance_from_the_walls_of_the_tank():
    near = {"north_m": 2.6, "east_m": 0.7, "path": "static"}
    life = begin(changed(TANK, target=near))
    life.live(240.0)
    water = life.robot.definition.site.water
    assert life.track[:, 5].max() < water.x_max_m - 0.05
    assert life.track[:, 6].max() < water.y_max_m - 0.05


def test_pursuit_waits_for_a_fix():
    life = Life()
    read = life.robot.body.read
    life.robot.body.read = lambda: replace(read(), fix_ne_m=None)
    life.live(3.0)
    assert life.start(order(TANK)) is CommandOutcome.DONE
    life.live(10.0)
    assert life.executive.mode is RobotMode.SURFACED
    life.robot.body.read = read
    assert life.live_until(lambda: life.executive.mode is RobotMode.TRACKING, 5.0)


def test_pursuit_costs_its_time_and_the_beats_of_its_tail():
    life = begin(TANK)
    life.live(100.0)
    energy = TANK_PLANNER.energy
    most = primitive.energy(PrimitiveKind.SWIM, 100.0, energy)
    assert 0.5 * most < life.executive.energy_used < 1.02 * most
    program = life.robot.program
    program.obey(CommandKind.HOLD, "")
    assert life.live_until(lambda: life.executive.mode is RobotMode.HOLDING, 20.0)
    before = life.executive.energy_used
    life.live(100.0)
    assert life.executive.energy_used - before == pytest.approx(100.0 * energy.time_factor)


def test_robot_that_follows_a_target_measures_the_field_at_the_missions_period():
    life = begin(TANK)
    life.live(20.0)
    samples = life.notebook.samples
    assert len(samples) == pytest.approx(20.0 / order(TANK).settings.sample_period_s, abs=1.5)
    own = life.robot.body.plant.position_ned
    assert horizontal(samples[-1][1], own) < 0.3
    assert all(0.0 < std_m < 0.2 for _, _, std_m, _ in samples)
