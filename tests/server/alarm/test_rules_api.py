"""Rules are changed, tried and taken out of service; alarms are noted, shelved and assigned."""

import asyncio
from datetime import UTC, datetime, timedelta

import pytest

from robot_link.messages import RobotMode
from robot_link.report import Reading
from tests.server.conftest import MINI, until
from tests.server.fake_link import state_report

pytestmark = pytest.mark.usefixtures("in_threads")
PLACE = (1.0, 0.5, 0.2)
RULES = "/api/alarm-rules"
NEW = {
    "key": "too warm",
    "title": "Too warm",
    "reads": "internal_temperature",
    "limits": [{"level": "severe", "high": 40.0}],
    "text": "{robot} is at {value}.",
    "action": "Let it cool.",
}


async def ok(answer, status=200):
    found = await answer
    assert found.status_code == status, found.text
    return found.json()


def alarm(station, cause):
    return next((one for one in station.foundation.alarms.open if one.cause == cause), None)


async def test_a_rule_of_the_teams_own_raises_with_its_level_and_action(station, client, world):
    added = await ok(client.post(RULES, json=NEW), 201)
    assert added["origin"] == "own"
    world.robots[MINI].sample(PLACE, "internal_temperature", 45.0)
    found = await until(lambda: alarm(station, "too warm"))
    assert (found.level, found.text, found.action) == (
        "severe", f"{MINI} is at 45.0 degC.", "Let it cool.",
    )  # fmt: skip
    assert (await ok(client.get(f"/api/robots/{MINI}")))["alarm_level"] == "severe"
    assert await ok(client.delete(f"{RULES}/too warm")) is None
    await until(lambda: alarm(station, "too warm").cleared_at is not None)
    kinds = [one["kind"] for one in (await ok(client.get("/api/events")))["events"]]
    assert {"alarm_rule.added", "alarm_rule.removed"} <= set(kinds)


async def test_a_rule_that_another_changed_meanwhile_is_not_overwritten(client):
    seen = {"If-Match": '"0"'}
    first = await ok(client.patch(f"{RULES}/battery", json={"delay_s": 5.0}, headers=seen))
    late = await client.patch(f"{RULES}/battery", json={"delay_s": 9.0}, headers=seen)
    assert late.status_code == 412
    assert f"by {first['changed_by']} at " in late.json()["detail"]
    assert (await client.delete(f"{RULES}/battery", headers=seen)).status_code == 412
    newest = {"If-Match": f'"{first["version"]}"'}
    again = await ok(client.patch(f"{RULES}/battery", json={"delay_s": 7.0}, headers=newest))
    assert (again["rule"]["delay_s"], again["version"] > first["version"]) == (7.0, True)


async def test_a_changed_delivered_rule_keeps_its_versions_and_can_be_reset(client):
    limits = {"limits": [{"level": "info", "low": 30.0}]}
    changed = await ok(client.patch(f"{RULES}/battery", json=limits))
    assert (changed["origin"], changed["rule"]["limits"][0]["low"]) == ("changed", 30.0)
    back = await ok(client.delete(f"{RULES}/battery"))
    assert (back["origin"], len(back["rule"]["limits"])) == ("delivered", 2)
    versions = await ok(client.get(f"{RULES}/battery/versions"))
    assert [one["rule"] is None for one in versions] == [True, False]
    assert (await client.delete(f"{RULES}/battery")).status_code == 409


@pytest.mark.parametrize(
    ("changes", "field", "words"),
    [
        ({"reads": "warp"}, "reads", "'warp'"),
        ({"kind": "expression", "expression": "warp > depth_m"}, "expression", "'warp'"),
        ({"kind": "rate", "reads": "silence"}, "reads", "watches a channel"),
        ({"robots": ["nobody"]}, "robots", "'nobody'"),
        ({"kind": "catalogue", "reads": "depth_m", "limits": []}, "reads", "no limits"),
    ],
)
async def test_a_rule_that_reads_what_does_not_exist_is_refused_with_its_name(
    client, changes, field, words
):
    refused = await client.post(RULES, json=NEW | changes)
    assert refused.status_code == 422
    [error] = refused.json()["errors"]
    assert error["loc"] == [field]
    assert words in error["msg"]


async def test_a_rule_out_of_service_asks_nobody_until_it_is_put_back(station, client, world):
    world.robots[MINI].sample(PLACE, "leak", 1.0)
    await until(lambda: alarm(station, "channel leak"))
    out = {"robot": MINI, "reason": "Its sensor is broken."}
    path = f"{RULES}/channel leak/out-of-service"
    taken = await ok(client.post(path, json=out))
    assert [one["reason"] for one in taken["out_of_service"]] == ["Its sensor is broken."]
    await until(lambda: alarm(station, "channel leak").state == "out_of_service")
    assert station.foundation.alarms.unacknowledged == 0
    assert (await client.post(path, json=out)).status_code == 409
    await ok(client.delete(path, params={"robot": MINI}))
    await until(lambda: alarm(station, "channel leak").state == "unacknowledged")


async def test_two_who_take_a_rule_out_at_once_take_it_out_once(client):
    path, out = f"{RULES}/channel leak/out-of-service", {"reason": "Its sensor is broken."}
    both = await asyncio.gather(*(client.post(path, json=out) for _ in range(2)))
    assert sorted(answer.status_code for answer in both) == [200, 409]
    both = await asyncio.gather(*(client.delete(path) for _ in range(2)))
    assert sorted(answer.status_code for answer in both) == [200, 404]


async def test_a_rule_tried_on_the_past_fires_when_it_would_have(station, client, world):
    ago = datetime.now(UTC) - timedelta(hours=2)
    for minute, value in enumerate((1000.0, 1150.0, 1160.0, 1000.0, 1200.0)):
        when = ago + timedelta(minutes=minute)
        world.tell(Reading(MINI, "internal_pressure", value, when, when))

    async def kept():
        told = await ok(client.get(f"/api/robots/{MINI}/channels"))
        return any(one["key"] == "internal_pressure" and one["samples"] == 5 for one in told)

    await until(kept)
    rule = NEW | {
        "reads": "internal_pressure",
        "limits": [{"level": "warning", "high": 1100.0}],
        "delay_s": 30.0,
    }
    started = await ok(client.post(f"{RULES}/try", json={"rule": rule, "days": 7}), 202)

    fired = await fired_of(client, started)
    begins = [datetime.fromisoformat(one["begin"]) - ago for one in fired]
    assert begins == [timedelta(minutes=1, seconds=30), timedelta(minutes=4, seconds=30)]
    assert [one["end"] is None for one in fired] == [False, True]


async def fired_of(client, started):
    """Return when a rule would have fired for the robot, once its trial is done."""

    async def ended():
        job = await ok(client.get(f"/api/jobs/{started['id']}"))
        return job if job["state"] not in ("queued", "running") else None

    job = await until(ended)
    assert job["state"] == "done", job
    return [one for one in job["result"]["fired"] if one["robot"] == MINI]


async def test_a_trial_follows_modes_and_leaves_out_what_cannot_be_true(client, world):
    ago = datetime.now(UTC) - timedelta(hours=2)
    flown = (RobotMode.GLIDING, RobotMode.SURFACED, RobotMode.GLIDING)
    for minute, mode in enumerate(flown):
        when = ago + timedelta(minutes=minute)
        world.tell(state_report(MINI, mode=mode, measured_at=when, received_at=when))
    told = ((0.5, 1150.0), (0.6, 99_999.0), (2.5, 1000.0), (2.6, 99_999.0))
    for minute, value in told:
        when = ago + timedelta(minutes=minute)
        world.tell(Reading(MINI, "internal_pressure", value, when, when))

    async def kept():
        told = await ok(client.get(f"/api/robots/{MINI}/channels"))
        return any(one["key"] == "internal_pressure" and one["samples"] == 4 for one in told)

    await until(kept)
    rule = NEW | {
        "reads": "internal_pressure",
        "limits": [{"level": "warning", "high": 1100.0}, {"level": "critical", "high": 9000.0}],
        "modes": ["gliding"],
    }
    started = await ok(client.post(f"{RULES}/try", json={"rule": rule, "days": 7}), 202)
    fired = await fired_of(client, started)
    assert {one["level"] for one in fired} == {"warning"}
    spans = [
        tuple((datetime.fromisoformat(one[end]) - ago) / timedelta(minutes=1)
              for end in ("begin", "end"))
        for one in fired
    ]  # fmt: skip
    assert spans == [(0.5, 1.0), (2.0, 2.5)]


async def test_a_value_whose_past_is_not_kept_cannot_be_tried(client):
    rule = NEW | {"reads": "silence"}
    refused = await client.post(f"{RULES}/try", json={"rule": rule})
    assert refused.status_code == 422
    assert "'silence' is not kept" in refused.json()["errors"][0]["msg"]


async def test_an_alarm_is_noted_assigned_shelved_and_comes_back(station, client, world):
    world.tell(state_report(MINI, battery_fraction=0.05))
    found = await until(lambda: alarm(station, "battery"))
    path = f"/api/alarms/{found.id}"
    noted = await ok(client.post(f"{path}/ack", json={"note": "Seen; a boat is on its way."}))
    assert (noted["state"], noted["note"]) == ("acknowledged", "Seen; a boat is on its way.")
    assert (await client.post(f"{path}/assign", json={"person": "nobody"})).status_code == 422
    shelved = await ok(client.post(f"{path}/shelve", json={"minutes": 5, "note": "Known."}))
    assert (shelved["state"], shelved["note"]) == ("shelved", "Known.")
    assert station.foundation.alarms.unacknowledged == 0
    assert (await ok(client.get(f"/api/robots/{MINI}")))["alarm_level"] is None
    board, soon = station.foundation.alarms, station.foundation.clock.now() + timedelta(seconds=0.3)
    await board.shelve(found.id, "ann", soon, "For a moment.")
    await until(lambda: alarm(station, "battery").state == "unacknowledged")
    assert (await client.post(f"{path}/unshelve")).status_code == 409
    texts = [one["text"] for one in (await ok(client.get("/api/events")))["events"]]
    assert any("shelved until" in text and "(Known.)" in text for text in texts)


async def test_more_alarms_than_a_page_holds_are_told_by_the_gravest(station, client):
    board = station.foundation.alarms
    for number in range(6):
        await board.raise_(f"cause {number}", "x", level="watch" if number else "critical")
    for _ in range(20):
        await board.clear("cause 5")
        await board.raise_("cause 5", "x", level="watch")
    told = await ok(client.get("/api/alarms", params={"limit": 2}))
    assert told["total"] == len(board.open)
    assert "critical" in [one["level"] for one in told["alarms"]]
    assert alarm(station, "cause 5").count == 21
    events = (await ok(client.get("/api/events", params={"limit": 500})))["events"]
    raised = [one for one in events if one["data"].get("alarm") == alarm(station, "cause 5").id]
    assert len(raised) < 25, "what flutters does not fill the log"
