import os
import signal
from dataclasses import replace
from datetime import timedelta

import pytest

from autonomy.planner.config import PlannerConfig
from robot_link.messages import OnboardPlanState
from server.base.worker import WorkerEndedError, WorkerPool
from server.plan.task import PLAN_SURVEY
from tests.server.conftest import FAST, MINI, until
from tests.server.fake_link import current_report
from tests.server.fake_worker import DEPTHS_M


async def plan_in(client, plan, *states, timeout_s=120.0):
    async def there():
        found = (await client.get(f"/api/plans/{plan}")).json()
        return found if found["state"] in states else None

    return await until(there, timeout_s)


async def drafted(client, **config):
    body = {"kind": "adaptive_survey", "config": {**FAST, **config}}
    answer = await client.post("/api/robots/mini-1/plans", json=body)
    assert answer.status_code == 202, answer.text
    return await plan_in(client, answer.json()["id"], "draft")


async def waiting_survey(client):
    body = {"kind": "adaptive_survey", "config": FAST}
    mission = (await client.post("/api/robots/mini-1/missions", json=body)).json()["id"]
    return await mission_in(client, mission, "ready")


async def mission_in(client, mission, *states):
    async def there():
        found = (await client.get(f"/api/missions/{mission}")).json()
        return found if found["state"] in states else None

    return await until(there)


async def test_runners_up_are_kept_with_their_legs_and_points(client, workers):
    draft = await drafted(client)
    assert [one["objective"] for one in draft["runners_up"]] == list(DEPTHS_M[1:])
    for one in draft["runners_up"]:
        assert one["legs"][0]["end_ned"][2] == one["objective"]
        assert len(one["points"][0]) == 5
        assert one["points"][-1][0] == pytest.approx(
            sum(leg["duration_s"] for leg in one["legs"]), abs=1e-3
        )


async def test_chosen_runner_up_takes_the_place_of_the_draft(client, workers):
    old = await drafted(client)
    answer = await client.post(f"/api/plans/{old['id']}/choose", json={"runner_up": 1})
    assert answer.status_code == 202
    new = await plan_in(client, answer.json()["id"], "draft")
    ends = [leg["end_ned"] for leg in new["legs"]]
    assert ends == [leg["end_ned"] for leg in old["runners_up"][1]["legs"]]
    assert new["objective"] == old["runners_up"][1]["objective"]
    assert new["account"]["energy"] == pytest.approx(old["runners_up"][1]["energy"])
    assert new["account"]["surfacings"] == len(new["legs"]) // 2
    assert new["account"]["satellite_bytes"] == 100 * new["account"]["surfacings"]
    assert new["violations"] == []
    assert new["replaces"] == old["id"]
    assert new["sha256"] not in {None, old["sha256"]}
    objectives = [one["objective"] for one in new["runners_up"]]
    assert objectives == [DEPTHS_M[0], DEPTHS_M[1]]
    ended = (await client.get(f"/api/plans/{old['id']}")).json()
    assert ended["state"] == "superseded"
    assert ended["message"] == f"{new['id']} took the place of {old['id']}."


async def test_search_goes_on_from_the_draft_and_its_runners_up(client, workers):
    old = await drafted(client)
    answer = await client.post(f"/api/plans/{old['id']}/continue", json={"planning_time_s": 7.0})
    new = await plan_in(client, answer.json()["id"], "draft")
    first, second = workers.problems
    assert first.warm == ()
    assert first.attempt == 0
    assert [len(legs) for legs in second.warm] == [
        len(one["legs"]) for one in (old, *old["runners_up"])
    ]
    assert second.attempt == 1
    assert second.planner.planning_time_s == 7.0
    assert second.budget == first.budget == 12.0
    assert second.start_xy == first.start_xy == (1.2, 0.6)
    assert (new["config_id"], new["config"]["planning_time_s"]) == (None, 7.0)
    again = (await client.post(f"/api/plans/{new['id']}/continue")).json()["id"]
    assert (await plan_in(client, again, "draft"))["config"] == new["config"]
    other = await drafted(client)
    longer = await client.post(f"/api/plans/{other['id']}/continue", json={"planning_time_s": 30})
    same = await plan_in(client, longer.json()["id"], "draft")
    assert same["config_id"] == other["config_id"] == old["config_id"]
    assert (await client.get(f"/api/plans/{old['id']}")).json()["state"] == "superseded"


async def test_what_the_robot_said_of_the_current_counts_once_however_often_one_searches_on(
    client, station, workers
):
    """A doubt that it has no more, and a current that it knew, are not kept for good."""
    told = current_report(MINI, station.foundation.clock.now())
    station.fleet.take_current(replace(told, current_std_m_s=0.004, doubt=2.0))
    draft = await drafted(client)
    asked = (await client.get("/api/config/planner?robot=mini-1")).json()["value"]
    station.fleet.take_current(
        replace(told, measured_at=told.measured_at + timedelta(seconds=1), doubt=1.0)
    )
    chosen = (await client.post(f"/api/plans/{draft['id']}/choose", json={"runner_up": 0})).json()
    await plan_in(client, chosen["id"], "draft")
    ways = {"planning_time_s": 7.0}, {}
    newest = chosen["id"]
    for body in ways:
        newest = (await client.post(f"/api/plans/{newest}/continue", json=body)).json()["id"]
        searched = await plan_in(client, newest, "draft")
        assert searched["config"]["position_filter"]["doubt"] == 1.0
    config = PlannerConfig.model_validate(asked)
    again = station.planning.settings.known_current(MINI, config).position_filter
    found = searched["config"]["position_filter"]["steady_current_m_s"]
    assert found == pytest.approx(again.steady_current_m_s, abs=2e-4)


async def test_a_chosen_runner_up_still_says_in_which_current_it_was_planned(client, workers):
    old = await drafted(client, current={"source": "map"})
    assert old["current_text"]
    answer = await client.post(f"/api/plans/{old['id']}/choose", json={"runner_up": 0})
    new = await plan_in(client, answer.json()["id"], "draft")
    assert new["current_text"] == old["current_text"]


@pytest.mark.parametrize("end", ["killed", "cancelled", "nothing"])
async def test_search_that_comes_to_nothing_leaves_the_draft_as_it_was(client, workers, end):
    ready = await waiting_survey(client)
    old = ready["plan_id"]
    before = (await client.get(f"/api/plans/{old}")).json()
    workers.may_plan.clear()
    if end == "killed":
        workers.fails[PLAN_SURVEY] = WorkerEndedError("The process ended.")
    workers.nothing_feasible = end == "nothing"
    new = (await client.post(f"/api/plans/{old}/continue")).json()["id"]
    assert (await client.get(f"/api/missions/{ready['id']}")).json()["state"] == "planning"
    if end == "cancelled":
        await client.post(f"/api/plans/{new}/cancel")
    workers.may_plan.set()
    await plan_in(client, new, "failed", "cancelled")
    again = await mission_in(client, ready["id"], "ready")
    assert again["plan_id"] == old
    assert [entry["plan_id"] for entry in again["rounds"]] == [old]
    assert (await client.get(f"/api/plans/{old}")).json() == before
    assert (await client.post(f"/api/missions/{ready['id']}/start")).status_code == 202


async def test_choice_of_a_waiting_survey_is_what_it_flies(client, workers, world):
    ready = await waiting_survey(client)
    answer = await client.post(f"/api/plans/{ready['plan_id']}/choose", json={"runner_up": 0})
    chosen = await plan_in(client, answer.json()["id"], "draft")
    again = await mission_in(client, ready["id"], "ready")
    assert again["plan_id"] == chosen["id"]
    world.robots[MINI].may_fly.clear()
    assert (await client.post(f"/api/missions/{ready['id']}/start")).status_code == 202
    await until(lambda: world.robots[MINI].state is OnboardPlanState.RUNNING)
    assert world.uploads == [(MINI, chosen["sha256"])]
    world.robots[MINI].may_fly.set()
    done = await mission_in(client, ready["id"], "done")
    # The draft that was not chosen spent nothing.
    spent = sum(entry["energy"] for entry in done["rounds"])
    assert done["budget"]["spent"] == pytest.approx(spent)


async def test_draft_that_was_sent_meanwhile_is_not_replaced(client, station, workers):
    old = await drafted(client)
    workers.may_plan.clear()
    new = (await client.post(f"/api/plans/{old['id']}/continue")).json()["id"]
    await client.post(f"/api/plans/{old['id']}/upload")
    await plan_in(client, old["id"], "on_board")
    workers.may_plan.set()
    failed = await plan_in(client, new, "failed")
    assert f"{old['id']} is on board" in failed["message"]
    assert (await client.get(f"/api/plans/{old['id']}")).json()["state"] == "on_board"


async def test_only_waiting_drafts_of_a_search_are_exchanged(client, workers, world):
    draft = await drafted(client)
    too_far = await client.post(f"/api/plans/{draft['id']}/choose", json={"runner_up": 2})
    assert too_far.status_code == 422
    assert too_far.json()["errors"] == [{"loc": ["runner_up"], "msg": "must be 0 to 1"}]
    long = await client.post(f"/api/plans/{draft['id']}/continue", json={"planning_time_s": 1e4})
    assert long.status_code == 422
    workers.may_plan.clear()
    new = (await client.post(f"/api/plans/{draft['id']}/continue")).json()["id"]
    second = await client.post(f"/api/plans/{draft['id']}/choose", json={"runner_up": 0})
    assert second.status_code == 409
    assert new in second.json()["detail"]
    workers.may_plan.set()
    await plan_in(client, new, "draft")
    gone = await client.post(f"/api/plans/{draft['id']}/choose", json={"runner_up": 0})
    assert gone.status_code == 409
    assert "superseded" in gone.json()["detail"]
    legs = [{"kind": "dive", "end_ned": [0, 0, z]} for z in (0.3, 0.0)]
    body = {"kind": "primitives", "legs": legs}
    laid = (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"]
    by_hand = await client.post(f"/api/plans/{laid}/continue")
    assert by_hand.status_code == 409
    assert "laid out by hand" in by_hand.json()["detail"]


async def test_plan_of_a_survey_under_way_is_not_exchanged(client, workers, world):
    world.robots[MINI].may_fly.clear()
    ready = await waiting_survey(client)
    await client.post(f"/api/missions/{ready['id']}/start")
    await mission_in(client, ready["id"], "running")
    refused = await client.post(f"/api/plans/{ready['plan_id']}/choose", json={"runner_up": 0})
    assert refused.status_code == 409


async def test_killed_planning_process_leaves_the_draft_that_it_searched_on_from(
    client, station, workers, monkeypatch
):
    """A real process, killed in the middle of its search."""
    old = await drafted(client, search={"iterations_max": 0})
    monkeypatch.setattr(WorkerPool, "run", workers.run_really)
    body = {"planning_time_s": 60.0}
    before = (await client.get(f"/api/plans/{old['id']}")).json()
    new = (await client.post(f"/api/plans/{old['id']}/continue", json=body)).json()["id"]

    async def searches():
        progress = (await client.get(f"/api/plans/{new}")).json()["progress"]
        return progress is not None and progress["elapsed_s"] > 0.0

    await until(searches)
    os.kill(station.workers.process_ids()[0], signal.SIGKILL)
    failed = await plan_in(client, new, "failed")
    assert "nothing was changed" in failed["message"]
    assert (await client.get(f"/api/plans/{old['id']}")).json() == before


async def test_a_plan_by_settings_of_its_own_leaves_the_robots_settings(client, workers):
    path, robot = "/api/config/planner", {"robot": "mini-1"}
    before = (await client.get(path, params=robot)).json()
    body = {"kind": "adaptive_survey", "config": {**FAST, "round_budget": 3.5}}
    wish = {**body, "keep_settings": False}
    made = (await client.post("/api/robots/mini-1/plans", json=wish)).json()["id"]
    draft = await plan_in(client, made, "draft")
    assert draft["config"]["round_budget"] == 3.5
    assert draft["config_id"] is None
    assert (await client.get(path, params=robot)).json() == before


async def test_a_mission_has_no_settings_that_are_not_kept(client, workers):
    mission = await waiting_survey(client)
    wish = {"kind": "adaptive_survey", "mission": mission["id"], "keep_settings": False}
    answer = await client.post("/api/robots/mini-1/plans", json=wish)
    assert answer.status_code == 422
    assert "keep_settings" in answer.text
