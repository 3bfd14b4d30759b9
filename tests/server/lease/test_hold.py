"""Hold automation: one switch for every script and for everything that sends or plans by itself."""

from datetime import UTC, datetime, timedelta

import pytest

from server.access.role import Role
from server.lease.hold import AutomationHold
from server.schedule.schedule import Schedule
from tests.server.conftest import FAST, GRACE, MINI, open_station, until
from tests.server.lease.conftest import act, let_pilot, person_at
from tests.server.schedule.test_schedule import send_in
from tests.server.station_parts import OpenStation
from tests.server.transfer.test_upload import DIVE, plan_in


async def hold(client, is_held=True, reason=""):
    return await client.put("/api/automation", json={"is_held": is_held, "reason": reason})


async def test_every_page_is_told_who_holds_automation_and_since_when(person):
    ann, ben = await person("ann"), await person("ben")
    assert (await ben.get("/api/automation")).json()["is_held"] is False
    assert (await hold(ann, reason="a script runs wild")).status_code == 200
    seen = (await ben.get("/api/automation")).json()
    assert (seen["is_held"], seen["by"], seen["reason"]) == (True, "ann", "a script runs wild")
    assert seen["since"] is not None
    again = await hold(ben)
    assert again.status_code == 409
    assert again.json()["detail"].startswith("ann holds the automation")
    assert (await hold(ben, is_held=False)).json()["text"] == ""
    events = (await ann.get("/api/events", params={"limit": 50})).json()["events"]
    told = [(one["kind"], one["by"]) for one in events if one["kind"].startswith("automation.")]
    assert told == [("automation.held", "ann"), ("automation.resumed", "ben")]


async def test_who_pilots_one_robot_may_hold_automation_but_not_let_it_go_on_for_all(
    station: OpenStation, person
):
    ann, ben = await person("ann"), await person("ben", Role.NONE)
    await let_pilot(station, "ben", MINI)
    assert (await hold(ben)).status_code == 200
    refused = await hold(ben, is_held=False)
    assert refused.status_code == 403
    assert "all of them" in refused.json()["detail"]
    assert (await ann.get("/api/automation")).json()["is_held"] is True
    told = (await ben.get("/api/automation")).json()["refusal"]
    assert told == refused.json()["detail"], "the app disables the button with the same reason"
    assert (await ann.get("/api/automation")).json()["refusal"] == ""
    await let_pilot(station, "ben", MINI, GRACE)
    assert (await ben.get("/api/automation")).json()["refusal"] == ""
    assert (await hold(ben, is_held=False)).status_code == 200
    eye = await person("eye", Role.VIEWER)
    assert "pilots no robot" in (await eye.get("/api/automation")).json()["refusal"]
    assert (await hold(eye)).status_code == 403


CHANGES = [
    ("POST", f"/api/robots/{MINI}/commands", {"kind": "hold"}),
    ("POST", f"/api/robots/{MINI}/plans", DIVE),
    ("PATCH", "/api/config/planner", {}),
    ("POST", f"/api/robots/{MINI}/lease", {"act": "take"}),
    ("POST", "/api/channels", {}),
    ("POST", "/api/people", {}),
    ("PUT", "/api/automation", {"is_held": False}),
]


@pytest.mark.parametrize(("method", "path", "body"), CHANGES)
async def test_a_script_changes_nothing_while_automation_is_held(
    person, client, method, path, body
):
    """``client`` is a script with every right there is."""
    ann = await person("ann")
    await hold(ann)
    refused = await client.request(method, path, json=body)
    assert refused.status_code == 423
    assert refused.json()["detail"].startswith("ann holds the automation of the station.")
    assert (await client.get("/api/robots")).status_code == 200, "it may look on"
    await hold(ann, is_held=False)
    assert (await client.request(method, path, json=body)).status_code != 423


async def test_a_script_may_hold_automation_but_not_let_it_go_on(client, person):
    assert (await hold(client)).status_code == 200
    assert (await hold(client, is_held=False)).status_code == 423
    assert (await hold(await person("ann"), is_held=False)).status_code == 200


async def test_a_person_goes_on_as_before_while_automation_is_held(person):
    ann = await person("ann")
    await hold(ann)
    sent = await ann.post(f"/api/robots/{MINI}/commands", json={"kind": "hold"})
    assert sent.status_code == 202


async def test_the_switch_is_kept_when_the_station_is_started_anew(tmp_path, world):
    async with open_station(tmp_path, world) as station, person_at(station, "ann") as ann:
        await hold(ann, reason="night")
    async with open_station(tmp_path, world) as station, person_at(station, "ann") as ann:
        assert (await ann.get("/api/automation")).json()["reason"] == "night"
        assert station.foundation.services.get(AutomationHold).is_held


async def scheduled(client, in_s):
    plan = (await client.post(f"/api/robots/{MINI}/plans", json=DIVE)).json()["id"]
    await plan_in(client, plan, "draft")
    now = datetime.now(UTC)
    wish = {
        "condition": {"kind": "time", "at": (now + timedelta(seconds=in_s)).isoformat()},
        "expires_at": (now + timedelta(minutes=5)).isoformat(),
    }
    sent = await client.post(f"/api/plans/{plan}/schedule", json=wish)
    assert sent.status_code == 201, sent.text
    return plan, sent.json()["id"]


async def test_a_scheduled_send_waits_while_automation_is_held_and_goes_on_after(
    station: OpenStation, person, world, hours
):
    ann = await person("ann")
    _, send = await scheduled(ann, in_s=60.0)
    await hold(ann, reason="look first")
    hours.passed_s = 61.0
    station.foundation.services.get(Schedule).wake(MINI)

    async def said() -> bool:
        sends = (await ann.get(f"/api/robots/{MINI}/schedule")).json()["sends"]
        return "held: ann holds the automation of the station: look first" in sends[0]["text"]

    await until(said)
    assert not world.uploads
    await hold(ann, is_held=False)
    await send_in(ann, send, "sent", "done")


async def mission_of(client, mission):
    return (await client.get(f"/api/missions/{mission}")).json()


async def test_a_survey_sends_no_round_while_automation_is_held(person, world, workers):
    del workers
    ann = await person("ann")
    await hold(ann)
    body = {"kind": "adaptive_survey", "config": FAST, "automation": True}
    made = await ann.post(f"/api/robots/{MINI}/missions", json=body)
    assert made.status_code == 202, made.text
    mission = made.json()["id"]

    async def drafted() -> str | None:
        plan = (await mission_of(ann, mission))["plan_id"]
        found = {} if plan is None else (await ann.get(f"/api/plans/{plan}")).json()
        return plan if found.get("state") == "draft" else None

    plan = await until(drafted)
    assert not world.uploads
    await hold(ann, is_held=False)
    await plan_in(ann, plan, "sent", "on_board", "running", "done")


async def test_surface_now_ends_what_waits_to_be_sent_by_itself_whoever_is_in_charge(person):
    ann, ben = await person("ann"), await person("ben")
    plan = (await ann.post(f"/api/robots/{MINI}/plans", json=DIVE)).json()["id"]
    await plan_in(ann, plan, "draft")
    later = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    end = (datetime.now(UTC) + timedelta(hours=2)).isoformat()
    wish = {"condition": {"kind": "time", "at": later}, "expires_at": end}
    send = (await ann.post(f"/api/plans/{plan}/schedule", json=wish)).json()["id"]
    assert (await act(ann, "take", GRACE)).status_code == 200
    order = await ben.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
    assert order.status_code == 202
    await send_in(ann, send, "withdrawn")
    assert (await ann.get(f"/api/robots/{MINI}/lease")).json()["holder"] == "ann"
