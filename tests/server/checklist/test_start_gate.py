"""A start waits for the robot's checklist, whoever starts a plan and by whatever way."""

import asyncio
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest

from db.query.mission.transfers import newest_transfer
from db.query.station.events import newest_events
from robot_link.messages import CommandKind, OnboardPlanState
from server.checklist.checklists import Checklists
from tests.server.checklist.begun import (
    begin,
    complete,
    completed,
    dry,
    list_of,
    lists_of,
    ready,
    require,
    tick,
    tick_all,
)
from tests.server.conftest import FAST, GRACE, MINI, until
from tests.server.fake_link import state_report
from tests.server.far import draft as far_draft
from tests.server.far import far_station, place_under, settled
from tests.server.sky import ManualClock, Sky
from tests.server.survey.test_survey import mission_in
from tests.server.transfer.test_upload import draft, plan_in, upload


async def drafted(client):
    plan = await draft(client)
    await plan_in(client, plan, "draft")
    return plan


async def start(client, plan, **more):
    return await client.post(f"/api/plans/{plan}/upload", json={"start": True, **more})


async def test_start_is_refused_with_every_open_blocking_item(client, world):
    await require(client)
    await ready(client, world)
    plan = await drafted(client)
    answer = await start(client, plan)
    assert answer.status_code == 409
    problem = answer.json()
    assert [one["loc"] for one in problem["errors"]] == [
        ["checklist", key] for key in ("hull", "trim", "surface", "tank")
    ]
    assert "Pre-dive, tank of mini-1: 4 blocking items are open" in problem["detail"]
    assert world.uploads == []
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"


async def test_plan_starts_once_the_list_is_complete(client, world):
    await require(client)
    await completed(client, world)
    plan = await drafted(client)
    assert (await start(client, plan)).status_code == 202
    found = await plan_in(client, plan, "running", "done")
    assert found["checklist"] == ""


async def test_ticks_alone_start_nothing_until_a_person_completes_the_list(client, world):
    await require(client)
    await ready(client, world)
    await tick_all(client, await begin(client))
    answer = await start(client, await drafted(client))
    assert answer.status_code == 409
    assert "is not completed" in answer.json()["detail"]


async def test_plan_without_start_is_brought_on_board_and_its_start_waits(client, world):
    await require(client)
    plan = await drafted(client)
    assert (await upload(client, plan)).status_code == 202
    await plan_in(client, plan, "on_board")
    assert (await start(client, plan)).status_code == 409
    assert world.commands == []


async def test_overruled_start_is_logged_with_its_reason_and_shown_at_the_plan(
    client, world, station
):
    await require(client)
    await ready(client, world)
    plan = await drafted(client)
    answer = await start(client, plan, overrule="Only the radio is tried.")
    assert answer.status_code == 202, answer.text
    found = await plan_in(client, plan, "running", "done")
    assert found["checklist"] == "test admin overruled Pre-dive, tank: Only the radio is tried."
    events = await station.foundation.store.query(lambda s: newest_events(s, limit=200))
    (said,) = [one for one in events if one.kind == "checklist.overruled"]
    assert (said.by, said.level) == ("test admin", "warning")
    assert "Only the radio is tried" in said.text
    again = await drafted(client)
    assert (await start(client, again)).status_code == 202, "the list stays overruled"


async def test_item_that_turned_bad_after_completion_blocks_again(client, world):
    await require(client)
    await completed(client, world)
    dry(world, leak=1.0)
    await until(lambda: _wet(client))
    answer = await start(client, await drafted(client))
    assert answer.status_code == 409
    assert answer.json()["errors"][0]["loc"] == ["checklist", "leak"]
    assert "although it was complete" in answer.json()["detail"]


async def _wet(client):
    return "leak" in (await list_of(client))["open_blocking"]


async def test_robot_whose_settings_only_tell_starts_and_says_what_is_missing(client, world):
    found = await lists_of(client)
    assert (found["demand"], found["is_start_open"]) == ("told", True)
    assert found["start_text"] == "Pre-dive, tank is not complete."
    assert (await start(client, await drafted(client))).status_code == 202
    await require(client, start="off")
    assert (await lists_of(client))["start_text"] == ""


async def test_surface_now_is_never_gated(client, world):
    await require(client)
    answer = await client.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
    assert answer.status_code == 202
    await until(lambda: world.commands)
    # One leaves ahead of its row where the storage is slow, and one with it: both are the order.
    assert {kind for _, kind, _ in world.commands} == {CommandKind.SURFACE}


async def test_scheduled_send_waits_for_the_list_and_goes_once_it_is_complete(clock, client, world):
    await require(client)
    await ready(client, world)
    plan = await drafted(client)
    now = datetime.now(UTC)
    wish = {
        "condition": {"kind": "time", "at": now.isoformat()},
        "expires_at": (now + timedelta(minutes=30)).isoformat(),
    }
    clock[0] = timedelta(seconds=-30)  # for the station, now is still to come
    answer = await client.post(f"/api/plans/{plan}/schedule", json=wish)
    assert answer.status_code == 201, answer.text
    clock[0] = timedelta()

    async def held():
        (send,) = (await client.get(f"/api/robots/{MINI}/schedule")).json()["sends"]
        return "4 blocking items are open" in send["text"]

    await until(held)
    assert world.uploads == []
    found = await begin(client)
    await tick_all(client, found)
    assert (await complete(client, found["id"])).status_code == 200
    await plan_in(client, plan, "running", "done")


async def test_survey_is_not_started_over_an_open_list_and_is_with_a_reason(client, world, workers):
    await require(client)
    await ready(client, world)
    answer = await client.post(
        f"/api/robots/{MINI}/missions", json={"kind": "adaptive_survey", "config": FAST}
    )
    mission = answer.json()["id"]
    await mission_in(client, mission, "ready")
    refused = await client.post(f"/api/missions/{mission}/start")
    assert refused.status_code == 409
    assert "4 blocking items are open" in refused.json()["detail"]
    assert (await client.get(f"/api/missions/{mission}")).json()["state"] == "ready"
    body = {"overrule": "Trial of the search."}
    assert (await client.post(f"/api/missions/{mission}/start", json=body)).status_code == 202
    await until(lambda: world.uploads)


async def test_survey_that_starts_by_itself_stops_at_an_open_list(client, world, workers):
    await require(client)
    await ready(client, world)
    body = {"kind": "adaptive_survey", "config": FAST, "automation": True}
    mission = (await client.post(f"/api/robots/{MINI}/missions", json=body)).json()["id"]
    stopped = await mission_in(client, mission, "stopped")
    assert "4 blocking items are open" in stopped["message"]
    assert world.uploads == []


async def test_plan_by_satellite_waits_for_the_list_too(tmp_path, world, monkeypatch):
    sky = Sky(ManualClock())
    robot = place_under(sky, tmp_path)
    async with far_station(tmp_path, world, sky, monkeypatch) as (station, client):
        await robot.call()
        await settled(station)
        await require(client, GRACE)
        plan = (await far_draft(client))["id"]
        refused = await start(client, plan, route="satellite")
        assert refused.status_code == 409
        assert "Pre-launch, open water of grace-1" in refused.json()["detail"]
        store = station.foundation.store
        assert await store.query(lambda s: newest_transfer(s, plan)) is None
        answer = await start(client, plan, route="satellite", overrule="Launched by hand before.")
        assert answer.status_code == 202, answer.text


async def test_plan_that_replaces_a_flown_one_waits_for_what_still_means_something(client, world):
    await require(client)
    await completed(client, world)
    world.robots[MINI].may_fly.clear()
    flown = await drafted(client)
    await start(client, flown)
    await plan_in(client, flown, "running")
    world.robots[MINI].say(OnboardPlanState.RUNNING)
    world.tell(state_report(MINI, (1.2, 0.6, 0.5)))  # under water: no depth zero

    async def deep():
        items = {one["key"]: one for one in (await list_of(client))["items"]}
        return (
            items["depth_zero"]["now"]["text"] == "0.50 m" and not items["depth_zero"]["is_meant"]
        )

    await until(deep)
    second = await drafted(client)
    assert (await start(client, second)).status_code == 202
    await plan_in(client, second, "waiting", "sent")
    dry(world, leak=1.0)
    await until(lambda: _wet(client))
    third = await drafted(client)
    answer = await start(client, third)
    assert answer.status_code == 409
    blocking = {one["loc"][1] for one in answer.json()["errors"]}
    assert "leak" in blocking
    assert not blocking & {"link", "depth_zero", "hull"}


@pytest.mark.parametrize("first", ["tick", "start"])
async def test_item_unticked_at_the_moment_of_a_start_comes_before_or_after_it(
    client, world, first
):
    await require(client)
    found = await completed(client, world)
    plan = await drafted(client)
    both = [tick(client, found["id"], "tank", False), start(client, plan)]
    if first == "start":
        both.reverse()
    answers = await asyncio.gather(*both)
    started = answers[both.index(both[1])] if first == "tick" else answers[0]
    now = (await client.get("/api/events?limit=500")).json()["events"]
    kinds = [one["kind"] for one in now]
    if started.status_code == 202:
        assert plan in {one["data"].get("plan") for one in now if one["kind"] != "plan.planning"}
    else:
        assert started.status_code == 409
        assert "checklist.reopened" in kinds
        assert world.uploads == []


async def in_the_workshop(client, robot=GRACE):
    """End the deployment of a robot of the lake, whose list is asked for at a launch."""
    await require(client, robot)
    lake = (await client.get(f"/api/robots/{robot}")).json()["deployment"]["id"]
    assert (await client.post(f"/api/deployments/{lake}/end")).status_code == 200


async def launched(client, **more):
    now = datetime.now(UTC).isoformat()
    return await client.post("/api/deployments", json={"robot": GRACE, "started_at": now, **more})


async def test_launch_is_refused_with_every_open_item_and_leaves_no_deployment(client):
    await in_the_workshop(client)
    before = (await client.get("/api/deployments")).json()
    answer = await launched(client)
    assert answer.status_code == 409
    assert {"hull", "ballast", "recovery"} <= {one["loc"][1] for one in answer.json()["errors"]}
    assert "overrule it with a reason" in answer.json()["detail"]
    assert (await client.get("/api/deployments")).json() == before
    found = await lists_of(client, GRACE)
    assert (found["is_launch_open"], found["launch_text"]) == (
        False, "Pre-launch, open water is not complete; a launch is refused until then."
    )  # fmt: skip
    planned = (await client.post("/api/deployments", json={"robot": GRACE})).json()["id"]
    refused = await client.post(f"/api/deployments/{planned}/begin")
    assert refused.status_code == 409
    assert (await client.get(f"/api/deployments/{planned}")).json()["state"] == "planned"


async def test_overruled_launch_is_logged_with_its_reason_and_lets_its_first_plan_start(
    client, station
):
    await in_the_workshop(client)
    planned = (await client.post("/api/deployments", json={"robot": GRACE})).json()["id"]
    body = {"overrule": "The boat waits; a diver looked at the hull."}
    answer = await client.post(f"/api/deployments/{planned}/begin", json=body)
    assert answer.status_code == 200, answer.text
    assert answer.json()["state"] == "in_water"
    events = await station.foundation.store.query(lambda s: newest_events(s, limit=50))
    told = {one.kind: one for one in events}
    for kind in ("checklist.overruled", "deployment.began"):
        assert "a diver looked at the hull" in told[kind].text, kind
        assert told[kind].by == "test admin"
    found = await list_of(client, "pre_launch_lake", GRACE)
    assert (found["state"], found["lets_start"]) == ("overruled", True)


async def test_list_that_let_a_deployment_begin_stands_before_the_fleet_hears_of_it(
    client, station, monkeypatch
):
    await in_the_workshop(client)
    assert (await launched(client, overrule="The boat waits.")).status_code == 201
    checklists = station.foundation.services.get(Checklists)
    ashore = SimpleNamespace(
        knows=lambda _: True, status=lambda _: SimpleNamespace(deployment=None)
    )
    with monkeypatch.context() as late:
        late.setattr(checklists, "_fleet", ashore)
        await checklists._expire(GRACE)
    assert (await list_of(client, "pre_launch_lake", GRACE))["state"] == "overruled"


async def test_list_of_the_workshop_is_of_the_deployment_it_let_begin_and_ends_with_it(client):
    await in_the_workshop(client)
    run = await begin(client, "pre_launch_lake", GRACE)
    await tick_all(client, run)
    first = await launched(client, overrule="Its radio is off on the bench.")
    assert first.status_code == 201, first.text
    deployment = first.json()["id"]
    (kept,) = (await client.get(f"/api/robots/{GRACE}/checklists/past")).json()
    assert (kept["id"], kept["deployment"]) == (run["id"], deployment)
    assert (await client.post(f"/api/deployments/{deployment}/end")).status_code == 200
    assert (await launched(client)).status_code == 409, "each launch has a list of its own"


async def test_launch_is_not_held_by_settings_that_only_tell_nor_one_that_is_noted_afterwards(
    client,
):
    await in_the_workshop(client)
    now = datetime.now(UTC)
    noted = {
        "robot": GRACE,
        "started_at": (now - timedelta(days=9)).isoformat(),
        "ended_at": (now - timedelta(days=8)).isoformat(),
    }
    assert (await client.post("/api/deployments", json=noted)).status_code == 201
    await require(client, GRACE, start="told")
    assert (await launched(client)).status_code == 201


async def test_launch_and_untick_at_the_same_moment_never_leave_an_open_list_launched(
    client, world
):
    """The gate judges in the transaction of the launch: one comes before the other."""
    await in_the_workshop(client)
    run = await begin(client, "pre_launch_lake", GRACE)
    await tick_all(client, run)
    assert (await client.post(f"/api/checklists/{run['id']}/overrule",
                              json={"reason": "Bench."})).status_code == 200  # fmt: skip
    begun, unticked = await asyncio.gather(
        launched(client), tick(client, run["id"], "hull", ticked=False)
    )
    assert unticked.status_code in (200, 201)
    found = await list_of(client, "pre_launch_lake", GRACE)
    assert found["open_blocking"] == ["hull"]
    if begun.status_code == 201:
        assert (await client.get(f"/api/robots/{GRACE}")).json()["deployment"] is not None
    else:
        assert begun.status_code == 409
        assert [one["loc"] for one in begun.json()["errors"]] == [["checklist", "hull"]]
        assert (await client.get(f"/api/robots/{GRACE}")).json()["deployment"] is None
