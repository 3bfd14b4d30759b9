"""Plans side by side: what each would tell of the map, whoever made it."""

import pytest

from robot_link.messages import OnboardPlanState
from tests.server.conftest import GRACE, MINI
from tests.server.transfer.test_upload import draft, plan_in, upload

PATH = f"/api/robots/{MINI}/plans/comparison"
CALM = {"max_uncertainty_m": 5.0, "adaptive": {"rehearse": False}}
SHORT = [("dive", (0, 0, 0.5)), ("dive", (0, 0, 0.0))]
LONG = [*SHORT, ("swim", (2.4, 0.9, 0.0)), ("dive", (0, 0, 0.8)), ("dive", (0, 0, 0.0))]


async def drawn(client, legs):
    body = [{"kind": kind, "end_ned": list(end)} for kind, end in legs]
    plan = await draft(client, {"kind": "primitives", "legs": body, "config": CALM})
    await plan_in(client, plan, "draft")
    return plan


async def compared(client, *plans):
    answer = await client.get(PATH, params={"plan": list(plans)})
    assert answer.status_code == 200, answer.text
    return answer.json()


async def test_the_plan_that_goes_farther_tells_more_in_whatever_order(client, in_threads):
    short, long = await drawn(client, SHORT), await drawn(client, LONG)
    found = {one["plan"]: one["brings"] for one in await compared(client, short, long)}
    assert 0.0 < found[short]["removed"] < found[long]["removed"] < 1.0
    assert found[short]["map_std"] > found[long]["map_std"]
    assert found[short]["energy"] < found[long]["energy"]
    again = await compared(client, long, short)
    assert [one["plan"] for one in again] == [long, short]
    assert again[0]["brings"]["removed"] == pytest.approx(found[long]["removed"])


async def test_a_plan_that_is_flown_is_judged_as_if_it_were_not(client, world, in_threads):
    plan = await drawn(client, SHORT)
    (before,) = await compared(client, plan)
    world.robots[MINI].may_fly.clear()
    await upload(client, plan, start=True)
    await plan_in(client, plan, "running")
    world.robots[MINI].say(OnboardPlanState.RUNNING)
    (now,) = await compared(client, plan)
    assert now["brings"]["removed"] == pytest.approx(before["brings"]["removed"])


async def test_a_plan_of_another_robot_is_refused_by_its_field(client, in_threads):
    plan = await drawn(client, SHORT)
    answer = await client.get(
        f"/api/robots/{GRACE}/plans/comparison", params={"plan": [plan, plan]}
    )
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["loc"] == ["plans", 0]
    assert MINI in answer.json()["errors"][0]["msg"]
