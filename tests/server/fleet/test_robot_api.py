import asyncio
import json
from datetime import UTC, datetime, timedelta

import pytest
import websockets
from pydantic import TypeAdapter

from robot_link.messages import LinkReport, LinkState, OnboardPlanState, RobotMode
from server.access.role import Role
from server.fleet.status import SentFix
from server.fleet.view import LiveRobotView
from server.plan.view import LivePlanView
from server.survey.view import LiveMissionView
from tests.server.conftest import FAST, GRACE, MINI, api_client, open_station, until
from tests.server.fake_link import state_report
from tests.server.station_app import bearer

NEW_ROBOT = {
    "id": "mini-2",
    "name": "Second Miniglider",
    "model": "miniglider",
    "system_id": 7,
    "links": ["xbee://127.0.0.1:9"],
}


async def test_fleet_says_in_words_what_each_robot_does(client, world, still):
    sinking = {"mode": RobotMode.GLIDING, "velocity_ned": (0, 0, 0.02)}
    world.tell(state_report(MINI, (1.0, 0.5, 0.4), at=still, **sinking))
    mini, grace = (await client.get("/api/robots")).json()
    assert (mini["id"], mini["activity"], mini["mode"]) == ("mini-1", "Gliding down", "gliding")
    assert mini["surface_forecast"] == "Reaches mini-1 now by XBee"
    assert mini["simulated"]
    assert (grace["activity"], grace["mode"]) == ("Not heard yet", None)
    assert grace["model_note"] == "scaled, not identified"
    assert grace["site"]["name"] == "Practice lake"


async def fix_told(client, world, at, **changes):
    """Let a robot say that cameras fixed it; return what the page says of that."""
    world.tell(state_report(MINI, at=at, has_fix=True, is_by_cameras=True, **changes))
    position = (await client.get("/api/robots/mini-1/state")).json()["position"]
    return position["fix_text"], position["fix_age_s"]


async def test_how_many_cameras_fixed_a_robot_is_told_of_a_fix_that_its_word_can_rest_on(
    client, station, world
):
    now = datetime.now(UTC)
    for cameras, ahead_s in ((2, -0.4), (3, 0.1)):
        fix = SentFix(cameras, now + timedelta(seconds=ahead_s))
        station.fleet.note_fix_sent(MINI, fix)
    text, age_s = await fix_told(client, world, now)
    assert text == "fixed by 2 cameras"
    since_s = (datetime.now(UTC) - now).total_seconds()
    assert 0.4 <= age_s <= 0.5 + since_s
    later = now + timedelta(seconds=2.2)
    assert await fix_told(client, world, later) == ("fixed by cameras", None)


async def test_the_robots_clock_is_not_taken_for_the_stations(client, station, world):
    now = datetime.now(UTC)
    link = LinkReport(MINI, "xbee", LinkState.LIVE, now, -50.0, 10, 0, clock_offset_s=0.4)
    world.tell(link)
    for cameras, ahead_s in ((2, -0.4), (3, 0.1)):
        fix = SentFix(cameras, now + timedelta(seconds=ahead_s))
        station.fleet.note_fix_sent(MINI, fix)
    ahead = now + timedelta(seconds=0.4)
    assert station.fleet.status(MINI).at_station(ahead) == now
    assert (await fix_told(client, world, ahead))[0] == "fixed by 2 cameras"


async def test_a_robot_that_its_own_camera_fixed_is_fixed_by_no_other(client, station, world):
    now = datetime.now(UTC)
    station.fleet.note_fix_sent(MINI, SentFix(3, now))
    told = await fix_told(client, world, now, is_by_own_camera=True)
    assert told == ("fixed by its own camera", None)


async def test_position_says_that_cameras_fixed_it_only_where_the_robot_says_so(
    client, station, world
):
    now = datetime.now(UTC)
    station.fleet.note_fix_sent(MINI, SentFix(3, now))
    world.tell(state_report(MINI, at=now, has_fix=True))
    assert (await client.get("/api/robots/mini-1/state")).json()["position"]["fix_text"] == ""
    text, age_s = await fix_told(client, world, now + timedelta(milliseconds=1))
    assert text == "fixed by 3 cameras"
    assert 0.0 <= age_s <= (datetime.now(UTC) - now).total_seconds()


async def test_old_words_are_marked_as_old(client, world, still):
    world.tell(state_report(MINI, at=still + timedelta(seconds=-1)))
    state = (await client.get("/api/robots/mini-1/state")).json()
    assert state["activity"] == "Idle at the surface"
    channel = state["channels"]["depth_m"]
    assert channel["age_s"] < channel["limit_s"]


async def test_robot_that_went_silent_is_last_heard(tmp_path, world, client, station):
    station.fleet.status(MINI).state = state_report(
        MINI, at=datetime.now(UTC) - timedelta(minutes=5), mode=RobotMode.GLIDING
    )
    robot = (await client.get("/api/robots/mini-1")).json()
    assert robot["activity"] == "Last heard: gliding"


async def test_submerged_robot_says_when_it_will_be_heard(client, station, world):
    body = {
        "kind": "primitives",
        "legs": [{"kind": "dive", "end_ned": [0, 0, d]} for d in (0.5, 0)],
    }
    world.robots[MINI].may_fly.clear()
    plan = (await client.post("/api/robots/mini-1/plans", json=body)).json()["id"]
    await client.post(f"/api/plans/{plan}/upload", json={"start": True})
    await until(lambda: world.robots[MINI].state is OnboardPlanState.RUNNING)
    world.hear(MINI, LinkState.SUBMERGED)

    async def running():
        return (await client.get("/api/robots/mini-1")).json()["next_contact"]

    contact = await until(running)
    legs = (await client.get(f"/api/plans/{plan}")).json()["legs"]
    said_at = station.fleet.status(MINI).plan_report.measured_at
    ahead_s = (datetime.fromisoformat(contact["at"]) - said_at).total_seconds()
    assert ahead_s == pytest.approx(sum(leg["duration_s"] for leg in legs), abs=0.01)
    robot = (await client.get("/api/robots/mini-1")).json()
    assert robot["surface_forecast"].startswith("Reaches mini-1 at its next surfacing, about ")


async def test_restarted_station_remembers_that_a_robot_dived(tmp_path, world):
    async with open_station(tmp_path, world):
        world.hear(GRACE)
        world.tell(state_report(GRACE, (200.0, 200.0, 4.0), mode=RobotMode.GLIDING))
    async with open_station(tmp_path, world) as station:
        robot = station.views.robot_view(GRACE)
        assert robot.link.state == "submerged"
        assert robot.surface_forecast == "Reaches grace-1 at its next surfacing"
        world.hear(GRACE)
        assert station.views.robot_view(GRACE).link.state == "live"


@pytest.mark.parametrize(
    ("state", "words"),
    [
        (LinkState.STALE, "mini-1 does not answer"),
        (LinkState.PORT_CLOSED, "The radio's port is closed"),
        (LinkState.NEVER_HEARD, "mini-1 was never heard"),
    ],
)
async def test_forecast_never_promises_what_the_link_cannot_do(client, world, state, words):
    world.hear(MINI, state)
    robot = (await client.get("/api/robots/mini-1")).json()
    assert robot["surface_forecast"].startswith(words)
    assert robot["link"]["state"] == state.value


async def test_garbage_on_the_radio_is_counted_and_shown(client, world):
    world.hear(MINI, frames_bad=17)
    assert (await client.get("/api/robots/mini-1")).json()["link"]["frames_bad"] == 17


@pytest.mark.parametrize("is_signed", [True, False])
async def test_each_radio_says_whether_its_frames_are_signed(client, world, is_signed):
    live = LinkState.LIVE
    world.tell(LinkReport(MINI, "xbee", live, datetime.now(UTC), None, 3, 0, is_signed=is_signed))
    links = (await client.get("/api/robots/mini-1/links")).json()
    signed = {link["kind"]: link["is_signed"] for link in links}
    assert signed["radio"] is is_signed
    assert signed.get("satellite") is None


async def test_silent_robot_raises_one_alarm_that_clears_when_it_is_heard(client, world):
    at_once = {"limits": [{"level": "warning", "high": 0.0}]}
    assert (await client.patch("/api/alarm-rules/silence", json=at_once)).status_code == 200
    heard_at = datetime.now(UTC)
    world.tell(LinkReport(MINI, "xbee", LinkState.STALE, heard_at, None, 3, 0))

    async def raised():
        return (await client.get("/api/robots/mini-1")).json()["alarm_level"] == "warning"

    await until(raised)
    world.hear(MINI)

    async def returned():
        alarms = (await client.get("/api/alarms")).json()["alarms"]
        return [alarm["state"] for alarm in alarms] == ["returned"]

    await until(returned)


async def test_empty_battery_raises_an_alarm_by_its_level(client, world):
    for charge, level in ((0.15, "warning"), (0.05, "critical")):
        world.tell(state_report(MINI, battery_fraction=charge))

        async def raised(level=level):
            return (await client.get("/api/robots/mini-1")).json()["alarm_level"] == level

        await until(raised)
    alarms = (await client.get("/api/alarms")).json()["alarms"]
    assert [alarm["text"] for alarm in alarms] == ["mini-1 has 5% of its battery left."]


async def test_history_and_track_come_back_in_order_and_thinned(client, world, station):
    begin = datetime.now(UTC) - timedelta(minutes=5)
    for second in range(120):
        depth = 0.3 + 0.3 * (second % 40) / 40
        world.tell(state_report(MINI, (1.0, 0.5, depth), at=begin + timedelta(seconds=second)))
    station.ingest.flush()

    async def stored():
        found = (await client.get("/api/robots/mini-1/samples?channel=depth_m")).json()
        return found if len(found["value"]) >= 120 else None

    full = await until(stored)
    assert full["unit"] == "m"
    assert full["measured_at"] == sorted(full["measured_at"])
    thin = (await client.get("/api/robots/mini-1/samples?channel=depth_m&max_points=20")).json()
    assert thin["decimated"]
    assert max(thin["value"]) == max(full["value"])
    track = (await client.get("/api/robots/mini-1/track")).json()
    assert len(track["north_m"]) == len(track["fidelity"]) == len(track["latitude_deg"])
    assert set(track["fidelity"]) == {2}


async def test_unknown_channel_is_refused_with_those_that_exist(client):
    refused = await client.get("/api/robots/mini-1/samples?channel=salt")
    assert refused.status_code == 404
    assert "depth_m" in refused.json()["detail"]


async def test_robot_can_be_added_and_is_listened_for_at_once(client, world, station):
    site = station.fleet.status(MINI).record.site.model_dump(mode="json")
    answer = await client.post("/api/robots", json={**NEW_ROBOT, "site": site})
    assert answer.status_code == 201
    world.hear("mini-2")
    assert (await client.get("/api/robots/mini-2")).json()["link"]["state"] == "live"
    again = await client.post("/api/robots", json={**NEW_ROBOT, "site": site})
    assert again.status_code == 409
    changed = await client.patch("/api/robots/mini-2", json={"name": "Renamed"})
    assert changed.json()["name"] == "Renamed"


@pytest.mark.parametrize(
    ("field", "value"),
    [("model", "submarine"), ("links", ["smoke://signal"]), ("system_id", 300), ("id", "A B")],
)
async def test_wrong_field_of_a_new_robot_is_named(client, station, field, value):
    site = station.fleet.status(MINI).record.site.model_dump(mode="json")
    refused = await client.post("/api/robots", json={**NEW_ROBOT, "site": site, field: value})
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["loc"][0] == field


async def test_viewer_may_look_but_not_act(station):
    async with api_client(station, Role.VIEWER) as viewer:
        assert (await viewer.get("/api/robots")).status_code == 200
        for path, body in (
            ("/api/robots/mini-1/commands", {"kind": "surface"}),
            ("/api/robots/mini-1/plans", {"kind": "adaptive_survey"}),
            ("/api/robots/mini-1/missions", {"kind": "adaptive_survey"}),
        ):
            assert (await viewer.post(path, json=body)).status_code == 403


async def test_every_operation_is_described_and_names_its_errors(client):
    schema = (await client.get("/openapi.json")).json()
    paths = (
        "/api/robots",
        "/api/plans",
        "/api/missions",
        "/api/commands",
        "/api/transfers",
        "/api/vehicles",
        "/api/whatifs",
        "/api/identifications",
    )
    operations = [
        (path, verb, operation)
        for path, verbs in schema["paths"].items()
        if path.startswith(paths)
        for verb, operation in verbs.items()
    ]
    assert len(operations) >= 38
    for path, verb, operation in operations:
        assert operation["tags"], (path, verb)
        assert operation["description"], (path, verb)
        assert "4XX" in operation["responses"], (path, verb)
        success = next(code for code in operation["responses"] if code.startswith("2"))
        content = operation["responses"][success]["content"]
        if {"application/octet-stream", "text/csv; charset=utf-8"} & content.keys():
            continue
        assert content["application/json"]["schema"], (path, verb)
    fields = schema["components"]["schemas"]["ChannelView"]["properties"]
    assert fields["limit_s"]["description"]


def stream_of(client, address):
    return websockets.connect(
        f"ws://{address}/api/live", additional_headers=bearer(client.secret), open_timeout=60
    )


async def test_live_stream_tells_gauges_plans_and_missions_in_the_shapes_of_rest(
    client, address, world
):
    uri = f"ws://{address}/api/live?after=0"
    async with websockets.connect(
        uri, additional_headers=bearer(client.secret), open_timeout=60
    ) as stream:
        first = json.loads(await stream.recv())
        assert set(first["robots"]) == {"mini-1", "grace-1"}
        assert [event["cursor"] for event in first["events"]] == sorted(
            event["cursor"] for event in first["events"]
        )
        await client.post(
            "/api/robots/mini-1/missions", json={"kind": "adaptive_survey", "config": FAST}
        )
        parts = {"robots": LiveRobotView, "plans": LivePlanView, "missions": LiveMissionView}
        seen = set()
        async with asyncio.timeout(120):
            while seen != set(parts):
                batch = json.loads(await stream.recv())
                for section, view in parts.items():
                    for value in batch[section].values():
                        TypeAdapter(view).validate_python(value)
                        seen.add(section)
                world.tell(state_report(MINI))


async def test_live_stream_of_one_robot_is_silent_about_the_others(client, address, world):
    uri = f"ws://{address}/api/live?robots=grace-1"
    async with websockets.connect(
        uri, additional_headers=bearer(client.secret), open_timeout=60
    ) as stream:
        assert set(json.loads(await stream.recv())["robots"]) == {"grace-1"}
        world.tell(state_report(MINI))
        world.tell(state_report(GRACE, (200.0, 200.0, 0.0), mode=RobotMode.HOLDING))
        robots = {}
        while robots.get("grace-1", {}).get("mode") != "holding":
            robots = json.loads(await stream.recv())["robots"]
            assert robots.keys() <= {"grace-1"}


async def test_live_stream_needs_a_sign_in(address):
    with pytest.raises(websockets.InvalidStatus) as refused:
        await websockets.connect(f"ws://{address}/api/live")
    assert refused.value.response.status_code == 403


async def test_station_that_stops_lets_the_live_stream_go(client, address, station):
    async with stream_of(client, address) as stream:
        await stream.recv()
        station.feed.close()
        async with asyncio.timeout(60):
            async for _ in stream:
                pass
        assert stream.close_code == 1001


async def test_client_that_vanishes_leaves_no_task_behind(client, address):
    stream = await stream_of(client, address)
    await stream.recv()
    stream.transport.abort()

    def gone():
        return not [
            task for task in asyncio.all_tasks() if "live stream to a client" in task.get_name()
        ]

    await until(gone)
