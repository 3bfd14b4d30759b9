"""Plans that are sent later: when they are due, never late, never after they were cancelled."""

import asyncio
from datetime import UTC, datetime, timedelta

import pytest

from db.query.station.events import newest_events
from robot_link.messages import LinkState, OnboardPlanState, RobotMode
from server.access.role import Role
from server.base import wakeups
from tests.server.conftest import GRACE, MINI, api_client, open_station, until
from tests.server.fake_link import current_report, state_report
from tests.server.transfer.test_upload import DEEP, DIVE, draft, plan_in, upload

SURFACING = {"kind": "surfacing"}


@pytest.fixture(autouse=True)
def _hasty(monkeypatch):
    monkeypatch.setattr(wakeups, "LONGEST_S", 0.05)


def ahead(**span) -> str:
    return (datetime.now(UTC) + timedelta(**span)).isoformat()


async def later(client, plan, condition=None, **body):
    wish = {"condition": condition or SURFACING, "expires_at": ahead(hours=1), **body}
    return await client.post(f"/api/plans/{plan}/schedule", json=wish)


async def scheduled(client, condition=None, **body):
    """Return a draft that waits, and how it waits."""
    plan = await draft(client)
    answer = await later(client, plan, condition, **body)
    assert answer.status_code == 202, answer.text
    return plan, answer.json()


async def sends_of(client, robot=MINI):
    return (await client.get(f"/api/robots/{robot}/schedule")).json()["sends"]


async def send_in(client, schedule, *states, robot=MINI):
    async def there():
        found = {one["id"]: one for one in await sends_of(client, robot)}[schedule]
        return found if found["state"] in states else None

    return await until(there)


def dive(world, robot=MINI, depth_m=0.6):
    world.tell(state_report(robot, (1.2, 0.6, depth_m), mode=RobotMode.GLIDING))


def surface(world, robot=MINI, **changes):
    world.tell(state_report(robot, (1.2, 0.6, 0.0), mode=RobotMode.SURFACED, **changes))


async def limit(client, most):
    answer = await client.patch("/api/config/automation", json={"most_sends_per_hour": most})
    assert answer.status_code == 200, answer.text


async def test_plan_is_sent_at_the_next_surfacing_and_not_before(client, world):
    plan, send = await scheduled(client)
    assert "waits at the station for the next surfacing" in send["text"]
    surface(world)  # it is at the surface already
    await asyncio.sleep(0.8)
    assert world.uploads == []
    dive(world)
    await asyncio.sleep(0.8)
    assert world.uploads == []
    surface(world)
    await until(lambda: world.uploads)
    done = await send_in(client, send["id"], "done")
    assert done["sent_at"] is not None
    await plan_in(client, plan, "on_board", "running", "done")


async def test_plan_is_sent_at_its_time(client, world):
    at = ahead(seconds=5)
    _, send = await scheduled(client, {"kind": "time", "at": at})
    await until(lambda: world.uploads)
    assert datetime.now(UTC) >= datetime.fromisoformat(at)
    await send_in(client, send["id"], "done")


async def test_plan_is_sent_when_a_value_is_under_its_limit(client, world):
    surface(world, battery_fraction=0.9)
    condition = {"kind": "value", "channel": "battery_fraction", "side": "under", "limit": 0.5}
    _, send = await scheduled(client, condition)
    surface(world, battery_fraction=0.7)
    await asyncio.sleep(0.8)
    assert world.uploads == []
    surface(world, battery_fraction=0.4)
    await until(lambda: world.uploads)
    await send_in(client, send["id"], "done")


async def test_sequence_goes_on_when_the_plan_before_is_done(client, world):
    first = await draft(client)
    second = await draft(client, {**DIVE, "legs": DIVE["legs"][:1] + DIVE["legs"][1:]})
    answer = await later(client, second, {"kind": "after", "plan": first}, confirmed=True)
    assert answer.status_code == 202, answer.text
    world.robots[MINI].may_end.clear()
    await upload(client, first, start=True)
    await plan_in(client, first, "running")
    await asyncio.sleep(0.6)
    assert len(world.uploads) == 1
    world.robots[MINI].may_end.set()
    await plan_in(client, first, "done")
    await until(lambda: len(world.uploads) == 2)
    await plan_in(client, second, "running", "done")


async def test_sequence_ends_with_a_plan_that_was_given_up(client, world):
    first = await draft(client)
    second = await draft(client)
    send = (await later(client, second, {"kind": "after", "plan": first})).json()
    world.robots[MINI].may_fly.clear()
    await upload(client, first, start=True)
    await plan_in(client, first, "running")
    world.robots[MINI].end_early("the battery is below its reserve")
    found = await send_in(client, send["id"], "failed")
    assert "will never be done" in found["text"]
    assert len(world.uploads) == 1


async def test_expired_is_dropped_with_an_event_and_an_alarm_and_never_sent(client, station, world):
    plan, send = await scheduled(client, expires_at=ahead(seconds=5))
    dropped = await send_in(client, send["id"], "expired")
    assert "its time was over" in dropped["text"]
    dive(world)
    surface(world)
    await asyncio.sleep(1.0)
    assert world.uploads == []
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"
    events = await station.foundation.store.query(newest_events)
    assert "schedule.expired" in [one.kind for one in events]
    alarms = (await client.get("/api/alarms")).json()["alarms"]
    assert any("its time was over" in one["text"] for one in alarms)


async def test_transfer_that_has_not_arrived_when_its_time_is_over_is_withdrawn(client, world):
    world.hear(MINI, LinkState.STALE)
    plan, send = await scheduled(
        client, {"kind": "time", "at": ahead(seconds=5)}, expires_at=ahead(seconds=9)
    )
    await send_in(client, send["id"], "sent")
    assert world.uploads == [], "the robot is out of reach"
    await send_in(client, send["id"], "expired")
    world.hear(MINI)
    await asyncio.sleep(1.0)
    assert world.uploads == []
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"


async def test_cancelled_is_not_sent(client, world):
    _, send = await scheduled(client)
    answer = await client.post(f"/api/schedule/{send['id']}/cancel")
    assert answer.json()["state"] == "cancelled"
    assert (await client.post(f"/api/schedule/{send['id']}/cancel")).status_code == 409
    dive(world)
    surface(world)
    await asyncio.sleep(0.8)
    assert world.uploads == []


async def test_order_to_surface_purges_what_waits_for_its_robot_alone(client, world):
    world.hear(GRACE)
    world.tell(state_report(GRACE, (150.0, 150.0, 0.0)))
    world.tell(current_report(GRACE))
    _, mine = await scheduled(client)
    body = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, d]} for d in (3, 0)]}
    other = (await client.post(f"/api/robots/{GRACE}/plans", json=body)).json()["id"]
    await plan_in(client, other, "draft")
    kept = (await later(client, other)).json()
    await client.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
    await send_in(client, mine["id"], "withdrawn")
    assert (await send_in(client, kept["id"], "waiting", robot=GRACE))["can_cancel"]
    dive(world)
    surface(world)
    await asyncio.sleep(0.8)
    assert world.uploads == []


async def test_more_than_the_limit_of_an_hour_is_held_with_the_reason(client, world):
    await limit(client, 1)
    _, first = await scheduled(client, {"kind": "time", "at": ahead(seconds=5)})
    await send_in(client, first["id"], "done")
    await until(lambda: world.robots[MINI].state is OnboardPlanState.DONE)
    _, second = await scheduled(client, {"kind": "time", "at": ahead(seconds=5)}, confirmed=True)

    async def held():
        found = {one["id"]: one for one in await sends_of(client)}[second["id"]]
        return found if "the limit is 1" in found["text"] else None

    found = await until(held)
    assert found["state"] == "waiting"
    assert len(world.uploads) == 1
    await limit(client, 2)
    await send_in(client, second["id"], "done")


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"condition": SURFACING}, "expires_at"),
        ({"condition": SURFACING, "expires_at": ahead(hours=-1)}, "expires_at"),
        ({"condition": SURFACING, "expires_at": ahead(days=30)}, "expires_at"),
        (
            {"condition": {"kind": "time", "at": ahead(hours=3)}, "expires_at": ahead(hours=1)},
            "at",
        ),
        (
            {
                "condition": {"kind": "value", "channel": "cheese", "side": "over", "limit": 1},
                "expires_at": ahead(hours=1),
            },
            "channel",
        ),
        ({"condition": {"kind": "moon"}, "expires_at": ahead(hours=1)}, "condition"),
    ],
)
async def test_what_cannot_be_is_refused_by_its_field(client, body, field):
    answer = await client.post(f"/api/plans/{await draft(client)}/schedule", json=body)
    assert answer.status_code == 422, answer.text
    assert any(field in one["loc"] for one in answer.json()["errors"])


async def test_plan_that_breaks_a_limit_and_one_that_waits_already_are_refused(client):
    assert (await later(client, await draft(client, DEEP))).status_code == 409
    plan, _ = await scheduled(client)
    again = await later(client, plan)
    assert again.status_code == 409
    assert "already" in again.json()["detail"]


async def test_same_wish_twice_acts_once(client):
    plan = await draft(client)
    wish = {"condition": SURFACING, "expires_at": ahead(hours=1)}
    headers = {"Idempotency-Key": "once"}
    answers = [
        await client.post(f"/api/plans/{plan}/schedule", json=wish, headers=headers)
        for _ in range(2)
    ]
    assert answers[0].json() == answers[1].json()
    assert len(await sends_of(client)) == 1


async def test_what_waits_survives_a_restart_and_what_came_meanwhile_counts(tmp_path, world):
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        world.hear(MINI)
        surface(world)
        world.tell(current_report(MINI))
        dive(world)
        surface(world)
        plan, send = await scheduled(client, {"kind": "time", "at": ahead(seconds=8)})
        old, gone = await scheduled(client, expires_at=ahead(seconds=6))
        assert old != plan
    assert world.uploads == []
    await asyncio.sleep(8.0)
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        await send_in(client, gone["id"], "expired")
        world.hear(MINI)
        surface(world)
        await send_in(client, send["id"], "done")
        assert len(world.uploads) == 1
