"""The next round is planned while the robot still flies the present one."""

import asyncio
from contextlib import suppress

import pytest

from robot_link.messages import SURFACED_BY_COMMAND, OnboardPlanState
from server.base.worker import WorkerTaskError
from server.plan import ahead as planned_ahead
from server.plan.task import MAP_STD
from server.survey import step as survey_step
from server.survey.map_quality import SurveyMaps
from tests.server.conftest import FAST, MINI, open_station, until
from tests.server.fake_link import current_report, state_report


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch):
    monkeypatch.setattr(survey_step, "QUIET_S", 0.05)


async def survey(client, **config):
    body = {"kind": "adaptive_survey", "config": {**FAST, **config}, "automation": True}
    answer = await client.post("/api/robots/mini-1/missions", json=body)
    assert answer.status_code == 202, answer.text
    return answer.json()["id"]


async def mission_when(client, mission, holds):
    async def there():
        found = (await client.get(f"/api/missions/{mission}")).json()
        return found if holds(found) else None

    try:
        return await until(there)
    except TimeoutError:
        events = (await client.get("/api/events?limit=500")).json()["events"]
        pytest.fail("\n".join(event["text"] for event in events))


async def has_draft_ahead(client, mission):
    found = await mission_when(client, mission, lambda one: one["ahead"] is not None)

    async def drafted():
        plan = (await client.get(f"/api/plans/{found['ahead']}")).json()
        return plan if plan["state"] == "draft" else None

    return await until(drafted)


async def let_the_first_search_go_on(workers):
    """Wait until the search after it is asked for, which waits."""
    await until(lambda: workers.problems)
    workers.may_plan.set()
    workers.may_plan.clear()
    await until(lambda: len(workers.problems) == 2)


async def survey_that_searches_ahead(client, world, workers, **config):
    """Return a survey whose robot flies its last leg while the search for the next round waits."""
    world.robots[MINI].may_end.clear()
    workers.may_plan.clear()
    mission = await survey(client, **config)
    await let_the_first_search_go_on(workers)
    return mission


async def test_next_round_is_planned_on_the_last_leg_and_flown_as_it_is(
    client, world, workers, monkeypatch
):
    monkeypatch.setattr(planned_ahead, "MARGIN_S", -FAST["planning_time_s"])  # by no time before
    robot = world.robots[MINI]
    robot.may_end.clear()
    mission = await survey(client, total_budget=20.0)
    ahead = await has_draft_ahead(client, mission)
    flown = (await client.get(f"/api/missions/{mission}")).json()
    assert flown["state"] == "running"
    first = (await client.get(f"/api/plans/{flown['plan_id']}")).json()
    assert (first["state"], first["round"], ahead["round"]) == ("running", 1, 2)
    assert ahead["outdated"] == []
    assert ahead["legs"][0]["start_ned"] == first["legs"][-1]["end_ned"]
    problem = workers.problems[1]
    assert problem.budget == pytest.approx(20.0 - first["account"]["energy"], abs=1e-6)
    # Of the running plan only its last leg is still to be sampled.
    last_s = sum(leg["duration_s"] for leg in first["legs"][:-1])
    rest = [point[1:4] for point in first["points"] if point[0] > last_s]
    assert problem.planned_points.tolist() == rest
    assert problem.warm[0] == tuple(robot.plan.legs[-1:])
    robot.may_end.set()
    done = await mission_when(client, mission, lambda one: one["state"] == "done")
    assert [entry["plan_id"] for entry in done["rounds"]] == [first["id"], ahead["id"]]
    assert len(workers.problems) == 2
    assert done["map_std"] == 1.0
    assert "The budget is spent" in done["message"]


async def test_plan_ahead_is_made_anew_where_the_robot_came_up_elsewhere(client, world, workers):
    robot = world.robots[MINI]
    robot.may_end.clear()
    mission = await survey(client)
    ahead = await has_draft_ahead(client, mission)
    drift = robot.plan.legs[-1].end_ned

    def say_elsewhere(event, tell=robot.tell):
        with suppress(AttributeError):
            if event.position_ned == drift and event.pitch_rad:
                event = state_report(MINI, (2.6, 0.6, 0.0))
        tell(event)

    robot.tell = say_elsewhere
    robot.may_end.set()
    robot.may_fly.clear()
    again = await mission_when(
        client,
        mission,
        lambda one: one["rounds"][-1]["round"] == 2 and one["rounds"][-1]["state"] == "running",
    )
    assert again["plan_id"] != ahead["id"]
    assert (await client.get(f"/api/plans/{ahead['id']}")).json()["state"] == "cancelled"
    second = workers.problems[2]
    assert second.start_xy == (2.6, 0.6)
    assert len(second.warm[0]) == len(ahead["legs"])
    assert len(second.planned_points) == 0


async def test_station_that_was_away_goes_on_with_the_plan_made_ahead(tmp_path, world, workers):
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        world.robots[MINI].may_end.clear()
        mission = await station.surveys.create(MINI, FAST, automation=True, by="test")

        async def drafted():
            plans = await station.missions.plans(mission)
            return [plan.state for plan in plans] == ["draft", "running"]

        await until(drafted)
    robot = world.robots[MINI]
    unheard = []
    robot.tell = unheard.append
    robot.may_end.set()
    await until(lambda: robot.state is OnboardPlanState.DONE)
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        for event in unheard:
            world.tell(event)

        async def ended():
            return (await station.missions.get(mission)).state == "done"

        await until(ended)
        plans = await station.missions.plans(mission)
        assert [(plan.round, plan.state) for plan in plans] == [(2, "done"), (1, "done")]


async def test_search_ahead_that_the_station_broke_off_is_taken_up_again(tmp_path, world, workers):
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        world.robots[MINI].may_end.clear()
        workers.may_plan.clear()
        mission = await station.surveys.create(MINI, FAST, automation=True, by="test")
        await let_the_first_search_go_on(workers)
    workers.may_plan.set()
    async with open_station(tmp_path, world) as station:
        world.hear(MINI)
        world.robots[MINI].say()

        async def again():
            plans = await station.missions.plans(mission)
            return [plan.state for plan in plans] == ["draft", "running"]

        await until(again)
        assert workers.problems[2].start_xy == workers.problems[1].start_xy
        assert (await station.missions.view(mission)).ahead is not None


async def test_surface_order_throws_the_plan_ahead_away(client, world, workers):
    world.robots[MINI].may_end.clear()
    mission = await survey(client)
    ahead = await has_draft_ahead(client, mission)
    order = {"kind": "surface"}
    assert (await client.post("/api/robots/mini-1/commands", json=order)).status_code == 202
    world.robots[MINI].may_end.set()

    async def cancelled():
        plan = (await client.get(f"/api/plans/{ahead['id']}")).json()
        return plan["state"] == "cancelled"

    await until(cancelled)
    stopped = (await client.get(f"/api/missions/{mission}")).json()
    assert (stopped["state"], stopped["ahead"]) == ("stopped", None)
    assert len(stopped["rounds"]) == 1
    assert world.robots[MINI].reason == SURFACED_BY_COMMAND
    # Started again, it flies the round that was broken off.
    world.robots[MINI].may_fly.clear()
    assert (await client.post(f"/api/missions/{mission}/start")).status_code == 202
    again = await mission_when(client, mission, lambda one: one["state"] == "running")
    assert again["rounds"][-1]["round"] == 1


async def test_stopped_survey_keeps_the_plan_ahead_and_goes_on_with_it(client, world, workers):
    robot = world.robots[MINI]
    robot.may_end.clear()
    mission = await survey(client)
    ahead = await has_draft_ahead(client, mission)
    assert (await client.post(f"/api/missions/{mission}/stop")).status_code == 202
    robot.may_end.set()
    await until(lambda: robot.state is OnboardPlanState.DONE)
    await mission_when(client, mission, lambda one: one["rounds"][0]["state"] == "done")
    kept = (await client.get(f"/api/plans/{ahead['id']}")).json()
    assert kept["state"] == "draft"
    assert len(world.uploads) == 1
    assert (await client.post(f"/api/missions/{mission}/start")).status_code == 202
    done = await mission_when(client, mission, lambda one: one["state"] == "done")
    assert [entry["plan_id"] for entry in done["rounds"]][-1] == ahead["id"]


async def test_survey_ends_when_its_map_is_good_enough(client, world, workers):
    world.robots[MINI].may_end.clear()
    workers.map_std = 0.4
    mission = await survey(client, target_std=0.5)
    ahead = await has_draft_ahead(client, mission)
    world.robots[MINI].may_end.set()
    done = await mission_when(client, mission, lambda one: one["state"] == "done")
    assert done["message"].startswith("The map is good enough")
    assert (done["map_std"], done["target_std"]) == (0.4, 0.5)
    assert (await client.get(f"/api/plans/{ahead['id']}")).json()["state"] == "cancelled"
    assert len(done["rounds"]) == 1


async def test_round_is_planned_after_the_flight_where_planning_ahead_is_switched_off(
    client, world, workers
):
    mission = await survey(client, adaptive={"plan_ahead": False, "warm_start": False})
    done = await mission_when(client, mission, lambda one: one["state"] == "done")
    assert len(done["rounds"]) == 2
    assert [len(problem.planned_points) for problem in workers.problems] == [0, 0]
    assert [problem.warm for problem in workers.problems] == [(), ()]


async def test_exploitation_follows_its_schedule_and_is_kept_in_each_plan(client, world, workers):
    ergodic = {"exploitation": 0.0, "exploitation_end": 1.0, "schedule": "linear"}
    mission = await survey(client, objective="ergodic", ergodic=ergodic)
    done = await mission_when(client, mission, lambda one: one["state"] == "done")
    plans = [(await client.get(f"/api/plans/{one['plan_id']}")).json() for one in done["rounds"]]
    spent = plans[0]["account"]["energy"]
    assert plans[0]["exploitation"] == 0.0
    assert plans[1]["exploitation"] == pytest.approx(spent / 24.0, abs=0.01)
    assert plans[1]["config"]["ergodic"]["exploitation"] == plans[1]["exploitation"]
    assert [one.planner.ergodic.exploitation for one in workers.problems] == [
        plan["exploitation"] for plan in plans
    ]
    assert done["exploitation"] == plans[1]["exploitation"]
    assert done["config"]["ergodic"]["exploitation"] == 0.0


async def test_plan_ahead_that_fails_is_made_after_the_flight(client, world, workers):
    mission = await survey_that_searches_ahead(client, world, workers)
    workers.nothing_feasible = True
    workers.may_plan.set()
    failed = await mission_when(client, mission, lambda one: one["ahead"] is None)
    assert failed["state"] == "running"
    workers.nothing_feasible = False
    world.robots[MINI].may_end.set()
    done = await mission_when(client, mission, lambda one: one["state"] == "done")
    assert {entry["state"] for entry in done["rounds"]} == {"done"}
    assert len(workers.problems) == 3


async def test_rest_of_the_budget_that_nothing_can_be_flown_with_ends_a_survey(
    client, world, workers
):
    mission = await survey_that_searches_ahead(client, world, workers, total_budget=20.0)
    workers.nothing_feasible = True
    workers.may_plan.set()
    world.robots[MINI].may_end.set()
    done = await mission_when(client, mission, lambda one: one["state"] in {"done", "failed"})
    assert done["state"] == "done"
    assert done["message"].startswith("The 8.25 energy units that are left are too little")
    assert [entry["state"] for entry in done["rounds"]] == ["done"]


async def test_full_round_that_cannot_be_planned_fails_a_survey(client, world, workers):
    mission = await survey_that_searches_ahead(client, world, workers, total_budget=40.0)
    workers.nothing_feasible = True
    workers.may_plan.set()
    world.robots[MINI].may_end.set()
    failed = await mission_when(client, mission, lambda one: one["state"] in {"done", "failed"})
    assert failed["state"] == "failed"
    assert "too shallow" in failed["message"]

    async def alarms():
        open_ones = (await client.get("/api/alarms")).json()["alarms"]
        return [one for one in open_ones if "too shallow" in one["text"]]

    (alarm,) = await until(alarms)
    assert (alarm["level"], alarm["robot"], alarm["state"]) == ("warning", MINI, "unacknowledged")
    events = (await client.get("/api/events?limit=500")).json()["events"]
    assert {one["level"] for one in events if one["kind"] == "mission.failed"} == {"warning"}
    # It goes on: the alarm is no longer true.
    workers.nothing_feasible = False
    assert (await client.post(f"/api/missions/{mission}/start")).status_code == 202
    assert [one["state"] for one in await alarms()] == ["returned"]


async def test_map_that_cannot_be_judged_does_not_hold_up_a_survey(client, world, workers):
    workers.fails[MAP_STD] = WorkerTaskError("ValueError: no map")
    mission = await survey(client)
    done = await mission_when(client, mission, lambda one: one["state"] == "done")
    assert done["map_std"] is None


async def test_survey_that_is_stopped_while_a_round_is_received_plans_no_further(
    client, station, world, workers, monkeypatch
):
    received = asyncio.Event()
    settle = SurveyMaps.settle

    async def settle_late(self, *args):
        await received.wait()
        await settle(self, *args)

    monkeypatch.setattr(SurveyMaps, "settle", settle_late)
    mission = await survey(client, adaptive={"plan_ahead": False})
    await until(lambda: world.robots[MINI].state is OnboardPlanState.DONE)
    await mission_when(client, mission, lambda one: one["rounds"][0]["state"] == "done")
    assert (await client.post(f"/api/missions/{mission}/stop")).status_code == 202
    received.set()
    await mission_when(client, mission, lambda one: one["map_std"] is not None)
    await asyncio.sleep(0.1)
    assert len(workers.problems) == 1
    assert (await client.get(f"/api/missions/{mission}")).json()["state"] == "stopped"


async def test_new_survey_ends_the_search_of_the_one_that_it_takes_the_place_of(client, workers):
    workers.may_plan.clear()
    body = {"kind": "adaptive_survey", "config": FAST}
    for _ in range(2):
        assert (await client.post("/api/robots/mini-1/missions", json=body)).status_code == 202
    states = [(await client.get(f"/api/plans/plan-{n}")).json()["state"] for n in (1, 2)]
    assert states == ["cancelled", "planning"]
    workers.may_plan.set()


async def test_place_that_is_told_as_a_draft_is_sent_makes_the_round_anew(
    client, station, world, workers, monkeypatch
):
    upload = station.transfers.send
    told = []

    async def upload_late(plan, **options):
        if not told:
            told.append(plan)
            world.tell(state_report(MINI, (2.6, 0.6, 0.0)))
        return await upload(plan, **options)

    monkeypatch.setattr(station.transfers, "send", upload_late)
    world.robots[MINI].may_fly.clear()
    mission = await survey(client)
    flown = await mission_when(client, mission, lambda one: one["state"] in {"running", "stopped"})
    assert flown["state"] == "running", flown["message"]
    assert flown["plan_id"] != told[0]
    assert workers.problems[-1].start_xy == (2.6, 0.6)
