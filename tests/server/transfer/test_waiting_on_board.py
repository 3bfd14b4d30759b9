"""A plan sent while another is flown: shown as waiting only by the robot's own word, then flown."""

import asyncio

from db.query.station.events import newest_events
from robot_link.messages import LinkState, OnboardPlanState
from server.access.role import Role
from tests.server.conftest import GRACE, MINI, api_client, open_station, until
from tests.server.fake_link import World, current_report, state_report
from tests.server.transfer.test_upload import DEEP, DIVE, draft, plan_in, transfer_in, upload

SHALLOW = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, d]} for d in (0.4, 0)]}
DEEPER = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, d]} for d in (0.6, 0)]}


async def flown(client, world, robot=MINI) -> str:
    """Let a robot fly a plan; return the plan."""
    world.robots[robot].may_end.clear()
    world.robots[robot].may_fly.clear()
    answer = await client.post(f"/api/robots/{robot}/plans", json=DIVE)
    plan = answer.json()["id"]
    await plan_in(client, plan, "draft")
    await upload(client, plan, start=True)
    await plan_in(client, plan, "running")
    return plan


async def sent_behind(client, *, start=False, body=SHALLOW) -> tuple[str, str]:
    """Send another plan; return it and its transfer once the robot keeps it."""
    plan = await draft(client, body)
    transfer = (await upload(client, plan, start=start)).json()["id"]
    await plan_in(client, plan, "waiting")

    async def over():
        return (await client.get(f"/api/transfers/{transfer}")).json()["ended_at"]

    await until(over)
    return plan, transfer


async def waiting_of(client, robot=MINI):
    return (await client.get(f"/api/robots/{robot}/state")).json()["waiting_plan"]


async def events(station) -> list[str]:
    found = await station.foundation.store.query(newest_events)
    return [one.kind for one in found]


async def test_plan_sent_behind_another_is_waiting_and_both_hashes_are_shown(client, world):
    first = await flown(client, world)
    second, transfer = await sent_behind(client)
    kept = await transfer_in(client, transfer, "kept")
    await until(lambda: world.robots[MINI].next)
    assert kept["level"] == "applied"
    assert "waits for the next surfacing" in kept["text"]
    plans = {one: (await client.get(f"/api/plans/{one}")).json() for one in (first, second)}
    assert plans[first]["state"] == "running"
    assert plans[second]["ladder"]["waiting_at"] is not None
    assert plans[second]["ladder"]["on_board_at"] is None
    shown = await waiting_of(client)
    assert (shown["plan_id"], shown["sha256"]) == (second, plans[second]["sha256"])
    assert (shown["flown_plan_id"], shown["flown_sha256"]) == (first, plans[first]["sha256"])
    assert shown["starts"] is False
    assert shown["text"].endswith(f"; {first} is flown on.")


async def test_started_plan_is_told_to_begin_at_the_surfacing_and_then_does(client, station, world):
    first = await flown(client, world)
    second, transfer = await sent_behind(client, start=True)
    ended = await transfer_in(client, transfer, "kept")

    async def held():
        return (await waiting_of(client))["starts"] or None

    await until(held)
    assert "is flown until then" in (await waiting_of(client))["text"]
    assert ended["state"] == "kept"
    assert (await client.get(f"/api/plans/{second}")).json()["state"] == "waiting"
    world.robots[MINI].change_over()
    await plan_in(client, second, "running")
    found = await plan_in(client, first, "superseded")
    assert "at a surfacing" in found["message"]
    assert await waiting_of(client) is None
    kinds = await events(station)
    assert kinds.index("plan.waiting") < kinds.index("plan.superseded")


async def test_plan_that_waits_is_started_later(client, world):
    await flown(client, world)
    second, _ = await sent_behind(client)
    answer = await upload(client, second, start=True)
    assert answer.status_code == 202, answer.text
    await until(lambda: world.robots[MINI].next_starts)
    assert len(world.uploads) == 2, "its bytes are not sent again"


async def test_plan_flown_to_its_end_is_done_though_its_last_word_was_lost(client, world):
    first = await flown(client, world)
    second, _ = await sent_behind(client, start=True)
    world.robots[MINI].change_over(is_done=True)
    await plan_in(client, first, "done")
    await plan_in(client, second, "running")


async def test_order_to_surface_purges_what_waits_once_the_robot_says_so(client, world):
    first = await flown(client, world)
    second, _ = await sent_behind(client)
    world.in_reach = False
    await client.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
    await asyncio.sleep(0.2)
    assert (await client.get(f"/api/plans/{second}")).json()["state"] == "waiting", "unheard"
    world.robots[MINI].keep(None)
    world.robots[MINI].end_early("surfaced by command")
    found = await plan_in(client, second, "draft")
    assert "no longer" in found["message"]
    await plan_in(client, first, "cancelled")


async def test_other_plan_takes_the_place_of_one_that_waits(client, world):
    await flown(client, world)
    second, _ = await sent_behind(client)
    third, _ = await sent_behind(client, body=DEEPER)
    await plan_in(client, second, "draft")
    assert (await waiting_of(client))["plan_id"] == third


async def test_station_that_starts_again_shows_what_waits_by_the_robot_s_last_word(
    tmp_path, world: World
):
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        world.tell(current_report(MINI))
        first = await flown(client, world)
        second, _ = await sent_behind(client, start=True)

        async def held():
            return (await waiting_of(client))["starts"] or None

        await until(held)
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        shown = await waiting_of(client)
        assert (shown["plan_id"], shown["flown_plan_id"]) == (second, first)
        assert shown["starts"] is True
        world.robots[MINI].change_over()
        await plan_in(client, second, "running")
        await plan_in(client, first, "superseded")


async def test_robot_that_was_switched_on_again_has_the_plan_on_board(client, world):
    first = await flown(client, world)
    second, _ = await sent_behind(client)
    robot = world.robots[MINI]
    robot.plan, robot.next = robot.next, None
    robot.say_queue()
    robot.say(OnboardPlanState.ON_BOARD, later_s=5.0)
    await plan_in(client, second, "on_board")
    await plan_in(client, first, "superseded")


async def test_plan_in_hand_is_the_one_that_is_flown(client, world):
    first = await flown(client, world)
    second, _ = await sent_behind(client)

    async def in_hand():
        return (await client.get(f"/api/robots/{MINI}")).json()["plan_id"]

    assert await in_hand() == first
    world.robots[MINI].say(OnboardPlanState.DONE)

    async def next_one():
        return await in_hand() == second or None

    await until(next_one)


async def test_two_robots_keep_a_plan_each_of_their_own(client, world):
    world.hear(GRACE)
    await flown(client, world)
    second, _ = await sent_behind(client)
    assert await waiting_of(client, GRACE) is None
    assert (await waiting_of(client))["plan_id"] == second


async def test_plan_that_breaks_a_limit_is_not_sent_behind_another_either(client, world):
    await flown(client, world)
    answer = await upload(client, await draft(client, DEEP))
    assert answer.status_code == 409
    assert "breaks" in answer.json()["detail"]


async def test_nothing_is_shown_to_wait_while_the_robot_is_not_heard(client, world):
    await flown(client, world)
    world.hear(MINI, LinkState.STALE)
    second = await draft(client, SHALLOW)
    await upload(client, second)
    await asyncio.sleep(0.2)
    assert (await client.get(f"/api/plans/{second}")).json()["state"] == "draft"
    assert await waiting_of(client) is None
    world.hear(MINI)
    await plan_in(client, second, "waiting")
