"""A stay at the surface and rules of surfacing, from the design to what the robot says of them."""

import pytest

from robot_link.messages import OnboardPlanState
from tests.server.conftest import MINI, until
from tests.server.survey.test_plan_choice import plan_in

STAY = {
    "kind": "station_keep",
    "place": {"north_m": 1.3, "east_m": 0.7},
    "radius_m": 0.6,
    "duration_s": 600.0,
}
RULES = {
    "samples_waiting": 40,
    "hold_off_s": 120.0,
    "on_value": [{"channel": "temperature", "side": "above", "value": 21.5}],
}


async def begun(client, document):
    body = {"name": "Stay", "document": document}
    answer = await client.post(f"/api/robots/{MINI}/designs", json=body)
    assert answer.status_code == 201, answer.text
    return answer.json()


async def planned(client, document):
    design = await begun(client, document)
    made = await client.post(f"/api/designs/{design['id']}/plan")
    assert made.status_code == 202, made.text
    return await plan_in(client, made.json()["id"], "draft")


async def test_a_stay_becomes_a_plan_with_one_leg(client):
    plan = await planned(client, {"content": STAY})
    (leg,) = plan["legs"]
    assert (leg["kind"], leg["end_ned"]) == ("keep", [1.3, 0.7, 0.0])
    assert (leg["radius_m"], leg["duration_s"]) == (0.6, 600.0)
    assert plan["violations"] == []
    assert plan["rules"] == []
    assert plan["account"]["battery"] is not None


async def test_a_stay_that_is_too_tight_is_a_violation_of_its_leg(client):
    design = await begun(client, {"content": STAY | {"radius_m": 0.1}})
    outline = (await client.get(f"/api/designs/{design['id']}/check")).json()
    (broken,) = outline["violations"]
    assert (broken["field"], broken["leg"]) == ("legs.0.radius_m", 0)
    assert "the robot can hold 0.6 m" in broken["message"]


async def test_rules_travel_and_a_dive_that_they_end_is_told_once(client, world):
    line = [{"north_m": 0.5, "east_m": 0.4}, {"north_m": 2.2, "east_m": 0.9}]
    document = {"content": {"kind": "waypoints", "waypoints": line}, "surfacing": RULES}
    plan = await planned(client, document)
    assert plan["rules"] == ["40 samples wait", "temperature is above 21.5 degC"]
    assert (await client.post(f"/api/plans/{plan['id']}/upload")).status_code == 202
    await plan_in(client, plan["id"], "on_board")
    robot = world.robots[MINI]
    assert robot.plan.rules.integers() == (40, 120, 1, 3, 1, 215, -1)
    robot.may_end.clear()
    robot.reason = "leg 1 ended early, by rule: temperature of 21.8 is above 21.5"
    robot.say(OnboardPlanState.RUNNING)
    robot.say(OnboardPlanState.RUNNING)

    async def told():
        events = (await client.get("/api/events", params={"limit": 1000})).json()["events"]
        return [one["text"] for one in events if one["kind"] == "plan.came_up"]

    (text,) = await until(told)
    assert text == f"{MINI} came up early in {plan['id']}: {robot.reason}."


@pytest.mark.parametrize(
    ("rule", "field"),
    [({"channel": "kryptonite"}, "channel"), ({"value": 99.0}, "value")],
)
async def test_a_rule_that_no_robot_can_keep_is_named_by_its_field(client, rule, field):
    wrong = RULES | {"on_value": [RULES["on_value"][0] | rule]}
    design = await begun(client, {"content": STAY, "surfacing": wrong})
    outline = (await client.get(f"/api/designs/{design['id']}/check")).json()
    assert outline["violations"][0]["field"] == f"surfacing.on_value.0.{field}"
    made = await client.post(f"/api/designs/{design['id']}/plan")
    assert made.status_code == 422
    assert made.json()["errors"][0]["loc"] == ["surfacing", "on_value", "0", field]


async def test_a_side_that_cannot_be_laid_out_is_said_and_its_legs_are_not_gone(client):
    line = [{"north_m": 0.5, "east_m": 0.4}, {"north_m": 2.2, "east_m": 0.9}]
    content = {"kind": "waypoints", "waypoints": line}
    design = await begun(client, {"content": content})
    wrong = RULES | {"on_value": [RULES["on_value"][0] | {"channel": "kryptonite"}]}
    path = f"/api/designs/{design['id']}/difference"
    tried = {"document": {"content": content, "surfacing": wrong}}
    answer = await client.post(path, json=tried)
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert "cannot be laid out: surfacing.on_value.0.channel" in found["second"]
    assert found["first_legs"]
    assert found["legs"] == []
    refused = await client.get(path, params={"first": "working", "second": "moon"})
    assert refused.status_code == 422
    assert refused.json()["errors"][0]["loc"] == ["second"]
