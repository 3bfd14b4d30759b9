"""Where a robot that is not heard should be: laws, and worlds with hidden currents drawn."""

import math

import numpy as np
import pytest

from autonomy.estimation.prediction import (
    FlownTrack,
    LastWord,
    WaterBelief,
    calibration,
    ellipse_90,
    miss,
    predict_afloat,
    predict_flown,
)
from tests.autonomy.lost_hour import FIX_STD_M, lost_hour

WATER = WaterBelief((0.04, -0.02), 0.01, 0.05, 36000.0, 0.3)
WORD = LastWord((10.0, -5.0, 0.0), 1.5, 0.0, 1.5)
VEE = FlownTrack(
    time_s=np.array([0.0, 60.0, 260.0, 460.0]),
    position_ned=np.array([[0.0, 0, 0], [0, 0, 0], [30, 0, 20], [60, 0, 0]]),
    leg_end_s=np.array([260.0, 460.0]),
    stays_s=np.array([[460.0, 460.0]]),
    now_s=100.0,
    following_std_m=1.0,
    pace_std=0.05,
    wait_std_s=10.0,
)
WORLDS = 300


def test_ellipse_holds_nine_of_ten_fixes_after_lost_hours():
    rng = np.random.default_rng(15)
    held = []
    for _ in range(WORLDS):
        world = lost_hour(rng)
        said = world.predicted()
        _, units = miss(said.position_ned[0, :2], said.covariance_m2[0], world.fix_ne_m, FIX_STD_M)
        held.append((world.track is not None, units <= 1.0))
    held = np.array(held)
    # 85 to 95 %, and what chance adds to about 150 draws of each kind
    assert 0.85 <= held[:, 1].mean() <= 0.95
    for is_flown in (False, True):
        assert 0.82 <= held[held[:, 0] == is_flown, 1].mean() <= 0.97


def test_water_carries_as_its_process_drawn_step_by_step():
    rng = np.random.default_rng(2)
    short = WaterBelief((0.0, 0.0), 0.0, 0.05, 600.0, 0.1)
    dt, draws = 5.0, 4000
    kept = math.exp(-dt / short.memory_s)
    current, place = np.zeros(draws), np.zeros(draws)
    for _ in range(240):
        fresh = short.unknown_std_m_s * math.sqrt(1.0 - kept**2)
        before = current
        current = kept * current + fresh * rng.standard_normal(draws)
        place += 0.5 * dt * (before + current) + 0.1 * math.sqrt(dt) * rng.standard_normal(draws)
    # a wrong telling in twenty takes part in the variance of the first moment
    wrong = 0.05 * 0.05**2 * (600.0 * -math.expm1(-1200.0 / 600.0)) ** 2
    assert place.var() == pytest.approx(short.variance_m2(1200.0) - wrong, rel=0.08)


def test_ellipse_of_a_drifting_robot_grows_and_goes_with_the_believed_current():
    ages = np.array([0.0, 60.0, 600.0, 3600.0])
    said = predict_afloat(WORD, WATER, ages)
    np.testing.assert_allclose(said.position_ned[0], (10.0, -5.0, 0.0))
    assert said.position_ned[-1, 0] == pytest.approx(10.0 + 0.04 * 3600.0, rel=0.06)
    axes = [ellipse_90(one)[0][0] for one in said.covariance_m2]
    assert axes[0] == pytest.approx(1.5 * math.sqrt(-2.0 * math.log(0.1)))
    assert np.all(np.diff(axes) > 0.0)


def test_flying_robot_keeps_to_its_track_and_floats_on_from_its_end():
    word = LastWord((6.0, 2.0, 4.0), 1.6, 40.0, 1.5)
    said = predict_flown(word, VEE, WATER, np.array([0.0, 160.0, 360.0, 3960.0]))
    np.testing.assert_allclose(said.position_ned[0], (6.0, 2.0, 4.0), atol=1e-9)
    assert said.position_ned[1, 2] == pytest.approx(20.0, abs=2.0)
    assert abs(said.position_ned[1, 1]) < 0.3, "it is back on its track by the end of the leg"
    carried = WATER.carried_ne_m(3600.0)
    np.testing.assert_allclose(said.position_ned[3, :2], (60.0 + carried[0], carried[1]), atol=2.0)
    assert said.position_ned[3, 2] == 0.0


def test_what_is_not_known_of_the_time_lies_along_the_track():
    word = LastWord((6.0, 0.0, 4.0), 0.2, 0.0, 0.1)
    still = WaterBelief((0.0, 0.0), 0.0, 0.0, 36000.0, 0.01)
    (cov,) = predict_flown(word, VEE, still, np.array([300.0])).covariance_m2
    assert cov[0, 0] > cov[1, 1]
    (long, _), direction = ellipse_90(cov)
    assert abs(math.sin(direction)) < 0.05
    assert long > 2.146 * 0.05 * 300.0 * 0.15 * 0.9


def test_fix_at_a_surfacing_ends_the_growth():
    longer = FlownTrack(
        time_s=np.array([0.0, 460.0, 500.0, 960.0]),
        position_ned=np.array([[0.0, 0, 0], [60, 0, 0], [60, 0, 0], [120, 0, 0]]),
        leg_end_s=np.array([460.0, 960.0]),
        stays_s=np.array([[460.0, 500.0], [960.0, 960.0]]),
        now_s=0.0,
        following_std_m=0.0,
        pace_std=0.0,
        wait_std_s=0.0,
    )
    word = LastWord((0.0, 0.0, 0.0), 1.5, 0.0, 1.5)
    said = predict_flown(word, longer, WATER, np.array([459.0, 505.0, 959.0]))
    across = said.covariance_m2[:, 1, 1]
    assert across[2] == pytest.approx(across[0], rel=0.1)
    # until it is back on its track, how far off it came up counts too
    assert across[1] > 0.8 * across[0]


def test_miss_is_told_in_metres_and_in_ellipses():
    cov = np.diag([4.0, 1.0])
    (long, short), _ = ellipse_90(cov)
    assert miss(np.zeros(2), cov, np.array([long, 0.0]), 0.0) == pytest.approx((long, 1.0))
    assert miss(np.zeros(2), cov, np.array([0.0, short]), 0.0)[1] == pytest.approx(1.0)
    assert miss(np.zeros(2), cov, np.array([0.0, short]), 1.0)[1] < 1.0


def test_predictions_that_miss_widen_the_next_and_a_few_hardly_matter():
    assert calibration(np.zeros(0)) == 1.0
    rng = np.random.default_rng(4)
    fair = np.sqrt((rng.standard_normal((200, 2)) ** 2).sum(axis=1) / (-2.0 * math.log(0.1)))
    assert calibration(fair) == pytest.approx(1.0, abs=0.1)
    assert calibration(2.0 * fair) == pytest.approx(1.85, abs=0.2)
    assert calibration(np.array([3.0])) < 1.6
    assert calibration(np.full(500, 9.0)) <= 4.0
