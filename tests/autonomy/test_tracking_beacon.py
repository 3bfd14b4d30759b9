"""Own position from ranges to one beacon of known place."""

import math

import numpy as np
import pytest

from autonomy.tracking.beacon import BeaconNavigator
from autonomy.tracking.config import RangingConfig
from autonomy.tracking.reading import RangeHeard
from tests.autonomy.tracking_water import DT_S, settings

BEACON = (40.0, 25.0)
CURRENT = np.array([0.03, -0.02])
CONFIG = settings(
    guess_ne_m=BEACON, ranging=RangingConfig(period_s=2.0, variance_m2=0.25, coast_after_s=10.0)
)


def lawnmower(seconds, *, ranges_every_s=None, late_s=0.0, seed=1):
    """Swim to and fro in a current that dead reckoning does not see.

    Returns true and reckoned places, shape (n, 2), and every fix.
    """
    noise = np.random.default_rng(seed)
    own, heading, speed = np.array([30.0, 10.0]), 0.0, 0.25
    reckoned = own.copy()
    navigator = BeaconNavigator(CONFIG, tuple(own), 1.0, heading, speed)
    rows, fixes, pending = [], [], []
    for n in range(round(seconds / DT_S)):
        turn = 0.2 if (n * DT_S) % 60.0 < 15.7 else 0.0
        heading += turn * DT_S
        through = speed * np.array([math.cos(heading), math.sin(heading)])
        own = own + DT_S * (through + CURRENT)
        reckoned = reckoned + DT_S * through
        if ranges_every_s and n % round(ranges_every_s / DT_S) == 0:
            pending.append((n, math.dist(own, BEACON) + noise.normal(0.0, 0.5)))
        due = [one for one in pending if (n - one[0]) * DT_S >= late_s]
        pending = [one for one in pending if one not in due]
        fix = navigator.step(
            heading + noise.normal(0.0, 0.05),
            speed + noise.normal(0.0, 0.02),
            DT_S,
            turn_rate_rad_s=turn,
            ranges=tuple(RangeHeard(r, DT_S * (n - since)) for since, r in due),
        )
        rows.append((own, reckoned))
        fixes.append(fix)
    return np.array(rows), fixes


@pytest.mark.parametrize("late_s", [0.0, 4.0])
def test_ranges_to_one_beacon_hold_a_drifting_dead_reckoning_in_bounds(late_s):
    rows, fixes = lawnmower(900.0, ranges_every_s=2.0, late_s=late_s)
    drift = np.hypot(*(rows[:, 1] - rows[:, 0]).T)
    places = np.array([fix.position_ne_m for fix in fixes])
    error = np.hypot(*(places - rows[:, 0]).T)
    assert drift[-1] > 30.0
    assert error.max() < 4.5
    assert error[2000:].max() < 2.0
    assert np.sqrt(np.mean(error[2000:] ** 2)) < 1.0
    assert fixes[-1].is_sure
    assert fixes[-1].current_ne_m_s == pytest.approx(CURRENT, abs=0.015)


def test_without_ranges_it_is_dead_reckoning_that_knows_how_it_drifts():
    rows, fixes = lawnmower(300.0)
    assert math.dist(fixes[-1].position_ne_m, rows[-1, 1]) < 3.0
    assert math.dist(fixes[-1].position_ne_m, rows[-1, 0]) > 5.0
    assert fixes[-1].position_std_m > 10.0
    assert fixes[-1].silence_s == pytest.approx(300.0, abs=0.2)


def test_bad_ranges_and_numbers_are_survived():
    navigator = BeaconNavigator(CONFIG, (30.0, 10.0), 1.0, 0.0, 0.2)
    bad = tuple(RangeHeard(r) for r in (math.nan, -1.0, math.inf, 1e300))
    fix = navigator.step(math.nan, math.nan, 0.1, ranges=bad)
    assert np.isfinite([*fix.position_ne_m, *fix.covariance_m2]).all()
    with pytest.raises(ValueError, match="finite rates"):
        navigator.step(0.0, 0.2, 0.1, turn_rate_rad_s=math.nan)
