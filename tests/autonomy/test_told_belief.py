"""What is told of a current beside what dives tell: believed while they agree, and no longer."""

import numpy as np
import pytest

from autonomy.current.config import CURRENT_PRESETS
from autonomy.current.model import CurrentMap, tabulate
from autonomy.current.table import flow_at, table_of
from autonomy.current.told import ToldCurrent, ToldProfile
from autonomy.site import LAKE
from tests.autonomy.test_current_map import observation

SEA = CURRENT_PRESETS["sea"].model_copy(update={"tide_std_m_s": (0.0,)})
STD_M_S = 0.05
MARGIN = 1.15
"""What a told current that is wrong may cost after eight dives: so many times the error without."""


def constant(velocity, from_s=-np.inf, until_s=np.inf) -> ToldCurrent:
    field = ToldProfile(np.zeros(1), np.array([velocity]), from_s, until_s)
    return ToldCurrent(field, (43.0, -80.0), STD_M_S)


def joint_error(error_m_s: float, dives: int, seeds: int = 30) -> tuple[float, float]:
    """Return the rms error of the current with and without a telling that is wrong by so much."""
    with_, without = [], []
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        truth = rng.normal(0.0, 0.15, 2)
        wrong = rng.normal(0.0, error_m_s, 2)
        alone, both = CurrentMap(SEA), CurrentMap(SEA)
        both.tell(constant(truth + wrong))
        for i in range(dives):
            drift = 400.0 * truth + rng.normal(0.0, 6.0, 2)
            place = tuple(rng.uniform(-2000.0, 2000.0, 2).tolist())
            seen = observation(600.0 * i, tuple(drift.tolist()), place)
            alone.append(seen)
            both.append(seen)
        points = np.column_stack(
            [rng.uniform(-2000.0, 2000.0, (20, 2)), rng.uniform(0.0, 16.0, 20), np.full(20, 9000.0)]
        )
        with_.append(both.mean_flow(points) - truth)
        without.append(alone.mean_flow(points) - truth)
        np.testing.assert_allclose(both.flow(points).mean_ne_m_s, both.mean_flow(points))
    return tuple(float(np.sqrt(np.mean(np.square(one)))) for one in (with_, without))


@pytest.mark.parametrize("error_m_s", [0.0, 0.05, 0.1, 0.2, 0.5, 1.0])
def test_a_wrong_telling_costs_no_more_than_the_margin(error_m_s: float) -> None:
    with_it, without = joint_error(error_m_s, 8)
    assert with_it <= MARGIN * without
    if error_m_s == 0.0:
        assert with_it <= 0.7 * without


def test_a_right_telling_is_worth_most_before_the_first_dive() -> None:
    with_it, without = joint_error(STD_M_S, 0)
    assert with_it < 0.5 * without


def test_the_stated_deviation_holds_where_no_dive_told() -> None:
    known = CurrentMap(SEA)
    point = np.array([[0.0, 0.0, 5.0, 100.0]])
    alone = known.flow(point)
    known.tell(constant((0.2, -0.1), 0.0, 1000.0))
    said = known.flow(point)
    np.testing.assert_allclose(said.mean_ne_m_s, [[0.2, -0.1]], atol=0.01)
    std = np.sqrt(np.diag(said.cov_m2_s2[0]))
    assert (std >= STD_M_S * 0.99).all()
    assert (std <= STD_M_S * 1.3).all()
    # beyond its time it is as if nobody had told
    point[0, 3] = 1001.0
    np.testing.assert_array_equal(known.flow(point).mean_ne_m_s, alone.mean_ne_m_s)
    np.testing.assert_array_equal(known.flow(point).cov_m2_s2, alone.cov_m2_s2)
    assert [known.is_told(at) for at in (-1.0, 500.0, 1001.0)] == [False, True, False]


def test_dives_before_the_telling_still_count() -> None:
    known = CurrentMap(SEA)
    for i in range(20):
        known.append(observation(600.0 * i, (80.0, -40.0), walk_std_m=1.0))
    point = np.array([[20.0, 0.0, 8.0, 12_500.0]])
    alone = known.mean_flow(point)
    known.tell(constant((-0.3, 0.3), 12_400.0, 50_000.0))
    np.testing.assert_allclose(known.mean_flow(point), alone, atol=0.25 * np.hypot(*alone[0]))


def test_belief_follows_the_dives_and_a_copy_keeps_it() -> None:
    right, wrong = CurrentMap(SEA), CurrentMap(SEA)
    right.tell(constant((0.2, -0.1)))
    wrong.tell(constant((-0.6, 0.5)))
    for i in range(6):
        for known in (right, wrong):
            known.append(observation(600.0 * i, (80.0, -40.0)))
    assert right.belief > 0.9
    assert wrong.belief < 0.01
    assert right.copy().belief == right.belief
    right.tell(None)
    assert (right.belief, right.told) == (0.0, None)


def test_a_plan_takes_the_telling_into_its_table() -> None:
    known = CurrentMap(SEA)
    known.tell(constant((0.2, -0.1)))
    record = tabulate(known, LAKE.domain, 0.0, 3600.0, (2, 2, 2, 2))
    assert record.dives == 0
    np.testing.assert_allclose(
        flow_at(table_of(record), 0.0, 0.0, 1.0, 60.0), (0.2, -0.1), atol=0.01
    )
