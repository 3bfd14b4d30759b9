from dataclasses import replace

import numpy as np
import pytest

from autonomy.planner.approach import approach, preceded
from autonomy.planner.check import violations
from autonomy.planner.config import PLANNER_PRESETS
from autonomy.planner.edge import planned_points
from autonomy.planner.plan import Candidate, Leg, PlanResult, PlanStatus, PrimitiveKind
from autonomy.planner.primitive import dive, glide, swim
from autonomy.site import TANK

CONFIG = PLANNER_PRESETS["miniglider"]
SURFACE = (1.0, 0.7, 0.0)
BELOW = (1.0, 0.7, 0.4)


def there_and_back() -> tuple[Leg, ...]:
    return (dive(CONFIG, SURFACE, 0.4), dive(CONFIG, BELOW, 0.0))


def messages(legs, config=CONFIG):
    return [violation.message for violation in violations(legs, config, TANK)]


def test_a_plan_within_every_limit_has_no_violation():
    assert messages(there_and_back()) == []


def test_a_dive_through_the_floor_names_the_floor():
    deep = (1.0, 0.7, 2.0)
    legs = (replace(dive(CONFIG, SURFACE, 0.4), end_ned=deep), dive(CONFIG, deep, 0.0))
    assert all("tank floor 1.2 m" in message for message in messages(legs))
    assert len(messages(legs)) == 2


def test_every_side_that_a_leg_leaves_is_named():
    outside = glide(CONFIG, SURFACE, (9.0, -9.0, 0.4))
    assert len(violations((outside,), CONFIG, TANK)) == 2


def test_a_plan_outside_the_domain_but_in_the_water_is_refused_for_the_domain():
    deep = (1.0, 0.7, 1.0)
    legs = (replace(dive(CONFIG, SURFACE, 0.4), end_ned=deep), dive(CONFIG, deep, 0.0))
    assert all("survey domain floor" in message for message in messages(legs))


def test_the_budget_is_named_with_both_numbers():
    config = CONFIG.model_copy(update={"round_budget": 1.0})
    (violation,) = violations(there_and_back(), config, TANK)
    assert violation.field == "round_budget"
    assert "a round may use 1" in violation.message


def test_too_much_uncertainty_is_named():
    config = CONFIG.model_copy(update={"max_uncertainty_m": 0.01})
    assert [found.field for found in violations(there_and_back(), config, TANK)] == [
        "max_uncertainty_m"
    ]


def test_legs_that_do_not_meet_and_a_wet_end_are_both_listed():
    legs = (dive(CONFIG, SURFACE, 0.4), dive(CONFIG, (2.0, 0.7, 0.1), 0.3))
    assert len(violations(legs, CONFIG, TANK)) == 2


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_number_that_is_not_finite_is_refused(bad):
    legs = (replace(there_and_back()[0], duration_s=bad),)
    assert "not finite" in messages(legs)[0]


def test_a_plan_without_legs_is_refused():
    assert messages(()) == ["The plan has no legs."]


def test_a_robot_inside_its_domain_needs_no_approach():
    assert approach(CONFIG, (1.0, 0.7)) is None


def test_a_robot_that_drifted_out_swims_back_first():
    leg = approach(CONFIG, (-0.3, 0.7))
    assert leg.kind is PrimitiveKind.SWIM
    assert CONFIG.domain.contains(*leg.end_ned)
    assert violations((leg,), CONFIG, TANK) == ()


def test_a_swim_that_leaves_the_domain_is_no_approach():
    leg = swim(CONFIG, SURFACE, (1.0, 1.6, 0.0))
    assert "survey domain" in messages((leg,))[0]


def test_what_follows_an_approach_is_later_and_costs_more():
    first = approach(CONFIG, (-0.3, 0.7))
    legs = (dive(CONFIG, first.end_ned, 0.4), dive(CONFIG, (*first.end_ned[:2], 0.4), 0.0))
    points = planned_points(CONFIG, legs)
    duration_s = sum(leg.duration_s for leg in legs)
    best = Candidate(legs, points, 1.0, 2.0, duration_s, float(points[:, 4].max()))
    result = PlanResult(PlanStatus.FOUND, "Found.", best, (best,), (), 1, reservoir_full=False)
    longer = preceded(result, first, CONFIG)
    assert longer.best.energy == pytest.approx(2.0 + first.energy)
    assert longer.best.points[-1, 0] == pytest.approx(duration_s + first.duration_s)
    assert np.all(np.diff(longer.best.points[:, 0]) > 0)
    assert longer.message.startswith("It begins with a swim")
    assert longer.runners_up[0].legs[0] is first
