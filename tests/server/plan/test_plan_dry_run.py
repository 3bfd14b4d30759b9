import asyncio
import math
import os
import signal
from asyncio import all_tasks

import pytest

from autonomy.planner.preset import MINIGLIDER
from autonomy.vehicle.trim import TrimConfig
from robot_link.dry_run import DRY_RUN
from robot_link.mission import Mission, MissionSettings
from server.access.role import Role
from server.base.worker import WorkerEndedError, WorkerSpentError
from server.plan import dry_run
from server.plan.dry_run import DryRuns
from server.plan.ledger import PlanLedger
from server.plan.primitive_legs import LegRequest, legs_from
from server.plan.search.request import SearchRequest
from server.plan.state import PlanEvidence
from server.survey import step as survey_step
from tests.server.conftest import FAST, MINI, api_client, open_station, until
from tests.server.fake_link import current_report, state_report
from tests.server.survey.test_plan_choice import drafted, mission_in, plan_in

LEGS = [{"kind": "dive", "end_ned": [0, 0, depth_m]} for depth_m in (0.3, 0.0)]
_BEFORE = DryRuns.before


@pytest.fixture(autouse=True)
def _rehearsed(monkeypatch, _unrehearsed):
    monkeypatch.setattr(DryRuns, "before", _BEFORE)
    monkeypatch.setattr(survey_step, "QUIET_S", 0.05)


async def laid_out(client, **config):
    body = {"kind": "primitives", "legs": LEGS, "config": config}
    answer = await client.post("/api/robots/mini-1/plans", json=body)
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


async def rehearses(client, plan):
    async def stage():
        return (await client.get(f"/api/plans/{plan}")).json()["stage"] == "rehearsing"

    await until(stage)


async def test_found_plan_is_flown_ahead_before_it_is_a_draft(client, workers):
    workers.may_plan.clear()
    workers.may_fly.clear()
    body = {"kind": "adaptive_survey", "config": FAST}
    plan = (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"]
    searching = (await client.get(f"/api/plans/{plan}")).json()
    assert (searching["state"], searching["stage"]) == ("planning", "searching")
    assert searching["rehearsal"] is None
    workers.may_plan.set()
    await rehearses(client, plan)
    working = (await client.get(f"/api/plans/{plan}")).json()
    assert working["state"] == "planning"
    assert working["legs"]
    assert working["rehearsal"]["state"] == "working"
    workers.may_fly.set()
    draft = await plan_in(client, plan, "draft")
    found = draft["rehearsal"]
    assert draft["stage"] is None
    assert found["state"] == "done"
    assert found["completed"]
    assert (found["position_error_m"], found["predicted_error_m"]) == (0.03, 0.04)
    assert len(found["flown"]) == len(draft["points"])
    problem = workers.dry_runs[0]
    assert problem.mission.sha256() == draft["sha256"]
    assert problem.start_ne_m == (1.2, 0.6)
    assert problem.drift_m_sqrt_s == draft["config"]["position_filter"]["drift_m_sqrt_s"]


async def test_legs_laid_out_by_hand_are_rehearsed_too(client, workers):
    draft = await plan_in(client, await laid_out(client), "draft")
    assert draft["rehearsal"]["state"] == "done"


async def test_plan_that_waits_is_flown_for_a_while_and_a_draft_as_often_as_can_be(client, workers):
    plan = (await plan_in(client, await laid_out(client), "draft"))["id"]
    await rehearsed_again(client, workers, plan)
    workers.may_fly.set()
    await nothing_rehearses(plan)
    waited, again = workers.dry_runs
    assert (waited.runs, again.runs) == (dry_run.RUNS, dry_run.RUNS)
    assert (waited.processor_s, again.processor_s) == (dry_run.WAITED_S, math.inf)


async def test_a_mission_that_is_no_plan_is_flown_ahead(station, workers):
    dry_runs = DryRuns(station.fleet, station.workers)
    legs = legs_from(MINIGLIDER, (1.2, 0.6), [LegRequest("dive", (0.0, 0.0, z)) for z in (0.3, 0)])
    settings = MissionSettings.of(MINIGLIDER, TrimConfig(), (1.2, 0.6, 0.0), 100.0)
    mission = Mission.from_legs(settings, legs)
    workers.may_fly.set()
    found = await dry_runs.fly_mission(MINI, mission, MINIGLIDER)
    assert (found.state, found.completed) == ("done", True)
    (problem,) = workers.dry_runs
    assert problem.mission == mission
    assert problem.planned_points[-1, 3] == 0.0


async def test_rehearsal_is_left_out_where_it_is_switched_off(client, workers):
    draft = await plan_in(client, await laid_out(client, adaptive={"rehearse": False}), "draft")
    assert draft["rehearsal"] is None
    assert workers.dry_runs == []


async def test_rehearsal_whose_process_dies_leaves_a_draft_that_says_so(client, workers):
    workers.fails[DRY_RUN] = WorkerEndedError("The working process ended unexpectedly.")
    draft = await drafted(client)
    assert draft["rehearsal"]["state"] == "failed"
    assert draft["rehearsal"]["message"].startswith("Not rehearsed: The working process ended")
    assert draft["rehearsal"]["rms_error_m"] is None
    assert draft["violations"] == []


async def test_rehearsal_that_takes_too_long_is_left_out(client, workers):
    workers.fails[DRY_RUN] = WorkerSpentError()
    draft = await plan_in(client, await laid_out(client), "draft")
    assert draft["rehearsal"]["state"] == "skipped"
    assert draft["rehearsal"]["message"].startswith("Not rehearsed: that would have taken")


async def test_a_draft_is_rehearsed_again_where_a_person_wants_it(client, workers):
    workers.fails[DRY_RUN] = WorkerSpentError()
    plan = await laid_out(client)
    await plan_in(client, plan, "draft")
    del workers.fails[DRY_RUN]
    workers.may_fly.clear()
    assert (await client.post(f"/api/plans/{plan}/rehearse")).status_code == 202
    await rehearses(client, plan)
    working = (await client.get(f"/api/plans/{plan}")).json()
    assert (working["state"], working["rehearsal"]["state"]) == ("draft", "working")
    assert (await client.post(f"/api/plans/{plan}/rehearse")).status_code == 409
    workers.may_fly.set()

    async def rehearsed():
        found = (await client.get(f"/api/plans/{plan}")).json()
        return found["rehearsal"]["state"] == "done" and found["stage"] is None

    await until(rehearsed)
    assert len(workers.dry_runs) == 2


async def rehearsed_again(client, workers, plan):
    """Begin to rehearse a draft once more; that goes on until ``workers.may_fly`` is set."""
    workers.may_fly.clear()
    begun = len(workers.dry_runs)
    answer = await client.post(f"/api/plans/{plan}/rehearse")
    assert answer.status_code == 202, answer.text
    await until(lambda: len(workers.dry_runs) > begun)
    await rehearses(client, plan)


async def nothing_rehearses(plan):
    await until(lambda: f"planning {plan}" not in {task.get_name() for task in all_tasks()})


async def refused_as_broken_off(client, plan):
    refused = await client.post(f"/api/plans/{plan}/upload")
    assert refused.status_code == 409
    assert [one["loc"] for one in refused.json()["errors"]] == [["adaptive.rehearse"]]
    (one,) = (await client.post(f"/api/plans/{plan}/check")).json()["violations"]
    assert one["field"] == "adaptive.rehearse"
    assert "it was lost." in one["message"]


async def test_draft_that_broke_off_is_kept_back_while_it_is_rehearsed_again(client, workers):
    workers.breaks_off = 1
    plan = (await plan_in(client, await laid_out(client), "draft"))["id"]
    await rehearsed_again(client, workers, plan)
    working = (await client.get(f"/api/plans/{plan}")).json()["rehearsal"]
    assert (working["state"], working["completed"]) == ("working", False)
    await refused_as_broken_off(client, plan)
    workers.may_fly.set()
    await nothing_rehearses(plan)
    found = (await client.get(f"/api/plans/{plan}")).json()
    assert (found["stage"], found["rehearsal"]["state"]) == (None, "done")
    assert found["rehearsal"]["completed"]
    assert (await client.post(f"/api/plans/{plan}/upload")).status_code == 202


async def test_rehearsal_that_fails_leaves_what_the_last_one_found(client, workers):
    workers.breaks_off = 1
    plan = (await plan_in(client, await laid_out(client), "draft"))["id"]
    workers.fails[DRY_RUN] = WorkerEndedError("The working process ended unexpectedly.")
    for _ in range(2):
        await rehearsed_again(client, workers, plan)
        workers.may_fly.set()
        await nothing_rehearses(plan)
        found = (await client.get(f"/api/plans/{plan}")).json()["rehearsal"]
        assert (found["state"], found["completed"]) == ("done", False)
        assert found["message"] == (
            "The robot did not fly the whole plan: it was lost. Last try: Not rehearsed: "
            "The working process ended unexpectedly."
        )
    await refused_as_broken_off(client, plan)


async def test_station_that_stops_during_another_rehearsal_keeps_the_last(tmp_path, world, workers):
    workers.breaks_off = 1
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        plan = (await plan_in(client, await laid_out(client), "draft"))["id"]
        before = (await client.get(f"/api/plans/{plan}")).json()["rehearsal"]
        await rehearsed_again(client, workers, plan)
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        found = (await client.get(f"/api/plans/{plan}")).json()
        assert (found["state"], found["stage"]) == ("draft", None)
        assert found["rehearsal"] == before
        await refused_as_broken_off(client, plan)


async def test_draft_that_is_sent_is_not_rehearsed_any_longer(client, workers):
    plan = (await plan_in(client, await laid_out(client), "draft"))["id"]
    before = (await client.get(f"/api/plans/{plan}")).json()["rehearsal"]
    await rehearsed_again(client, workers, plan)
    assert (await client.post(f"/api/plans/{plan}/upload")).status_code == 202
    sent = await plan_in(client, plan, "on_board")
    await nothing_rehearses(plan)
    assert not workers.may_fly.is_set()
    assert (sent["stage"], sent["rehearsal"]) == (None, before)
    assert (await client.get(f"/api/plans/{plan}")).json()["rehearsal"] == before


async def test_draft_that_leaves_just_before_is_not_rehearsed_again(client, workers, monkeypatch):
    plan = (await plan_in(client, await laid_out(client), "draft"))["id"]
    workers.may_fly.clear()
    get = PlanLedger.get

    async def leave_once_read(ledger, plan):
        monkeypatch.setattr(PlanLedger, "get", get)
        record = await ledger.get(plan)
        await ledger.move(plan, PlanEvidence.SENT, f"{plan} was sent.")
        return record

    monkeypatch.setattr(PlanLedger, "get", leave_once_read)
    refused = await client.post(f"/api/plans/{plan}/rehearse")
    assert refused.status_code == 409
    assert "no draft any more" in refused.json()["detail"]
    await nothing_rehearses(plan)
    assert (await client.get(f"/api/plans/{plan}")).json()["rehearsal"]["state"] == "done"


async def test_another_rehearsal_keeps_no_plan_waiting(client, workers, station):
    plan = (await plan_in(client, await laid_out(client), "draft"))["id"]
    await rehearsed_again(client, workers, plan)
    assert workers.dry_run_pools == [station.workers, station.study_workers]


async def test_only_a_draft_is_rehearsed_again(client):
    plan = (await plan_in(client, await laid_out(client), "draft"))["id"]
    assert (await client.post(f"/api/plans/{plan}/cancel")).status_code == 202
    refused = await client.post(f"/api/plans/{plan}/rehearse")
    assert refused.status_code == 409
    assert "only such a one can be rehearsed" in refused.json()["detail"]


async def test_a_busy_machine_has_a_minute_for_a_rehearsal():
    assert dry_run.LIMIT_S >= 60.0


async def test_a_real_rehearsal_ends_by_the_processor_time_that_it_took(client, monkeypatch):
    monkeypatch.setattr(dry_run, "LIMIT_S", 0.0)
    # a real process, which beside a busy neighbour takes minutes to load what it flies with
    draft = await plan_in(client, await laid_out(client), "draft", timeout_s=280.0)
    assert draft["rehearsal"]["state"] == "skipped"
    assert "0 s of work" in draft["rehearsal"]["message"]


async def test_plan_can_be_cancelled_while_it_is_rehearsed(client, workers):
    workers.may_fly.clear()
    plan = await laid_out(client)
    await rehearses(client, plan)
    assert (await client.post(f"/api/plans/{plan}/cancel")).status_code == 202
    workers.may_fly.set()
    await asyncio.sleep(0.05)
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "cancelled"


async def test_station_that_stops_during_a_rehearsal_rehearses_again(tmp_path, world, workers):
    workers.may_fly.clear()
    async with open_station(tmp_path, world) as station:
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        config_id, config = await station.planning.configure(MINI, FAST, by="test")
        plan = await station.planning.plan_survey(SearchRequest(MINI, config, config_id, "test"))
        await until(lambda: workers.dry_runs)
    async with open_station(tmp_path, world) as station:
        view = station.plans.view(await station.plans.get(plan.id))
        assert (view.state, view.stage) == ("planning", "rehearsing")
        assert view.legs
        workers.may_fly.set()

        async def offered():
            return (await station.plans.get(plan.id)).state == "draft"

        await until(offered)
        view = station.plans.view(await station.plans.get(plan.id))
        assert view.rehearsal.state == "done"
        assert len(workers.problems) == 1


async def test_plan_whose_rehearsal_broke_off_is_sent_after_a_second_word_only(
    client, workers, world
):
    workers.breaks_off = 1
    draft = await plan_in(client, await laid_out(client), "draft")
    assert draft["rehearsal"]["completed"] is False
    (found,) = (await client.post(f"/api/plans/{draft['id']}/check")).json()["violations"]
    assert found["field"] == "adaptive.rehearse"
    assert found["message"].endswith("The robot did not fly the whole plan: it was lost.")
    refused = await client.post(f"/api/plans/{draft['id']}/upload")
    assert refused.status_code == 409
    assert "may not be flown as it must" in refused.json()["detail"]
    assert refused.json()["errors"] == [{"loc": [found["field"]], "msg": found["message"]}]
    assert world.uploads == []
    body = {"confirmed": True}
    sent = await client.post(f"/api/plans/{draft['id']}/upload", json=body)
    assert sent.status_code == 202
    await plan_in(client, draft["id"], "on_board")


async def test_survey_plans_once_more_where_a_rehearsal_broke_off(client, workers, world):
    workers.breaks_off = 1
    body = {"kind": "adaptive_survey", "config": FAST, "automation": True}
    mission = (await client.post("/api/robots/mini-1/missions", json=body)).json()["id"]
    done = await mission_in(client, mission, "done")
    assert [problem.attempt for problem in workers.problems[:2]] == [0, 1]
    assert workers.problems[1].warm == ()
    assert len(world.uploads) == len(done["rounds"]) == 2
    first = (await client.get("/api/plans/plan-1")).json()
    assert (first["state"], first["ladder"]["sent_at"]) == ("cancelled", None)


async def test_survey_leaves_a_plan_to_a_person_where_rehearsals_break_off_again(
    client, workers, world
):
    workers.breaks_off = 2
    body = {"kind": "adaptive_survey", "config": FAST, "automation": True}
    mission = (await client.post("/api/robots/mini-1/missions", json=body)).json()["id"]
    stopped = await mission_in(client, mission, "stopped")
    assert "is not sent without a person's word" in stopped["message"]
    assert stopped["message"].endswith("it was lost.")
    assert not stopped["automation"]
    assert world.uploads == []
    draft = (await client.get(f"/api/plans/{stopped['plan_id']}")).json()
    assert draft["state"] == "draft"
    sent = {"confirmed": True, "start": True}
    assert (await client.post(f"/api/plans/{draft['id']}/upload", json=sent)).status_code == 202
    await plan_in(client, draft["id"], "done")


async def test_plan_that_leads_into_a_keep_out_when_rehearsed_is_left_to_a_person(client, workers):
    workers.enters = ("reeds",)
    reeds = {"name": "reeds", "corners_m": [[3.0, 1.0], [3.0, 1.5], [3.5, 1.5]]}
    plan = (await plan_in(client, await laid_out(client, keep_outs=[reeds]), "draft"))["id"]
    assert [area.name for area in workers.dry_runs[0].keep_outs] == ["reeds"]
    assert (await client.get(f"/api/plans/{plan}")).json()["rehearsal"]["entered"] == ["reeds"]
    (one,) = (await client.post(f"/api/plans/{plan}/check")).json()["violations"]
    assert one["field"] == "adaptive.rehearse"
    assert (await client.post(f"/api/plans/{plan}/upload", json={})).status_code == 409
    wanted = {"confirmed": True}
    assert (await client.post(f"/api/plans/{plan}/upload", json=wanted)).status_code == 202


async def test_killed_rehearsal_process_leaves_the_draft(client, station):
    """A real process and the real rehearsal."""
    plan = await laid_out(client)
    await until(station.workers.process_ids)
    os.kill(station.workers.process_ids()[0], signal.SIGKILL)
    draft = await plan_in(client, plan, "draft")
    assert draft["rehearsal"]["state"] == "failed"
    assert "nothing was changed" in draft["rehearsal"]["message"]


async def test_simulated_robot_rehearses_dives_near_to_the_plan(client, station, monkeypatch):
    """The real rehearsal, in a process of its own."""
    monkeypatch.setattr(dry_run, "RUNS", 1)
    draft = await plan_in(client, await laid_out(client), "draft", timeout_s=280.0)
    found = draft["rehearsal"]
    assert found["state"] == "done", found["message"]
    assert found["completed"]
    assert 0.0 < found["rms_error_m"] < 0.5
    assert 0.5 < found["duration_s"] / draft["account"]["duration_s"] < 2.0
    assert len(found["flown"][0]) == 5
