"""When the next round is due to be planned, and what of a plan is still to be flown."""

from datetime import UTC, datetime, timedelta

import pytest

from autonomy.planner.preset import MINIGLIDER
from db.query.mission.plans import PlanRecord
from robot_link.messages import OnboardPlanState, PlanReport
from server.plan.ahead import due_at, is_due, planned_rest, remaining_s, unflown
from server.plan.document import legs_of, points_of
from server.plan.search.request import SearchRequest
from server.plan.search.survey_round import survey_status
from server.plan.state import PlanEvidence
from tests.server.conftest import FAST, MINI, until

NOW = datetime(2026, 5, 1, tzinfo=UTC)


async def flown_plan(station, workers):
    """Return a plan as its robot flies it."""
    config_id, config = await station.planning.configure(MINI, FAST, by="test")
    plan = await station.planning.plan_survey(SearchRequest(MINI, config, config_id, "test"))

    async def drafted():
        return (await station.plans.get(plan.id)).state == "draft"

    await until(drafted)
    return await station.plans.move(plan.id, PlanEvidence.ROBOT_FLIES_IT, "")


def report_of(plan, leg, measured_at=NOW):
    legs = len(plan.document["legs"])
    state = OnboardPlanState.RUNNING
    return PlanReport(MINI, plan.sha256, state, leg, legs, 1.0, "", measured_at, measured_at)


async def test_rest_of_a_plan_is_what_its_robot_has_not_flown(station, workers):
    plan = await flown_plan(station, workers)
    legs, points = legs_of(plan.document), points_of(plan.document)
    assert unflown(plan, report_of(plan, 2)) == legs[2:]
    rest = planned_rest(plan, report_of(plan, 2))
    flown_s = legs[0].duration_s + legs[1].duration_s
    assert len(rest) == (points[:, 0] > flown_s).sum()
    assert rest[0, 0] > flown_s
    assert unflown(plan, None) == legs


async def test_next_round_is_due_when_the_time_left_is_what_planning_takes(station, workers):
    plan = await flown_plan(station, workers)
    config = MINIGLIDER.model_copy(update={"planning_time_s": 5.0})
    legs = legs_of(plan.document)
    last = len(legs) - 1
    assert is_due(plan, config, report_of(plan, last), NOW, 1.0)
    before = report_of(plan, last - 1)
    left_s = remaining_s(plan, config, before, NOW)
    assert left_s == pytest.approx(legs[-1].duration_s + legs[-2].duration_s)
    assert not is_due(plan, config, before, NOW, 1.0)
    assert is_due(plan, config, before, NOW + timedelta(seconds=left_s - 14.0), 1.0)
    assert is_due(plan, config, before, NOW, left_s / 14.0)
    assert not is_due(plan, config, report_of(plan, 0), NOW, 1.0)


def plan_record(number, state, **document):
    at = dict.fromkeys(("draft_at", "sent_at", "on_board_at", "running_at", "ended_at"))
    if state == "draft" or document.pop("was_draft", False):
        at["draft_at"] = NOW
    key = f"plan-{number}"
    return PlanRecord(
        key, MINI, "adaptive_survey", "mission-1", 1, state, None, {}, document, NOW, "test", **at
    )


def test_search_that_came_too_late_to_replace_a_draft_does_not_decide_a_survey():
    old = plan_record(1, "superseded", was_draft=True)
    new = plan_record(2, "draft", replaces="plan-1")
    late = plan_record(3, "failed", replaces="plan-1")
    assert survey_status([late, new, old]).plan is new
    assert survey_status([late, plan_record(1, "running", was_draft=True)]).plan.state == "running"
    assert survey_status([plan_record(4, "failed"), new, old]).plan.state == "failed"


async def test_next_round_comes_due_by_time_alone_under_water(station, workers):
    plan = await flown_plan(station, workers)
    config = MINIGLIDER.model_copy(update={"planning_time_s": 5.0})
    report = report_of(plan, 0)
    at = due_at(plan, config, report, NOW, 1.0)
    assert at > NOW
    assert not is_due(plan, config, report, at - timedelta(seconds=1.0), 1.0)
    assert is_due(plan, config, report, at, 1.0)
