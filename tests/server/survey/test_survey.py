"""A survey from its first plan to its last map, with what may come in between."""

import asyncio
import json
import os
import signal
from contextlib import suppress

import pytest

from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.planner.work import joules_per_unit
from autonomy.vehicle.config import VEHICLES
from db.query.measured.maps import newest_maps
from db.query.measured.samples import sample_columns
from db.query.station.events import newest_events
from robot_link.messages import OnboardPlanState
from server.link.ingest import Ingest
from server.plan.search.decided import SURVEY_ROUND
from server.survey import step as survey_step
from server.survey.map_quality import SurveyMaps
from tests.server.conftest import FAST, GRACE, MINI, open_station, until
from tests.server.fake_link import current_report, state_report

pytestmark = pytest.mark.timeout(300)
PLANNING_S = 240.0
"""A worker that has to compile the planner first takes its time."""


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch):
    """A round counts as received once what its robot said is kept, however long that takes."""
    settle = SurveyMaps.settle

    async def settle_when_kept(maps, *args):
        await maps._foundation.services.get(Ingest).settle()
        await settle(maps, *args)

    monkeypatch.setattr(SurveyMaps, "settle", settle_when_kept)
    monkeypatch.setattr(survey_step, "QUIET_S", 0.3)


async def survey_of(client, automation=False, **config):
    answer = await client.post(
        "/api/robots/mini-1/missions",
        json={
            "kind": "adaptive_survey",
            "config": {**FAST, **config},
            "automation": automation,
        },
    )
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


async def mission_in(client, mission, *states):
    async def there():
        found = (await client.get(f"/api/missions/{mission}")).json()
        return found if found["state"] in states else None

    try:
        return await until(there, PLANNING_S)
    except TimeoutError:
        events = (await client.get("/api/events?limit=500")).json()["events"]
        pytest.fail("\n".join(event["text"] for event in events))


async def test_survey_plans_flies_and_maps_until_its_budget_is_spent(client, station, world):
    mission = await survey_of(client)
    ready = await mission_in(client, mission, "ready")
    assert ready["budget"] == {
        "total": 24.0,
        "spent": 0.0,
        "round": 12.0,
        "remaining": 24.0,
        "round_time_s": None,
        "round_satellite_bytes": None,
        "planned_s": 0.0,
        "satellite_bytes": 0,
    }
    assert world.uploads == []
    assert (await client.post(f"/api/missions/{mission}/start")).status_code == 202
    done = await mission_in(client, mission, "done")
    assert [entry["round"] for entry in done["rounds"]][:2] == [1, 2]
    assert {entry["state"] for entry in done["rounds"]} == {"done"}
    assert done["budget"]["spent"] == pytest.approx(
        sum(entry["energy"] for entry in done["rounds"]), abs=0.01
    )
    assert 24.0 - 2.5 < done["budget"]["spent"] <= 24.0 + 0.01
    assert done["budget"]["remaining"] == pytest.approx(24.0 - done["budget"]["spent"])
    assert done["budget"]["satellite_bytes"] > 0
    assert 0.0 < done["map_std"] < 2.2
    assert len(done["scores"]) == 4
    assert all(0.0 < scores["rmse"] < 2.0 for scores in done["scores"])
    columns = await station.foundation.store.query(
        lambda session: sample_columns(session, MINI, "blue_light")
    )
    assert len(columns) == done["scores"][0]["samples"] == world.robots[MINI].sequence
    kept = await station.foundation.store.query(lambda session: newest_maps(session, MINI))
    assert {record.samples for record in kept} == {len(columns)}
    shown = (await client.get("/api/robots/mini-1/maps/blue_light")).json()
    assert shown["scores"]["samples"] == len(columns)
    robot = (await client.get("/api/robots/mini-1")).json()
    assert robot["mission_id"] == mission


async def test_survey_continues_after_the_station_was_away(tmp_path, world):
    """The robot flies its round on while nobody listens; the station picks it up."""
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        world.robots[MINI].may_fly.clear()
        mission = await station.surveys.create(MINI, FAST, automation=True, by="test")
        await until(lambda: world.robots[MINI].state is OnboardPlanState.RUNNING, PLANNING_S)
    robot = world.robots[MINI]
    unheard = []
    robot.tell = unheard.append
    robot.may_fly.set()
    await until(lambda: robot.state is OnboardPlanState.DONE)
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        for event in unheard:
            world.tell(event)

        async def ended():
            state = (await station.missions.get(mission)).state
            return state in {"done", "failed", "stopped"}

        with suppress(TimeoutError):
            await until(ended, PLANNING_S)
        view = await station.missions.view(mission)
        events = await station.foundation.store.query(newest_events)
        assert view.state == "done", "\n".join(event.text for event in events)
        assert len(view.rounds) >= 2
        assert view.scores[0].samples == robot.sequence


async def test_round_that_was_being_planned_when_the_station_died_is_taken_up_again(
    tmp_path, world
):
    slow = {**FAST, "search": {"iterations_max": 0}, "planning_time_s": 60.0}
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        mission = await station.surveys.create(MINI, slow, automation=False, by="test")
        await until(station.workers.process_ids)
    async with open_station(tmp_path, world) as station:

        async def again():
            [plan] = await station.missions.plans(mission)
            return plan.document["message"].startswith("Taken up again after the station restarted")

        await until(again)
        [plan] = await station.missions.plans(mission)
        assert (plan.round, plan.state) == (1, "planning")
        await until(station.workers.process_ids)


async def test_killed_worker_leaves_a_failed_plan_and_a_mission_that_can_be_started_again(
    client, station, world
):
    mission = await survey_of(client, search={"iterations_max": 0})
    await until(station.workers.process_ids)
    plan = (await client.get(f"/api/missions/{mission}")).json()["plan_id"]
    os.kill(station.workers.process_ids()[0], signal.SIGKILL)
    failed = await mission_in(client, mission, "failed")
    assert "nothing was changed" in failed["message"]
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "failed"
    assert (await client.post(f"/api/missions/{mission}/start")).status_code == 202
    again = await mission_in(client, mission, "replanning", "planning")
    assert again["plan_id"] != plan


async def test_cancelled_planning_ends_at_once(client, station):
    answer = await client.post(
        "/api/robots/mini-1/plans",
        json={"kind": "adaptive_survey", "config": {**FAST, "search": {"iterations_max": 0}}},
    )
    plan = answer.json()["id"]
    await until(station.workers.process_ids)
    assert (await client.post(f"/api/plans/{plan}/cancel")).status_code == 202
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "cancelled"


async def test_stopped_survey_sends_nothing_more_and_keeps_its_draft(client, world, workers):
    mission = await survey_of(client)
    ready = await mission_in(client, mission, "ready")
    assert (await client.post(f"/api/missions/{mission}/stop")).status_code == 202
    stopped = await mission_in(client, mission, "stopped")
    assert (await client.get(f"/api/plans/{ready['plan_id']}")).json()["state"] == "draft"
    assert stopped["message"].startswith("Stopped by")
    again = await client.post(f"/api/missions/{mission}/stop")
    assert again.status_code == 409
    assert world.uploads == []


async def test_survey_stops_with_a_sentence_when_the_robot_ends_a_plan_early(
    client, world, workers
):
    world.robots[MINI].may_fly.clear()
    mission = await survey_of(client, automation=True)
    await until(lambda: world.robots[MINI].state is OnboardPlanState.RUNNING, PLANNING_S)
    world.robots[MINI].end_early("the floor was near")
    stopped = await mission_in(client, mission, "stopped")
    assert "the floor was near" in stopped["message"]
    assert not stopped["automation"]


async def test_second_survey_waits_for_the_first(client, world, workers):
    world.robots[MINI].may_fly.clear()
    mission = await survey_of(client, automation=True)
    await mission_in(client, mission, "running")
    refused = await client.post(
        "/api/robots/mini-1/missions", json={"kind": "adaptive_survey", "config": FAST}
    )
    assert refused.status_code == 409
    assert mission in refused.json()["detail"]


async def test_started_survey_plans_an_outdated_round_again(client, station, world, workers):
    mission = await survey_of(client)
    ready = await mission_in(client, mission, "ready")
    world.tell(state_report(MINI, (2.6, 0.6, 0.0)))
    world.robots[MINI].may_fly.clear()
    assert (await client.post(f"/api/missions/{mission}/start")).status_code == 202

    async def flies():
        plans = await station.missions.plans(mission)
        return plans if plans[0].state == "running" else None

    plans = await until(flies, PLANNING_S)
    assert [(plan.round, plan.state) for plan in plans] == [(1, "running"), (1, "cancelled")]
    assert plans[1].id == ready["plan_id"]
    assert plans[0].document["legs"][0]["start_ned"] == [2.6, 0.6, 0.0]
    events = (await client.get("/api/events?limit=500")).json()["events"]
    (said,) = (one["text"] for one in events if one["kind"] == "plan.cancelled")
    away = "the robot is 1.4 m from where the plan begins; the limit is 1 m."
    assert said == f"{ready['plan_id']} was cancelled: {away} Planning again."


async def test_draft_that_its_robot_drifted_away_from_is_not_shown_as_ready(
    client, station, world, workers
):
    mission = await survey_of(client)
    ready = await mission_in(client, mission, "ready")
    path = f"/api/plans/{ready['plan_id']}"
    assert ready["message"] == f"{ready['plan_id']} is ready to be sent."
    assert (await client.get(path)).json()["outdated"] == []
    texts = []

    async def read(text):
        texts.append(json.loads(text))

    following = asyncio.ensure_future(station.feed.follow(read, None, None))
    world.tell(state_report(MINI, (2.6, 0.6, 0.0)))
    away = "The robot is 1.4 m from where the plan begins; the limit is 1 m."

    def is_told():
        plans = (one["plans"].get(ready["plan_id"], {}) for one in texts)
        missions = (one["missions"].get(mission, {}) for one in texts)
        said = [found["message"] for plan in plans for found in plan.get("outdated", ())]
        return away in said and any(away in one.get("message", "") for one in missions)

    await until(is_told)
    following.cancel()
    with suppress(asyncio.CancelledError):
        await following
    outdated = (await client.get(path)).json()["outdated"]
    assert outdated == [{"field": "mission.draft_distance_m", "message": away}]
    assert outdated == (await client.post(f"{path}/check")).json()["violations"]
    stale = (await client.get(f"/api/missions/{mission}")).json()
    assert stale["message"].startswith(f"{ready['plan_id']} no longer fits: {away}")
    world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
    world.tell(current_report(MINI))

    async def fits():
        return (await client.get(path)).json()["outdated"] == []

    await until(fits)
    again = (await client.get(f"/api/missions/{mission}")).json()
    assert again["message"] == ready["message"]


async def test_progress_and_best_objective_travel_in_the_live_stream(client, station, monkeypatch):
    texts = []

    async def keep(text):
        texts.append(text)

    def told():
        return any('"objective":' in text and '"candidates":' in text for text in texts)

    make = station.foundation.decisions.make

    async def make_and_tell(kind, *args, **more):
        found = await make(kind, *args, **more)
        if kind is SURVEY_ROUND:
            await until(told)  # of a search that took no time, too
        return found

    monkeypatch.setattr(station.foundation.decisions, "make", make_and_tell)
    follower = asyncio.create_task(station.feed.follow(keep, None, None))
    answer = await client.post(
        "/api/robots/mini-1/plans",
        json={"kind": "adaptive_survey", "config": {**FAST, "search": {"iterations_max": 120}}},
    )
    plan = answer.json()["id"]

    async def drafted():
        return (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"

    await until(drafted, PLANNING_S)
    found = (await client.get(f"/api/plans/{plan}")).json()
    assert found["objective_unit"] == "nat"
    assert found["history"][-1]["objective"] >= found["searched_objective"] - 1e-6
    assert found["objective"] == pytest.approx(found["searched_objective"], rel=0.3)
    assert found["account"]["energy"] <= 12.0 + 1e-6
    vehicle, preset = VEHICLES["miniglider"], PLANNER_PRESETS["miniglider"]
    unit_wh = joules_per_unit(vehicle, preset.primitives, preset.energy) / 3600.0
    watt_hours = found["account"]["energy"] * unit_wh
    assert found["account"]["energy_wh"] == pytest.approx(watt_hours, rel=1e-6)
    assert len(found["points"][0]) == 5
    follower.cancel()


async def test_planning_again_replaces_the_draft_of_a_waiting_survey(client, workers):
    mission = await survey_of(client)
    first = (await mission_in(client, mission, "ready"))["plan_id"]
    body = {
        "kind": "adaptive_survey",
        "mission": mission,
        "config": {**FAST, "objective": "ergodic"},
    }
    second = (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"]
    ready = await mission_in(client, mission, "ready")
    assert ready["plan_id"] == second
    assert (await client.get(f"/api/plans/{first}")).json()["state"] == "cancelled"
    assert (await client.get(f"/api/plans/{second}")).json()["config"]["objective"] == "ergodic"
    refused = await client.post(f"/api/robots/{GRACE}/plans", json=body)
    assert refused.status_code == 409
    assert refused.json()["detail"] == f"{mission} is mini-1's."


async def test_new_survey_takes_the_place_of_one_that_only_waits(client, workers):
    first = await survey_of(client)
    await mission_in(client, first, "ready")
    second = await survey_of(client)
    stopped = await mission_in(client, first, "stopped")
    assert stopped["message"] == "A new survey took its place."
    await mission_in(client, second, "ready")
    listed = (await client.get("/api/robots/mini-1/missions")).json()
    assert [entry["id"] for entry in listed] == [second, first]
    plans = (await client.get("/api/robots/mini-1/plans?state=draft")).json()
    assert {plan["mission_id"] for plan in plans} == {first, second}


async def test_survey_stops_when_its_plan_does_not_get_on_board(client, world, workers):
    world.refuse_upload = OnboardPlanState.REFUSED
    mission = await survey_of(client, automation=True)
    stopped = await mission_in(client, mission, "stopped")
    assert "the robot did not answer" in stopped["message"]
    events = (await client.get("/api/events?limit=500")).json()["events"]
    assert [one["level"] for one in events if one["kind"] == "mission.stopped"] == ["warning"]
    plan = (await client.get(f"/api/plans/{stopped['plan_id']}")).json()
    assert plan["state"] == "draft"


async def test_robot_that_lost_its_plan_ends_it_and_the_survey(client, world, workers):
    world.robots[MINI].may_fly.clear()
    mission = await survey_of(client, automation=True)
    await mission_in(client, mission, "running")
    await until(lambda: world.robots[MINI].state is OnboardPlanState.RUNNING)
    world.robots[MINI].plan = None
    world.robots[MINI].say(OnboardPlanState.NONE)
    stopped = await mission_in(client, mission, "stopped")
    assert "no longer holds" in stopped["message"]


async def test_robot_that_was_switched_off_as_it_flew_ends_plan_and_survey_and_keeps_the_account(
    client, world, workers
):
    robot = world.robots[MINI]
    robot.may_end.clear()
    mission = await survey_of(client, automation=True)
    await until(lambda: robot.plan is not None and robot.leg == len(robot.plan.legs) - 1)
    flown = await mission_in(client, mission, "running")
    used = robot.energy_used
    robot.say(OnboardPlanState.ON_BOARD, later_s=-60.0)
    robot.energy_used = used + 1.0
    robot.say(OnboardPlanState.RUNNING)
    assert (await mission_in(client, mission, "running"))["plan_id"] == flown["plan_id"]
    robot.energy_used = 0.0
    robot.say(OnboardPlanState.ON_BOARD, later_s=5.0)
    stopped = await mission_in(client, mission, "stopped")
    assert "was switched off while it flew" in stopped["message"]
    assert stopped["budget"]["spent"] == pytest.approx(used + 1.0), "not by the older word"


async def test_survey_that_is_done_cannot_be_started_again(client, station):
    mission = await survey_of(client)
    await mission_in(client, mission, "ready")
    await station.missions.move(mission, "done", "The budget is spent.")
    refused = await client.post(f"/api/missions/{mission}/start")
    assert refused.status_code == 409
    assert "plan a new survey" in refused.json()["detail"]
    assert (await client.post("/api/missions/mission-99/start")).status_code == 404


async def test_checking_a_draft_again_tells_what_it_breaks_now(client):
    body = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, 1.1]}]}
    plan = (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"]
    checked = (await client.post(f"/api/plans/{plan}/check")).json()
    assert checked["plan_id"] == plan
    assert checked["violations"]


async def test_what_was_read_of_a_mission_before_a_change_is_not_shown_after_it(
    client, station, monkeypatch
):
    mission = await survey_of(client)
    await mission_in(client, mission, "ready")
    ledger, has_read, may_go_on = station.missions, asyncio.Event(), asyncio.Event()
    plans = ledger.plans

    async def late(mission):
        monkeypatch.setattr(ledger, "plans", plans)
        has_read.set()
        await may_go_on.wait()
        return await plans(mission)

    monkeypatch.setattr(ledger, "plans", late)
    async with asyncio.TaskGroup() as both:
        both.create_task(ledger._read(mission))
        await has_read.wait()
        moved = both.create_task(ledger.move(mission, "stopped", "Ben stopped it."))
        await asyncio.wait([moved], timeout=0.5)  # time enough to overtake the first
        may_go_on.set()
    assert ledger.live_view(mission).state == "stopped"
