import math
from dataclasses import replace

import numpy as np
import pytest

from autonomy.planner.approach import preceded, way_in
from autonomy.planner.check.check import outdated, violations
from autonomy.planner.leg.edge import legs_energy, planned_points
from autonomy.planner.leg.primitive import dive, glide, spiral, swim
from autonomy.planner.plan import Candidate, Leg, PlanResult, PlanStatus, PrimitiveKind
from autonomy.site import TANK, Area
from tests.autonomy.planner_problem import TOLD

CONFIG = TOLD["miniglider"]
SURFACE = (1.0, 0.7, 0.0)
BELOW = (1.0, 0.7, 0.4)


def there_and_back() -> tuple[Leg, ...]:
    return (dive(CONFIG, SURFACE, 0.4), dive(CONFIG, BELOW, 0.0))


def found(legs, config=CONFIG):
    return {violation.field: violation.message for violation in violations(legs, config, TANK)}


def test_a_plan_within_every_limit_has_no_violation():
    assert found(there_and_back()) == {}


def test_a_dive_through_the_floor_names_the_floor():
    legs = (dive(CONFIG, SURFACE, 2.0), dive(CONFIG, (1.0, 0.7, 2.0), 0.0))
    messages = [violation.message for violation in violations(legs, CONFIG, TANK)]
    assert len(messages) == 2
    assert all("0.80 m beyond the tank floor 1.2 m" in message for message in messages)


def test_every_side_that_a_leg_leaves_is_named():
    slope = 0.4 / math.tan(math.radians(45.0)) / math.sqrt(2.0)
    corner = (3.6, -0.8, 0.0)
    leg = glide(CONFIG, corner, (corner[0] + slope, corner[1] - slope, 0.4))
    messages = [violation.message for violation in violations((leg,), CONFIG, TANK)]
    assert any("0.21 m beyond the north edge of the tank" in message for message in messages)
    assert any("0.22 m beyond the west edge of the tank" in message for message in messages)
    assert not any("survey domain" in message for message in messages)


def test_a_plan_outside_the_domain_but_in_the_water_is_refused_for_the_domain():
    legs = (dive(CONFIG, SURFACE, 1.0), dive(CONFIG, (1.0, 0.7, 1.0), 0.0))
    messages = [violation.message for violation in violations(legs, CONFIG, TANK)]
    assert len(messages) == 2
    assert all("0.35 m beyond the survey domain floor 0.65 m" in message for message in messages)


def test_the_budget_is_named_with_both_numbers():
    config = CONFIG.model_copy(update={"round_budget": 1.0})
    assert found(there_and_back(), config) == {
        "round_budget": "The plan takes 2.433 energy units; a round may use 1."
    }


def test_energy_that_a_leg_understates_is_found():
    down, up = there_and_back()
    assert list(found((replace(down, energy=0.1), up))) == ["legs.0.energy"]


def test_too_much_uncertainty_is_named():
    config = CONFIG.model_copy(update={"max_uncertainty_m": 0.01})
    assert "the limit is 0.01 m" in found(there_and_back(), config)["max_uncertainty_m"]


def test_legs_that_do_not_meet_and_a_wet_end_are_both_listed():
    legs = (dive(CONFIG, SURFACE, 0.4), dive(CONFIG, (2.0, 0.7, 0.4), 0.1))
    assert found(legs) == {
        "legs.1.start_ned": "Leg 2 (dive) begins 1.00 m from where leg 1 ends.",
        "legs.1.end_ned": "The plan ends 0.10 m under water, not at the surface.",
    }


def test_a_plan_that_begins_under_water_is_refused():
    assert list(found((dive(CONFIG, BELOW, 0.0),))) == ["legs.0.start_ned"]


@pytest.mark.parametrize("field", ["speed_m_s", "duration_s", "energy", "turn_rad"])
@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_number_that_is_not_finite_is_named(field, bad):
    down, up = there_and_back()
    assert found((down, replace(up, **{field: bad}))) == {
        f"legs.1.{field}": f"Leg 2 (dive) has a {field} that is not a finite number."
    }


def test_a_plan_without_legs_is_refused():
    assert found(()) == {"legs": "The plan has no legs."}


def test_a_glide_that_is_too_flat_names_the_angles():
    legs = (glide(CONFIG, SURFACE, (2.0, 0.7, 0.4)), glide(CONFIG, (2.0, 0.7, 0.4), SURFACE))
    assert (
        "glide angle of 21.8 deg; the robot glides at 42 to 55 deg" in found(legs)["legs.0.end_ned"]
    )


def test_a_leg_that_is_not_what_its_kind_says_is_refused():
    down, up = there_and_back()
    sideways = replace(down, end_ned=(1.3, 0.7, 0.4))
    assert "0.30 m sideways" in found((sideways, up))["legs.0.end_ned"]
    sinking = replace(swim(CONFIG, SURFACE, (1.4, 0.7, 0.0)), end_ned=(1.4, 0.7, 0.2))
    assert "changes depth by 0.20 m" in found((sinking,))["legs.0.end_ned"]
    bend = spiral(CONFIG, SURFACE, 0.0, 0.3, 1.0, 0.4)
    assert (
        "turns to a point 0.50 m from its end"
        in found((replace(bend, end_ned=(bend.end_ned[0] + 0.5, *bend.end_ned[1:])),))[
            "legs.0.end_ned"
        ]
    )


def test_a_duration_that_the_speed_does_not_allow_is_refused():
    down, up = there_and_back()
    assert "takes 33.3 s" in found((replace(down, duration_s=5.0), up))["legs.0.duration_s"]


def test_a_leg_without_speed_is_refused():
    down, up = there_and_back()
    assert list(found((replace(down, speed_m_s=0.0), up))) == ["legs.0.speed_m_s"]


def test_a_robot_inside_its_domain_needs_no_approach():
    assert way_in(CONFIG, (1.0, 0.7), TANK).legs == ()


def test_a_robot_that_drifted_out_swims_back_first():
    (leg,) = way_in(CONFIG, (-0.3, 0.7), TANK).legs
    assert leg.kind is PrimitiveKind.SWIM
    assert CONFIG.domain.contains(*leg.end_ned)
    assert found((leg,)) == {}


def test_a_swim_that_leaves_the_domain_is_no_approach():
    leg = swim(CONFIG, SURFACE, (1.0, 1.6, 0.0))
    assert "survey domain" in found((leg,))["legs.0.end_ned"]


def test_what_follows_an_approach_is_later_and_costs_more():
    (first,) = way_in(CONFIG, (-0.3, 0.7), TANK).legs
    legs = (dive(CONFIG, first.end_ned, 0.4), dive(CONFIG, (*first.end_ned[:2], 0.4), 0.0))
    points = planned_points(CONFIG, legs)
    duration_s = sum(leg.duration_s for leg in legs)
    best = Candidate(legs, points, 1.0, 2.0, duration_s, float(points[:, 4].max()))
    result = PlanResult(PlanStatus.FOUND, "Found.", best, (best,), (), 1, reservoir_full=False)
    longer = preceded(result, (first,), CONFIG, 20.0)
    surfacing_s = CONFIG.mission.turn_time_s
    surfacing = CONFIG.energy.time_factor * surfacing_s
    assert longer.best.energy == pytest.approx(2.0 + first.energy + surfacing)
    assert longer.best.duration_s == pytest.approx(duration_s + first.duration_s + 2 * surfacing_s)
    assert f"spends {longer.best.energy:.1f} of 20 energy units" in longer.message
    assert longer.best.points[-1, 0] == pytest.approx(duration_s + first.duration_s)
    assert np.all(np.diff(longer.best.points[:, 0]) > 0)
    assert longer.message.startswith("It begins with a swim")
    assert longer.runners_up[0].legs[0] is first


def test_the_surfacing_before_each_dive_takes_its_time_and_the_energy_of_that_time():
    legs = there_and_back() + there_and_back()
    price = CONFIG.energy.time_factor * CONFIG.mission.turn_time_s
    assert legs_energy(CONFIG, legs) == pytest.approx(sum(leg.energy for leg in legs) + 2 * price)
    least = CONFIG.model_copy(update={"round_budget": legs_energy(CONFIG, legs)})
    assert found(legs, least) == {}
    short = CONFIG.model_copy(update={"round_budget": legs_energy(CONFIG, legs) - 0.5 * price})
    assert list(found(legs, short)) == ["round_budget"]


def test_a_plan_is_outdated_far_from_its_start_or_long_after_it_was_made():
    legs = there_and_back()
    near = {"mission": CONFIG.mission.model_copy(update={"draft_distance_m": 1.0})}
    config = CONFIG.model_copy(update=near)
    assert outdated(legs, config, (1.6, 0.7), 3000.0, TANK) == ()
    (away,) = outdated(legs, config, (2.5, 0.7), 3000.0, TANK)
    assert away.message == "The robot is 1.5 m from where the plan begins; the limit is 1 m."
    (old,) = outdated(legs, config, (1.0, 0.7), 4000.0, TANK)
    assert old.message == "The plan was made 67 min ago; the limit is 60 min."
    assert len(outdated(legs, config, (2.5, 0.7), 4000.0, TANK)) == 2


def test_an_idle_robots_drift_in_the_tank_does_not_outdate_a_plan():
    """The robot swims back to where the plan begins."""
    legs = there_and_back()
    assert outdated(legs, CONFIG, (3.0, 0.7), 600.0, TANK) == ()


def test_a_keep_out_between_the_robot_and_the_plan_outdates_it():
    legs = there_and_back()
    ladder = Area(name="Ladder", corners_m=((2.2, 0.4), (2.5, 0.4), (2.5, 1.0), (2.2, 1.0)))
    config = CONFIG.model_copy(update={"keep_outs": (ladder,)})
    (found_,) = outdated(legs, config, (2.9, 0.7), 600.0, TANK)
    assert found_.message.endswith("and the way there is not free.")
    assert outdated(legs, config, (1.5, 0.7), 600.0, TANK) == ()
