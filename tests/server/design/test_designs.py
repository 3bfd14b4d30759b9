"""Designs by REST: kept with every change, told apart, compared, made plans of."""

import json

import numpy as np
import pytest

from tests.server.conftest import MINI, until


def waypoints(*places, **more):
    named = [{"north_m": north, "east_m": east} for north, east in places]
    return {"content": {"kind": "waypoints", "waypoints": named}, **more}


LINE = waypoints((0.4, 0.3), (2.3, 0.3), (2.3, 1.0))


async def begun(client, document=LINE, **more):
    body = {"name": "Line", "document": document, **more}
    answer = await client.post(f"/api/robots/{MINI}/designs", json=body)
    assert answer.status_code == 201, answer.text
    return answer.json()


async def put(client, design, document, what="Moved", revision=None):
    number = design["revision"] if revision is None else revision
    return await client.put(
        f"/api/designs/{design['id']}/document",
        json={"document": document, "what": what},
        headers={"If-Match": f'"{number}"'},
    )


async def ask(client, design, verb, **body):
    headers = {"If-Match": f'"{design["revision"]}"'}
    path = f"/api/designs/{design['id']}/{verb}"
    return await client.post(path, json=body or None, headers=headers)


def east_of(design, number):
    return design["document"]["content"]["waypoints"][number]["east_m"]


async def test_each_change_is_a_step_that_is_undone_and_done_again(client):
    design = await begun(client)
    moved = (await put(client, design, waypoints((0.4, 0.3), (2.3, 0.5)), "Moved 2")).json()
    assert moved["undo"] == ["Moved 2"]
    undone = (await ask(client, moved, "undo")).json()
    assert (east_of(undone, 1), undone["redo"]) == (0.3, ["Moved 2"])
    again = (await ask(client, undone, "redo")).json()
    assert east_of(again, 1) == 0.5
    nothing = await ask(client, again, "redo")
    assert (nothing.status_code, nothing.json()["detail"]) == (
        409,
        f"{design['id']} has nothing to do again.",
    )


async def test_a_change_without_its_revision_or_from_an_older_one_is_refused(client):
    design = await begun(client)
    newest = (await put(client, design, waypoints((1.0, 1.0)), "Cut")).json()
    late = await put(client, design, waypoints((0.1, 0.1)), "Late")
    assert late.status_code == 412
    assert "(Cut)" in late.json()["detail"]
    assert late.headers["ETag"] == f'"{newest["revision"]}"'
    kept = (await client.get(f"/api/designs/{design['id']}")).json()
    assert kept["document"] == newest["document"]
    path = f"/api/designs/{design['id']}/document"
    body = {"document": LINE, "what": "Blind"}
    assert (await client.put(path, json=body)).status_code == 428
    bad = await client.put(path, json=body, headers={"If-Match": "x"})
    assert bad.status_code == 400


@pytest.mark.parametrize(
    ("document", "where"),
    [
        (waypoints((0.0, 1e7)), ["document", "content", "waypoints", "waypoints", 0, "east_m"]),
        (
            {"content": {"kind": "lawnmower", "area": [{"north_m": 0, "east_m": 0}]}},
            ["document", "content", "lawnmower", "area"],
        ),
        ({"manner": {"shallow_m": 3.0, "deep_m": 2.0}}, ["document", "manner"]),
        ({"content": {"kind": "zigzag"}}, ["document", "content"]),
        (waypoints((0.0, 0.0), depth=3), ["document", "depth"]),
    ],
)
async def test_a_document_that_is_none_is_refused_by_its_field(client, document, where):
    design = await begun(client)
    answer = await put(client, design, document)
    assert answer.status_code == 422
    assert [error["loc"] for error in answer.json()["errors"]] == [where]


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999"])
async def test_a_number_that_is_none_is_not_json(client, number):
    design = await begun(client)
    body = json.dumps({"document": waypoints((0.0, 0.0)), "what": "Moved"})
    answer = await client.put(
        f"/api/designs/{design['id']}/document",
        content=body.replace('"east_m": 0.0', f'"east_m": {number}'),
        headers={"Content-Type": "application/json", "If-Match": f'"{design["revision"]}"'},
    )
    assert answer.status_code == 422, answer.text
    assert "not JSON" in answer.json()["detail"]


async def test_versions_are_compared_and_restored(client):
    design = await begun(client)
    saved = (await ask(client, design, "versions", comment="As agreed")).json()
    other = (await put(client, saved, waypoints((0.4, 0.3), (2.3, 0.6), (2.3, 1.0)))).json()
    path = f"/api/designs/{design['id']}/difference?first=version:1&second=working"
    found = (await client.get(path)).json()
    assert [(one["title"], one["first"], one["second"]) for one in found["fields"]] == [
        ("waypoint 2, east m", "0.3", "0.6")
    ]
    assert {one["change"] for one in found["legs"]} >= {"moved"}
    back = (await ask(client, other, "restore", version=1)).json()
    assert east_of(back, 1) == 0.3
    assert back["undo"][0] == "Back to version 1"


async def test_a_copy_is_shifted_as_a_whole(client):
    design = await begun(client)
    rng = np.random.default_rng()
    north, east = rng.uniform(-0.2, 0.2, 2).round(3).tolist()
    body = {"name": "B", "design": design["id"], "shift_north_m": north, "shift_east_m": east}
    copied = (await client.post(f"/api/robots/{MINI}/designs", json=body)).json()
    pairs = zip(
        design["document"]["content"]["waypoints"],
        copied["document"]["content"]["waypoints"],
        strict=True,
    )
    for before, after in pairs:
        assert after["north_m"] - before["north_m"] == pytest.approx(north)
        assert after["east_m"] - before["east_m"] == pytest.approx(east)


async def test_a_template_without_its_parameter_is_refused_by_its_name(client):
    document = {
        "content": {
            "kind": "star",
            "centre": {"north_m": 1.3, "east_m": 0.7},
            "radius_m": 0.4,
        }
    }
    parameters = [
        {
            "key": "radius",
            "title": "Radius",
            "unit": "m",
            "low": 0.2,
            "high": 0.6,
            "paths": ["/content/radius_m"],
        }
    ]
    body = {"name": "Star", "document": document, "parameters": parameters}
    made = await client.post("/api/design-templates", json=body)
    assert made.status_code == 201, made.text
    template = made.json()["id"]

    async def begin(**values):
        wanted = {"name": "S", "template": template, "values": values}
        return await client.post(f"/api/robots/{MINI}/designs", json=wanted)

    missing = await begin()
    assert missing.status_code == 422
    assert missing.json()["errors"] == [{"loc": ["values", "radius"], "msg": "Radius must be said"}]
    large = await begin(radius=3.0)
    assert large.json()["errors"][0]["msg"] == "Radius must be at most 0.6 m, not 3"
    fine = await begin(radius=0.5)
    assert fine.json()["document"]["content"]["radius_m"] == 0.5
    wrong = {**body, "parameters": [{**parameters[0], "paths": ["/content/width_m"]}]}
    refused = await client.post("/api/design-templates", json=wrong)
    assert refused.json()["errors"][0]["loc"] == ["parameters", 0, "paths", 0]


async def test_a_template_whose_usual_value_is_beyond_its_limits_is_refused(client):
    usual = np.random.default_rng().uniform(3_601.0, 86_400.0)
    one = {
        "key": "duration",
        "title": "Duration",
        "unit": "s",
        "default": usual,
        "high": 3_600.0,
        "paths": ["/content/duration_s"],
    }
    place = {"north_m": 1.3, "east_m": 0.7}
    document = {"content": {"kind": "mooring", "place": place, "duration_s": 600.0}}
    body = {"name": "Mooring", "document": document, "parameters": [one]}
    refused = await client.post("/api/design-templates", json=body)
    [error] = refused.json()["errors"]
    assert error["loc"] == ["parameters", 0, "default"]
    assert error["msg"].startswith("Duration must be at most 3600 s")


async def test_a_deleted_template_is_offered_no_more_and_its_designs_stay(client):
    body = {"name": "Way", "document": waypoints((0.4, 0.3), (2.3, 0.3)), "parameters": []}
    template = (await client.post("/api/design-templates", json=body)).json()["id"]
    wanted = {"name": "W", "template": template}
    made = (await client.post(f"/api/robots/{MINI}/designs", json=wanted)).json()
    gone = await client.delete(f"/api/design-templates/{template}")
    assert gone.status_code == 200, gone.text
    assert (await client.get("/api/design-templates")).json() == []
    kept = (await client.get(f"/api/designs/{made['id']}")).json()
    assert len(kept["document"]["content"]["waypoints"]) == 2


async def test_an_outline_names_what_is_broken_and_where(client):
    document = waypoints((0.4, 0.3), (2.3, 0.3), (9.0, 0.3))
    answer = await client.post(f"/api/robots/{MINI}/designs/check", json={"document": document})
    found = answer.json()
    assert answer.status_code == 200, answer.text
    assert {one["waypoint"] for one in found["violations"]} == {2}
    assert all(one["place_ned"][0] > 2.3 for one in found["violations"])
    same_place = waypoints((0.4, 0.3), (0.4, 0.3))
    answer = await client.post(f"/api/robots/{MINI}/designs/check", json={"document": same_place})
    [flaw] = answer.json()["violations"]
    assert (flaw["field"], flaw["waypoint"]) == ("waypoints.1", 1)


async def test_a_design_becomes_a_draft_that_is_opened_again(client):
    design = await begun(client)
    made = await client.post(f"/api/designs/{design['id']}/plan")
    assert made.status_code == 202, made.text
    plan = made.json()["id"]

    async def draft():
        found = (await client.get(f"/api/plans/{plan}")).json()
        return found if found["state"] == "draft" else None

    found = await until(draft)
    assert found["kind"] == "design"
    assert found["violations"] == []
    kept = (await client.get(f"/api/designs/{design['id']}")).json()
    assert [(one["number"], one["plan"]) for one in kept["versions"]] == [(1, plan)]
    body = {"name": "Again", "plan": plan, "shift_north_m": -0.1}
    again = (await client.post(f"/api/robots/{MINI}/designs", json=body)).json()
    first = again["document"]["content"]["waypoints"][0]
    assert first["north_m"] == pytest.approx(0.3)
    same = await client.get(f"/api/designs/{design['id']}/difference?first=plan:{plan}")
    assert {one["change"] for one in same.json()["legs"]} == {"same"}


async def test_a_robot_far_from_the_first_waypoint_is_given_time_to_get_there(client):
    async def patience_and_way_s(first):
        design = await begun(client, document=waypoints(first, (1.2, 0.9)))
        made = await client.post(f"/api/designs/{design['id']}/plan")
        plan = (await client.get(f"/api/plans/{made.json()['id']}")).json()
        outline = (await client.get(f"/api/designs/{design['id']}/check")).json()
        return plan["config"]["mission"]["patience_s"], outline["way_there"]["duration_s"]

    near, near_s = await patience_and_way_s((1.3, 0.5))
    far, far_s = await patience_and_way_s((2.5, 1.2))
    assert far_s > near_s
    assert far - near == pytest.approx(2.0 * (far_s - near_s))


async def test_an_empty_design_is_not_made_a_plan_of(client):
    design = await begun(client, document=waypoints())
    answer = await client.post(f"/api/designs/{design['id']}/plan")
    assert answer.status_code == 422
    assert answer.json()["errors"] == [{"loc": ["content"], "msg": "it has no legs yet"}]


async def test_designs_are_put_away_and_brought_back(client):
    design = await begun(client)
    path = f"/api/designs/{design['id']}"
    await client.patch(path, json={"is_archived": True})
    listed = (await client.get(f"/api/robots/{MINI}/designs")).json()
    assert design["id"] not in {one["id"] for one in listed}
    away = (await client.get(f"/api/robots/{MINI}/designs?archived=true")).json()
    assert design["id"] in {one["id"] for one in away}
    assert not (await client.patch(path, json={"is_archived": False})).json()["is_archived"]
