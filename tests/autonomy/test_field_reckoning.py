"""How position errors of a dive go together, and what the jumps at fixes tell of them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autonomy.field.reckoning import (
    ErrorScale,
    Reckoning,
    error_scale,
    located_std_m,
    position_error_covariance,
)
from autonomy.field.samples import FieldSamples

FIX_M, DRIFT, PERIOD_S = 0.01, 0.02, 2.0


def walk_and_current(time_s, current_m_s):
    """Covariance between moments since a fix, by the contract."""
    walk = FIX_M**2 + DRIFT**2 * np.minimum.outer(time_s, time_s)
    return walk + current_m_s**2 * np.multiply.outer(time_s, time_s)


def dive_of(count, current_m_s, *, smoothed=False, jump=(0.0, 0.0), number=0, true_m_s=None):
    """Samples every two seconds, the last one just before the fix that ends the dive."""
    time_s = PERIOD_S * np.arange(count + 1)
    P = walk_and_current(time_s, current_m_s)
    std = np.sqrt(np.diagonal(P))[:-1]
    gain = P[:-1, -1] / (P[-1, -1] + FIX_M**2)
    left = P[:-1, :-1] - np.outer(gain, P[-1, :-1])
    believed = np.zeros((count, 3))
    points = believed.copy()
    if smoothed:
        points[:, :2] += np.outer(gain, jump)
    samples = FieldSamples.of(
        points,
        np.ones(count),
        np.sqrt(np.diagonal(left)) if smoothed else std,
        filtered_std_m=std,
        dive=np.full(count, number),
        time_s=1e5 + 1e3 * number + time_s[:-1],
        believed=believed,
    )
    return samples, P[:-1, :-1], left


def joined_dives(dives):
    whole = dives[0]
    for dive in dives[1:]:
        whole = FieldSamples(
            *(
                np.concatenate([getattr(whole, name), getattr(dive, name)])
                for name in FieldSamples.__slots__[:-1]
            ),
            whole.reckoning.followed_by(dive.reckoning),
        )
    return whole


def test_a_dive_under_way_errs_by_a_walk_and_by_the_current_that_its_robot_doubts():
    samples, P, _ = dive_of(15, 0.02)
    np.testing.assert_allclose(position_error_covariance(samples, samples), P, rtol=1e-6)
    np.testing.assert_allclose(samples.reckoning.current_std_m_s, 0.02, rtol=1e-6)


def test_a_current_that_nobody_was_told_adds_what_it_carries():
    samples, P, _ = dive_of(15, 0.0)
    told = position_error_covariance(samples, samples, ErrorScale(1.0, 0.03))
    way = 0.03 * samples.reckoning.since_fix_s
    np.testing.assert_allclose(told, P + np.outer(way, way), rtol=1e-9)
    np.testing.assert_allclose(
        located_std_m(samples, ErrorScale(1.0, 0.03)), np.sqrt(np.diagonal(told))
    )


def test_a_current_that_the_robot_doubts_itself_is_not_counted_twice():
    samples, P, _ = dive_of(15, 0.02)
    told = position_error_covariance(samples, samples, ErrorScale(1.0, 0.01))
    np.testing.assert_allclose(told, P, rtol=1e-6)


@pytest.mark.parametrize("current_m_s", [0.0, 0.01, 0.05])
def test_what_is_left_after_smoothing_is_the_walk_and_current_given_the_fix(current_m_s):
    samples, _, left = dive_of(20, current_m_s, smoothed=True, jump=(0.3, -0.1))
    np.testing.assert_allclose(
        position_error_covariance(samples, samples), left, rtol=2e-3, atol=2e-6
    )


def test_a_smoothed_dive_hardly_depends_on_the_current():
    samples, _, left = dive_of(20, 0.0, smoothed=True, jump=(1.2, 0.0))
    doubted = position_error_covariance(samples, samples, ErrorScale(1.0, 0.03))
    assert np.max(np.abs(doubted - left)) < 0.15 * np.max(left)


def test_the_jump_is_read_off_how_far_smoothing_moved_a_dive():
    samples, _, _ = dive_of(20, 0.01, smoothed=True, jump=(0.3, -0.1))
    np.testing.assert_allclose(samples.reckoning.jump_ne_m[0], (0.3, -0.1), rtol=1e-3)
    assert np.isnan(dive_of(20, 0.01)[0].reckoning.jump_ne_m).all()


def dives_in_water(true_m_s, walk_share=1.0, count=20, seed=0):
    rng = np.random.default_rng(seed)
    course = rng.uniform(0.0, 2.0 * math.pi)
    dives = []
    for number in range(count):
        length = int(rng.integers(6, 16))
        end_s = PERIOD_S * length
        walked = walk_share * math.sqrt(FIX_M**2 + DRIFT**2 * end_s) * rng.standard_normal(2)
        jump = walked + FIX_M * rng.standard_normal(2)
        jump += true_m_s * end_s * np.array([math.cos(course), math.sin(course)])
        dives.append(dive_of(length, 0.0, smoothed=True, jump=jump, number=number)[0])
    return joined_dives(dives)


@pytest.mark.parametrize("seed", range(5))
def test_jumps_tell_an_untold_current_from_a_walk(seed):
    samples = dives_in_water(0.03, seed=seed)
    scale = error_scale(samples.reckoning, samples.dive, 0.01)
    assert 0.017 < scale.current_m_s < 0.028  # 3 cm/s are 2.1 on each axis
    assert 0.6 < scale.walk < 1.6
    quiet = dives_in_water(0.0, seed=seed)
    as_told = error_scale(quiet.reckoning, quiet.dive, 0.01)
    assert as_told.current_m_s < 0.004
    assert 0.75 < as_told.walk < 1.3


def test_still_water_makes_walks_shorter_than_stated():
    samples = dives_in_water(0.0, walk_share=0.1)
    assert error_scale(samples.reckoning, samples.dive, 0.01).walk < 0.5


def test_without_a_jump_the_prior_counts():
    samples, _, _ = dive_of(15, 0.0)
    assert error_scale(samples.reckoning, samples.dive, 0.05) == ErrorScale(1.0, 0.05)
    nothing = Reckoning.unknown(0)
    assert error_scale(nothing, np.empty(0, dtype=np.int64), 0.0) == ErrorScale(1.0, 0.0)


def test_a_fix_that_no_water_explains_tells_nothing():
    samples = dives_in_water(0.0)
    jumps = samples.reckoning.jump_ne_m.copy()
    jumps[samples.dive == 3] = (200.0, 0.0)
    wrong = replace(samples.reckoning, jump_ne_m=jumps)
    right = error_scale(samples.reckoning, samples.dive, 0.01)
    assert error_scale(wrong, samples.dive, 0.01).current_m_s == pytest.approx(
        right.current_m_s, abs=0.001
    )


def test_samples_just_after_the_fix_are_at_the_fix():
    samples = FieldSamples.of(
        np.zeros((5, 3)),
        np.zeros(5),
        np.full(5, 0.1),
        filtered_std_m=np.array([0.1, 0.2, 0.3, 0.4, 0.5]),
        time_s=np.array([0.0, 5e-324, 1e-160, 1e-9, 1e-4]),
    )
    np.testing.assert_array_equal(samples.reckoning.since_fix_s, 0.0)
    np.testing.assert_array_equal(samples.reckoning.current_std_m_s, 0.0)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_whatever_robots_state_and_water_does_it_is_a_covariance(data):
    n = data.draw(st.integers(1, 16))
    numbers = st.floats(0.0, 10.0)
    filtered = np.array(data.draw(st.lists(numbers, min_size=n, max_size=n)))
    shares = data.draw(st.lists(st.floats(0.0, 1.0), min_size=n, max_size=n))
    time_s = np.array(data.draw(st.lists(st.floats(0.0, 1e3), min_size=n, max_size=n)))
    samples = FieldSamples.of(
        np.zeros((n, 3)),
        np.zeros(n),
        filtered * shares,
        filtered_std_m=filtered,
        dive=np.arange(n) % data.draw(st.integers(1, 3)),
        time_s=time_s,
    )
    scale = ErrorScale(data.draw(st.floats(0.2, 5.0)), data.draw(st.floats(0.0, 3.0)))
    covariance = position_error_covariance(samples, samples, scale)
    assert np.isfinite(covariance).all()
    np.testing.assert_array_equal(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance)[0] >= -1e-9 * max(1.0, float(np.trace(covariance)))


def test_samples_that_come_one_by_one_know_when_their_dive_began():
    whole, _, _ = dive_of(12, 0.02)
    first = FieldSamples.of(
        whole.points[:9], whole.values[:9], whole.position_std_m[:9], time_s=whole.time_s[:9]
    )
    later = FieldSamples.of(
        whole.points[9:],
        whole.values[9:],
        whole.position_std_m[9:],
        time_s=whole.time_s[9:],
        after=first,
    )
    np.testing.assert_allclose(later.reckoning.since_fix_s, whole.reckoning.since_fix_s[9:])
    np.testing.assert_allclose(later.reckoning.current_std_m_s, 0.02, rtol=1e-6)


def dives_that_doubt(doubt_m_s, true_ne_m_s, walk_share, seed, count=20):
    """Smoothed dives of a robot that doubts the current and never learns it."""
    rng = np.random.default_rng(seed)
    dives = []
    for number in range(count):
        length = int(rng.integers(6, 16))
        end_s = PERIOD_S * length
        spread = math.hypot(math.sqrt(2.0) * FIX_M, walk_share * DRIFT * math.sqrt(end_s))
        jump = spread * rng.standard_normal(2) + end_s * np.array(true_ne_m_s)
        dives.append(dive_of(length, doubt_m_s, smoothed=True, jump=jump, number=number)[0])
    return joined_dives(dives)


def test_a_doubt_that_no_jump_bears_out_does_not_count():
    walks = []
    for seed in range(6):
        samples = dives_that_doubt(0.01, (0.0, 0.0), 0.0, seed)
        scale = error_scale(samples.reckoning, samples.dive, 0.01)
        assert scale.doubt < 0.2
        np.testing.assert_allclose(located_std_m(samples, scale), FIX_M, rtol=0.4)
        drifting = dives_that_doubt(0.01, (0.0, 0.0), 1.0, seed)
        walks.append(error_scale(drifting.reckoning, drifting.dive, 0.01).walk)
    assert 0.8 < np.mean(walks) < 1.2


def test_a_current_that_all_dives_meet_is_not_taken_for_longer_walks():
    walks = []
    for seed in range(6):
        samples = dives_that_doubt(0.01, (0.024, -0.018), 1.0, seed)
        scale = error_scale(samples.reckoning, samples.dive, 0.01)
        assert 0.017 < scale.current_m_s < 0.026  # 3 cm/s are 2.1 on each axis
        walks.append(scale.walk)
    assert 0.8 < np.mean(walks) < 1.2


@pytest.mark.parametrize("walk", [0.2, 3.0])
def test_the_fix_that_began_a_dive_is_as_good_as_stated_however_long_walks_are(walk):
    samples, _, _ = dive_of(20, 0.0, smoothed=True, jump=(0.1, 0.0))
    scale = ErrorScale(walk)
    at_fix = samples.position_std_m[0]
    assert located_std_m(samples, scale)[0] == pytest.approx(at_fix, rel=0.1)
    middle = located_std_m(samples, scale)[10] ** 2 - samples.position_std_m[10] ** 2
    assert math.copysign(1.0, middle) == math.copysign(1.0, walk - 1.0)


def test_smoothing_that_samples_do_not_explain_makes_none_less_sure_than_stated():
    filtered = np.array([0.00999, 0.02297, 0.04216, 0.0619])  # a doubt of 1 cm/s, seen three times
    samples = FieldSamples.of(
        np.zeros((4, 3)),
        np.ones(4),
        np.array([0.00991, 0.00933, 0.00976, 0.00998]),
        filtered_std_m=filtered,
        time_s=np.array([0.0, 2.0, 4.0, 6.0]),
        believed=np.array([[0.0, 0.0, 0.0], [0.001, 0.0, 0.0], [0.002, 0.0, 0.0], [0.003, 0, 0]]),
    )
    for scale in (ErrorScale(0.3, 0.0004, 0.05), ErrorScale(1.0, 0.001), ErrorScale(0.7, 0.0)):
        assert (located_std_m(samples, scale) <= 1.05 * filtered).all()
