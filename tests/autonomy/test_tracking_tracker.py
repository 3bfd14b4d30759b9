"""The tracker: what it does with a target, and with everything that can go wrong."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.site import TANK, Box
from autonomy.tracking.config import (
    TRACKING_PRESETS,
    BarrierConfig,
    FilterConfig,
    MotionConfig,
    RangingConfig,
)
from autonomy.tracking.phase import TargetPhase
from autonomy.tracking.tracker import RangeHeard, Tracker, TrackerReading, TrackerStart
from reproduction.tracking import unicycle
from tests.autonomy.tracking_water import DT_S, QUICK, Water, settings, silent

MINUTE = RangingConfig(period_s=0.1, lost_after_s=15.0, give_up_after_s=120.0)


def spread(step):
    nn, ne, ee = step.hypotheses[0].covariance_m2
    return math.sqrt(0.5 * (nn + ee) + math.hypot(0.5 * (nn - ee), ne))


def test_a_target_near_the_first_guess_is_orbited_and_known():
    water = Water(settings(guess_ne_m=(0.3, -0.2)))
    step = water.swim(60.0)
    assert step.phase is TargetPhase.TRACKING
    assert (step.reason, step.note) == ("", "")
    assert water.error < 0.3
    assert water.distance < 1.0
    assert step.ranges_heard == 600
    assert sum(one.weight for one in step.hypotheses) == pytest.approx(1.0)


def test_before_the_first_range_it_waits_and_then_gives_up_with_a_sentence():
    water = Water(settings())
    step = water.swim(39.0, silent)
    assert (step.phase, step.command, step.hypotheses) == (TargetPhase.WAITING, (0.0, 0.0), ())
    step = water.swim(2.0, silent)
    assert step.phase is TargetPhase.ENDED
    assert step.reason == "no range of the target was heard in 40 s"


def test_a_target_far_from_the_first_guess_is_found():
    water = Water(settings(guess_ne_m=(-3.0, 8.0)))
    assert water.swim(0.1).phase is TargetPhase.LOST
    step = water.swim(50.0)
    assert step.phase is TargetPhase.TRACKING
    assert water.error < 0.5


def test_silence_for_a_minute_widens_the_estimate_and_the_target_is_found_again():
    water = Water(settings(ranging=MINUTE))
    water.swim(40.0)
    before = spread(water.newest)
    phases = [water.swim(1.0, silent).phase for _ in range(60)]
    assert phases[:2] == [TargetPhase.TRACKING] * 2
    assert phases[3:14] == [TargetPhase.COASTING] * 11
    assert phases[15:] == [TargetPhase.LOST] * 45
    assert spread(water.newest) > 3.0 * before
    assert "no range was believed" in water.newest.note
    assert water.newest.range_age_s == pytest.approx(60.0, abs=0.2)
    step = water.swim(40.0)
    assert step.phase is TargetPhase.TRACKING
    assert water.error < 0.5


def test_silence_without_end_ends_the_track_with_a_sentence():
    water = Water(settings())
    water.swim(10.0)
    step = water.swim(60.0, silent)
    assert step.phase is TargetPhase.ENDED
    assert step.reason.startswith("track lost for 40 s: no range was believed")
    assert step.command == (0.0, 0.0)
    assert water.swim(1.0).phase is TargetPhase.ENDED


@pytest.mark.parametrize("bad", [math.nan, math.inf, -1.0, 1e300, -math.inf])
def test_a_range_that_is_no_distance_is_counted_and_changes_nothing(bad):
    clean, dirty = Water(settings()), Water(settings())
    clean.swim(5.0)
    step = dirty.swim(5.0, lambda range_m: (RangeHeard(range_m), RangeHeard(bad)))
    assert step.hypotheses == clean.newest.hypotheses
    assert step.command == clean.newest.command
    assert step.ranges_rejected == clean.newest.ranges_rejected + 50
    assert step.range_m == clean.newest.range_m


@pytest.mark.parametrize("age_s", [math.nan, -1.0, math.inf, 1e4])
def test_a_range_of_no_time_is_counted_and_not_used(age_s):
    water = Water(settings())
    water.swim(1.0)
    step = water.swim(5.0, lambda range_m: (RangeHeard(range_m, age_s),))
    assert step.ranges_rejected == 50
    assert step.phase is TargetPhase.COASTING


def test_only_bad_ranges_end_the_track_as_silence_does():
    water = Water(settings())
    step = water.swim(41.0, lambda _: (RangeHeard(math.nan),))
    assert (step.phase, step.ranges_rejected) == (TargetPhase.ENDED, 410)
    assert "no range of the target was heard" in step.reason


def test_a_target_on_top_of_the_robot_measures_zero_and_is_survived():
    water = Water(settings(guess_std_m=0.2), pose=(0.0, 0.0, 0.3, 0.1))
    step = water.swim(3.0, lambda _: (RangeHeard(0.0),))
    assert step.phase in {TargetPhase.TRACKING, TargetPhase.LOST}
    assert np.isfinite(step.hypotheses[0].position_ne_m).all()
    step = water.swim(40.0)
    assert step.phase is TargetPhase.TRACKING
    assert water.error < 0.5


def test_single_jumps_of_the_range_are_not_believed():
    water = Water(settings())
    water.swim(30.0)
    rejected = water.newest.ranges_rejected
    jumps = iter(range(100_000))
    step = water.swim(20.0, lambda r: (RangeHeard(r + (25.0 if next(jumps) % 4 == 0 else 0.0)),))
    assert step.phase is TargetPhase.TRACKING
    assert step.ranges_rejected - rejected >= 50
    assert water.error < 0.4


def test_a_range_that_jumps_and_stays_is_believed_and_the_target_found_there():
    water = Water(settings())
    water.swim(30.0)
    water.target = np.array([9.0, 7.0])
    water.swim(1.5)
    assert water.newest.phase is TargetPhase.LOST
    assert "contradict" in water.newest.note
    step = water.swim(60.0)
    assert step.phase is TargetPhase.TRACKING
    assert water.error < 0.5


def test_ranges_without_sense_end_the_track():
    water = Water(settings())
    water.swim(10.0)
    wild = np.random.default_rng(4)
    step = water.swim(70.0, lambda _: (RangeHeard(wild.uniform(0.0, 5000.0)),))
    assert step.phase is TargetPhase.ENDED
    assert step.reason.startswith("track lost for 40 s")


def test_a_standing_robot_says_so_and_ends():
    water = Water(settings(), pose=(-3.0, 1.0, 0.5, 0.0))
    water.is_moved = False
    first = spread(water.swim(1.0))
    step = water.swim(20.0)
    assert step.phase is TargetPhase.LOST
    assert "the robot stands" in step.note
    assert spread(step) > first
    step = water.swim(40.0)
    assert step.phase is TargetPhase.ENDED
    assert "the robot stands" in step.reason


def test_a_target_faster_than_the_robot_is_left_alone():
    water = Water(settings())
    water.swim(10.0)
    water.velocity = np.array([2.0, 0.0])
    step = water.swim(40.0)
    assert step.phase is TargetPhase.ENDED
    assert step.reason.startswith("the target is faster than the robot")


def test_a_robot_that_does_not_know_its_heading_coasts_then_is_lost():
    water = Water(settings())
    water.swim(10.0)
    for phase, seconds in ((TargetPhase.COASTING, 4.0), (TargetPhase.LOST, 6.0)):
        for _ in range(round(seconds / DT_S)):
            reading = replace(water.measured(), heading_rad=math.nan, own_ne_m=(math.nan, 0.0))
            step = water.tracker.step(reading, DT_S)
            assert np.isfinite([*step.command, *step.hypotheses[0].position_ne_m]).all()
        assert step.phase is phase
    assert "heading and speed" in step.note
    assert water.swim(20.0).phase is TargetPhase.TRACKING


@pytest.mark.parametrize("controller", ["nominal", "mpc_condition", "mpc_trace"])
def test_every_controller_commands_within_its_limits(controller):
    config = settings(barrier=BarrierConfig(controller=controller))
    water = Water(config)
    water.swim(3.0)
    motion = config.motion
    for step in water.steps:
        assert abs(step.command[0]) <= motion.turn_rate_max_rad_s
        assert motion.acceleration_min_m_s2 <= step.command[1] <= motion.acceleration_max_m_s2


def test_a_known_velocity_is_used_and_told():
    water = Water(settings(filter=FilterConfig(target_velocity="known")))
    reading = replace(water.measured(), target_velocity_ne_m_s=(0.02, -0.01))
    assert water.tracker.step(reading, 0.0).hypotheses[0].velocity_ne_m_s == (0.02, -0.01)


def test_a_late_range_gives_a_bank_exactly_the_answer_that_it_gives_in_order():
    config = settings(filter=FilterConfig(hypotheses="two"))
    in_order, late = (Tracker(config, TrackerStart((-3.0, 1.0), 0.5, 0.2)) for _ in range(2))
    rng = np.random.default_rng(8)
    pending = []
    for n in range(200):
        own = (-3.0 + 0.02 * n, 1.0)
        heard = RangeHeard(float(abs(math.hypot(*own) + rng.normal(0.0, 0.3))))
        reading = TrackerReading(own, 0.5 + rng.normal(0.0, 0.1), 0.2 + rng.normal(0.0, 0.3))
        command = (rng.uniform(-0.5, 0.5), rng.uniform(-0.01, 0.01))
        dt_s = DT_S if n else 0.0
        first = in_order.step(replace(reading, ranges=(heard,) if n % 3 == 0 else ()), dt_s)
        if n % 3 == 0:
            pending.append((n + int(rng.integers(0, 25)), n, heard.range_m))
        due = [one for one in pending if one[0] <= n or n == 199]
        pending = [one for one in pending if one not in due]
        arrived = tuple(RangeHeard(r, DT_S * (n - since)) for _, since, r in due)
        second = late.step(replace(reading, ranges=arrived), dt_s)
        in_order.applied(command)
        late.applied(command)
    assert first.hypotheses == second.hypotheses
    assert first.ranges_rejected == second.ranges_rejected


def test_near_a_wall_it_turns_inward_and_stays_in_the_tank():
    config = settings(guess_ne_m=(1.4, 0.4), guess_std_m=0.3)
    water = Water(config, pose=(1.0, 0.5, 0.3, 0.15), target=(1.4, 0.3))
    tank = TANK.model_copy(
        update={"water": Box(x_min_m=0.0, x_max_m=2.75, y_min_m=0.0, y_max_m=2.0)}
    )
    turned = 0
    for n in range(1200):
        step = water.tracker.step(water.measured(), DT_S if n else 0.0)
        kept = water.tracker.keep_inside(step, water.pose[:2], tank)
        turned += kept.command != step.command
        water.pose = unicycle.advance(water.pose, *kept.command, DT_S)
        assert tank.clearance_m(*water.pose[:2]) >= 0.0
    assert turned > 0


def test_the_same_readings_give_the_same_steps():
    first, second = Water(settings()), Water(settings())
    first.swim(20.0)
    second.swim(20.0)
    assert first.steps == second.steps


@pytest.mark.parametrize(
    "start",
    [
        TrackerStart((math.nan, 0.0), 0.0, 0.1),
        TrackerStart((0.0, 0.0), math.inf, 0.1),
        TrackerStart((0.0, 0.0), 0.0, math.nan),
    ],
)
def test_a_tracker_starts_at_numbers_only(start):
    with pytest.raises(ValueError, match="must start at finite own_ne_m"):
        Tracker(settings(), start)


@pytest.mark.parametrize("dt_s", [-0.1, math.nan, 61.0])
def test_time_goes_forward(dt_s):
    water = Water(settings())
    with pytest.raises(ValueError, match="dt_s must be from 0 to 60 s"):
        water.tracker.step(water.measured(), dt_s)


def test_thresholds_are_those_of_the_settings():
    ranging = QUICK.model_copy(update={"coast_after_s": 1.0, "lost_after_s": 2.0})
    water = Water(settings(ranging=ranging))
    water.swim(5.0)
    assert water.swim(1.5, silent).phase is TargetPhase.COASTING
    assert water.swim(1.0, silent).phase is TargetPhase.LOST


def test_a_robot_told_not_to_ping_says_so():
    water = Water(settings())
    water.swim(5.0)
    for _ in range(50):
        step = water.tracker.step(replace(water.measured(silent), is_quiet=True), DT_S)
    assert step.phase is TargetPhase.COASTING
    assert step.note == "the robot was told not to ping; no range was believed for 5 s"


def test_a_track_cannot_coast_between_two_ranges():
    with pytest.raises(ValueError, match=r"coast_after_s \(3 s\) must exceed period_s \(5 s\)"):
        RangingConfig(period_s=5.0)


def test_without_the_barrier_the_estimate_diverges_in_the_tank_and_with_it_it_does_not():
    tank = TANK.model_copy(
        update={"water": Box(x_min_m=0.0, x_max_m=3.1, y_min_m=0.0, y_max_m=4.6)}
    )
    errors = {}
    for controller in ("nominal", "barrier"):
        config = settings(
            guess_ne_m=(1.7, 1.4),
            ranging=RangingConfig(period_s=0.1),
            barrier=BarrierConfig(controller=controller),
            motion=MotionConfig(speed_max_m_s=0.3),
        )
        water = Water(config, pose=(0.5, 0.6, 0.7, 0.1), target=(1.5, 1.6), seed=3)
        errors[controller] = []
        for n in range(2000):
            water.newest = water.tracker.step(water.measured(), DT_S if n else 0.0)
            kept = water.tracker.keep_inside(water.newest, water.pose[:2], tank)
            water.pose = unicycle.advance(water.pose, *kept.command, DT_S)
            errors[controller].append(water.error)
        assert len(water.newest.hypotheses) == 1 or controller == "barrier"
    assert np.mean(errors["nominal"]) > 1.5
    assert np.mean(errors["barrier"]) < 0.2


def test_the_teaching_mode_tells_a_contradiction_and_does_not_search():
    config = settings(guess_ne_m=(-6.0, 2.0), barrier=BarrierConfig(controller="nominal"))
    water = Water(config)
    water.swim(15.0)
    lost = [step for step in water.steps if step.phase is TargetPhase.LOST]
    assert lost
    assert all(step.command == step.nominal for step in lost)
    assert water.newest.ranges_rejected == 0


def test_a_robot_that_runs_away_by_mistake_does_not_blame_the_target():
    water = Water(settings(ranging=MINUTE, barrier=BarrierConfig(controller="nominal")))
    water.swim(160.0)
    assert water.distance > 20.0
    assert water.newest.phase is TargetPhase.ENDED
    assert water.newest.reason.startswith("track lost for 120 s: the ranges contradict")


def test_a_robot_that_waits_is_left_where_it_is_near_a_wall():
    water = Water(settings(), pose=(0.05, 0.05, -2.0, 0.2))
    step = water.tracker.step(water.measured(silent), 0.0)
    tank = TANK.model_copy(
        update={"water": Box(x_min_m=0.0, x_max_m=3.0, y_min_m=0.0, y_max_m=3.0)}
    )
    assert water.tracker.keep_inside(step, water.pose[:2], tank) is step


@pytest.mark.parametrize(
    ("kind", "told", "expected"),
    [
        ("beacon", None, (0.0, 0.0)),
        ("virtual", (0.03, 0.0), (0.03, 0.0)),
        ("virtual", (math.nan, 0.0), None),
        ("virtual", None, None),
    ],
)
def test_a_velocity_is_known_of_a_beacon_and_where_it_is_told(kind, told, expected):
    config = settings(filter=FilterConfig(target_velocity="known"))
    config = config.model_copy(update={"target": config.target.model_copy(update={"kind": kind})})
    water = Water(config)
    for n in range(100):
        reading = replace(water.measured(), target_velocity_ne_m_s=told)
        step = water.tracker.step(reading, DT_S if n else 0.0)
    if expected is None:
        assert 0.0 < math.hypot(*step.hypotheses[0].velocity_ne_m_s) < 0.3
    else:
        assert step.hypotheses[0].velocity_ne_m_s == expected


def test_a_command_that_is_none_is_neither_taken_nor_given():
    class Broken:
        def command(self, *_):
            return (math.nan, 0.0)

    one, other = Water(settings()), Water(settings())
    one.swim(1.0)
    other.swim(1.0)
    other.tracker.applied((math.nan, 0.1))
    assert one.swim(0.1) == other.swim(0.1)
    one.tracker._predictive = Broken()
    assert one.swim(0.1).command == (0.0, 0.0)


def false_speed(target_speed_std_m_s, seed):
    """Mean estimated speed of a tag that stays, seen by a slow robot with rare, rough ranges."""
    lake = TRACKING_PRESETS["grace3"]
    chosen = lake.filter.model_copy(update={"target_speed_std_m_s": target_speed_std_m_s})
    target = lake.target.model_copy(update={"north_m": 0.0, "east_m": 0.0})
    config = lake.model_copy(update={"filter": chosen, "target": target})
    rough = np.random.default_rng(seed)
    tracker = Tracker(config, TrackerStart((-20.0, 6.0), 0.0, 0.1))
    pose, speeds = (-20.0, 6.0, 0.0, 0.1), []
    for n in range(2000):
        range_m, heading, speed = rough.standard_normal(3) * (1.5, 0.05, 0.03)
        heard = (RangeHeard(abs(math.hypot(*pose[:2]) + range_m)),) if n % 20 == 0 else ()
        reading = TrackerReading(pose[:2], pose[2] + heading, pose[3] + speed, heard)
        step = tracker.step(reading, DT_S if n else 0.0)
        speeds.append(math.hypot(*step.hypotheses[0].velocity_ne_m_s))
        pose = unicycle.advance(pose, *step.command, DT_S)
    return np.mean(speeds)


def test_a_slow_robot_that_expects_a_slow_target_sees_less_false_motion():
    vague, expected = ([false_speed(std, seed) for seed in range(6)] for std in (0.1, 0.03))
    assert np.mean(expected) < 0.03
    assert np.mean(expected) < 0.7 * np.mean(vague)
