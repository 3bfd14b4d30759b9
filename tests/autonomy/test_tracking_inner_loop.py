"""The loops from turn rate and acceleration to the tail, and the tank trial that they swim in."""

import math

import numpy as np
import pytest

from autonomy.site import TANK
from autonomy.tracking.config import TRACKING_PRESETS
from autonomy.tracking.control.inner_loop import BeatAverage, InnerLoop, Swimming
from autonomy.tracking.control.inner_loop_config import INNER_LOOP_PRESETS
from autonomy.vehicle.config import VEHICLES
from autonomy.vehicle.extended_kernel import advance
from reproduction.tracking.tail_beat_trial import TailBeatTrial, run_trial

MINI = INNER_LOOP_PRESETS["miniglider"]
PERIOD_S = 0.1


def swim(key: str, turn_rate: float, acceleration: float, seconds: float) -> list[Swimming]:
    """Swim with the full dynamics under constant wants; return the measured motion."""
    vehicle, loops = VEHICLES[key], INNER_LOOP_PRESETS[key]
    average, loop = BeatAverage(loops, PERIOD_S), InnerLoop(loops, PERIOD_S)
    state, water = np.zeros(15), np.array([0.0] * 7 + [20.0, 0.0])
    state[6], state[12], state[13] = 0.03, 0.15 * vehicle.limits.m0_min_kg, vehicle.swim.rp1_m
    seen = []
    for n in range(round(seconds / PERIOD_S)):
        c, s = math.cos(state[5]), math.sin(state[5])
        velocity = (state[6] * c - state[7] * s, state[6] * s + state[7] * c)
        now = average.step(velocity, float(state[5]), float(state[11]))
        seen.append(now)
        beat = loop.step(turn_rate, acceleration, now)
        pitch = float(state[4]) - math.radians(4.0)
        command = np.array(
            [
                0.15 * vehicle.limits.m0_min_kg,
                vehicle.swim.rp1_m + abs(vehicle.limits.rp1_min_m) * pitch,
                beat.bias_rad,
                beat.amplitude_rad,
                beat.frequency_hz,
            ]
        )
        state = advance(state, command, vehicle.packed(), water, n * PERIOD_S, 0.02, 5)
    return seen


@pytest.mark.parametrize("key", ["miniglider", "grace3"])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_robot_turns_as_fast_as_it_is_told_either_way(key, side):
    wanted = 0.05 * side
    rates = [now.turn_rate_rad_s for now in swim(key, wanted, 0.0, 120.0)[600:]]
    assert np.mean(rates) == pytest.approx(wanted, rel=0.1)


def test_robot_gathers_speed_when_it_is_told_and_slows_down_when_it_is_not():
    fast = swim("miniglider", 0.0, 0.01, 60.0)[-1].speed_m_s
    slow = swim("miniglider", 0.0, -0.01, 60.0)[-1].speed_m_s
    assert fast > 0.07
    assert slow < 0.5 * fast


def test_mean_over_a_beat_does_not_see_the_swing_of_the_tail():
    average = BeatAverage(MINI, PERIOD_S)
    for n in range(100):
        swing = math.sin(2.0 * math.pi * MINI.frequency_hz * n * PERIOD_S)
        now = average.step((0.05, 0.02 * swing), 0.0, 0.3 * swing)
    assert now.course_rad == pytest.approx(0.0, abs=1e-9)
    assert now.turn_rate_rad_s == pytest.approx(0.0, abs=1e-9)
    assert now.speed_m_s == pytest.approx(0.05)


def test_mean_course_is_moved_to_the_present():
    average, rate = BeatAverage(MINI, PERIOD_S), 0.1
    for n in range(200):
        heading = rate * n * PERIOD_S
        now = average.step((0.05 * math.cos(heading), 0.05 * math.sin(heading)), heading, rate)
    assert math.remainder(now.course_rad - heading, math.tau) == pytest.approx(0.0, abs=0.01)


def test_robot_without_speed_beats_hard_and_steers_little():
    still = Swimming(0.0, 0.5 * MINI.speed_floor_m_s, 0.0, 0.0)
    beat = InnerLoop(MINI, PERIOD_S).step(0.1, -0.01, still)
    assert beat.amplitude_rad == MINI.amplitude_max_rad
    assert -0.5 * MINI.bias_max_rad < beat.bias_rad < 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_none_never_reach_the_tail(bad):
    average, loop = BeatAverage(MINI, PERIOD_S), InnerLoop(MINI, PERIOD_S)
    for value in (0.01, bad, bad, 0.02):
        now = average.step((value, value), 0.3, value)
        beat = loop.step(bad, bad, now)
        assert math.isfinite(beat.bias_rad)
        assert MINI.amplitude_min_rad <= beat.amplitude_rad <= MINI.amplitude_max_rad


def test_end_stop_winds_nothing_up():
    loop = InnerLoop(MINI, PERIOD_S)
    for _ in range(600):
        loop.step(1.0, 0.0, Swimming(0.0, 0.05, 0.05, 0.0))
    back = [loop.step(0.0, 0.0, Swimming(0.0, 0.05, 0.0, 0.0)).bias_rad for _ in range(10)]
    assert abs(back[-1]) < MINI.bias_max_rad


def trial(controller: str) -> TailBeatTrial:
    tank = TRACKING_PRESETS["miniglider"]
    config = tank.model_copy(
        update={
            "barrier": tank.barrier.model_copy(update={"controller": controller}),
            "motion": tank.motion.model_copy(update={"duration_s": 120.0}),
            "filter": tank.filter.model_copy(update={"target_velocity": "known"}),
        }
    )
    return TailBeatTrial(config, VEHICLES["miniglider"], MINI, TANK.water, (0.2, 0.0), 0.5)


def test_trial_in_the_tank_keeps_the_estimate_and_is_the_same_for_the_same_seed():
    one, same, other = (run_trial(trial("barrier"), seed) for seed in (1, 1, 2))
    assert one.estimation_error_m < 0.4
    assert not one.has_left
    assert np.array_equal(one.own_ne_m, same.own_ne_m)
    assert not np.array_equal(one.own_ne_m, other.own_ne_m)


def test_trial_under_a_predictive_controller_has_finite_scores():
    run = run_trial(trial("mpc_condition"), 1)
    scores = (run.estimation_error_m, run.tracking_error_m, run.condition_sum_s)
    assert np.isfinite(scores).all()
