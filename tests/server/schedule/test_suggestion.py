"""Suggestions in contact: offered with their gain, in time or late, sent by themselves or not."""

import asyncio
from datetime import datetime
from functools import partialmethod

import pytest
import pytest_asyncio

from db.query.station.events import newest_events
from robot_link.messages import LinkState, OnboardPlanState, RobotMode
from server.access.role import Role
from server.base import wakeups
from server.base.event_bus import EventLogged
from server.base.worker import WorkerPool, WorkerTaskError
from server.lease.hold import AutomationHold
from server.link.moments import SURFACED
from server.schedule.replan import opportunity, suggestions
from server.schedule.replan.problem import Judged, SuggestionFound, SuggestionProblem
from tests.server.conftest import FAST, GRACE, MINI, api_client, open_station, until
from tests.server.fake_link import current_report, state_report
from tests.server.fake_worker import FakeWorkers
from tests.server.transfer.test_upload import DIVE, draft, plan_in, upload

QUICK = {**FAST, "planning_time_s": 1.0, "adaptive": {"rehearse": False}}
STAY_S = 120.0
"""At each surfacing the robot stays longer than a busy machine takes to suggest something."""
LASTING = {"draft_distance_m": 100.0, "draft_age_s": 3600.0, "turn_time_s": STAY_S}


@pytest.fixture(autouse=True)
def _hasty(monkeypatch):
    monkeypatch.setattr(wakeups, "LONGEST_S", 0.05)
    monkeypatch.setattr(suggestions, "QUIET_S", 0.05)


def judged(removed: float, duration_s: float = 240.0) -> Judged:
    return Judged(
        removed=removed,
        map_std=0.5,
        worst_map_std=1.2,
        objective=10.0 * removed,
        worst_position_std_m=0.2,
        energy=6.0,
        duration_s=duration_s,
        dives=2,
        flights=8,
    )


class Searchers(FakeWorkers):
    """Suggests dives in place, with a gain as it is wanted."""

    def __init__(self) -> None:
        super().__init__()
        self.removed = (0.20, 0.25)
        self.duration_s = (240.0, 240.0)
        self.asked: list[SuggestionProblem] = []
        self.may_suggest = asyncio.Event()
        self.may_suggest.set()
        self.breaks = False

    async def run(self, pool, task, payload, **more):
        if not isinstance(payload, SuggestionProblem):
            return await super().run(pool, task, payload, **more)
        self.asked.append(payload)
        await self.may_suggest.wait()
        if self.breaks:
            raise WorkerTaskError("ValueError: it is not finite")
        result = self.plan(payload.survey)
        keep, new = map(judged, self.removed, self.duration_s)
        return SuggestionFound(result, keep, new, samples=len(payload.survey.samples))


@pytest_asyncio.fixture
async def workers(monkeypatch):
    fake = Searchers()
    monkeypatch.setattr(WorkerPool, "run", partialmethod(FakeWorkers.run_for, fake))
    return fake


async def flying(client, world, config=None):
    """Return a searched plan that the robot flies, before its first leg."""
    config = config or {**QUICK, "mission": LASTING}
    plan = await draft(client, {"kind": "adaptive_survey", "config": config})
    await plan_in(client, plan, "draft")
    world.robots[MINI].may_fly.clear()
    await upload(client, plan, start=True)
    found = await plan_in(client, plan, "running")
    assert len(found["legs"]) >= 6, "three dives at least"
    return plan


def dive(world, leg=0):
    robot = world.robots[MINI]
    robot.leg = leg
    robot.say(OnboardPlanState.RUNNING)
    world.tell(state_report(MINI, (1.2, 0.6, 0.5), mode=RobotMode.GLIDING))


def surface(world, leg=2):
    robot = world.robots[MINI]
    robot.leg = leg
    robot.say(OnboardPlanState.RUNNING)
    world.tell(state_report(MINI, (1.2, 0.6, 0.0), mode=RobotMode.SURFACED))


async def surface_and_be_heard(station, world, leg=2):
    """Surface, and wait until the station has decided whether to suggest something for that."""
    told = asyncio.Event()
    station.foundation.bus.subscribe(
        EventLogged, lambda one: told.set() if one.event.kind == SURFACED else None
    )
    surface(world, leg)
    await told.wait()
    name = f"suggestion for {MINI}"
    await until(lambda: name not in {task.get_name() for task in asyncio.all_tasks()})


async def suggestion(client, robot=MINI):
    answer = await client.get(f"/api/robots/{robot}/suggestion")
    assert answer.status_code == 200, answer.text
    return answer.json()


async def suggested(client, *states):
    async def there():
        found = await suggestion(client)
        return found if found["state"] in states else None

    return await until(there)


async def contact(client, robot=MINI):
    return (await client.get(f"/api/robots/{robot}/contact")).json()


async def set_automation(client, **wish):
    answer = await client.patch("/api/config/automation", json=wish)
    assert answer.status_code == 200, answer.text


async def ask(client):
    return await client.post(f"/api/robots/{MINI}/suggestion")


async def at_a_surfacing(client, world):
    """Fly to the first surfacing, with nothing suggested by itself."""
    await set_automation(client, suggestions="asked")
    plan = await flying(client, world)
    dive(world)
    await until(lambda: _state(client, "closed"))
    surface(world)
    await until(lambda: _is_counted(client))
    return plan


async def _state(client, state):
    found = await contact(client)
    return found if found["state"] == state else None


async def _is_counted(client):
    found = await contact(client)
    return found if found["closes"] else None


async def test_better_plan_is_offered_with_its_gain_and_nothing_is_sent(
    client, station, world, workers
):
    plan = await at_a_surfacing(client, world)
    answer = await ask(client)
    assert answer.status_code == 202, answer.text
    found = await suggested(client, "replace")
    assert "Maps 25% more of the tank for the same battery" in found["text"]
    assert "20.0%" in found["text"]
    assert plan in found["text"]
    assert found["gain"] == pytest.approx(0.25)
    assert (found["surfacing"], found["timeliness"]) == ("now", "in_time")
    assert found["instead_of"] == plan
    assert "not measured" in found["basis"]
    assert found["fix_at"] is not None
    assert (found["plan_state"], found["keep"]["removed"]) == ("draft", 0.2)
    assert len(world.uploads) == 1, "the flown plan alone"
    # what is left is what is judged, from here, on the robot's own budget
    problem = workers.asked[0]
    legs = (await client.get(f"/api/plans/{plan}")).json()["legs"]
    assert len(problem.present) == len(legs) - 2
    assert problem.survey.start_xy == (1.2, 0.6)
    assert len(problem.survey.planned_points) == 0
    events = await station.foundation.store.query(newest_events)
    told = [one for one in events if one.kind == "plan.suggested"]
    assert [one.data["plan"] for one in told] == [found["plan"]]


@pytest.mark.parametrize(
    ("durations_s", "told"),
    [
        ((223.0, 258.0), "It takes 258 s instead of 223."),
        ((3595.0, 3700.0), "It takes 61.7 min instead of 59.9."),
    ],
)
async def test_times_that_differ_are_told_apart(client, world, workers, durations_s, told):
    workers.duration_s = durations_s
    await at_a_surfacing(client, world)
    await ask(client)
    assert (await suggested(client, "replace"))["text"].endswith(told)


async def test_taken_suggestion_waits_on_board_and_replaces_what_is_flown(client, world, workers):
    plan = await at_a_surfacing(client, world)
    await ask(client)
    found = await suggested(client, "replace")
    answer = await upload(client, found["plan"], start=True)
    assert answer.status_code == 202, answer.text
    await plan_in(client, found["plan"], "waiting")
    assert (await suggestion(client))["timeliness"] == "sent"
    world.robots[MINI].change_over()
    await plan_in(client, found["plan"], "running")
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "superseded"
    del workers


async def test_hardly_better_plan_is_not_offered(client, world, workers):
    plan = await at_a_surfacing(client, world)
    workers.removed = (0.20, 0.202)
    await ask(client)
    found = await suggested(client, "keep")
    assert found["text"].startswith(f"Keep {plan}: the new one is only 1% better")
    assert (found["plan"], found["timeliness"]) == (None, None)
    drafts = (await client.get(f"/api/robots/{MINI}/plans?state=draft")).json()
    assert drafts == []


async def test_too_late_is_said_and_the_present_plan_goes_on(client, world, workers):
    plan = await at_a_surfacing(client, world)
    await ask(client)
    await suggested(client, "replace")
    dive(world, leg=2)

    async def late():
        found = await suggestion(client)
        return found if found["timeliness"] == "late" else None

    found = await until(late)
    assert f"Too late for this surfacing; {plan} goes on" in found["timeliness_text"]
    assert "waits on board for the next surfacing" in found["timeliness_text"]
    del workers


async def test_in_a_dive_it_is_for_the_next_surfacing_and_the_dive_counts_for_both(
    client, world, workers
):
    await set_automation(client, suggestions="asked")
    plan = await flying(client, world)
    dive(world, leg=2)
    await until(lambda: _state(client, "closed"))
    assert (await ask(client)).status_code == 202
    found = await suggested(client, "replace")
    assert found["surfacing"] == "next"
    assert found["fix_at"] is None
    assert "no fix has confirmed" in found["basis"]
    legs = (await client.get(f"/api/plans/{plan}")).json()["legs"]
    problem = workers.asked[0]
    assert len(problem.present) == len(legs) - 4
    assert len(problem.survey.planned_points) > 0
    assert problem.survey.start_xy == pytest.approx(tuple(legs[3]["end_ned"][:2]))


async def test_surfacing_is_reason_enough_and_the_settings_can_forbid_it(
    client, station, world, workers
):
    await set_automation(client, suggestions="asked")
    await flying(client, world)
    dive(world)
    await until(lambda: _state(client, "closed"))
    await surface_and_be_heard(station, world)
    assert (await suggestion(client))["state"] == "none"
    assert workers.asked == []
    await set_automation(client, suggestions="offered")
    dive(world, leg=2)
    await until(lambda: _state(client, "closed"))
    surface(world, leg=4)
    found = await suggested(client, "replace")
    assert found["plan"] is not None
    assert len(world.uploads) == 1
    assert "a person sends them" in found["automation"]["text"]


async def test_surfacing_is_no_occasion_while_automation_is_held(client, station, world, workers):
    switch = station.foundation.services.get(AutomationHold)
    await flying(client, world)
    dive(world)
    await until(lambda: _state(client, "closed"))
    await switch.set(held=True, by="ann")
    await surface_and_be_heard(station, world)
    assert (await suggestion(client))["state"] == "none"
    assert workers.asked == []
    await switch.set(held=False, by="ann")
    dive(world, leg=2)
    await until(lambda: _state(client, "closed"))
    surface(world, leg=4)
    await suggested(client, "replace")
    assert len(workers.asked) == 1


async def test_sent_by_itself_within_the_limit_of_the_hour_alone(client, world, workers):
    await set_automation(client, suggestions="sent", most_sends_per_hour=1)
    await flying(client, world)
    dive(world)
    await until(lambda: _state(client, "closed"))
    surface(world)
    found = await suggested(client, "replace")
    await until(lambda: len(world.uploads) == 2)
    await plan_in(client, found["plan"], "waiting")
    automation = (await suggestion(client))["automation"]
    assert (automation["sent_last_hour"], automation["most_sends_per_hour"]) == (1, 1)
    assert automation["free_at"] is not None
    # the next one finds the hour used up, by the same count
    world.robots[MINI].change_over()
    await plan_in(client, found["plan"], "running")
    workers.removed = (0.2, 0.4)
    dive(world)
    await until(lambda: _state(client, "closed"))
    surface(world)

    async def another():
        newest = await suggestion(client)
        is_new = newest["state"] == "replace" and newest["plan"] != found["plan"]
        return newest if is_new else None

    second = await until(another)

    async def held():
        sends = (await client.get(f"/api/robots/{MINI}/schedule")).json()["sends"]
        texts = [one["text"] for one in sends if one["plan"] == second["plan"]]
        return next((text for text in texts if "the limit is 1" in text), None)

    assert await until(held)
    assert len(world.uploads) == 2


@pytest.mark.parametrize("body", [DIVE], ids=["legs by hand"])
async def test_plan_without_an_aim_is_refused_with_the_reason(client, world, body):
    plan = await draft(client, body)
    world.robots[MINI].may_fly.clear()
    await upload(client, plan, start=True)
    await plan_in(client, plan, "running")
    answer = await ask(client)
    assert answer.status_code == 409
    assert "laid out leg by leg" in answer.json()["detail"]
    found = await suggestion(client)
    assert (found["can_ask"], found["state"]) == (False, "none")
    assert "no aim" in found["why_not"]


async def test_robot_without_a_flown_plan_and_one_in_its_last_dive_are_refused(
    client, world, workers
):
    answer = await ask(client)
    assert answer.status_code == 409
    assert "of no plan that it flies one" in answer.json()["detail"]
    await set_automation(client, suggestions="asked")
    plan = await flying(client, world)
    legs = (await client.get(f"/api/plans/{plan}")).json()["legs"]
    dive(world, leg=len(legs) - 1)

    async def refused():
        detail = (await ask(client)).json().get("detail", "")
        return detail if "nothing to replace" in detail else None

    assert await until(refused)
    del workers


async def test_there_is_no_time_where_the_robot_comes_up_sooner(
    client, world, workers, monkeypatch
):
    monkeypatch.setattr(opportunity, "MARGIN_S", 3600.0)
    await set_automation(client, suggestions="asked")
    plan = await flying(client, world)
    dive(world)
    await until(lambda: _state(client, "closed"))
    answer = await ask(client)
    assert answer.status_code == 409
    assert "There is no time" in answer.json()["detail"]
    assert f"{plan} goes on" in answer.json()["detail"]
    del workers


async def test_search_is_a_job_that_can_be_cancelled(client, world, workers):
    plan = await at_a_surfacing(client, world)
    workers.may_suggest.clear()
    begun = (await ask(client)).json()
    assert (begun["kind"], begun["state"]) == ("suggestion", "running")
    assert (await client.get(f"/api/robots/{MINI}/suggestion")).json()["state"] == "searching"
    assert (await ask(client)).json()["id"] == begun["id"], "one search a robot"
    await until(lambda: workers.asked)
    await client.delete(f"/api/jobs/{begun['id']}")
    found = await suggested(client, "failed")
    assert "cancelled" in found["text"]
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "running"
    assert found["can_ask"]


async def test_search_that_breaks_says_so(client, world, workers):
    await at_a_surfacing(client, world)
    workers.breaks = True
    await ask(client)
    found = await suggested(client, "failed")
    assert "it is not finite" in found["text"]
    assert "The present plan goes on" in found["text"]


async def test_new_suggestion_takes_the_place_of_the_draft_before(client, world, workers):
    await at_a_surfacing(client, world)
    await ask(client)
    first = await suggested(client, "replace")
    await ask(client)

    async def other():
        found = await suggestion(client)
        return found if found["plan"] not in {None, first["plan"]} else None

    await until(other)
    assert (await client.get(f"/api/plans/{first['plan']}")).json()["state"] == "superseded"
    del workers


async def test_suggestion_survives_a_restart(tmp_path, world, workers):
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        await at_a_surfacing(client, world)
        await ask(client)
        before = await suggested(client, "replace")
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        after = await suggestion(client)
        for key in ("state", "text", "gain", "plan", "keep", "new", "judged_at", "until"):
            assert after[key] == before[key]
    del workers


async def test_contact_counts_down_from_the_robots_own_words(client, world, workers):
    unheard = await contact(client, GRACE)
    assert (unheard["state"], unheard["closes"], unheard["since"]) == ("unknown", None, None)
    idle = await contact(client)
    assert (idle["state"], idle["closes"], idle["opens"]) == ("open", None, None)
    assert "of no plan" in idle["text"]
    await set_automation(client, suggestions="asked")
    plan = await flying(client, world)
    dive(world)
    closed = await until(lambda: _state(client, "closed"))
    assert closed["closes"] is None
    assert plan in closed["opens"]["source"]
    surface(world)
    found = await until(lambda: _is_counted(client))
    since, closes = (datetime.fromisoformat(found[k]) for k in ("since",)), found["closes"]
    stay_s = (datetime.fromisoformat(closes["at"]) - next(since)).total_seconds()
    assert stay_s == pytest.approx(STAY_S, abs=0.01), "as the planner reckons"
    assert "planner" in closes["source"]
    assert found["earliest"]["source"] == "as the program on board is built"
    assert found["earliest"]["at"] < closes["at"] <= found["latest"]["at"] < found["opens"]["at"]
    assert found["link"] == "xbee"
    world.tell(state_report(MINI, (1.2, 0.6, 0.0), mode=RobotMode.HOLDING))

    async def held():
        one = await contact(client)
        return one if "until it is told" in one["text"] else None

    assert (await until(held))["closes"] is None
    world.hear(MINI, LinkState.STALE)

    async def unheard_now():
        one = await contact(client)
        return one if one["link"] == "" else None

    assert (await until(unheard_now))["heard_at"] is not None
    del workers
