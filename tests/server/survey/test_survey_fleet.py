"""Several robots of one site share a survey."""

import numpy as np
import pytest

from autonomy.site import TANK
from db.query.fleet.robots import add_robot
from robot_link.messages import RobotId
from server.survey import step as survey_step
from tests.server.conftest import FAST, GRACE, MINI, open_station, robot_record, until
from tests.server.fake_link import current_report, state_report
from tests.server.survey.test_plan_choice import mission_in

SECOND = RobotId("mini-2")


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch):
    monkeypatch.setattr(survey_step, "QUIET_S", 0.05)


@pytest.fixture
async def pair(station, world):
    """A second robot in the tank of the first."""
    await station.foundation.store.write(
        lambda session: add_robot(session, robot_record(SECOND, 7, "miniglider", TANK))
    )
    await station.refresh(SECOND)
    world.hear(SECOND)
    world.tell(state_report(SECOND, (2.0, 0.6, 0.0)))


async def ask(client, *robots, **config):
    body = {"robots": list(robots), "config": {**FAST, **config}, "automation": False}
    return await client.post("/api/surveys", json=body)


async def test_second_robot_is_planned_for_after_the_first_and_counts_its_plan(
    client, pair, workers
):
    workers.may_plan.clear()
    answer = await ask(client, MINI, SECOND)
    assert answer.status_code == 202, answer.text
    missions = answer.json()["missions"]
    assert [one["robot"] for one in missions] == [MINI, SECOND]
    await until(lambda: workers.problems)
    assert len(workers.problems) == 1
    plans = [(await client.get(f"/api/robots/{one}/plans")).json()[0] for one in (MINI, SECOND)]
    whole = [(await client.get(f"/api/plans/{one['id']}")).json() for one in plans]
    assert [one["stage"] for one in whole] == ["searching", "waiting"]
    workers.may_plan.set()
    first, second = [await mission_in(client, one["mission"], "ready") for one in missions]
    assert first["fleet"] == second["fleet"] == [one["mission"] for one in missions]
    plan = (await client.get(f"/api/plans/{first['plan_id']}")).json()
    here, there = workers.problems
    assert len(here.planned_points) == 0
    np.testing.assert_array_equal(there.planned_points, np.array(plan["points"])[:, 1:4])
    np.testing.assert_array_equal(there.planned_std_m, np.array(plan["points"])[:, 4])


async def test_robots_of_a_site_plan_with_the_samples_of_all(client, station, pair, world, workers):
    world.robots[MINI].sample((1.0, 0.5, 0.2))
    await station.ingest.settle()
    answer = await ask(client, SECOND)
    await mission_in(client, answer.json()["missions"][0]["mission"], "ready")
    assert workers.problems[0].samples.points.tolist() == [[1.0, 0.5, 0.2]]


async def test_draft_of_a_survey_that_was_stopped_does_not_count(client, pair, workers):
    alone = (await ask(client, MINI)).json()["missions"][0]["mission"]
    await mission_in(client, alone, "ready")
    assert (await client.post(f"/api/missions/{alone}/stop")).status_code == 202
    other = (await ask(client, SECOND)).json()["missions"][0]["mission"]
    await mission_in(client, other, "ready")
    assert len(workers.problems[1].planned_points) == 0


async def test_robots_that_do_not_fit_together_are_named(client, pair, workers):
    refused = await ask(client, MINI, GRACE, "nobody", MINI)
    assert refused.status_code == 422
    errors = refused.json()["errors"]
    assert [error["loc"] for error in errors] == [["robots", number] for number in (1, 2, 3)]
    assert "grace-1 works at Practice lake, not with mini-1 at Test tank" in errors[0]["msg"]
    assert "no robot 'nobody'" in errors[1]["msg"]
    assert "named twice" in errors[2]["msg"]
    assert (await client.post("/api/surveys", json={"robots": []})).status_code == 422
    assert (await client.get("/api/robots/mini-1/missions")).json() == []


async def test_robot_that_cannot_take_part_keeps_the_others_from_beginning(client, pair, world):
    world.tell(state_report(SECOND, (3.5, 2.1, 0.0)))
    refused = await ask(client, MINI, SECOND, total_budget=4.0, round_budget=2.5)
    assert refused.status_code == 409
    assert SECOND in refused.json()["detail"]
    assert (await client.get("/api/robots/mini-1/missions")).json() == []


async def test_survey_of_two_goes_on_after_the_station_stopped(tmp_path, world, workers):
    workers.may_plan.clear()
    async with open_station(tmp_path, world) as station:
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        await station.foundation.store.write(
            lambda session: add_robot(session, robot_record(SECOND, 7, "miniglider", TANK))
        )
        await station.refresh(SECOND)
        world.tell(state_report(SECOND, (2.0, 0.6, 0.0)))
        both = await station.surveys.create_all([MINI, SECOND], FAST, automation=False, by="test")
        await until(lambda: workers.problems)
    workers.problems.clear()
    workers.may_plan.set()
    async with open_station(tmp_path, world) as station:

        async def ready():
            states = [(await station.missions.get(mission)).state for mission in both]
            return states == ["ready", "ready"]

        await until(ready)
    assert sorted(len(one.planned_points) > 0 for one in workers.problems) == [False, True]
