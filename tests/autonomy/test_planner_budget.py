import math

import pytest

from autonomy.planner.outcome import least_spending, spending
from autonomy.planner.plan import PlanStatus
from autonomy.planner.reference import literal
from autonomy.planner.search import search
from autonomy.site import LAKE, TANK, Area, Box
from tests.autonomy.planner_problem import THESIS_TANK, belief_over, run, with_search

QUICK = with_search(THESIS_TANK, iterations_max=25)
PLANNERS = pytest.mark.parametrize("planner", [search.plan, literal.plan])
KEEP_OUT = Area(name="the mooring", corners_m=((0.1, 0.1), (0.6, 0.1), (0.6, 0.6), (0.1, 0.6)))


def few(planner):
    """Settings for a short run; the letter takes longer for an iteration."""
    return with_search(QUICK, iterations_max=25 if planner is search.plan else 6)


@PLANNERS
def test_no_trajectory_exceeds_the_time_of_a_round(planner):
    config = few(planner).model_copy(update={"time_budget_s": 150.0})
    result = run(planner, config, belief_over(config.domain))
    assert result.status is PlanStatus.FOUND
    for offer in (result.best, *result.runners_up):
        assert offer.duration_s <= 150.0 + 1e-6
    free = run(planner, few(planner), belief_over(config.domain))
    assert free.best.duration_s > 150.0


@PLANNERS
def test_no_trajectory_sends_more_than_the_satellite_budget(planner):
    config = few(planner).model_copy(update={"satellite_bytes": 320})
    result = run(planner, config, belief_over(config.domain))
    assert result.status is PlanStatus.FOUND
    for offer in (result.best, *result.runners_up):
        assert spending(config, offer.legs).satellite_bytes <= 320
    free = run(planner, few(planner), belief_over(config.domain))
    assert spending(config, free.best.legs).satellite_bytes > 320


def test_the_scarcest_budget_decides_what_is_compared():
    config = QUICK.model_copy(update={"time_budget_s": 60.0})
    result = run(search.plan, config, belief_over(config.domain))
    spent = spending(config, result.best.legs)
    assert spent.energy < 0.9 * 20.0
    assert spent.greatest_share(config, 20.0) == pytest.approx(spent.duration_s / 60.0)
    assert 0.9 < spent.greatest_share(config, 20.0) <= 1.0
    assert "No trajectory spends more" not in result.message


@PLANNERS
@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"time_budget_s": 0.5}, "time budget of 0.5 s is below the fastest way"),
        ({"satellite_bytes": 40}, "satellite budget of 40 bytes is below what one surfacing sends"),
    ],
)
def test_a_budget_below_the_cheapest_primitive_is_refused_with_its_name(planner, change, reason):
    config = QUICK.model_copy(update=change)
    result = run(planner, config, belief_over(config.domain))
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert reason in result.message
    assert result.best is None


def test_the_least_spending_bounds_that_of_every_edge():
    result = run(search.plan, QUICK, belief_over(QUICK.domain))
    least = least_spending(QUICK)
    begin = 0
    legs = result.best.legs
    for number, leg in enumerate(legs, start=1):
        if leg.end_ned[2] == 0.0:
            spent = spending(QUICK, legs[begin:number])
            begin = number
            assert spent.energy >= least.energy - 1e-9
            assert spent.duration_s >= least.duration_s - 1e-9
            assert spent.satellite_bytes >= least.satellite_bytes


@PLANNERS
def test_a_start_inside_a_keep_out_is_refused_by_its_name(planner):
    config = QUICK.model_copy(update={"keep_outs": (KEEP_OUT,)})
    result = run(planner, config, belief_over(config.domain))
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert "inside the keep-out the mooring" in result.message


@PLANNERS
def test_a_start_within_the_margin_of_a_keep_out_is_refused_with_the_distance(planner):
    config = QUICK.model_copy(update={"keep_outs": (KEEP_OUT,), "margin_m": 0.2})
    result = run(planner, config, belief_over(config.domain), start=(0.7, 0.3))
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert "0.1 m from the keep-out the mooring; the margin is 0.2 m" in result.message


@PLANNERS
def test_a_start_on_land_is_refused(planner):
    north = max(corner[0] for corner in LAKE.shoreline.corners_m) + 5.0
    domain = Box(x_min_m=0.0, x_max_m=north + 10.0, y_min_m=0.0, y_max_m=400.0, depth_max_m=10.0)
    config = QUICK.model_copy(update={"domain": domain})
    result = run(planner, config, belief_over(domain), start=(north, 200.0), site=LAKE)
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert "is not in the water" in result.message


@PLANNERS
def test_a_domain_without_volume_is_refused(planner):
    flat = Box.model_construct(x_min_m=0.0, x_max_m=0.0, y_min_m=0.0, y_max_m=1.0, depth_max_m=1.0)
    config = QUICK.model_copy(update={"domain": flat})
    result = run(planner, config, belief_over(QUICK.domain))
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert "the domain has no volume" in result.message


def test_a_domain_without_water_is_refused():
    belief = belief_over(QUICK.domain).within(
        belief_over(QUICK.domain).test_points[:, 0] > math.inf
    )
    result = run(search.plan, QUICK, belief, site=TANK)
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert "no point of the domain is in the water" in result.message


@PLANNERS
def test_a_domain_that_a_keep_out_closes_all_around_is_told(planner):
    wall = Area(
        name="the wall",
        corners_m=(
            (0.0, 0.0),
            (2.75, 0.0),
            (2.75, 1.37),
            (0.0, 1.37),
            (0.0, 0.34),
            (0.05, 0.34),
            (0.05, 0.29),
            (0.0, 0.29),
        ),
    )
    config = with_search(QUICK, iterations_max=10).model_copy(update={"keep_outs": (wall,)})
    config = config.model_copy(
        update={"primitives": config.primitives.model_copy(update={"swim_length_min_m": 0.6})}
    )
    result = run(planner, config, belief_over(config.domain), start=(0.02, 0.315))
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert "met every limit" in result.message
