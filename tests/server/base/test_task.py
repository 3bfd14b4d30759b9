import itertools
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from autonomy.field.config import FIELD_PRESETS
from autonomy.field.samples import FieldSamples
from autonomy.field.synthetic import measure
from autonomy.planner.belief import planning_kernel
from autonomy.planner.check.check import violations
from autonomy.planner.objective import objective
from autonomy.planner.plan import PlanStatus, PrimitiveKind
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.site import LAKE, TANK, Area
from server.base.problem import Problem
from server.map.task_model import PLANNING, SCORING, domain_points
from server.plan.primitive_legs import LegRequest, candidate_of, legs_from
from server.plan.search import task as plan_survey
from server.plan.task import MapProblem, SurveyProblem

MINI = PLANNER_PRESETS["miniglider"]
FIELD = FIELD_PRESETS["blue_light"]
QUICK = MINI.model_copy(
    update={
        "planning_time_s": 600.0,
        "search": MINI.search.model_copy(update={"iterations_max": 60}),
    }
)


def samples(count, std_m=0.02):
    rng = np.random.default_rng(3)
    domain = TANK.domain
    points = rng.random((count, 3)) * [domain.x_max_m, domain.y_max_m, domain.depth_max_m]
    return FieldSamples.of(points, measure("blue_light", points, rng), np.full(count, std_m))


def never():
    return False


def test_round_is_planned_from_samples_within_its_budget():
    problem = SurveyProblem(QUICK, FIELD, samples(40), (1.2, 0.6), 10.0, 1)
    progress = []
    result = plan_survey.run(problem, progress.append, never)
    assert result.status is PlanStatus.FOUND
    assert result.best.energy <= 10.0
    assert result.best.legs[-1].end_ned[2] == pytest.approx(0.0, abs=1e-6)


def test_another_round_searches_with_other_random_numbers():
    legs = [
        plan_survey.run(
            SurveyProblem(QUICK, FIELD, samples(10), (1.2, 0.6), 8.0, number), print, never
        ).best.legs
        for number in (1, 1, 2)
    ]
    assert legs[0] == legs[1] != legs[2]


def test_search_begins_with_the_trajectories_of_an_earlier_one():
    earlier = plan_survey.run(
        SurveyProblem(QUICK, FIELD, samples(10), (1.2, 0.6), 12.0, 1, TANK, attempt=1), print, never
    )
    short = QUICK.search.model_copy(update={"iterations_max": 1})
    config = QUICK.model_copy(update={"search": short})
    warm = (earlier.best.legs, *(one.legs for one in earlier.runners_up))
    cold, later = (
        plan_survey.run(
            SurveyProblem(config, FIELD, samples(10), (1.2, 0.6), 12.0, 1, TANK, begun, attempt=1),
            print,
            never,
        )
        for begun in ((), warm)
    )
    assert later.best.objective >= earlier.best.objective - 1e-6
    assert cold.best is None or cold.best.objective < later.best.objective


def test_samples_that_others_will_take_make_theirs_worth_less():
    alone = SurveyProblem(QUICK, FIELD, samples(10), (1.2, 0.6), 8.0, 1, TANK)
    first = plan_survey.run(alone, print, never).best
    belief = plan_survey.belief_of(alone)
    taken = replace(alone, planned_points=first.points[:, 1:4], planned_std_m=first.points[:, 4])
    worth = objective(QUICK, belief)(first.points)
    assert objective(QUICK, plan_survey.belief_of(taken))(first.points) < 0.5 * worth


def test_plan_of_the_lake_stays_off_the_shore():
    config = PLANNER_PRESETS["grace3"].model_copy(
        update={
            "planning_time_s": 600.0,
            "search": QUICK.search.model_copy(
                update={"step_m": 40.0, "near_radius_m": 40.0, "nearest_radius_m": 32.0}
            ),
        }
    )
    field = FIELD_PRESETS["chlorophyll"]
    nothing = FieldSamples.none()
    problem = SurveyProblem(config, field, nothing, (250.0, 250.0), 20.0, 1, LAKE)
    best = plan_survey.run(problem, print, never).best
    assert violations(best.legs, config, LAKE) == ()


def test_robot_inside_a_keep_out_is_not_planned_for():
    corners = ((1.0, 0.4), (1.5, 0.4), (1.5, 0.8), (1.0, 0.8))
    config = QUICK.model_copy(update={"keep_outs": (Area(name="net", corners_m=corners),)})
    result = plan_survey.run(
        SurveyProblem(config, FIELD, samples(10), (1.2, 0.6), 8.0, 1, TANK), print, never
    )
    assert result.status is PlanStatus.NOTHING_FEASIBLE
    assert "net" in result.message


@pytest.mark.parametrize("model", ["recursive", "joint"])
def test_model_with_levels_is_planned_for_by_levels_with_its_own_kernel(model):
    field = FIELD.model_copy(update={"model": model})
    belief = plan_survey.belief_of(SurveyProblem(MINI, field, samples(20), (1.0, 0.5), 8.0, 1))
    assert belief.counts == "levels"
    assert belief.kernel() == planning_kernel(field) != FIELD.single


def test_belief_says_less_where_nothing_was_measured():
    near = samples(60)
    near.points[:, 0] *= 0.2
    belief = plan_survey.belief_of(SurveyProblem(MINI, FIELD, near, (1.0, 0.5), 8.0, 1))
    assert belief.counts == "noise"
    assert belief.kernel() == FIELD.single
    known = belief.test_points[:, 0] < 0.5
    assert belief.std[known].mean() < belief.std[~known].mean()
    assert len(belief.sample_points) == 60


def test_map_gets_surer_with_every_sample():
    stds = [
        plan_survey.mean_std(MapProblem(MINI, FIELD, samples(count), TANK), print, never)
        for count in (0, 5, 200)
    ]
    assert stds[0] == pytest.approx(FIELD.single.signal_variance**0.5, rel=0.5)
    assert stds[0] > stds[1] > 2.0 * stds[2] > 0.0


def test_only_points_in_the_water_stand_for_a_domain():
    points = plan_survey.water_points(LAKE.domain, LAKE, SCORING)
    everywhere = domain_points(LAKE.domain, SCORING)
    assert 0 < len(points) < len(everywhere)
    assert np.all(points[:, 2] <= LAKE.floor_m(points[:, 0], points[:, 1]))
    assert len(plan_survey.water_points(TANK.domain, TANK, SCORING)) == 420


def test_points_that_stand_for_a_domain_follow_its_shape():
    assert domain_points(TANK.domain, PLANNING).shape == (240, 3)
    assert domain_points(TANK.domain, SCORING).shape == (420, 3)
    lake = domain_points(LAKE.domain, SCORING)
    assert len(np.unique(lake[:, 0])) == len(np.unique(lake[:, 1]))


def test_station_never_loads_the_compiler():
    code = "import server.app, sys; print('numba' in sys.modules)"
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=240
    )
    assert found.stdout.strip() == "False"


def test_legs_laid_end_to_end_cost_what_the_planner_says():
    legs = legs_from(
        MINI,
        (1.0, 0.5),
        [
            LegRequest(PrimitiveKind.SWIM, (1.5, 0.5, 9.0)),
            LegRequest(PrimitiveKind.GLIDE, (1.9, 0.5, 0.4)),
            LegRequest(PrimitiveKind.SPIRAL, (0.0, 0.0, 0.0), radius_m=0.4, turn_rad=1.0),
            LegRequest(PrimitiveKind.DIVE, (0.0, 0.0, 0.3), speed_m_s=0.01),
            LegRequest(PrimitiveKind.DIVE, (0.0, 0.0, 0.0)),
        ],
    )
    assert [leg.kind.value for leg in legs] == ["swim", "glide", "spiral", "dive", "dive"]
    for before, after in itertools.pairwise(legs):
        assert after.start_ned == before.end_ned
    assert legs[0].end_ned == (1.5, 0.5, 0.0)
    assert legs[3].duration_s == pytest.approx(30.0)
    candidate = candidate_of(MINI, legs)
    turning_s = 3 * MINI.mission.turn_time_s  # before the swim, the glide and the last dive
    assert candidate.energy == pytest.approx(
        sum(leg.energy for leg in legs) + MINI.energy.time_factor * turning_s
    )
    assert candidate.duration_s == pytest.approx(sum(leg.duration_s for leg in legs) + turning_s)
    assert np.all(np.diff(candidate.points[:, 0]) > 0)


def test_leg_that_does_not_move_the_robot_is_named():
    requests = [
        LegRequest(PrimitiveKind.DIVE, (0.0, 0.0, 0.5)),
        LegRequest(PrimitiveKind.DIVE, (0.0, 0.0, 0.5)),
    ]
    with pytest.raises(Problem) as refused:
        legs_from(MINI, (1.0, 0.5), requests)
    assert refused.value.status == 422
    assert refused.value.errors[0].loc == ["legs", 1, "end_ned"]
