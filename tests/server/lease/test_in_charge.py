"""Who may send a robot something: one place asks, whichever route it is."""

import asyncio

import pytest

from server.access.dependency import TAKEN_HEADER
from server.access.role import Role
from tests.server.conftest import GRACE, MINI
from tests.server.lease.conftest import act, lease_of
from tests.server.transfer.test_upload import DIVE


async def order(client, robot=MINI, kind="hold"):
    return await client.post(f"/api/robots/{robot}/commands", json={"kind": kind})


async def test_one_person_alone_is_never_hindered_and_is_told_that_they_are_in_charge(person):
    ann = await person("ann")
    sent = await order(ann)
    assert sent.status_code == 202, sent.text
    assert sent.headers[TAKEN_HEADER] == MINI
    lease = await lease_of(ann)
    assert lease["is_mine"]
    assert lease["reason"].endswith("by the first order, plan or setting that they sent.")
    again = await order(ann)
    assert again.status_code == 202
    assert TAKEN_HEADER not in again.headers


async def test_another_pilot_may_draft_but_not_send(person):
    ann, ben = await person("ann"), await person("ben")
    await order(ann)
    refused = await order(ben)
    assert refused.status_code == 409
    assert "ann is in charge of mini-1" in refused.json()["detail"]
    assert "request it" in refused.json()["detail"]
    settings = await ben.patch("/api/config/planner", params={"robot": MINI}, json={})
    assert settings.status_code == 409
    draft = await ben.post(f"/api/robots/{MINI}/plans", json=DIVE)
    assert draft.status_code == 202, draft.text
    assert (await order(ben, GRACE)).status_code == 202, "another robot is another lease"


@pytest.mark.parametrize(
    ("kind", "patch"),
    [("delivery", {"project": "Lake survey"}), ("quality", {"depth": {"margin_m": 3.0}})],
)
async def test_what_is_said_of_data_needs_nobody_in_charge(person, kind, patch):
    ann, ben = await person("ann"), await person("ben")
    changed = await ann.patch(f"/api/config/{kind}", params={"robot": MINI}, json=patch)
    assert changed.status_code == 200, changed.text
    assert not (await lease_of(ann))["holder"]
    await order(ann)
    other = await ben.patch(f"/api/config/{kind}", params={"robot": MINI}, json=patch)
    assert other.status_code == 200, other.text


async def test_anybody_surfaces_a_robot_at_once_whoever_is_in_charge(person, script):
    ann, ben = await person("ann"), await person("ben")
    planner = await script("planner")
    await order(ann)
    await ben.put("/api/automation", json={"is_held": True})
    for client in (ben, planner):
        answer = await order(client, kind="surface")
        assert answer.status_code == 202, answer.text
    assert (await lease_of(ann))["holder"] == "ann", "to surface takes nothing from anybody"


async def test_settings_for_all_robots_wait_for_who_is_in_charge_of_one(person):
    ann, ben = await person("ann"), await person("ben")
    await order(ann)
    refused = await ben.patch("/api/config/planner", json={})
    assert refused.status_code == 409
    assert "This reaches every robot. ann is in charge of mini-1" in refused.json()["detail"]
    assert (await ann.patch("/api/config/planner", json={})).status_code == 200
    assert (await lease_of(ann, GRACE))["state"] == "free", "it takes charge of no robot"


async def test_of_two_who_order_at_once_one_is_in_charge_and_the_other_is_told(person):
    people = [await person(name) for name in ("ann", "ben")]
    answers = await asyncio.gather(*(order(client) for client in people))
    assert sorted(answer.status_code for answer in answers) == [202, 409]
    holder = (await lease_of(people[0]))["holder"]
    loser = next(answer for answer in answers if answer.status_code == 409)
    assert f"{holder} is in charge" in loser.json()["detail"]


async def test_a_script_that_acts_on_a_free_robot_is_in_charge_until_a_person_acts(person, script):
    ann, planner, other = await person("ann"), await script("planner"), await script("other")
    assert (await order(planner)).status_code == 202
    refused = await order(other)
    assert refused.status_code == 409
    assert "The script planner is in charge of mini-1" in refused.json()["detail"]
    assert (await order(ann)).status_code == 202
    refused = await order(planner)
    assert refused.status_code == 409
    assert "ask them to let this script act" in refused.json()["detail"]


async def test_a_script_acts_under_a_person_s_lease_once_that_person_lets_it(person, script):
    ann, ben = await person("ann"), await person("ben")
    planner, same_name = await script("planner"), await script("planner")
    await order(ann)
    await order(planner)
    asking = (await lease_of(ann))["asking"]
    assert asking["name"] == "planner"
    way = f"/api/robots/{MINI}/lease/script"
    assert (await ben.put(way, json={"token": asking["token"]})).status_code == 409
    let = await ann.put(way, json={"token": asking["token"]})
    assert let.json()["script"] == "planner"
    assert (await order(planner)).status_code == 202
    assert (await order(same_name)).status_code == 409, "another token of that name is another"
    assert (await ann.put(way, json={"token": None})).json()["script"] == ""
    assert (await order(planner)).status_code == 409


async def test_a_script_s_leave_ends_with_the_lease(person, script):
    ann, ben, planner = await person("ann"), await person("ben"), await script("planner")
    await order(ann)
    await order(planner)
    token = (await lease_of(ann))["asking"]["token"]
    await ann.put(f"/api/robots/{MINI}/lease/script", json={"token": token})
    await lease_of(ben)
    await act(ann, "hand_over", to="ben")
    assert (await lease_of(ben))["script"] == ""
    assert (await order(planner)).status_code == 409


async def test_a_script_that_has_fallen_silent_makes_room_for_another(script, hours):
    planner, other = await script("planner"), await script("other")
    await order(planner)
    assert (await order(other)).status_code == 409
    hours.passed_s = 301.0
    assert (await order(other)).status_code == 202


async def test_a_script_with_a_new_token_is_the_same_script(script):
    planner, renewed = await script("planner"), await script("planner")
    assert (await order(planner)).status_code == 202
    assert (await order(renewed)).status_code == 202


@pytest.mark.parametrize("role", Role)
@pytest.mark.parametrize("whose", ["nobody", "mine", "another", "a script"])
async def test_role_and_lease_together_decide_who_may_send(person, script, role, whose):
    """Every role by every holder: the right first, then the lease."""
    ann, me = await person("ann"), await person("me", role)
    match whose:
        case "another":
            await act(ann, "take")
        case "a script":
            await act(await script("planner"), "take")
        case "mine" if role in (Role.PILOT, Role.ADMIN):
            await act(me, "take")
    may_pilot = role in (Role.PILOT, Role.ADMIN)
    sent, surfaced = await order(me), await order(me, kind="surface")
    expected = 403 if not may_pilot else 409 if whose == "another" else 202
    assert sent.status_code == expected, sent.text
    assert surfaced.status_code == (202 if may_pilot else 403)


async def test_an_unknown_robot_and_a_recording_are_answered_by_their_route(person):
    ann = await person("ann")
    assert (await order(ann, "mini-9")).status_code == 404
    assert (await act(ann, "take", "mini-9")).status_code == 404


async def test_a_send_goes_on_when_its_holder_has_gone_and_says_who_began_it(person, world, hours):
    """It is the station's: what ann sent waits for the radio, and ben sees whose it is."""
    del world
    ann, ben = await person("ann"), await person("ben")
    sent = (await order(ann)).json()["id"]
    await ann.aclose()
    hours.passed_s = 301.0
    await act(ben, "take")
    command = (await ben.get(f"/api/commands/{sent}")).json()
    assert command["level"] not in ("refused", "expired")
    events = (await ben.get("/api/events", params={"robot": MINI, "limit": 50})).json()["events"]
    assert next(one for one in events if one["kind"] == "command.hold")["by"] == "ann"
