"""Surveys of an area, a polygon that is drawn at run time inside of the lake's domain."""

import math

import numpy as np
import pytest

from autonomy.planner.approach import way_in
from autonomy.planner.check.check import violations
from autonomy.planner.plan import PlanStatus
from autonomy.planner.preset import GRACE3
from autonomy.planner.resolution import drawn_points
from autonomy.planner.search import search
from autonomy.site import LAKE, Area
from tests.autonomy.planner_problem import belief_over, run, with_search


@pytest.fixture
def rng():
    return np.random.default_rng()


@pytest.fixture
def area(rng):
    """A pentagon about the middle of the lake."""
    angles = np.arange(5) * 2.0 * math.pi / 5.0 + rng.uniform(0.0, 1.2)
    reach = rng.uniform(90.0, 150.0, 5)
    corners = [
        (250.0 + r * math.cos(a), 250.0 + r * math.sin(a))
        for r, a in zip(reach, angles, strict=True)
    ]
    return Area(name="front", corners_m=tuple(corners))


def confined(area, **changes):
    config = with_search(GRACE3, iterations_max=150)
    return config.model_copy(update={"area": area, **changes})


def planned(config, start=(250.0, 250.0)):
    belief = belief_over(config.domain, lengths=(60.0, 60.0, 8.0))
    return run(search.plan, config, belief, start=start, budget=config.round_budget, site=LAKE)


def test_a_survey_stays_inside_of_its_area(area):
    result = planned(confined(area))
    assert result.status is PlanStatus.FOUND
    for candidate in (result.best, *result.runners_up):
        away = area.distance_m(candidate.points[:, 1], candidate.points[:, 2])
        assert float(away.max()) <= 0.01
        assert violations(candidate.legs, confined(area), LAKE) == ()


def test_a_plan_without_the_area_breaks_it(area):
    small = Area(
        name="front",
        corners_m=tuple(
            (250.0 + 0.1 * (n - 250.0), 250.0 + 0.1 * (e - 250.0)) for n, e in area.corners_m
        ),
    )
    result = planned(with_search(GRACE3, iterations_max=150))
    broken = violations(result.best.legs, confined(small), LAKE)
    assert any('goes beyond the survey area "front"' in one.message for one in broken)


def test_a_robot_outside_swims_in_first(area):
    start = (60.0, 60.0)
    way = way_in(confined(area), start, LAKE)
    assert way.refusal == ""
    assert bool(area.contains(*way.end_xy))
    result = planned(confined(area), start=way.end_xy)
    legs = (*way.legs, *result.best.legs)
    named = [one.message for one in violations(legs, confined(area), LAKE)]
    assert not [text for text in named if "survey area" in text]


def test_what_the_search_is_judged_on_lies_in_the_area(area, rng):
    points = drawn_points(LAKE.domain, LAKE, rng, 300, area)
    assert len(points) == 300
    assert area.contains(points[:, 0], points[:, 1]).all()


def test_an_area_on_land_is_refused_in_words():
    land = Area(name="hill", corners_m=((0.0, 0.0), (6.0, 0.0), (6.0, 6.0), (0.0, 6.0)))
    result = planned(confined(land))
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert "survey area" in result.message
