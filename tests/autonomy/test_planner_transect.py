import math

import numpy as np
import pytest

from autonomy.planner.check.check import violations
from autonomy.planner.graph import DEPTH_MAX
from autonomy.planner.leg.edge import legs_energy
from autonomy.planner.leg.waterway import waterway_of
from autonomy.planner.objective import objective
from autonomy.planner.search import search
from autonomy.planner.transect import transects
from autonomy.site import LAKE, Area
from tests.autonomy.planner_problem import TOLD, belief_over, run, with_search

CONFIG = TOLD["grace3"]
JETTY = (120.0, 120.0)
MOORING = Area(name="mooring", corners_m=((200.0, 200.0), (260.0, 200.0), (230.0, 260.0)))


def lines_of(config, budget=CONFIG.round_budget, start_xy=JETTY):
    found = transects(config, start_xy, budget, waterway_of(config, LAKE), DEPTH_MAX)
    return [tuple(leg for edge in line for leg in edge.legs) for line in found]


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"keep_outs": (MOORING,)},
        {"current": {"north_m_s": 0.01, "east_m_s": -0.01}},
        {"time_budget_s": 3600.0},
        {"satellite_bytes": 500},
    ],
    ids=lambda change: next(iter(change), "lake"),
)
def test_a_transect_keeps_every_limit(change):
    config = type(CONFIG).model_validate(CONFIG.model_dump() | change)
    lines = lines_of(config)
    assert len(lines) == config.search.transects
    for legs in lines:
        assert violations(legs, config, LAKE) == ()
        assert legs[0].start_ned == (*JETTY, 0.0)
        assert legs[-1].end_ned[2] == 0.0


def test_a_transect_keeps_its_course_until_the_water_ends_and_spends_its_budget():
    lines = lines_of(CONFIG, start_xy=(250.0, 250.0))
    for number, legs in enumerate(lines):
        course = 2.0 * math.pi * number / CONFIG.search.transects
        north, east = np.subtract(legs[5].end_ned[:2], legs[0].start_ned[:2])
        assert math.atan2(east, north) == pytest.approx(math.remainder(course, math.tau), abs=1e-6)
        assert legs_energy(CONFIG, legs) > 0.9 * CONFIG.round_budget


def test_a_transect_has_no_more_dives_than_a_search_can_hold():
    found = transects(CONFIG, JETTY, 4000.0, waterway_of(CONFIG, LAKE), 7)
    assert {len(line) for line in found} == {7}


def test_there_is_no_transect_where_no_dive_can_be_flown():
    shallow = CONFIG.model_copy(update={"floor_margin_m": 18.0})
    assert lines_of(shallow) == []
    assert lines_of(with_search(CONFIG, transects=0)) == []


def test_a_search_is_never_worse_than_its_best_transect():
    config = with_search(CONFIG, iterations_max=1)
    belief = belief_over(config.domain)
    worth = objective(config, belief, JETTY)
    waterway = waterway_of(config, LAKE)
    lines = transects(config, JETTY, config.round_budget, waterway, DEPTH_MAX)
    best = max(worth(np.concatenate([edge.points for edge in line])) for line in lines)
    found = run(search.plan, config, belief, start=JETTY, budget=config.round_budget, site=LAKE)
    assert found.best.objective >= best * (1.0 - 1e-3)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_round_of_the_usual_survey_leads_far_across_the_lake(seed):
    config = with_search(CONFIG, iterations_max=30)
    belief = belief_over(config.domain, lengths=(202.0, 293.0, 6.3))
    found = run(
        search.plan,
        config,
        belief,
        seed=seed,
        start=JETTY,
        budget=config.round_budget,
        site=LAKE,
    )
    way = np.linalg.norm(found.best.points[:, 1:3] - JETTY, axis=1)
    assert way.max() > 150.0
    assert violations(found.best.legs, config, LAKE) == ()
