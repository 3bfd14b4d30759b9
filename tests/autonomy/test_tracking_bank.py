"""The filter bank: mirrored estimates, contradiction, and late ranges."""

import math
from itertools import pairwise

import numpy as np
import pytest

from autonomy.tracking.config import BarrierConfig, FilterConfig, RangingConfig
from autonomy.tracking.filter import hypothesis_kernel as hk
from autonomy.tracking.filter.bank import Bank, BankInput
from autonomy.tracking.filter.hypothesis import RING, mirrored_across, ring
from autonomy.tracking.filter.late_range import LONGEST_AGE_S, Timeline
from autonomy.tracking.reacquire import SearchCircle
from autonomy.tracking.reading import RangeHeard
from autonomy.tracking.reference.filter import predict, start_estimate, update
from autonomy.tracking.reference.velocity_filter import TargetMotion, step_motion
from reproduction.tracking import unicycle
from tests.autonomy.tracking_water import DT_S, NOISE_STD, settings

ONE = FilterConfig(hypotheses="one")


def begin(config, place=(-3.0, 1.0), std_m=0.4):
    return Bank.begin(config, place, 0.5, 0.2, std_m)


def swim(bank, pose, turn_rate, seconds, noise, target=(0.0, 0.0), share=1.0):
    """Steer a robot at a turn rate past a target that stays; return its pose at the end."""
    for n in range(round(seconds / DT_S)):
        range_m, heading, speed = noise.standard_normal(3) * NOISE_STD
        measured = abs(math.dist(pose[:2], target) + range_m)
        heard = (measured,) if noise.random() < share else ()
        dt_s = DT_S if n else 0.0
        psi, v = pose[2] + heading, pose[3] + speed
        bank.step(BankInput(dt_s, (turn_rate, 0.0), psi, v, heard, (0.0, 0.0)))
        pose = unicycle.advance(pose, turn_rate, 0.0, DT_S)
    return pose


def off(bank, pose, target=(0.0, 0.0)):
    return math.dist(bank.best.h[:2], (pose[0] - target[0], pose[1] - target[1]))


def test_a_bank_of_one_is_the_readable_filter():
    config = settings(filter=FilterConfig(hypotheses="one", target_velocity="known"))
    bank, rng = begin(config), np.random.default_rng(2)
    readable = start_estimate((-3.0, 1.0), 0.5, 0.2, 0.16, config)
    for n in range(200):
        dt_s = DT_S if n else 0.0
        command, vt = (0.3, 0.005), (0.01, -0.02)
        readable = predict(readable, command, dt_s, vt, config)
        psi, v = 0.5 + 0.03 * n + rng.normal(0.0, 0.1), 0.2 + rng.normal(0.0, 0.3)
        range_m = float(np.hypot(*readable.x[:2]) + rng.normal(0.0, 0.3))
        readable, _ = update(readable, psi, v, range_m, config)
        bank.step(BankInput(dt_s, command, psi, v, (range_m,), vt))
        assert bank.best.h[:4] == pytest.approx(readable.x, rel=1e-12, abs=1e-12)
        assert bank.best.h[[4, 5, 8, 11, 13]] == pytest.approx(
            readable.P[[0, 0, 1, 2, 3], [0, 1, 1, 2, 3]], rel=1e-12, abs=1e-12
        )
    assert bank.hearing.rejected == 0


def test_the_velocity_of_a_hypothesis_is_that_of_the_readable_filter():
    config, rng = settings(filter=ONE), np.random.default_rng(6)
    bank = begin(config)
    motion = TargetMotion(np.array([[3.0, -1.0], [0.0, 0.0]]), np.diag([0.16, 0.01]))
    for n in range(300):
        dt_s = DT_S if n else 0.0
        range_m = math.hypot(*bank.best.h[:2]) + rng.normal(0.05, 0.1)
        bank.step(BankInput(dt_s, (0.2, 0.0), 0.5 + 0.02 * n, 0.2, (range_m,)))
        h = bank.best.h
        place = (h[hk.RECKONED] - h[0], h[hk.RECKONED + 1] - h[1])
        motion = step_motion(motion, place, dt_s, config.filter)
        velocity = h[[hk.NORTH_RATE, hk.EAST_RATE]]
        assert velocity == pytest.approx(motion.mean[1], rel=1e-12, abs=1e-12)
        assert h[hk.RATE_VARIANCE] == pytest.approx(motion.P[1, 1], rel=1e-12)
    assert np.hypot(*velocity) > 0.01


def test_rarer_ranges_tell_as_much_of_the_velocity():
    variances = []
    for every in (1, 20):
        bank = begin(settings(filter=ONE))
        for n in range(1200):
            heard = (3.0,) if n % every == 0 else ()
            bank.step(BankInput(DT_S, (0.0, 0.0), 0.5, 0.0, heard))
        variances.append(bank.best.h[hk.RATE_VARIANCE])
    assert 0.3 < variances[0] / variances[1] < 1.5


@pytest.mark.parametrize("seed", range(4))
def test_a_mirrored_start_is_resolved_once_the_robot_turns(seed):
    noise = np.random.default_rng(seed)
    bank = begin(settings(), place=(-3.0, -1.5), std_m=0.6)
    pose = (-3.0, 1.5, 0.0, 0.3)
    pose = swim(bank, pose, 0.0, 6.0, noise)
    pose = swim(bank, pose, 0.5, 25.0, noise)
    assert off(bank, pose) < 0.7
    assert bank.best.weight > 0.9
    assert not bank.hearing.is_searching


def test_an_estimate_behind_the_robot_is_contradicted_and_replaced():
    noise = np.random.default_rng(5)
    bank, pose = begin(settings(), place=(3.0, 0.0), std_m=0.3), (-3.0, 0.0, 0.0, 0.3)
    pose = swim(bank, pose, 0.0, 8.0, noise)
    assert bank.hearing.restarts == 1
    pose = swim(bank, pose, 0.6, 20.0, noise)
    assert off(bank, pose) < 0.5


def test_a_single_filter_that_is_contradicted_tries_another_bearing():
    noise = np.random.default_rng(5)
    bank = begin(settings(filter=ONE), place=(3.0, 0.0), std_m=0.3)
    pose = swim(bank, (-3.0, 0.0, 0.0, 0.3), 0.0, 8.0, noise)
    assert bank.hearing.restarts == 1
    pose = swim(bank, pose, 0.6, 40.0, noise)
    assert len(bank.hypotheses) == 1
    assert off(bank, pose) < 0.5


def test_on_a_straight_course_past_the_target_both_sides_are_kept():
    noise = np.random.default_rng(7)
    bank, pose = begin(settings(), place=(-2.0, 0.4), std_m=0.5), (-2.0, 0.4, 0.0, 0.2)
    pose = swim(bank, pose, 0.0, 4.0, noise)
    assert len(bank.hypotheses) == 2
    east = sorted(float(one.h[1]) for one in bank.hypotheses)
    assert east[0] < 0.0 < east[1]
    weights = [one.weight for one in bank.hypotheses]
    assert sum(weights) == pytest.approx(1.0)
    assert min(weights) > 0.02


def test_a_mirrored_hypothesis_expects_the_same_ranges_on_a_straight_course():
    bank = begin(settings())
    h, q = bank.best.h, bank.q
    h[[hk.NORTH_RATE, hk.EAST_RATE]] = 0.0
    other = mirrored_across(h, -math.sin(0.5), math.cos(0.5), q)
    twice = mirrored_across(other, -math.sin(0.5), math.cos(0.5), q)
    assert twice[: hk.VELOCITY] == pytest.approx(h[: hk.VELOCITY], abs=1e-12)
    for _ in range(50):
        for one in (h, other):
            hk.pass_time(one, 0.0, 0.0, DT_S, 0.0, 0.0, 0.0, q)
        assert hk.expect(other, q) == pytest.approx(hk.expect(h, q), rel=1e-9)
    assert math.dist(h[:2], other[:2]) > 2.0


def test_a_first_range_far_from_the_guess_starts_a_ring_and_a_circle_resolves_it():
    noise = np.random.default_rng(3)
    bank, pose = begin(settings(), place=(-1.0, 0.0)), (-7.0, 4.0, 0.5, 0.3)
    bank.step(BankInput(0.0, (0.0, 0.0), 0.5, 0.3, (math.hypot(7.0, 4.0),)))
    assert len(bank.hypotheses) == RING
    assert bank.hearing.is_searching
    pose = swim(bank, pose, 0.5, 15.0, noise)
    assert not bank.hearing.is_searching
    assert off(bank, pose) < 1.2


def test_outliers_do_not_move_the_estimate_but_a_run_of_them_reopens_the_gate():
    noise = np.random.default_rng(3)
    bank, pose = begin(settings()), (-3.0, 1.0, 0.5, 0.2)
    pose = swim(bank, pose, 0.4, 10.0, noise)
    for n in range(4):
        before = bank.best.h[:2].copy()
        bank.step(BankInput(0.0, (0.0, 0.0), math.nan, math.nan, (9.0,)))
        assert bank.best.h[:2].tolist() == before.tolist()
        assert bank.hearing.rejected == n + 1
    bank.step(BankInput(0.0, (0.0, 0.0), math.nan, math.nan, (9.0,)))
    assert bank.hearing.is_searching
    assert all(math.hypot(*one.h[:2]) == pytest.approx(9.0) for one in bank.hypotheses)


def test_outliers_that_disagree_among_themselves_never_reopen_the_gate():
    bank = begin(settings())
    swim(bank, (-3.0, 1.0, 0.5, 0.2), 0.4, 10.0, np.random.default_rng(3))
    for n in range(60):
        bank.step(BankInput(0.0, (0.0, 0.0), math.nan, math.nan, (12.0 + 7.0 * (n % 3),)))
    assert bank.hearing.rejected == 60
    assert bank.hearing.restarts == 0


def test_silence_widens_a_target_of_unknown_velocity_faster_than_one_of_known():
    spreads = []
    for velocity in (None, (0.0, 0.0)):
        bank = begin(settings())
        for n in range(600):
            bank.step(BankInput(DT_S if n else 0.0, (0.2, 0.0), math.nan, math.nan, (), velocity))
        spreads.append(hk.worst_variance(bank.best.h))
    assert spreads[0] > spreads[1] + 0.5 * 0.01 * 60.0**2


def runaway(velocity=None, kind="tag", controller="barrier", farther_m=0.0):
    """Hear what a hypothesis expects, or a wrong range, that is sure to move by 0.8 m/s."""
    config = settings(barrier=BarrierConfig(controller=controller))
    target = config.target.model_copy(update={"kind": kind})
    bank = begin(config.model_copy(update={"target": target}))
    swim(bank, (-3.0, 1.0, 0.5, 0.2), 0.4, 10.0, np.random.default_rng(3))
    h = bank.best.h
    h[[hk.NORTH_RATE, hk.EAST_RATE, hk.RATE_VARIANCE]] = 0.8, 0.0, 1e-4
    heard = (hk.expect(h, bank.q)[0] + farther_m,)
    bank.step(BankInput(0.0, (0.0, 0.0), math.nan, math.nan, heard, velocity))
    return bank


def test_an_estimate_that_runs_away_faster_than_the_robot_is_started_anew():
    bank = runaway()
    assert bank.hearing.is_searching
    assert bank.hearing.restarts == 1
    assert all(one.h[hk.NORTH_RATE] == 0.0 for one in bank.hypotheses)


@pytest.mark.parametrize(
    "case",
    [
        {"velocity": (0.0, 0.0)},
        {"kind": "beacon"},
        {"controller": "nominal"},
        {"farther_m": 50.0},
    ],
)
def test_no_track_starts_anew_by_known_velocity_beacon_teaching_or_a_wrong_range(case):
    assert runaway(**case).hearing.restarts == 0


def test_every_hypothesis_begins_with_the_speed_that_a_target_is_expected_to_have():
    bank = begin(settings(filter=FilterConfig(target_speed_std_m_s=0.02)))
    others = [mirrored_across(bank.best.h, 0.0, 1.0, bank.q)]
    others += [one.h for one in ring(bank.best.h, 5.0, bank.q)]
    for h in (bank.best.h, *others):
        assert h[hk.RATE_VARIANCE] == pytest.approx(4e-4)


def test_a_copy_lives_its_own_life():
    bank = begin(settings())
    copy = bank.copy()
    before = copy.best.h.copy()
    bank.step(BankInput(0.1, (0.1, 0.0), 0.5, 0.2, (3.0,)))
    assert copy.best.h.tolist() == before.tolist()
    assert (copy.hearing.believed, bank.hearing.believed) == (0, 1)


def test_ranges_of_one_time_in_any_order_of_arrival_give_the_same_bank():
    given = [BankInput(DT_S if n else 0.0, (0.3, 0.0), 0.03 * n, 0.2) for n in range(40)]
    heard = [(12, 3.1), (12, 3.0), (25, 2.7), (31, 2.9)]
    answers = []
    for order in (heard, heard[::-1], [heard[2], heard[0], heard[3], heard[1]]):
        timeline = Timeline(begin(settings()))
        for one in given:
            timeline.step(one, ())
        for step, range_m in order:
            age_s = DT_S * (39 - step)
            nothing = BankInput(0.0, (0.0, 0.0), math.nan, math.nan)
            assert timeline.step(nothing, (RangeHeard(range_m, age_s),)) == 0
        answers.append(timeline.bank.best.h.tolist())
    assert answers[0] == answers[1] == answers[2]


def test_a_range_from_before_the_memory_is_counted_and_not_used():
    timeline = Timeline(begin(settings()))
    for _ in range(400):
        timeline.step(BankInput(DT_S, (0.0, 0.0), 0.5, 0.2), ())
    before = timeline.bank.best.h.tolist()
    nothing = BankInput(0.0, (0.0, 0.0), math.nan, math.nan)
    assert timeline.step(nothing, (RangeHeard(3.0, LONGEST_AGE_S + 1.0),)) == 1
    assert timeline.bank.best.h.tolist() == before


def test_the_search_circles_to_each_side_in_turn_within_the_limits():
    config = settings()
    search = SearchCircle(config)
    rates = [search.command(0.3, DT_S)[0] for _ in range(1000)]
    assert {np.sign(rate) for rate in rates} == {-1.0, 1.0}
    assert max(abs(rate) for rate in rates) <= config.motion.turn_rate_max_rad_s
    changes = [n for n, (a, b) in enumerate(pairwise(rates)) if a != b]
    assert sum(rates[: changes[0] + 1]) * DT_S == pytest.approx(2.0 * math.pi, rel=0.02)


def test_the_search_waits_for_ranges_that_are_far_between():
    slow = RangingConfig(period_s=5.0, coast_after_s=12.0, lost_after_s=30.0)
    rate = SearchCircle(settings(ranging=slow)).command(0.3, DT_S)[0]
    assert 2.0 * math.pi / rate == pytest.approx(40.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_bank_begins_at_numbers_only(bad):
    with pytest.raises(ValueError, match="finite numbers"):
        begin(settings(), place=(bad, 0.0))
    with pytest.raises(ValueError, match="position_std_m > 0"):
        begin(settings(), std_m=0.0)
