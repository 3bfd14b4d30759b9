"""Templates of checklists: refused where they make no sense, kept version by version."""

import pytest

from server.access.role import Role
from server.checklist.check import CHECKS
from server.checklist.delivered import DELIVERED
from tests.server.checklist.begun import TANK_LIST, begin, list_of, lists_of
from tests.server.conftest import api_client

PATH = "/api/checklist-templates"


def document(*items, **more):
    return {"title": "Camera", "act": "start", "items": list(items), **more}


def asks(check, **more):
    return {"key": "one", "text": "It is so", "kind": "automatic", "check": check, **more}


TICK = {"key": "lens", "text": "The lens is clean"}


async def add(client, *items, key="camera", **more):
    return await client.post(PATH, json={"key": key, "template": document(*items, **more)})


async def test_template_with_an_unknown_check_is_refused_by_name_with_those_there_are(client):
    answer = await add(client, TICK, asks("propeller"))
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert error["loc"][:3] == ["template", "items", 1]
    assert "there is no check 'propeller'" in error["msg"]
    assert all(key in error["msg"] for key in CHECKS)


@pytest.mark.parametrize(
    ("item", "words"),
    [
        (asks("battery", limit=101.0), "the limit of battery is 0 to 100 %, not 101"),
        (asks("leak", limit=1.0), "the check leak takes no limit"),
        ({**TICK, "check": "leak"}, "a manual item has no check"),
        ({**TICK, "key": "Lens"}, "pattern"),
        ({**TICK, "colour": "red"}, "there is no such field"),
    ],
)
async def test_item_that_makes_no_sense_is_refused_with_the_reason(client, item, words):
    answer = await add(client, item)
    assert answer.status_code == 422
    assert words in answer.json()["errors"][0]["msg"]


async def test_item_is_there_once(client):
    answer = await add(client, TICK, TICK)
    assert "two items have the key 'lens'" in answer.json()["errors"][0]["msg"]


async def test_own_template_applies_where_it_says_and_is_put_away(client):
    assert (await add(client, TICK, waters=["tank"])).status_code == 201
    assert (await add(client, TICK)).status_code == 409
    assert (await list_of(client, "camera"))["act_text"] == "before a plan is started"
    lake = {one["template"] for one in (await lists_of(client, "grace-1"))["lists"]}
    assert "camera" not in lake
    left = await client.delete(f"{PATH}/camera")
    assert "camera" not in {one["key"] for one in left.json()}
    assert (await client.delete(f"{PATH}/camera")).status_code == 404
    versions = (await client.get(f"{PATH}/{TANK_LIST}/versions")).json()
    assert versions == []


async def test_change_is_a_version_with_its_author_and_a_run_keeps_its_own(client):
    await begin(client)
    one = DELIVERED[TANK_LIST].model_dump(mode="json")
    body = {"template": {**one, "items": one["items"][:9]}, "version": 0}
    changed = (await client.put(f"{PATH}/{TANK_LIST}", json=body)).json()
    assert (changed["version"], changed["origin"]) == (1, "changed")
    assert changed["saved_by"] == "test admin"
    assert len((await list_of(client))["items"]) == len(one["items"])
    late = await client.put(f"{PATH}/{TANK_LIST}", json=body)
    assert late.status_code == 409
    assert "test admin changed it meanwhile" in late.json()["detail"]
    reset = (await client.delete(f"{PATH}/{TANK_LIST}")).json()
    now = {one["key"]: one for one in reset}[TANK_LIST]
    assert (now["origin"], now["version"]) == ("delivered", 2)
    assert now["template"] == one
    versions = (await client.get(f"{PATH}/{TANK_LIST}/versions")).json()
    assert [one["version"] for one in versions] == [2, 1]
    assert versions[0]["template"] is None


async def test_templates_are_changed_by_admins_alone(client, station):
    async with api_client(station, Role.PILOT) as pilot:
        assert (await add(pilot, TICK)).status_code == 403
        assert (await pilot.delete(f"{PATH}/{TANK_LIST}")).status_code == 403
        assert (await pilot.get(PATH)).status_code == 200


async def test_checks_are_told_with_their_limits(client):
    told = {one["key"]: one for one in (await client.get("/api/checklist-checks")).json()}
    assert set(told) == set(CHECKS)
    assert told["battery"]["limit"]["unit"] == "%"
    assert told["leak"]["limit"] is None
