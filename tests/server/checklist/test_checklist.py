"""A robot's checklist: ticked by name, judged by telemetry, completed, overruled, expired."""

import asyncio
from datetime import UTC, datetime, timedelta

from db.query.mission.checklists import standing_runs
from db.query.station.events import newest_events
from server.access.role import Role
from server.checklist.delivered import DELIVERED
from server.checklist.state import TRANSITIONS
from tests.server.checklist.begun import (
    TANK_LIST,
    begin,
    complete,
    completed,
    dry,
    list_of,
    lists_of,
    ready,
    tick,
    tick_all,
)
from tests.server.conftest import GRACE, MINI, api_client, until
from tests.server.fake_link import state_report


async def texts(station, kind):
    events = await station.foundation.store.query(lambda s: newest_events(s, limit=200))
    return [one.text for one in events if one.kind == kind]


async def test_robot_in_a_tank_has_the_tanks_list_and_one_in_a_lake_the_lakes(client):
    tank = {one["template"] for one in (await lists_of(client))["lists"]}
    lake = {one["template"] for one in (await lists_of(client, GRACE))["lists"]}
    assert tank == {"pre_dive_tank", "daily", "recovery"}
    assert lake == {"pre_launch_lake", "daily", "recovery"}


async def test_automatic_items_show_the_value_and_why_they_do_not_pass(client, world):
    world.tell(state_report(MINI, (1.2, 0.6, 0.31), battery_fraction=0.22))

    async def there():
        items = {one["key"]: one for one in (await list_of(client))["items"]}
        return items if items["battery"]["now"]["text"] == "22 %" else None

    items = await until(there)
    assert (items["battery"]["is_done"], items["battery"]["limit_text"]) == (False, "at least 30 %")
    assert (items["depth_zero"]["is_done"], items["depth_zero"]["now"]["text"]) == (False, "0.31 m")
    assert items["leak"]["now"]["text"] == "The leak sensor is not told yet"
    assert not items["leak"]["is_done"], "what is not known is not known to be well"
    assert items["position"]["is_done"]
    assert "tank's frame" in items["position"]["now"]["text"]
    assert items["battery"]["now"]["at"] is not None


async def test_value_of_yesterday_at_this_hour_stands_beside_the_one_of_now(client, world, station):
    yesterday = datetime.now(UTC) - timedelta(days=1)
    for minutes, charge in ((-90, 0.3), (-4, 0.77), (25, 0.5)):
        at = yesterday + timedelta(minutes=minutes)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0), at, battery_fraction=charge))

    async def told():
        items = {one["key"]: one for one in (await list_of(client))["items"]}
        return items["battery"]["yesterday"] or None

    assert await until(told) == "77 %"


async def test_tick_has_name_and_time_and_stays_in_the_history_once_it_is_unticked(client):
    run = (await begin(client))["id"]
    assert (await tick(client, run, "hull", note="new ring")).status_code == 201
    assert (await tick(client, run, "hull", note="new ring")).status_code == 201
    assert (await tick(client, run, "hull", ticked=False)).status_code == 201
    items = {one["key"]: one for one in (await list_of(client))["items"]}
    assert items["hull"]["tick"] is None
    history = items["hull"]["history"]
    assert [(one["is_ticked"], one["note"]) for one in history] == [(True, "new ring"), (False, "")]
    assert {one["by"] for one in history} == {"test admin"}
    assert history[0]["at"] < history[1]["at"]


async def test_robot_answers_automatic_items_and_nobody_ticks_them(client):
    run = (await begin(client))["id"]
    answer = await tick(client, run, "battery")
    assert answer.status_code == 422
    assert "is answered by the robot" in answer.json()["errors"][0]["msg"]
    answer = await tick(client, run, "propeller")
    assert "hull" in answer.json()["errors"][0]["msg"], "it names what can be ticked"


async def test_list_is_complete_only_once_every_blocking_item_is(client, world):
    await ready(client, world)
    found = await begin(client)
    assert found["state"] == "open"
    refused = await complete(client, found["id"])
    assert refused.status_code == 409
    assert [one["loc"][1] for one in refused.json()["errors"]] == [
        "hull",
        "trim",
        "surface",
        "tank",
    ]
    await tick_all(client, found)
    assert (await complete(client, found["id"])).status_code == 200
    done = await list_of(client)
    assert (done["state"], done["settled_by"], done["lets_start"]) == (
        "complete",
        "test admin",
        True,
    )
    assert not next(one for one in done["items"] if one["key"] == "hook")["is_done"], "a warning"


async def test_values_are_kept_as_they_were_when_the_list_was_completed(client, world):
    await completed(client, world)
    world.tell(state_report(MINI, (1.2, 0.6, 0.0), battery_fraction=0.25))

    async def worse():
        found = await list_of(client)
        return found if found["open_blocking"] else None

    found = await until(worse)
    assert found["state"] == "complete"
    assert (found["open_blocking"], found["lets_start"]) == (["battery"], False)
    assert "Since then 1 blocking item is open again" in found["text"]
    battery = next(one for one in found["items"] if one["key"] == "battery")
    assert (battery["settled"]["text"], battery["now"]["text"]) == ("90 %", "25 %")
    past = (await client.get(f"/api/robots/{MINI}/checklists/past")).json()
    kept = next(one for one in past[0]["items"] if one["key"] == "battery")
    assert kept["settled"]["text"] == "90 %"


async def test_unticking_opens_a_complete_list_again(client, world, station):
    found = await completed(client, world)
    await tick(client, found["id"], "tank", ticked=False)
    again = await list_of(client)
    assert (again["state"], again["open_blocking"]) == ("open", ["tank"])
    assert await texts(station, "checklist.reopened")


async def test_overruling_needs_a_reason_and_what_turns_bad_later_blocks_again(
    client, world, station
):
    await ready(client, world)
    run = (await begin(client))["id"]
    path = f"/api/checklists/{run}/overrule"
    assert (await client.post(path, json={"reason": "  "})).status_code == 422
    answer = await client.post(path, json={"reason": "Tank test of the radio only"})
    assert answer.status_code == 200, answer.text
    found = await list_of(client)
    assert (found["state"], found["lets_start"]) == ("overruled", True)
    (said,) = await texts(station, "checklist.overruled")
    assert "Tank test of the radio only" in said
    assert "Nobody and nothing is in the tank" in said
    dry(world, leak=1.0)

    async def wet():
        now = await list_of(client)
        return "leak" in now["open_blocking"] and not now["lets_start"]

    await until(wet)


async def test_list_of_yesterday_counts_no_more_today(clock, client, world, station):
    short = DELIVERED[TANK_LIST].model_copy(update={"valid_h": 0.5}).model_dump(mode="json")
    body = {"template": short, "version": 0}
    assert (await client.put(f"/api/checklist-templates/{TANK_LIST}", json=body)).status_code == 200
    found = await completed(client, world)
    clock[0] = timedelta(minutes=31)
    assert (await list_of(client))["state"] == "not begun"
    assert (await tick(client, found["id"], "hook")).status_code == 409
    said = await until(lambda: _now(texts(station, "checklist.expired")))
    assert "its time was over" in said[0]


async def _now(asked):
    return await asked or None


async def test_list_ends_with_its_deployment(client, world, station):
    await completed(client, world)
    deployments = (await client.get(f"/api/deployments?robot={MINI}")).json()["deployments"]
    assert (await client.post(f"/api/deployments/{deployments[0]['id']}/end")).status_code == 200
    assert (await list_of(client))["state"] == "not begun"

    async def ended():
        return await station.foundation.store.query(lambda s: standing_runs(s, MINI)) == []

    await until(ended)


async def test_open_list_is_not_begun_twice_and_a_settled_one_is_begun_anew(client, world):
    first = await completed(client, world)
    second = await begin(client)
    assert (second["state"], second["id"] != first["id"]) == ("open", True)
    again = await client.post(f"/api/robots/{MINI}/checklists", json={"template": TANK_LIST})
    assert again.status_code == 409
    assert "is open already" in again.json()["detail"]


async def test_list_of_another_water_is_refused(client):
    answer = await client.post(
        f"/api/robots/{MINI}/checklists", json={"template": "pre_launch_lake"}
    )
    assert answer.status_code == 409
    assert "not for mini-1 in a tank" in answer.json()["detail"]


async def test_ticks_and_completion_at_the_same_moment_never_complete_an_open_list(client, world):
    await ready(client, world)
    found = await begin(client)
    await tick_all(client, found)
    run = found["id"]
    for _ in range(5):
        done, _ = await asyncio.gather(complete(client, run), tick(client, run, "tank", False))
        now = await list_of(client)
        assert now["state"] == "open", done.text
        assert now["open_blocking"] == ["tank"]
        assert (await tick(client, run, "tank")).status_code == 201


async def test_who_may_only_look_ticks_nothing(client, station):
    run = (await begin(client))["id"]
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await tick(viewer, run, "hull")).status_code == 403
        assert (await complete(viewer, run)).status_code == 403
        assert (await list_of(viewer))["state"] == "open"


def test_every_state_of_the_table_leads_somewhere_but_the_last():
    reached = {step.state for step in TRANSITIONS.values()}
    assert reached == {"open", "complete", "overruled", "expired"}
    assert "expired" not in {state for state, _ in TRANSITIONS}
