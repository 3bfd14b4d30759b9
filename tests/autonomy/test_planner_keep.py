"""Stays at the surface as the planner counts them, in currents that are drawn at run time."""

import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.planner.check.check import violations
from autonomy.planner.leg import drift, primitive
from autonomy.planner.leg.edge import (
    POINT_STD,
    departures,
    legs_duration_s,
    legs_energy,
    planned_points,
    surfacings,
)
from autonomy.planner.leg.waterway import waterway_of
from autonomy.planner.plan import PrimitiveKind
from autonomy.planner.preset import GRACE3
from autonomy.planner.search.warm import rebased
from autonomy.site import LAKE

PLACE = (250.0, 250.0, 0.0)
RULES = GRACE3.model_copy(
    update={"domain": LAKE.water, "round_budget": 1e6, "total_budget": 1e6, "time_budget_s": 0.0}
)


@pytest.fixture
def rng():
    return np.random.default_rng()


def in_current(speed_m_s, angle_rad, *, unknown_m_s=0.0, drift_m_sqrt_s=0.0):
    north, east = speed_m_s * math.cos(angle_rad), speed_m_s * math.sin(angle_rad)
    position = GRACE3.position_filter.model_copy(
        update={"steady_current_m_s": unknown_m_s, "drift_m_sqrt_s": drift_m_sqrt_s}
    )
    current = GRACE3.current.model_copy(update={"north_m_s": north, "east_m_s": east})
    return RULES.model_copy(update={"current": current, "position_filter": position})


def test_in_a_steady_current_it_swims_the_share_that_drifting_and_swimming_back_takes(rng):
    for _ in range(50):
        swims = GRACE3.primitives.swim_speed_m_s
        speed, radius = rng.uniform(0.0, 0.74 * swims), rng.uniform(6.0, 50.0)
        config = in_current(speed, rng.uniform(0.0, 6.3), drift_m_sqrt_s=1e-9)
        out_s, back_s = radius / max(speed, 1e-12), radius / (swims - speed)
        share = primitive.keeping_share(config, PLACE, radius, 3600.0, 0.0)
        assert share == pytest.approx(back_s / (out_s + back_s), abs=1e-9)
        leg = primitive.keep(config, PLACE, radius, 3600.0)
        swimming = primitive.energy(PrimitiveKind.SWIM, share * 3600.0, config.energy)
        floating = config.energy.time_factor * (1.0 - share) * 3600.0
        assert leg.energy == pytest.approx(swimming + floating, rel=1e-9)


def test_what_is_not_known_of_the_water_never_makes_a_stay_cheaper(rng):
    for _ in range(50):
        speed, angle = rng.uniform(0.0, 0.08), rng.uniform(0.0, 6.3)
        known = primitive.keep(in_current(speed, angle, drift_m_sqrt_s=1e-9), PLACE, 10.0, 600.0)
        doubtful = in_current(
            speed, angle, unknown_m_s=rng.uniform(0.001, 0.1), drift_m_sqrt_s=rng.uniform(0.01, 0.5)
        )
        assert primitive.keep(doubtful, PLACE, 10.0, 600.0).energy > known.energy
        narrow, wide = (primitive.keep(doubtful, PLACE, r, 600.0).energy for r in (6.0, 60.0))
        assert narrow >= wide


def test_eddies_carry_it_out_as_fast_as_a_walk_does(rng):
    """The mean time in which a walk of d per root second leaves a radius r is r^2 / (2 d^2)."""
    d, radius, dt_s = 0.3, 6.0, 1.0
    steps = rng.normal(0.0, d * math.sqrt(dt_s), (300, 4000, 2))
    away = np.hypot(*np.moveaxis(np.cumsum(steps, axis=1), 2, 0))
    left = away > radius
    assert left.any(axis=1).mean() > 0.99
    out_s = dt_s * np.argmax(left, axis=1).mean()
    swims = GRACE3.primitives.swim_speed_m_s
    config = in_current(0.0, 0.0, drift_m_sqrt_s=d)
    share = primitive.keeping_share(config, PLACE, radius, 3600.0, 0.0)
    assert share == pytest.approx((radius / swims) / (out_s + radius / swims), rel=0.2)


def test_a_stay_is_at_its_place_with_fixes_and_counts_no_surfacing(rng):
    config = in_current(0.05, rng.uniform(0.0, 6.3), drift_m_sqrt_s=0.2)
    leg = primitive.keep(config, PLACE, 12.0, 86_400.0)
    assert drift.knows_place(leg)
    points = planned_points(config, (leg,))
    assert len(points) <= 500
    assert points[-1, 0] == 86_400.0
    assert (points[:, 1:4] == np.array(PLACE)).all()
    assert points[:, POINT_STD].max() <= config.position_filter.fix_std_m * 1.01
    assert (surfacings([leg]), departures([leg])) == (0, 1)
    assert legs_energy(config, [leg]) == pytest.approx(leg.energy + config.surfacing_energy)
    assert legs_duration_s(config, [leg]) == 86_400.0 + config.mission.turn_time_s
    assert violations((leg,), config, LAKE) == ()


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"radius_m": 3.0}, "legs.0.radius_m", "the robot can hold 6 m"),
        ({"end_ned": (250.0, 250.0, 2.0)}, "legs.0.end_ned", "2.00 m under water"),
        ({"start_ned": (200.0, 250.0, 0.0)}, "legs.0.start_ned", "begins 50.00 m from"),
        ({"duration_s": 0.0}, "legs.0.speed_m_s", "a duration above 0"),
        ({"radius_m": 1000.0}, "legs.0.end_ned", "Leg 1 (keep)"),
        ({"energy": 0.1}, "legs.0.energy", "energy units, not 0.10"),
        ({"radius_m": math.nan}, "legs.0.radius_m", "not a finite number"),
    ],
)
def test_what_speaks_against_a_stay_is_named(changes, field, words):
    leg = replace(primitive.keep(RULES, PLACE, 10.0, 600.0), **changes)
    found = violations((leg,), RULES, LAKE)
    assert any(one.field == field and words in one.message for one in found), found


def test_a_current_that_is_too_strong_is_refused_in_words(rng):
    speed = rng.uniform(0.76, 2.0) * GRACE3.primitives.swim_speed_m_s
    config = in_current(speed, rng.uniform(0.0, 6.3))
    with pytest.raises(ValueError, match=r"too strong to keep a place; the robot swims at 0\.12"):
        primitive.keep(config, PLACE, 10.0, 600.0)
    still = primitive.keep(RULES, PLACE, 10.0, 600.0)
    assert any("too strong" in one.message for one in violations((still,), config, LAKE))


def test_the_rim_of_a_stay_keeps_off_the_shore():
    """A place may be far enough from the shore itself, and what the robot drifts to not."""
    shore_m = -float(LAKE.shore.distance_m(PLACE[0], PLACE[1]))
    near = primitive.keep(RULES, PLACE, shore_m - RULES.margin_m + 5.0, 600.0)
    assert any("shoreline" in one.message for one in violations((near,), RULES, LAKE))


def test_a_search_that_begins_with_an_earlier_plan_leaves_a_stay_out():
    keep = primitive.keep(RULES, PLACE, 10.0, 600.0)
    edges = rebased(
        RULES,
        PLACE[:2],
        1e3,
        [keep],
        rng=np.random.default_rng(0),
        waterway=waterway_of(RULES, None),
        site=None,
    )
    assert edges == []
