"""The default filter in currents that nobody told it, and with bad input; seeded, few cases."""

import numpy as np
import pytest

from benchmarks.estimation.estimation_hidden import (
    Judged,
    default_filter,
    hidden_flight,
    judged,
    with_bad_fixes,
    with_prior,
    with_turned_compass,
)
from simulator.fleet import GRACE_1, MINI_1, RobotDefinition

CURRENTS = (np.array([0.02, 0.0]), np.array([-0.012, 0.024]), np.array([0.0, 0.0]))


def pooled(values: list[Judged]) -> tuple[float, float, float]:
    """Return NEES, share held by the 95 % circle, and RMS error, from the third fix on."""
    late = [one.late for one in values]
    nees = np.mean([one.nees(when) for one, when in zip(values, late, strict=True)])
    held = np.mean([one.held(when) for one, when in zip(values, late, strict=True)])
    errors = np.concatenate([one.error_m[when] for one, when in zip(values, late, strict=True)])
    return float(nees), float(held), float(np.sqrt(np.mean(errors**2)))


@pytest.fixture(scope="module")
def in_the_tank() -> list[Judged]:
    flown = []
    for seed, current in enumerate(CURRENTS):
        flight = hidden_flight(MINI_1, np.random.default_rng([seed, 5]), current)
        flown.append(judged(flight, default_filter(MINI_1)))
    return flown


def test_positions_in_a_current_that_nobody_told_are_as_good_as_they_say(
    in_the_tank: list[Judged],
) -> None:
    nees, held, error_m = pooled(in_the_tank)
    assert 1.0 < nees < 3.2
    assert held > 0.88
    assert error_m < 0.35
    assert np.mean([one.held(~one.late) for one in in_the_tank]) > 0.8


def test_a_lake_of_ten_cm_s_is_learned_by_the_third_fix() -> None:
    flight = hidden_flight(GRACE_1, np.random.default_rng(3), np.array([0.06, -0.08]))
    nees, held, error_m = pooled([judged(flight, default_filter(GRACE_1))])
    assert nees < 4.0
    assert held > 0.85
    assert error_m < 10.0


@pytest.mark.parametrize("prior_m_s", [0.0, 2.0])
def test_a_prior_that_is_far_wrong_still_gives_honest_positions(prior_m_s: float) -> None:
    flown = [with_prior(prior_m_s)(MINI_1, np.random.default_rng([s, 8])) for s in range(2)]
    nees, held, error_m = pooled(flown)
    assert nees < 4.0
    assert held > 0.85
    assert error_m < 0.6


def test_lone_fixes_far_off_are_refused_and_change_nothing(in_the_tank: list[Judged]) -> None:
    flown = [with_bad_fixes(MINI_1, np.random.default_rng([s, 9])) for s in range(2)]
    nees, held, error_m = pooled(flown)
    assert min(one.refused for one in flown) > 20
    assert max(one.refused for one in in_the_tank) <= 4
    assert nees < 4.0
    assert held > 0.85
    assert error_m < 0.35


def test_a_compass_that_is_far_off_is_doubted() -> None:
    flown = [with_turned_compass(MINI_1, np.random.default_rng([s, 4])) for s in range(2)]
    _, held, _ = pooled(flown)
    assert min(one.doubt for one in flown) > 1.3
    assert held > 0.7


@pytest.mark.parametrize("robot", [MINI_1, GRACE_1], ids=["tank", "lake"])
def test_a_filter_begins_with_the_current_of_its_water_in_doubt(robot: RobotDefinition) -> None:
    expected = {"tank": 0.01, "lake": 0.05}[robot.site.kind]
    told = default_filter(robot).steady_current_std_m_s
    assert expected < told < 2.0 * expected
