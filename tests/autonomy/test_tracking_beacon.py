"""Own position from ranges to one beacon of known place."""

import math

import numpy as np
import pytest

from autonomy.tracking.beacon import BeaconNavigator
from autonomy.tracking.config import FilterConfig, RangingConfig
from autonomy.tracking.reading import RangeHeard
from tests.autonomy.tracking_water import settings

BEACON = (40.0, 25.0)
CURRENT = np.array([0.03, -0.02])
DT_S = 0.5
CONFIG = settings(
    guess_ne_m=BEACON,
    ranging=RangingConfig(period_s=2.0, variance_m2=0.25, coast_after_s=10.0),
    filter=FilterConfig(target_speed_std_m_s=0.05),
)


def lawnmower(seconds, *, ranges_every_s=None, late_s=0.0, seed=1):
    """Swim to and fro in a current that dead reckoning does not see, and among eddies.

    Returns true and reckoned places, shape (n, 2, 2), and every fix.
    """
    noise = np.random.default_rng(seed)
    own, heading, speed = np.array([30.0, 10.0]), 0.0, 0.25
    eddy_std_m_sqrt_s = 0.05
    reckoned, std_m = own + noise.normal(0.0, 1.0, 2), 1.0
    navigator = BeaconNavigator(CONFIG, tuple(reckoned), std_m, np.random.default_rng(seed))
    rows, fixes, pending = [], [], []
    for n in range(round(seconds / DT_S)):
        turn = 0.2 if (n * DT_S) % 60.0 < 15.7 else 0.0
        heading += turn * DT_S
        through = speed * np.array([math.cos(heading), math.sin(heading)])
        own = own + DT_S * (through + CURRENT)
        own = own + eddy_std_m_sqrt_s * math.sqrt(DT_S) * noise.standard_normal(2)
        reckoned = reckoned + DT_S * through
        std_m = math.hypot(std_m, eddy_std_m_sqrt_s * math.sqrt(DT_S))
        if ranges_every_s and n % round(ranges_every_s / DT_S) == 0:
            pending.append((n, math.dist(own, BEACON) + noise.normal(0.0, 0.5)))
        due = [one for one in pending if (n - one[0]) * DT_S >= late_s]
        pending = [one for one in pending if one not in due]
        heard = tuple(RangeHeard(r, DT_S * (n - since)) for since, r in due)
        fixes.append(navigator.step(tuple(reckoned), std_m, DT_S, heard))
        rows.append((own, reckoned))
    return np.array(rows), fixes


def errors_in_stds(rows, fixes):
    """Return how far every fix is off, as a Mahalanobis distance."""
    off = np.array([fix.position_ne_m for fix in fixes]) - rows[:, 0]
    nn, ne, ee = np.array([fix.covariance_m2 for fix in fixes]).T
    north, east = off.T
    square = (ee * north**2 - 2.0 * ne * north * east + nn * east**2) / (nn * ee - ne**2)
    return np.sqrt(square)


@pytest.mark.parametrize(("seed", "late_s"), [(1, 0.0), (2, 0.0), (3, 4.0)])
def test_ranges_to_one_beacon_hold_a_drifting_dead_reckoning_in_bounds(seed, late_s):
    rows, fixes = lawnmower(900.0, ranges_every_s=2.0, late_s=late_s, seed=seed)
    drift = np.hypot(*(rows[:, 1] - rows[:, 0]).T)
    error = np.hypot(*(np.array([fix.position_ne_m for fix in fixes]) - rows[:, 0]).T)
    assert drift[-1] > 25.0
    assert np.sqrt(np.mean(error[600:] ** 2)) < 1.5
    assert error[600:].max() < 5.0
    assert fixes[-1].current_ne_m_s == pytest.approx(CURRENT, abs=0.03)


@pytest.mark.parametrize("ranges_every_s", [2.0, 10.0, None])
def test_what_it_says_of_its_error_is_about_right(ranges_every_s):
    squares = []
    for seed in range(4):
        rows, fixes = lawnmower(600.0, ranges_every_s=ranges_every_s, seed=seed)
        squares.append(np.mean(errors_in_stds(rows, fixes) ** 2))
    # two for a filter that knows itself
    assert 0.3 < np.mean(squares) < 3.0


def test_without_ranges_it_is_dead_reckoning_that_knows_how_it_drifts():
    rows, fixes = lawnmower(300.0)
    assert math.dist(fixes[-1].position_ne_m, rows[-1, 1]) < 3.0
    assert math.dist(fixes[-1].position_ne_m, rows[-1, 0]) > 5.0
    assert fixes[-1].position_std_m > 10.0
    assert fixes[-1].silence_s == pytest.approx(300.0, abs=0.01)


def test_straight_course_leaves_two_places_and_is_said_to():
    """Abeam of the beacon, a mirrored current explains every range as well."""
    navigator = BeaconNavigator(CONFIG, (0.0, 25.0), 5.0, np.random.default_rng(1))
    std_along = std_across = math.nan
    for n in range(200):
        own = (0.25 * n, 25.0)
        fix = navigator.step(own, 5.0, 1.0, (RangeHeard(abs(40.0 - own[0])),))
        nn, _, ee = fix.covariance_m2
        if n == 100:
            std_along, std_across = math.sqrt(nn), math.sqrt(ee)
    assert std_across > 3.0 * std_along


def test_bad_ranges_are_survived_and_bad_numbers_named():
    navigator = BeaconNavigator(CONFIG, (30.0, 10.0), 1.0, np.random.default_rng(1))
    bad = tuple(RangeHeard(r) for r in (math.nan, -1.0, math.inf, 1e300))
    fix = navigator.step((30.0, 10.0), 1.0, 0.1, bad)
    assert np.isfinite([*fix.position_ne_m, *fix.covariance_m2]).all()
    with pytest.raises(ValueError, match="finite position"):
        navigator.step((math.nan, 0.0), 1.0, 0.1)
    with pytest.raises(ValueError, match="own_std_m"):
        navigator.step((0.0, 0.0), -1.0, 0.1)
