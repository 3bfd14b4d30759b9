from dataclasses import replace

import numpy as np
import pytest

from autonomy.planner.check.check import violations
from autonomy.planner.leg.edge import legs_energy, propose_edge, random_shape
from autonomy.planner.leg.waterway import waterway_of
from autonomy.planner.plan import PlanStatus
from autonomy.planner.search import search
from autonomy.planner.search.warm import rebased, shape_of
from autonomy.site import TANK
from tests.autonomy.planner_problem import (
    START,
    THESIS_TANK,
    belief_over,
    independent_worth,
    plain_worth_of_best,
    run,
    with_search,
)

QUICK = with_search(THESIS_TANK, iterations_max=25)
OBJECTIVES = ("information_gain", "ergodic", "weighted")


def base(config, legs, start=START, budget=20.0):
    return rebased(
        config,
        start,
        budget,
        legs,
        rng=np.random.default_rng(0),
        waterway=waterway_of(config, None),
        site=None,
    )


@pytest.fixture(scope="module")
def found():
    return run(search.plan, QUICK, belief_over(QUICK.domain))


@pytest.mark.parametrize("name", OBJECTIVES)
def test_a_search_that_goes_on_is_never_worse(name):
    config = QUICK.model_copy(update={"objective": name})
    belief = belief_over(config.domain)
    before = run(search.plan, config, belief)
    warm = [offer.legs for offer in (before.best, *before.runners_up)]
    again = with_search(config, iterations_max=1)
    after = run(search.plan, again, belief, seed=7, warm=warm)
    worth = independent_worth(config, belief, seed=7)
    assert after.best.objective >= worth(before.best.points) - 1e-9
    more = run(search.plan, config, belief, seed=7, warm=warm)
    assert more.best.objective >= before.best.objective - 1e-9
    assert violations(more.best.legs, config, TANK) == ()


def test_what_was_known_is_offered_even_if_there_is_no_time_left(found):
    result = run(
        search.plan,
        QUICK,
        belief_over(QUICK.domain),
        warm=[found.best.legs],
        elapsed_s=lambda: 1e6,
    )
    assert result.status is PlanStatus.FOUND
    assert result.best.legs == found.best.legs
    assert result.best.objective == pytest.approx(found.best.objective, rel=1e-9)


def test_the_search_values_a_known_trajectory_as_the_reference_does(found):
    belief = belief_over(QUICK.domain)
    for name in OBJECTIVES:
        config = with_search(QUICK.model_copy(update={"objective": name}), points_per_edge_max=64)
        one = search.Search(config, belief, START, np.random.default_rng(0), 20.0)
        one.begin_with([found.best.legs])
        expected = plain_worth_of_best(one, config, belief)
        assert one.best == pytest.approx(expected, rel=1e-4)


def test_a_warm_search_repeats_itself(found):
    belief = belief_over(QUICK.domain)
    one, two = (run(search.plan, QUICK, belief, seed=3, warm=[found.best.legs]) for _ in range(2))
    assert one.best.legs == two.best.legs
    assert one.candidates == two.candidates


def test_edges_that_were_flown_already_are_left_out(found):
    ends = [leg.end_ned for leg in found.best.legs if leg.end_ned[2] == 0.0]
    rest = base(QUICK, found.best.legs, start=ends[0][:2])
    kept = tuple(leg for edge in rest for leg in edge.legs)
    assert kept == found.best.legs[-len(kept) :]
    assert kept[0].start_ned == ends[0]
    assert 0 < len(kept) < len(found.best.legs)


def test_a_robot_that_came_up_elsewhere_is_joined_by_a_feasible_edge(found):
    surfaced = next(leg.end_ned for leg in found.best.legs if leg.end_ned[2] == 0.0)
    start = (surfaced[0] + 0.04, surfaced[1] - 0.03)
    rest = base(QUICK, found.best.legs, start=start)
    legs = tuple(leg for edge in rest for leg in edge.legs)
    assert legs[0].start_ned == (*start, 0.0)
    assert violations(legs, QUICK, TANK) == ()
    assert legs[-1] == found.best.legs[-1]


def test_what_exceeds_the_budget_is_cut_off_at_the_end(found):
    half = 0.5 * found.best.energy
    edges = base(QUICK, found.best.legs, budget=half)
    legs = tuple(leg for edge in edges for leg in edge.legs)
    assert 0.0 < legs_energy(QUICK, legs) <= half
    assert legs == found.best.legs[: len(legs)]


def test_what_cannot_be_flown_is_dropped(found):
    belief = belief_over(QUICK.domain)
    broken = tuple(replace(leg, end_ned=(float("nan"), 0.0, 0.0)) for leg in found.best.legs)
    far = tuple(
        replace(
            leg,
            start_ned=(leg.start_ned[0] + 50.0, *leg.start_ned[1:]),
            end_ned=(leg.end_ned[0] + 50.0, *leg.end_ned[1:]),
        )
        for leg in found.best.legs
    )
    cold = run(search.plan, QUICK, belief, seed=1)
    warm = run(search.plan, QUICK, belief, seed=1, warm=[(), broken, far])
    assert warm.best.legs == cold.best.legs


def test_a_shape_read_from_an_edge_gives_the_edge_again():
    rng = np.random.default_rng(0)
    alike = 0
    for _ in range(300):
        goal = (float(rng.uniform(0.0, 2.7)), float(rng.uniform(0.0, 1.3)))
        edge = propose_edge(QUICK, START, goal, 20.0, random_shape(QUICK, rng))
        if edge is None:
            continue
        again = propose_edge(QUICK, START, goal, 20.0, shape_of(QUICK, edge))
        if again is not None and len(again.legs) == len(edge.legs):
            np.testing.assert_allclose(again.points[-1], edge.points[-1], atol=1e-6)
            middle = [np.array(each.legs[0].end_ned) for each in (edge, again)]
            alike += bool(np.linalg.norm(middle[0] - middle[1]) < 1e-6)
    assert alike > 20
