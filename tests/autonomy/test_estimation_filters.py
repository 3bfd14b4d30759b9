"""The model filter: what it takes, refuses and claims."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autonomy.estimation import model_kernel as kernel
from autonomy.estimation.attitude import AttitudeFilter
from autonomy.estimation.config import (
    MODEL_FILTER_PRESETS,
    EstimatorConfig,
    ModelFilterConfig,
    WaterMotionConfig,
    estimator_preset,
)
from autonomy.estimation.model_filter import ModelFilter
from autonomy.estimation.telling_stay import telling_stay_s
from autonomy.vehicle.config import VEHICLES

ESTIMATOR = EstimatorConfig()
MINIGLIDER = VEHICLES["miniglider"]
LEVEL = (0.0, 0.0, 0.0)


def model_filter(config: ModelFilterConfig | None = None, depth_m: float = 1.0) -> ModelFilter:
    return ModelFilter(
        ESTIMATOR,
        config or ModelFilterConfig(current=WaterMotionConfig(steady_std_m_s=0.05)),
        MINIGLIDER,
        (0.0, 0.0, depth_m),
        0.01,
        attitude_rad=LEVEL,
        actuators=LEVEL,
    )


def drift_by(
    follower: ModelFilter,
    depth_m: float = 1.0,
    fix: tuple[float, float] | None = None,
    dt_s: float = 0.1,
    actuators: tuple[float, float, float] = LEVEL,
) -> None:
    follower.step(
        dt_s,
        np.zeros(5),
        0.0,
        attitude_rad=LEVEL,
        angular_velocity_rad_s=LEVEL,
        actuators=actuators,
        depth_m=depth_m,
        fix_ne=fix,
    )


def test_fixes_tell_the_current_that_carries_a_resting_robot() -> None:
    follower = model_filter()
    rng = np.random.default_rng(2)
    for k in range(1200):
        fix = 0.04 * 0.1 * k + 0.01 * rng.standard_normal(), 0.01 * rng.standard_normal()
        drift_by(follower, 0.003 * rng.standard_normal(), fix)
    std = math.sqrt(follower.covariance[kernel.STEADY_NORTH, kernel.STEADY_NORTH])
    assert follower.steady_current_ne_m_s == pytest.approx((0.04, 0.0), abs=3.0 * std)
    assert std < 0.004


@pytest.mark.parametrize("doubt", [1.0, 2.0])
def test_a_current_that_was_known_before_carries_a_dive_as_far_as_it_is_unsure(
    doubt: float,
) -> None:
    follower = model_filter()
    follower.begin_with_current((0.02, -0.01), 0.003, doubt)
    assert follower.steady_current_ne_m_s == (0.02, -0.01)
    assert follower.steady_current_std_m_s == pytest.approx(doubt * 0.003)
    assert follower.doubt == pytest.approx(doubt)
    unsure, sure = model_filter(), model_filter()
    sure.begin_with_current((0.0, 0.0), 0.0, doubt)
    for each in (follower, unsure, sure):
        for _ in range(600):
            drift_by(each)
    north_m, east_m, _ = np.subtract(follower.position_ned, sure.position_ned)
    assert (north_m, east_m) == pytest.approx((60.0 * 0.02, -60.0 * 0.01), rel=0.01)
    gained = follower.position_std_m**2 - sure.position_std_m**2
    assert gained == pytest.approx((doubt * 0.003 * 60.0) ** 2, rel=0.05)
    assert unsure.position_std_m / unsure.doubt > 2.0 * follower.position_std_m / follower.doubt


def test_depth_tells_that_the_ballast_is_wrong() -> None:
    follower = model_filter(ModelFilterConfig(buoyancy_bias_kg=0.001))
    depth, speed = 1.0, 0.0
    for _ in range(600):
        # a body of 8.291 kg that is 1 g heavier than its feedback says, with quadratic drag
        force = 0.001 * 9.82 - 0.5 * 992.2 * 0.013 * 60.0 * speed**2
        speed += 0.1 * force / MINIGLIDER.parameters.mass_3_kg
        depth += 0.1 * speed
        drift_by(follower, depth)
    assert follower.buoyancy_bias_kg < -0.0003


def test_a_far_fix_and_a_mad_depth_are_refused_and_a_lasting_jump_is_believed() -> None:
    follower = model_filter(depth_m=0.0)
    drift_by(follower, 0.0, (0.0, 0.0))
    for _ in range(30):
        drift_by(follower, 0.0)
    before = follower.position_ned
    drift_by(follower, 900.0)
    drift_by(follower, 0.0, (50.0, 50.0))
    assert follower.refused == (1, 1)
    assert math.dist(follower.position_ned, before) < 0.05
    for k in range(40):
        drift_by(follower, 0.0, (50.0 + 1e-6 * k, 50.0))
    assert follower.position_ned[:2] == pytest.approx((50.0, 50.0), abs=0.2)
    assert follower.position_std_m < 0.1


def test_a_stuck_receiver_does_not_make_the_position_certain() -> None:
    follower = model_filter()
    for _ in range(200):
        drift_by(follower, 0.0, (0.003, -0.002))
    assert follower.position_std_m > 5.0 * ESTIMATOR.fix_std_m


def test_a_fix_from_the_deep_is_not_believed() -> None:
    follower, other = model_filter(), model_filter()
    drift_by(follower, 1.0, (0.5, 0.5))
    drift_by(other, 1.0)
    assert follower.position_ned == other.position_ned


def test_a_silence_is_answered_with_doubt_about_all_but_what_lasts() -> None:
    follower = model_filter()
    for k in range(300):
        drift_by(follower, 0.0, (0.004 * k, 1e-6 * k))
    known = follower.covariance
    drift_by(follower, 0.0, None, dt_s=3600.0)
    later = follower.covariance
    assert follower.position_std_m > 800.0
    assert later[kernel.STEADY_NORTH, kernel.STEADY_NORTH] == pytest.approx(
        known[kernel.STEADY_NORTH, kernel.STEADY_NORTH], rel=1e-9
    )
    drift_by(follower, 0.0, (200.0, 3.0))
    assert follower.position_ned[:2] == pytest.approx((200.0, 3.0), abs=0.05)


def test_a_new_trim_makes_the_ballast_error_unknown_again() -> None:
    follower = model_filter()
    for _ in range(300):
        drift_by(follower)
    before = follower.covariance[kernel.BIAS, kernel.BIAS]
    drift_by(follower, actuators=(0.005, 0.0, 0.0))
    assert math.sqrt(follower.covariance[kernel.BIAS, kernel.BIAS]) > 0.004
    assert math.sqrt(before) < 0.0004


def test_the_model_filter_stays_positive_definite_for_hours_of_dives() -> None:
    follower = model_filter()
    for k in range(2160):
        surfaced = k % 60 < 20
        fix = (0.001 * math.sin(k), 0.001 * math.cos(k)) if surfaced else None
        drift_by(follower, 0.0 if surfaced else 1.0, fix, dt_s=5.0)
    P = follower.covariance
    assert np.isfinite(P).all()
    assert np.array_equal(P, P.T)
    assert np.linalg.eigvalsh(P)[0] > 0.0


def test_the_triangular_update_is_the_kalman_update() -> None:
    rng = np.random.default_rng(3)
    A = rng.standard_normal((14, 14))
    S = kernel.triangular(A.copy())
    P, x = A.T @ A, rng.standard_normal(14)
    assert pytest.approx(P, abs=1e-12) == S @ S.T
    assert np.array_equal(S, np.tril(S))
    for index in (kernel.DEPTH, kernel.EAST):
        gain = P[:, index] / (P[index, index] + 0.3)
        expected = x + gain * 0.7
        P = P - np.outer(gain, P[index])
        kernel.measure(x, S, index, 0.7, 0.3)
        assert x == pytest.approx(expected, abs=1e-12)
        assert pytest.approx(P, abs=1e-12) == S @ S.T
        assert np.array_equal(S, np.tril(S))
    kernel.widen(S, np.full(14, 2.0))
    P = P + 4.0 * np.eye(14)
    assert pytest.approx(P, abs=1e-12) == S @ S.T


def test_a_correction_by_any_gain_leaves_the_covariance_of_its_errors() -> None:
    rng = np.random.default_rng(4)
    A = rng.standard_normal((14, 14))
    S = kernel.triangular(A.copy())
    gain = rng.standard_normal(14)
    left = np.eye(14) - np.outer(gain, np.eye(14)[kernel.DEPTH])
    expected = left @ A.T @ A @ left.T + 0.3 * np.outer(gain, gain)
    kernel.correct(S, kernel.DEPTH, gain, 0.3)
    assert pytest.approx(expected, abs=1e-12) == S @ S.T
    assert np.array_equal(S, np.tril(S))


nonsense = st.sampled_from([math.nan, math.inf, -math.inf])


@settings(max_examples=40, deadline=None)
@given(bad=nonsense, place=st.integers(0, 6))
def test_nothing_that_is_no_number_enters_a_filter(bad: float, place: int) -> None:
    model = model_filter()
    attitude = AttitudeFilter(LEVEL, LEVEL)
    good = [0.1, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    numbers = [*good[:place], bad, *good[place + 1 :]]
    dt_s, depth, roll, rate, mass, north, east = numbers
    before = model.covariance
    with pytest.raises(ValueError, match="finite"):
        model.step(
            dt_s,
            np.zeros(5),
            0.0,
            attitude_rad=(roll, 0.0, 0.0),
            angular_velocity_rad_s=(rate, 0.0, 0.0),
            actuators=(mass, 0.0, 0.0),
            depth_m=depth,
            fix_ne=(north, east),
        )
    if place in (0, 2, 3):
        with pytest.raises(ValueError, match="finite"):
            attitude.step(dt_s, (roll, 0.0, 0.0), (rate, 0.0, 0.0))
    assert np.array_equal(model.covariance, before)


@pytest.mark.parametrize("dt_s", [0.0, -0.1])
def test_time_that_does_not_pass_is_refused(dt_s: float) -> None:
    with pytest.raises(ValueError, match="dt > 0"):
        drift_by(model_filter(), dt_s=dt_s)
    with pytest.raises(ValueError, match="dt > 0"):
        AttitudeFilter(LEVEL, LEVEL).step(dt_s, LEVEL, LEVEL)


def test_no_filter_begins_where_nobody_knows() -> None:
    nowhere = (math.nan, 0.0)
    with pytest.raises(ValueError, match="finite"):
        ModelFilter(
            ESTIMATOR,
            ModelFilterConfig(),
            MINIGLIDER,
            (*nowhere, 0.0),
            1.0,
            attitude_rad=LEVEL,
            actuators=LEVEL,
        )


def floating(estimator: EstimatorConfig, seconds: int) -> ModelFilter:
    """A lake robot at rest in water that flows north at 5 cm/s, with a fix every second."""
    model = MODEL_FILTER_PRESETS["grace3"]
    current = model.current.model_copy(update={"steady_std_m_s": estimator.steady_current_m_s})
    belief = ModelFilter(
        estimator,
        model.model_copy(update={"current": current}),
        VEHICLES["grace3"],
        (0.0, 0.0, 0.0),
        estimator.fix_std_m,
        attitude_rad=(0.0, 0.0, 0.0),
        actuators=(-0.02, 0.0, 0.0),
    )
    rng = np.random.default_rng(3)
    for second in range(1, seconds + 1):
        noise_ne = estimator.fix_std_m * rng.standard_normal(2)
        belief.step(
            1.0,
            np.zeros(5),
            float(second),
            attitude_rad=(0.0, 0.0, 0.0),
            angular_velocity_rad_s=(0.0, 0.0, 0.0),
            actuators=(-0.02, 0.0, 0.0),
            depth_m=0.0,
            fix_ne=(0.05 * second + noise_ne[0], noise_ne[1]),
        )
    return belief


def test_a_short_stay_at_the_surface_tells_nothing_of_the_current_and_a_long_one_does() -> None:
    estimator = estimator_preset("grace3", "lake")
    assert 60.0 < telling_stay_s(estimator, estimator.steady_current_m_s) < 300.0
    short, long = floating(estimator, 20), floating(estimator, 900)
    assert math.hypot(*short.steady_current_ne_m_s) < 0.005
    assert short.steady_current_std_m_s > 0.9 * estimator.steady_current_m_s
    assert math.dist(long.steady_current_ne_m_s, (0.05, 0.0)) < 0.025
    assert long.steady_current_std_m_s < 0.6 * estimator.steady_current_m_s
    assert math.isinf(telling_stay_s(estimator, 0.0))
