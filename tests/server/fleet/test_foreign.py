"""A vehicle of another maker is a robot of the fleet; what it cannot do is said, not offered."""

import math
from dataclasses import replace
from datetime import timedelta

import pytest

from autonomy.site import LAKE
from robot_link.messages import RobotId
from robot_link.report import VehicleReport, VehicleValue, VehicleWord
from server.fleet.capability import KEYS
from tests.server.conftest import MINI, until
from tests.server.fake_link import state_report


@pytest.fixture
def lake():
    return LAKE.model_dump(mode="json")


SUB = {
    "id": "sub-1",
    "name": "Sub 1",
    "protocol": "mavlink",
    "system_id": 9,
    "links": ["udp://127.0.0.1:14560"],
}


async def test_a_mavlink_robot_needs_no_vehicle_of_the_catalogue(client, lake):
    added = (await client.post("/api/robots", json={**SUB, "site": lake})).json()
    assert (added["protocol"], added["model_key"], added["signing_key"]) == ("mavlink", "", None)
    assert added["activity"] == "Not heard yet"
    known = {one["id"]: one["protocol"] for one in (await client.get("/api/robots")).json()}
    assert known == {"mini-1": "grace", "grace-1": "grace", "sub-1": "mavlink"}


async def test_one_of_our_robots_needs_a_vehicle_of_the_catalogue(client, lake):
    answer = await client.post("/api/robots", json={**SUB, "protocol": "grace", "site": lake})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["loc"] == ["model"]


async def test_a_robot_becomes_a_mavlink_vehicle_and_ours_again(client):
    changed = await client.patch("/api/robots/mini-1", json={"protocol": "mavlink", "model": ""})
    assert (changed.json()["protocol"], changed.json()["model_key"]) == ("mavlink", "")
    refused = await client.patch("/api/robots/mini-1", json={"protocol": "grace"})
    assert refused.status_code == 422
    back = {"protocol": "grace", "model": "miniglider"}
    assert (await client.patch("/api/robots/mini-1", json=back)).json()["protocol"] == "grace"


async def test_what_it_cannot_do_is_said_in_a_sentence(client, lake):
    added = (await client.post("/api/robots", json={**SUB, "site": lake})).json()
    said = {one["key"]: one["reason"] for one in added["capabilities"]}
    assert tuple(said) == KEYS
    offered = {one["key"] for one in added["capabilities"] if one["is_offered"]}
    assert offered == {
        "waypoints", "surface", "hold", "resume", "arm", "drive", "logs", "parameters",
    }  # fmt: skip
    assert all(text.endswith(".") for key, text in said.items() if key not in offered)
    assert "sub-1 speaks standard MAVLink" in said["adaptive_survey"]
    own = (await client.get(f"/api/robots/{MINI}")).json()["capabilities"]
    assert [one["key"] for one in own if not one["is_offered"]] == ["waypoints", "arm"]


async def test_what_it_cannot_do_is_refused_with_the_same_sentence(client, lake):
    added = (await client.post("/api/robots", json={**SUB, "site": lake})).json()
    said = {one["key"]: one["reason"] for one in added["capabilities"]}
    plan = await client.post("/api/robots/sub-1/plans", json={"kind": "adaptive_survey"})
    assert (plan.status_code, plan.json()["detail"]) == (409, said["adaptive_survey"])
    ping = await client.post("/api/robots/sub-1/commands", json={"kind": "ping"})
    assert (ping.status_code, ping.json()["detail"]) == (409, said["ping"])
    arm = await client.post(f"/api/robots/{MINI}/commands", json={"kind": "arm"})
    assert (arm.status_code, "needs no arming" in arm.json()["detail"]) == (409, True)
    by_satellite = {"kind": "arm", "route": "satellite"}
    far = await client.post("/api/robots/sub-1/commands", json=by_satellite)
    assert (far.status_code, "by radio alone" in far.json()["detail"]) == (409, True)


def vehicle_report(at, values, **changes):
    report = VehicleReport(
        robot=RobotId("sub-1"),
        measured_at=at,
        received_at=at,
        autopilot="ArduSub",
        kind="submarine",
        mode="ALT_HOLD",
        mode_number=2,
        mode_words="holds its depth",
        is_armed=True,
        is_critical=False,
        values={key: VehicleValue(value, at) for key, value in values.items()},
        place=None,
        depth_source="GLOBAL_POSITION_INT",
        std_source="",
        mission_item=None,
        mission_items=None,
        unhealthy=(),
    )
    return replace(report, **changes)


async def test_its_page_shows_what_it_said_and_nothing_else(client, world, station, lake):
    await client.post("/api/robots", json={**SUB, "site": lake})
    at = station.foundation.clock.now()
    world.tell(vehicle_report(at, {"depth_m": 4.2, "temperature": 12.1}))
    state = (await client.get("/api/robots/sub-1/state")).json()
    assert state["activity"] == "Armed, in ALT_HOLD (holds its depth)"
    shown = {key: (one["value"], one["unit"]) for key, one in state["channels"].items()}
    assert shown == {"depth_m": (4.2, "m"), "temperature": (12.1, "degC")}
    assert state["vehicle"]["depth_source"] == "GLOBAL_POSITION_INT"
    assert state["position"] is None


async def test_named_values_are_channels_of_the_stations_own_catalogue(
    client, world, station, lake
):
    await client.post("/api/robots", json={**SUB, "site": lake})
    methane = {"key": "methane", "title": "Methane", "unit": "nmol/L", "low": 0.0, "high": 100.0}
    assert (await client.post("/api/channels", json=methane)).status_code == 201
    at = station.foundation.clock.now()
    told = {"methane": 4.0, "dissolved_": 8.0, "temperature": 99.0, "made_up": 1.0}
    world.tell(vehicle_report(at, told))
    shown = (await client.get("/api/robots/sub-1/state")).json()["channels"]
    assert {key: one["value"] for key, one in shown.items()} == {
        "methane": 4.0,
        "dissolved_oxygen": 8.0,
    }


async def test_a_state_without_a_place_is_kept_and_one_with_is_tracked(
    client, world, station, lake
):
    await client.post("/api/robots", json={**SUB, "site": lake})
    at, gap = station.foundation.clock.now(), math.nan
    gaps = dict.fromkeys(("roll_rad", "battery_fraction", "battery_v", "tail_rad"), gap)
    world.tell(state_report(RobotId("sub-1"), (gap, gap, 3.0), at, position_std_m=math.inf, **gaps))
    told = "/api/robots/sub-1/samples?channel="

    async def depths():
        return (await client.get(f"{told}depth_m")).json()["value"]

    assert await until(depths) == [3.0]
    assert (await client.get("/api/robots/sub-1/track")).json()["measured_at"] == []
    for channel in ("battery_v", "position_std_m"):
        assert (await client.get(f"{told}{channel}")).json()["value"] == []
    later = at + timedelta(seconds=1)
    placed = state_report(RobotId("sub-1"), (1.0, 2.0, 3.0), later, position_std_m=math.inf, **gaps)
    world.tell(placed)

    async def track():
        found = (await client.get("/api/robots/sub-1/track")).json()
        return found if found["north_m"] else None

    assert (await until(track))["std_m"] == [None]
    position = (await client.get("/api/robots/sub-1/state")).json()["position"]
    assert (position["ned_m"], position["std_m"]) == ([1.0, 2.0, 3.0], None)


async def test_a_negative_depth_or_one_below_the_floor_is_refused(client, world, station, lake):
    await client.post("/api/robots", json={**SUB, "site": lake})
    at = station.foundation.clock.now()
    for depth_m in (-3.0, 4000.0):
        world.tell(state_report(RobotId("sub-1"), (1.0, 2.0, depth_m), at))
    assert station.fleet.status("sub-1").state is None
    assert station.fleet.status("sub-1").refused == 2


async def test_its_grave_words_and_its_leak_are_alarms(client, world, station, lake):
    await client.post("/api/robots", json={**SUB, "site": lake})
    at = station.foundation.clock.now()
    world.tell(VehicleWord(RobotId("sub-1"), 6, "EKF2 is using GPS", at))
    world.tell(VehicleWord(RobotId("sub-1"), 2, "Leak Detected", at))
    world.tell(vehicle_report(at, {"leak": 1.0}))

    async def alarms():
        found = (await client.get("/api/alarms")).json()["alarms"]
        texts = {one["text"]: one["level"] for one in found if one["robot"] == "sub-1"}
        return texts if len(texts) > 1 else None

    assert await until(alarms) == {
        "sub-1 says: Leak Detected": "critical",
        "sub-1: Leak says LEAK.": "critical",
    }

    async def said():
        found = (await client.get("/api/events?robot=sub-1&limit=50")).json()
        texts = {one["text"]: one["level"] for one in found["events"]}
        return texts if levels.keys() <= texts.keys() else None

    levels = {
        "sub-1 says: EKF2 is using GPS": "info",
        "sub-1 says: Leak Detected": "critical",
        "sub-1 is armed, in ALT_HOLD (holds its depth).": "info",
    }
    words = await until(said)
    assert {text: words[text] for text in levels} == levels
