import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.planner.approach import after_approach, approach_energy, shortfall, way_in
from autonomy.planner.check.check import violations
from autonomy.planner.check.clearance import clearance_m, floor_contacts
from autonomy.planner.check.true_ways import TrueWays
from autonomy.planner.check.water_check import out_of_bounds
from autonomy.planner.config import PlannedCurrentConfig
from autonomy.planner.leg.edge import departures, planned_points, propose_edge, surfacings
from autonomy.planner.leg.primitive import dive, glide, spiral, swim
from autonomy.planner.leg.waterway import usable_depth_m, waterway_of
from autonomy.planner.outcome import spending
from autonomy.planner.plan import PrimitiveKind
from autonomy.site import LAKE, TANK, Area
from tests.autonomy.planner_problem import TOLD
from tests.autonomy.planner_water import BUOY, NET, POOL, pool_config, proposals

POOLED = pool_config()
LAKE_CONFIG = TOLD["grace3"]


def down_and_up(config, x, y, depth):
    return dive(config, (x, y, 0.0), depth), dive(config, (x, y, depth), 0.0)


def found(legs, config=POOLED, site=POOL):
    return [violation.message for violation in violations(legs, config, site)]


@pytest.mark.parametrize("current", [(0.0, 0.0), (0.01, -0.006)])
def test_the_planner_and_the_check_agree_about_every_edge(current):
    config = pool_config(*current)
    waterway = waterway_of(config, POOL)
    agreed = 0
    for start, goal, shape in proposals(config, 400, seed=8):
        edge = propose_edge(config, start, goal, 20.0, shape, waterway)
        if edge is not None:
            agreed += 1
            assert violations(edge.legs, config, POOL) == ()
    assert agreed > 10


def test_a_dive_in_a_keep_out_names_it():
    messages = found(down_and_up(POOLED, 1.45, 0.65, 0.4))
    assert messages == [
        'Leg 1 (dive) enters the keep-out "Buoy".',
        'Leg 2 (dive) enters the keep-out "Buoy".',
    ]


def test_a_way_through_a_keep_out_is_found_though_both_ends_are_outside():
    assert clearance_m(BUOY, np.array([(1.2, 0.65, 0.0), (1.8, 0.65, 0.0)])) == 0.0
    straight = (swim(POOLED, (1.2, 0.65, 0.0), (1.8, 0.65, 0.0)),)
    assert found(straight) == ['Leg 1 (swim) enters the keep-out "Buoy".']
    depth = 0.3
    reach = depth / math.tan(math.radians(50.0))
    legs = (
        glide(POOLED, (1.45 - reach, 0.65, 0.0), (1.45, 0.65, depth)),
        glide(POOLED, (1.45, 0.65, depth), (1.45 + reach, 0.65, 0.0)),
    )
    assert found(legs) == [
        'Leg 1 (glide) enters the keep-out "Buoy".',
        'Leg 2 (glide) enters the keep-out "Buoy".',
    ]


def test_a_margin_is_named_with_what_is_left_of_it():
    messages = found(down_and_up(POOLED, 1.29, 0.65, 0.3))
    assert len(messages) == 2
    assert all('of the keep-out "Buoy"; the margin is 0.05 m' in text for text in messages)


def test_land_and_the_shore_are_named():
    messages = found(down_and_up(POOLED, 2.72, 0.05, 0.15))
    assert 'Leg 1 (dive) goes beyond the shoreline "Pool".' in messages
    near = found(down_and_up(POOLED, 1.2, 0.13, 0.3))
    assert any('of the shoreline "Pool"; the margin is 0.05 m' in text for text in near)


def test_the_floor_is_named_with_its_depth_and_place():
    messages = found(down_and_up(POOLED, 1.7, 1.0, 0.55))
    assert "goes 0.10 m under the floor, which is 0.45 m deep at 1.7 m north" in messages[0]
    close = found(down_and_up(POOLED, 1.7, 1.0, 0.43))
    assert "comes within 0.02 m of the floor, 0.45 m deep" in close[0]
    assert "the margin is 0.04 m" in close[0]
    assert found(down_and_up(POOLED, 1.7, 1.0, 0.40)) == []


def test_a_ridge_between_the_ends_of_a_leg_is_met():
    config = POOLED.model_copy(update={"keep_outs": ()})
    way = np.array([(0.9, 1.0, 0.44), (2.75, 1.0, 0.44)])
    assert floor_contacts(POOL, TrueWays.of([way]))[0].floor_m == pytest.approx(0.45)
    under_water = swim(config, (0.9, 1.0, 0.44), (2.5, 1.0, 0.44))
    assert any("of the floor" in text for text in found((under_water,), config))


def test_a_current_that_is_not_aimed_off_is_found():
    config = pool_config(0.01, 0.0)
    legs = (*down_and_up(config, 1.0, 0.5, 0.4), *down_and_up(config, 1.0, 0.5, 0.4))
    messages = found(legs, config)
    drifted_m = 0.01 * 2 * 0.4 / config.primitives.dive_speed_m_s
    assert messages == [
        f"Leg 3 (dive) begins {drifted_m:.2f} m from where leg 2 leads in the current."
    ]
    later = down_and_up(config, 1.0 + drifted_m, 0.5, 0.4)
    assert found((*legs[:2], *later), config) == []


def test_a_spiral_that_begins_a_later_dive_in_a_current_is_refused():
    config = pool_config(0.004, 0.0)
    first = down_and_up(config, 1.0, 0.4, 0.4)
    x = 1.0 + 0.004 * 2 * 0.4 / config.primitives.dive_speed_m_s
    bend = spiral(config, (x, 0.4, 0.0), 0.3, 0.2, 2.0, 0.4)
    back = dive(config, bend.end_ned, 0.0)
    messages = found((*first, bend, back), config)
    assert any("cannot begin a dive in a current" in text for text in messages)


def test_a_swim_faster_than_the_current_allows_is_refused():
    config = pool_config(-0.05, 0.0)
    leg = swim(config, (0.5, 0.5, 0.0), (1.0, 0.5, 0.0))
    assert leg.speed_m_s == pytest.approx(config.primitives.swim_speed_m_s - 0.05)
    assert found((leg,), config) == []
    hasty = replace(leg, speed_m_s=0.1, duration_s=5.0)
    assert any("needs 0.15 m/s through the water" in text for text in found((hasty,), config))
    with pytest.raises(ValueError, match="too strong"):
        swim(pool_config(-0.09, 0.0), (0.5, 0.5, 0.0), (1.0, 0.5, 0.0))


def test_budgets_of_time_and_satellite_are_named():
    legs = down_and_up(POOLED, 1.0, 0.5, 0.4)
    config = POOLED.model_copy(update={"time_budget_s": 30.0, "satellite_bytes": 50})
    assert found(legs, config) == [
        "The plan takes 33 s; a round may take 30 s.",
        "The plan's surfacings send 100 bytes by satellite; a round may send 50.",
    ]


def test_a_robot_where_plans_may_begin_needs_no_way():
    assert way_in(POOLED, (1.0, 0.5), POOL).legs == ()
    assert way_in(POOLED, (math.nan, 0.5), POOL).refusal == "The robot's position is unknown."


def test_a_robot_within_a_margin_leaves_it_without_getting_nearer():
    start = (1.29, 0.65)
    found_way = way_in(POOLED, start, POOL)
    assert found_way.legs
    end = np.array([found_way.end_xy])
    assert usable_depth_m(POOLED, POOL, end[:, 0], end[:, 1])[0] > 0.1
    assert found(found_way.legs) == []
    plan = (*found_way.legs, *down_and_up(POOLED, *found_way.end_xy, 0.15))
    assert found(plan) == []


def test_a_robot_inside_a_keep_out_is_refused_by_name():
    assert 'inside the keep-out "Buoy"' in way_in(POOLED, (1.45, 0.65), POOL).refusal


def test_the_way_in_leads_around_a_keep_out():
    boom = Area(name="Boom", corners_m=((150.0, 32.0), (350.0, 32.0), (350.0, 46.0), (150.0, 46.0)))
    config = LAKE_CONFIG.model_copy(update={"keep_outs": (boom,), "margin_m": 3.0})
    start = (250.0, 25.0)
    found_way = way_in(config, start, LAKE)
    assert found_way.refusal == ""
    assert len(found_way.legs) >= 2
    assert found_way.legs[0].start_ned == (*start, 0.0)
    for before, after in itertools.pairwise(found_way.legs):
        assert before.end_ned == after.start_ned
    for leg in found_way.legs:
        assert leg.kind is PrimitiveKind.SWIM
        assert clearance_m(boom, np.array([leg.start_ned, leg.end_ned])) >= 3.0 - 1e-9
    length_m = sum(math.dist(leg.start_ned, leg.end_ned) for leg in found_way.legs)
    assert length_m < 180.0
    assert approach_energy(config, found_way.legs) > sum(leg.energy for leg in found_way.legs)
    left = after_approach(
        config.model_copy(update={"time_budget_s": 5000.0, "satellite_bytes": 500}),
        found_way.legs,
    )
    assert 0.0 < left.time_budget_s < 5000.0 - length_m / 0.12
    assert left.satellite_bytes == 500


def test_a_budget_that_the_way_back_uses_up_is_named_as_it_was_asked_for():
    way = swim(POOLED, (-1.0, 0.5, 0.0), (0.2, 0.5, 0.0))
    takes_s = way.duration_s + POOLED.mission.turn_time_s
    hasty = POOLED.model_copy(update={"time_budget_s": 5.0})
    text = shortfall(hasty, [way], 20.0)
    assert text.startswith("a time budget of 5 s is too little: the swim back into the domain ")
    assert f"takes {takes_s:.3g} s, and the fastest way" in text
    poor = shortfall(POOLED, [way], 0.5)
    assert poor.startswith("a budget of 0.5 energy units is too little: the swim back")
    assert f"takes {approach_energy(POOLED, [way]):.3g}, and the cheapest way" in poor
    assert shortfall(hasty, [], 0.5) == ""
    assert shortfall(POOLED.model_copy(update={"time_budget_s": 500.0}), [way], 20.0) == ""


def test_a_swim_along_the_surface_ends_with_no_surfacing():
    dives = down_and_up(POOLED, 1.0, 0.5, 0.4)
    way = swim(POOLED, (0.4, 0.5, 0.0), (1.0, 0.5, 0.0))
    legs = (way, *dives, *dives)
    assert (surfacings(legs), departures(legs)) == (2, 3)
    spent = spending(POOLED, legs)
    assert spent.satellite_bytes == 2 * POOLED.mission.surfacing_bytes
    assert spent.energy == pytest.approx(
        sum(leg.energy for leg in legs) + 3 * POOLED.surfacing_energy
    )


def test_a_robot_that_is_fenced_in_is_refused_with_the_names():
    walls = tuple(
        Area(name=name, corners_m=corners)
        for name, corners in (
            ("South", ((90.0, -20.0), (100.0, -20.0), (100.0, 60.0), (90.0, 60.0))),
            ("North", ((300.0, -20.0), (310.0, -20.0), (310.0, 60.0), (300.0, 60.0))),
            ("East", ((90.0, 50.0), (310.0, 50.0), (310.0, 60.0), (90.0, 60.0))),
        )
    )
    config = LAKE_CONFIG.model_copy(update={"keep_outs": walls, "margin_m": 1.0})
    refusal = way_in(config, (200.0, 25.0), LAKE).refusal
    assert '"South", "North", "East"' in refusal


def test_no_place_deep_enough_is_said():
    config = POOLED.model_copy(update={"floor_margin_m": 5.0})
    assert "Nowhere in the domain" in way_in(config, (1.0, 0.5), POOL).refusal


def test_a_current_too_strong_for_the_way_in_is_said():
    config = TOLD["miniglider"].model_copy(update={"current": PlannedCurrentConfig(north_m_s=-0.2)})
    assert "The current is too strong" in way_in(config, (-0.3, 0.7), TANK).refusal


def test_points_of_a_plan_in_a_current_are_where_the_robot_really_is():
    config = pool_config(0.01, 0.0)
    legs = down_and_up(config, 1.0, 0.5, 0.4)
    points = planned_points(config, legs)
    np.testing.assert_allclose(points[:, 1], 1.0 + 0.01 * points[:, 0], atol=1e-12)
    assert NET.distance_m(points[:, 1], points[:, 2]).min() > config.margin_m


def test_what_is_wrong_with_a_leg_does_not_depend_on_the_legs_beside_it():
    generator = np.random.default_rng()
    legs = []
    for _ in range(60):
        here = (*generator.uniform((-0.5, -0.5), (3.5, 2.0)).tolist(), 0.0)
        there = (*(np.array(here[:2]) + generator.normal(0.0, 0.4, 2)).tolist(), 0.5)
        heading, turn_rad = generator.uniform(-3.0, 3.0, 2).tolist()
        legs += [
            spiral(POOLED, here, heading, 0.2, turn_rad, 0.6),
            glide(POOLED, here, there),
            dive(POOLED, there, 0.0),
        ]
    together = [one.message for one in out_of_bounds(tuple(legs), POOLED, POOL)]
    alone = [
        one.message.replace("Leg 1 ", f"Leg {number} ")
        for number, leg in enumerate(legs, start=1)
        for one in out_of_bounds((leg,), POOLED, POOL)
    ]
    assert together == alone
    assert len(together) > 60
