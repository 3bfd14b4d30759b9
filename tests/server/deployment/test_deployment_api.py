"""Deployments by REST: who is in the water, what belongs to it, and what a past one shows."""

from datetime import UTC, datetime, timedelta

import pytest

from robot_link.messages import LinkReport, LinkState, RobotMode
from server.access.role import Role
from tests.server.conftest import MINI, api_client, until
from tests.server.deployment.shore import answered, deployments, sample_at
from tests.server.fake_link import state_report

NEW_ROBOT = {
    "id": "mini-2",
    "name": "Second Miniglider",
    "model": "miniglider",
    "system_id": 7,
    "links": ["xbee://127.0.0.1:9"],
}


async def in_water(client, robot=MINI):
    (now,) = await deployments(client, robot=robot, state="in_water")
    return now


async def test_a_deployment_is_planned_begins_and_ends(client):
    first = await in_water(client)
    asked = {"robot": MINI, "name": "Transect", "purpose": "Light", "people": ["Ann", "Bo"]}
    planned = await answered(client.post("/api/deployments", json=asked), 201)
    assert (planned["state"], planned["started_at"], planned["water"]) == (
        "planned",
        None,
        "Test tank",
    )
    refused = await answered(client.post(f"/api/deployments/{planned['id']}/begin"), 409)
    assert first["id"] in refused["detail"]
    ended = await answered(client.post(f"/api/deployments/{first['id']}/end"))
    assert ended["state"] == "recovered"
    robot = (await client.get(f"/api/robots/{MINI}")).json()
    assert (robot["is_in_workshop"], robot["activity"]) == (True, "In the workshop")
    begun = await answered(client.post(f"/api/deployments/{planned['id']}/begin"))
    assert (begun["state"], begun["people"]) == ("in_water", ["Ann", "Bo"])
    robot = (await client.get(f"/api/robots/{MINI}")).json()
    assert robot["deployment"]["name"] == "Transect"
    events = (await client.get("/api/events")).json()["events"]
    kinds = [one["kind"] for one in events if one["kind"].startswith("deployment.")]
    assert kinds == ["deployment.planned", "deployment.ended", "deployment.began"]


async def test_the_water_of_a_past_deployment_is_as_it_was_then(client):
    first = await in_water(client)
    await answered(client.post(f"/api/deployments/{first['id']}/end"))
    path = f"/api/deployments/{first['id']}/water"
    before = await answered(client.get(path))
    assert before["name"] == "Test tank"
    await answered(client.patch(f"/api/robots/{MINI}", json={"site": {**before, "name": "Pond"}}))
    assert await answered(client.get(path)) == before
    await answered(client.get("/api/deployments/deployment-999/water"), 404)


async def test_times_are_corrected_but_never_into_another_or_the_future(client):
    first = await in_water(client)
    begun = datetime.fromisoformat(first["started_at"])
    second = await answered(
        client.post(
            "/api/deployments",
            json={
                "robot": MINI,
                "started_at": (begun - timedelta(days=2)).isoformat(),
                "ended_at": (begun - timedelta(days=1)).isoformat(),
            },
        ),
        201,
    )
    path = f"/api/deployments/{second['id']}"
    refused = await answered(
        client.patch(path, json={"ended_at": (begun + timedelta(microseconds=1)).isoformat()}), 409
    )
    assert first["id"] in refused["detail"]
    met = await answered(client.patch(path, json={"ended_at": begun.isoformat()}))
    assert met["ended_at"] == first["started_at"]
    tomorrow = (datetime.now(UTC) + timedelta(days=1)).isoformat()
    refused = await answered(client.patch(path, json={"ended_at": tomorrow}), 422)
    assert refused["errors"][0]["loc"] == ["ended_at"]
    assert (await answered(client.patch(path, json={"purpose": "Lost", "people": ["Cy"]})))[
        "purpose"
    ] == "Lost"
    refused = await answered(client.patch(path, json={"state": "delivered"}), 422)
    assert refused["errors"][0]["loc"] == ["state"]
    assert await answered(client.delete(path), 405)


async def test_what_a_robot_says_belongs_to_the_deployment_of_its_time(client, world, station):
    now = datetime.now(UTC)
    first = await in_water(client)
    begin = datetime.fromisoformat(first["started_at"])
    await answered(
        client.patch(
            f"/api/deployments/{first['id']}",
            json={"started_at": (begin - timedelta(hours=1)).isoformat()},
        )
    )
    for minutes in (50, 40, 30, 20, 10):
        at = now - timedelta(minutes=minutes)
        world.tell(state_report(MINI, (1.0, 0.5, minutes / 100), at=at))
        world.tell(sample_at(MINI, at, minutes))
    station.ingest.flush()
    edge = (now - timedelta(minutes=30)).isoformat()
    split = f"/api/deployments/{first['id']}/split"
    two = await answered(client.post(split, json={"at": edge, "name": "After noon"}))
    assert two["second"]["name"] == "After noon"

    async def counted():
        found = await deployments(client, robot=MINI)
        return [one["samples"] for one in found] == [3, 2]

    await until(counted)
    for part, expected in (("first", [50.0, 40.0]), ("second", [30.0, 20.0, 10.0])):
        of = f"deployment={two[part]['id']}"
        path = f"/api/robots/{MINI}/samples?channel=blue_light&{of}"
        assert (await answered(client.get(path)))["value"] == expected
        track = await answered(client.get(f"/api/robots/{MINI}/track?{of}"))
        told = [round(depth * 100) for depth in track["depth_m"] if depth > 0.05]
        assert told == expected
        csv = await client.get(f"/api/deployments/{two[part]['id']}/export")
        assert len([row for row in csv.text.splitlines() if row[0].isdigit()]) == len(expected)
    refused = await answered(
        client.get(f"/api/robots/grace-1/track?deployment={two['first']['id']}"), 422
    )
    assert refused["errors"][0]["loc"] == ["deployment"]
    await answered(client.get(f"/api/robots/{MINI}/track?deployment=deployment-99"), 404)
    refused = await answered(client.post(split, json={"at": now.isoformat()}), 422)
    assert "not within" in refused["detail"]


async def test_events_alarms_plans_and_commands_are_those_of_the_deployment(client, world):
    first = await in_water(client)
    world.tell(state_report(MINI, battery_fraction=0.05))
    await client.post(f"/api/robots/{MINI}/commands", json={"kind": "hold"})

    async def raised():
        return (await client.get("/api/alarms")).json()["alarms"]

    await until(raised)
    await answered(client.post(f"/api/deployments/{first['id']}/end"))
    second = await answered(
        client.post(
            "/api/deployments", json={"robot": MINI, "started_at": datetime.now(UTC).isoformat()}
        ),
        201,
    )
    for deployment, count in ((first, 1), (second, 0)):
        of = f"deployment={deployment['id']}"
        alarms = await answered(client.get(f"/api/alarms?{of}"))
        assert len(alarms["alarms"]) == count
        assert len(await answered(client.get(f"/api/robots/{MINI}/commands?{of}"))) == count
        events = (await answered(client.get(f"/api/events?{of}")))["events"]
        assert {one["robot"] for one in events} <= {MINI}
        assert any(one["kind"] == "alarm.raised" for one in events) == bool(count)
        assert await answered(client.get(f"/api/robots/{MINI}/plans?{of}")) == []


async def test_a_void_deployment_is_hidden_with_its_reason(client):
    first = await in_water(client)
    path = f"/api/deployments/{first['id']}/void"
    assert await answered(client.post(path, json={"reason": " "}), 422)
    void = await answered(client.post(path, json={"reason": "A test on the bench."}))
    assert void["void_reason"] == "A test on the bench."
    assert await deployments(client, robot=MINI) == []
    assert [one["id"] for one in await deployments(client, robot=MINI, void="true")] == [
        first["id"]
    ]
    assert (await client.get(f"/api/robots/{MINI}")).json()["is_in_workshop"]


async def test_alarms_of_contact_do_not_cry_for_a_robot_in_the_workshop(client, world):
    at_once = {"limits": [{"level": "warning", "high": 0.0}]}
    assert (await client.patch("/api/alarm-rules/silence", json=at_once)).status_code == 200
    first = await in_water(client)

    async def open_causes():
        return [one["state"] for one in (await client.get("/api/alarms")).json()["alarms"]]

    heard_at = datetime.now(UTC)
    world.tell(LinkReport(MINI, "xbee", LinkState.STALE, heard_at, None, 3, 0))

    async def cries():
        return await open_causes() == ["unacknowledged"]

    async def stands_aside():
        return await open_causes() == ["suppressed"]

    await until(cries)
    await answered(client.post(f"/api/deployments/{first['id']}/end"))
    await until(stands_aside)
    world.tell(state_report(MINI, battery_fraction=0.05))

    async def battery_cries():
        return "unacknowledged" in await open_causes()

    await until(battery_cries)


async def test_the_station_suggests_to_begin_and_a_person_confirms(client, world):
    first = await in_water(client)
    await answered(client.post(f"/api/deployments/{first['id']}/end"))

    async def suggestion():
        return (await client.get(f"/api/robots/{MINI}")).json()["suggestion"]

    world.tell(state_report(MINI))
    assert await suggestion() is None
    dived = datetime.now(UTC)
    world.tell(state_report(MINI, (1.0, 0.5, 0.2), at=dived, mode=RobotMode.GLIDING))
    made = await suggestion()
    assert (made["kind"], made["at"]) == ("begin", dived.isoformat().replace("+00:00", "Z"))
    assert made["text"].startswith("mini-1 is no longer idle since ")
    await answered(client.delete(f"/api/robots/{MINI}/deployment-suggestion"))
    world.tell(state_report(MINI, (1.0, 0.5, 0.9), mode=RobotMode.GLIDING))
    assert await suggestion() is None
    world.tell(state_report(MINI))
    world.tell(state_report(MINI, (1.0, 0.5, 0.6)))
    made = await suggestion()
    assert "is 0.6 m deep" in made["text"]
    asked = {"robot": MINI, "started_at": made["at"]}
    begun = await answered(client.post("/api/deployments", json=asked), 201)
    assert (begun["state"], begun["started_at"]) == ("in_water", made["at"])
    assert await suggestion() is None


async def test_the_station_suggests_to_end_after_a_day_idle_at_the_surface(client, world, station):
    first = await in_water(client)
    ago = datetime.now(UTC) - timedelta(hours=30)
    path = f"/api/deployments/{first['id']}"
    await answered(client.patch(path, json={"started_at": (ago - timedelta(hours=2)).isoformat()}))
    status = station.fleet.status(MINI)
    status.state = None
    world.tell(state_report(MINI, (1.0, 0.5, 0.9), at=ago, mode=RobotMode.GLIDING))
    world.tell(state_report(MINI, at=ago + timedelta(hours=1)))
    robot = (await client.get(f"/api/robots/{MINI}")).json()
    assert robot["suggestion"]["kind"] == "end"
    world.tell(state_report(MINI, mode=RobotMode.GLIDING))
    assert (await client.get(f"/api/robots/{MINI}")).json()["suggestion"] is None


async def test_only_a_pilot_decides_and_a_viewer_looks(client, station):
    first = await in_water(client)
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.get("/api/deployments")).status_code == 200
        for step in ("begin", "end", "split", "void", "review", "deliver", "reopen"):
            path = f"/api/deployments/{first['id']}/{step}"
            assert (await viewer.post(path, json={})).status_code == 403
        assert (await viewer.post("/api/deployments", json={"robot": MINI})).status_code == 403


@pytest.mark.parametrize(
    ("deployment", "expected"),
    [({}, "Second Miniglider, from "), ({"name": "Maiden dive"}, "Maiden dive"), (None, None)],
)
async def test_a_new_robot_begins_its_first_deployment_or_waits_in_the_workshop(
    client, deployment, expected
):
    site = (await client.get(f"/api/robots/{MINI}")).json()["site"]
    asked = NEW_ROBOT | {"site": site, "deployment": deployment}
    added = await answered(client.post("/api/robots", json=asked), 201)
    if expected is None:
        assert added["is_in_workshop"]
        assert await deployments(client, robot="mini-2") == []
    else:
        assert added["deployment"]["name"].startswith(expected)
        assert (await in_water(client, "mini-2"))["name"] == added["deployment"]["name"]


async def test_a_robot_retires_and_comes_back_with_its_past(client, world, station):
    first = await in_water(client)
    refused = await answered(client.post(f"/api/robots/{MINI}/retire"), 409)
    assert "in the water" in refused["detail"]
    await answered(client.post(f"/api/deployments/{first['id']}/end"))
    retired = await answered(client.post(f"/api/robots/{MINI}/retire"))
    assert retired["activity"] == "Retired"
    listed = await answered(client.get("/api/robots"))
    assert [one["id"] for one in listed] == ["grace-1"]
    assert [one["id"] for one in await answered(client.get("/api/robots?retired=true"))] == [MINI]
    assert [one["id"] for one in await deployments(client, robot=MINI)] == [first["id"]]
    assert (await client.get(f"/api/robots/{MINI}/track")).status_code == 200
    refused = await answered(
        client.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"}), 409
    )
    assert "retired" in refused["detail"]
    site = (await client.get("/api/robots/grace-1")).json()["site"]
    heir = NEW_ROBOT | {"site": site, "system_id": 1, "deployment": None}
    await answered(client.post("/api/robots", json=heir), 201)
    refused = await answered(client.post(f"/api/robots/{MINI}/restore"), 409)
    assert "System id 1 belongs to 'mini-2'" in refused["detail"]
    await answered(client.patch("/api/robots/mini-2", json={"system_id": 8}))
    back = await answered(client.post(f"/api/robots/{MINI}/restore"))
    assert (back["system_id"], back["is_in_workshop"]) == (1, True)


async def test_a_name_for_recordings_has_no_radio(client):
    site = (await client.get(f"/api/robots/{MINI}")).json()["site"]
    asked = {"id": "old-1", "name": "Old glider", "kind": "recorded", "site": site}
    added = await answered(client.post("/api/robots", json=asked), 201)
    assert (added["kind"], added["deployment"], added["signing_key"]) == ("recorded", None, None)
    refused = await answered(client.post("/api/robots", json=asked | {"system_id": 9}), 422)
    assert "neither" in str(refused["errors"])
    refused = await answered(client.post("/api/deployments", json={"robot": "old-1"}), 409)
    assert "recording" in refused["detail"]


async def test_data_are_reviewed_then_delivered_and_can_be_reopened(client):
    first = await in_water(client)
    path = f"/api/deployments/{first['id']}"
    refused = await answered(client.post(f"{path}/review"), 409)
    assert "is in water, and would have to be recovered" in refused["detail"]
    await answered(client.post(f"{path}/end"))
    refused = await answered(client.post(f"{path}/deliver", json={"to": "A data centre"}), 409)
    assert "would have to be reviewed" in refused["detail"]
    reviewed = await answered(client.post(f"{path}/review", json={"note": "One spike"}))
    assert (reviewed["state"], reviewed["review"]["note"]) == ("reviewed", "One spike")
    assert reviewed["review"]["by"]
    refused = await answered(client.patch(path, json={"started_at": first["started_at"]}), 409)
    assert "is reviewed, and would have to be in water or recovered" in refused["detail"]
    assert (await answered(client.patch(path, json={"purpose": "Light"})))["purpose"] == "Light"
    assert await answered(client.post(f"{path}/deliver", json={"to": " "}), 422)
    delivered = await answered(client.post(f"{path}/deliver", json={"to": "A data centre"}))
    assert (delivered["state"], delivered["delivery"]["note"]) == ("delivered", "A data centre")
    assert delivered["review"] == reviewed["review"]
    assert [one["id"] for one in await deployments(client, state="delivered")] == [first["id"]]
    reopened = await answered(client.post(f"{path}/reopen", json={"reason": "A bad stretch"}))
    assert (reopened["state"], reopened["review"], reopened["delivery"]) == (
        "recovered",
        None,
        None,
    )
    events = (await answered(client.get("/api/events")))["events"]
    steps = [one["text"] for one in events if one["kind"].startswith("deployment.")]
    assert [text.rsplit(") ", 1)[-1] for text in steps] == [
        "ended.",
        "was reviewed: One spike",
        "was corrected.",
        "was delivered: A data centre",
        "is to be reviewed anew: A bad stretch",
    ]
    await answered(client.post(f"{path}/reopen", json={"reason": "Again"}), 409)


async def test_a_void_deployment_is_not_reviewed(client):
    first = await in_water(client)
    path = f"/api/deployments/{first['id']}"
    await answered(client.post(f"{path}/void", json={"reason": "On the bench."}))
    refused = await answered(client.post(f"{path}/review"), 409)
    assert "is void: On the bench." in refused["detail"]
