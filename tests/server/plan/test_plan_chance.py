"""Plans that are too likely to leave the water: searched again with more margin, or held back."""

import pytest

from autonomy.planner.plan import PlanResult, PlanStatus
from robot_link.dry_run import LegOut, Safety
from server.plan.chance import MOST_SEARCHES
from server.plan.dry_run import DryRuns
from tests.server.conftest import FAST
from tests.server.plan.test_plan_dry_run import _BEFORE, laid_out
from tests.server.survey.test_plan_choice import plan_in

LIMIT = {"greatest_chance": 0.1}


@pytest.fixture(autouse=True)
def _rehearsed(monkeypatch, _unrehearsed):
    monkeypatch.setattr(DryRuns, "before", _BEFORE)


def out(flights, short_m=0.3):
    return Safety(200, flights, (LegOut(1, "the water", flights, 0.4),), short_m)


async def survey(client):
    body = {"kind": "adaptive_survey", "config": {**FAST, "adaptive": LIMIT}}
    plan = (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"]
    return await plan_in(client, plan, "draft")


async def held_back(client, plan):
    refused = await client.post(f"/api/plans/{plan}/upload")
    assert refused.status_code == 409
    (one,) = (await client.post(f"/api/plans/{plan}/check")).json()["violations"]
    assert one["field"] == "adaptive.greatest_chance"
    return one["message"]


async def test_a_survey_is_planned_again_with_more_margin(client, workers):
    workers.safety = [out(60, 0.3), out(25, 0.1)]
    draft = await survey(client)
    margins_m = [problem.planner.margin_m for problem in workers.problems]
    assert margins_m == pytest.approx([0.0, 0.33, 0.44])
    domains = [problem.planner.domain.x_min_m for problem in workers.problems]
    assert domains == sorted(domains)
    assert [problem.greatest_chance for problem in workers.dry_runs] == [0.1] * 3
    assert draft["config"]["margin_m"] == 0.0
    assert draft["rehearsal"]["safety"]["out"] == 0
    assert "0.44 m more margin" in draft["message"]
    assert (await client.post(f"/api/plans/{draft['id']}/check")).json()["violations"] == []


async def test_the_safest_of_all_is_the_draft_where_none_is_safe(client, workers):
    workers.safety = [out(60), out(30), out(50), out(55)]
    draft = await survey(client)
    assert len(workers.problems) == len(workers.dry_runs) == MOST_SEARCHES
    assert draft["rehearsal"]["safety"]["out"] == 30
    message = await held_back(client, draft["id"])
    assert "15 % (30 of 200 flights); at most 10 % are allowed" in message
    assert "Leg 2 breaks it: 30 flights leave the water there, by 0.4 m." in message
    assert "It lacks 0.3 m of margin." in message


async def test_a_margin_that_leaves_no_way_leaves_the_first_plan(client, workers):
    workers.safety, plan = [out(60)], workers.plan

    def only_without_margin(problem):
        if problem.planner.margin_m > 0.0:
            return PlanResult(PlanStatus.NOTHING_FEASIBLE, "No way.", None, (), (), 0, False)
        return plan(problem)

    workers.plan = only_without_margin
    draft = await survey(client)
    assert len(workers.problems) == 2
    assert "60 of 200" in await held_back(client, draft["id"])


async def test_legs_that_people_laid_out_are_held_and_not_changed(client, workers):
    workers.safety = [out(60)]
    draft = await plan_in(client, await laid_out(client, adaptive=LIMIT), "draft")
    assert len(workers.dry_runs) == 1
    assert "Leg 2 breaks it" in await held_back(client, draft["id"])


async def test_a_plan_that_was_not_rehearsed_is_held_where_there_is_a_limit(client):
    blind = {"greatest_chance": 0.1, "rehearse": False}
    draft = await plan_in(client, await laid_out(client, adaptive=blind), "draft")
    assert "is not known" in await held_back(client, draft["id"])


async def test_without_a_limit_nothing_is_searched_twice(client, workers):
    workers.safety = [out(190)]
    body = {"kind": "adaptive_survey", "config": FAST}
    plan = (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"]
    draft = await plan_in(client, plan, "draft")
    assert len(workers.problems) == 1
    assert (await client.post(f"/api/plans/{draft['id']}/check")).json()["violations"] == []
