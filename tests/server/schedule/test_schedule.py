"""Plans that are sent later: when they are due, never late, never after they were cancelled."""

from collections import Counter
from datetime import UTC, datetime, timedelta

import pytest

from db.query.mission.transfers import get_transfer, newest_transfer
from db.query.station.events import newest_events, newest_of_kinds
from robot_link.clock import SystemClock
from robot_link.messages import LinkState, OnboardPlanState, RobotMode
from server.access.role import Role
from server.base import wakeups
from server.link.moments import DIVE_BEGUN, SURFACED
from server.schedule.schedule import Schedule
from server.schedule.state import SendEvidence, apply
from tests.server.conftest import GRACE, MINI, api_client, open_station, until
from tests.server.fake_link import current_report, state_report
from tests.server.transfer.test_upload import DEEP, draft, plan_in, upload

SURFACING = {"kind": "surfacing"}


class MovedClock:
    """The station's clock: the machine's, moved by hand."""

    def __init__(self):
        self.moved = timedelta()

    def now(self) -> datetime:
        return datetime.now(UTC) + self.moved

    def ahead(self, **span) -> str:
        return (self.now() + timedelta(**span)).isoformat()

    def move(self, **span):
        self.moved += timedelta(**span)


@pytest.fixture(autouse=True)
def clock(monkeypatch):
    monkeypatch.setattr(wakeups, "LONGEST_S", 0.05)
    moved = MovedClock()
    monkeypatch.setattr(SystemClock, "now", lambda _: moved.now())
    return moved


@pytest.fixture(autouse=True)
def looks(monkeypatch):
    """How often each scheduled send was looked at, to the end."""
    counted = Counter()
    look_at = Schedule._look_at

    async def counting(self, send):
        await look_at(self, send)
        counted[send.id] += 1

    monkeypatch.setattr(Schedule, "_look_at", counting)
    return counted


async def later(client, clock, plan, condition=None, *, life_s=3600.0, **body):
    """Have a plan sent later, from now on; a condition may be how many seconds it is to wait."""
    if isinstance(condition, float):
        condition = {"kind": "time", "at": clock.ahead(seconds=condition)}
    expires_at = clock.ahead(seconds=life_s)
    wish = {"condition": condition or SURFACING, "expires_at": expires_at, **body}
    return await client.post(f"/api/plans/{plan}/schedule", json=wish)


async def scheduled(client, clock, condition=None, **body):
    """Return a draft that waits, and how it waits."""
    plan = await draft(client)
    await plan_in(client, plan, "draft")
    answer = await later(client, clock, plan, condition, **body)
    assert answer.status_code == 201, answer.text
    return plan, answer.json()


async def sends_of(client, robot=MINI):
    return (await client.get(f"/api/robots/{robot}/schedule")).json()["sends"]


async def send_of(client, schedule, robot=MINI):
    return {one["id"]: one for one in await sends_of(client, robot)}[schedule]


async def send_in(client, schedule, *states, robot=MINI):
    async def there():
        found = await send_of(client, schedule, robot)
        return found if found["state"] in states else None

    return await until(there)


async def looked_at(station, looks, schedule, robot=MINI):
    """Wait until a send was looked at from its beginning with what is known now."""
    service, before = station.foundation.services.get(Schedule), looks[schedule]

    def is_done():
        service.wake(robot)
        return looks[schedule] >= before + 2

    await until(is_done)


async def still_waits(client, station, looks, schedule):
    await looked_at(station, looks, schedule)
    assert (await send_of(client, schedule))["state"] == "waiting"


async def logged(station, kind, since=0, robot=MINI):
    """Wait for a moment of a robot in the log that is newer than another; return its cursor."""

    async def there():
        found = await station.foundation.store.query(lambda s: newest_of_kinds(s, robot, (kind,)))
        return found.cursor if found is not None and found.cursor > since else None

    return await until(there)


def dive(world, robot=MINI, depth_m=0.6):
    world.tell(state_report(robot, (1.2, 0.6, depth_m), mode=RobotMode.GLIDING))


def surface(world, robot=MINI, **changes):
    world.tell(state_report(robot, (1.2, 0.6, 0.0), mode=RobotMode.SURFACED, **changes))


async def limit(client, most):
    answer = await client.patch("/api/config/automation", json={"most_sends_per_hour": most})
    assert answer.status_code == 200, answer.text


async def test_plan_is_sent_at_the_next_surfacing_and_not_before(
    client, world, clock, station, looks
):
    plan, send = await scheduled(client, clock)
    assert "waits at the station for the next surfacing" in send["text"]
    surface(world)  # it is at the surface already
    dive(world)
    await logged(station, DIVE_BEGUN)
    await still_waits(client, station, looks, send["id"])
    surface(world)
    done = await send_in(client, send["id"], "done")
    assert done["sent_at"] is not None
    assert plan in done["text"]
    await plan_in(client, plan, "on_board", "running", "done")


async def test_plan_is_sent_at_its_time(client, world, clock, station, looks):
    _, send = await scheduled(client, clock, 600.0)
    await still_waits(client, station, looks, send["id"])
    clock.move(seconds=600)
    done = await send_in(client, send["id"], "done")
    assert done["sent_at"] >= done["due_at"]
    assert len(world.uploads) == 1


async def test_plan_is_sent_when_a_value_is_under_its_limit(client, world, clock, station, looks):
    surface(world, battery_fraction=0.9)
    condition = {"kind": "value", "channel": "battery_fraction", "side": "under", "limit": 0.5}
    _, send = await scheduled(client, clock, condition)
    surface(world, battery_fraction=0.7)
    await still_waits(client, station, looks, send["id"])
    surface(world, battery_fraction=0.4)
    await send_in(client, send["id"], "done")


async def test_sequence_goes_on_when_the_plan_before_is_done(client, world, clock, station, looks):
    first = await draft(client)
    second = await draft(client)
    answer = await later(client, clock, second, {"kind": "after", "plan": first}, confirmed=True)
    assert answer.status_code == 201, answer.text
    world.robots[MINI].may_end.clear()
    await upload(client, first, start=True)
    await plan_in(client, first, "running")
    await still_waits(client, station, looks, answer.json()["id"])
    assert len(world.uploads) == 1
    world.robots[MINI].may_end.set()
    await plan_in(client, first, "done")
    await until(lambda: len(world.uploads) == 2)
    await plan_in(client, second, "running", "done")


async def test_sequence_ends_with_a_plan_that_was_given_up(client, world, clock):
    first = await draft(client)
    second = await draft(client)
    send = (await later(client, clock, second, {"kind": "after", "plan": first})).json()
    world.robots[MINI].may_fly.clear()
    await upload(client, first, start=True)
    await plan_in(client, first, "running")
    world.robots[MINI].end_early("the battery is below its reserve")
    found = await send_in(client, send["id"], "failed")
    assert "will never be done" in found["text"]
    assert len(world.uploads) == 1


async def test_expired_is_dropped_with_an_event_and_an_alarm_and_never_sent(
    client, station, world, clock
):
    plan, send = await scheduled(client, clock, life_s=600.0)
    clock.move(seconds=600)
    dropped = await send_in(client, send["id"], "expired")
    assert "its time was over" in dropped["text"]
    dive(world)
    surface(world)
    await logged(station, SURFACED)
    # one that is sent at the same surfacing says that the other was not
    _, later_one = await scheduled(client, clock)
    dive(world)
    surface(world)
    await send_in(client, later_one["id"], "done")
    assert len(world.uploads) == 1
    assert (await send_of(client, send["id"]))["state"] == "expired"
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"
    events = await station.foundation.store.query(newest_events)
    assert "schedule.expired" in [one.kind for one in events]
    alarms = (await client.get("/api/alarms")).json()["alarms"]
    assert any("its time was over" in one["text"] for one in alarms)


async def transfer_of(station, plan):
    """Return the newest transfer of a plan."""
    store = station.foundation.store
    newest = await store.query(lambda s: newest_transfer(s, plan))
    return await store.query(lambda s: get_transfer(s, newest))


async def test_transfer_that_has_not_arrived_when_its_time_is_over_is_withdrawn(
    client, world, clock, station
):
    world.hear(MINI, LinkState.STALE)
    plan, send = await scheduled(client, clock, 60.0, life_s=600.0)
    clock.move(seconds=60)
    await send_in(client, send["id"], "sent")
    assert world.uploads == [], "the robot is out of reach"
    clock.move(seconds=600)
    await send_in(client, send["id"], "expired")
    assert (await transfer_of(station, plan)).state == "withdrawn"
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"
    world.hear(MINI)
    _, later_one = await scheduled(client, clock, 60.0)
    clock.move(seconds=60)
    await send_in(client, later_one["id"], "done")
    assert len(world.uploads) == 1


async def test_cancelled_is_not_sent(client, world, clock):
    _, send = await scheduled(client, clock)
    answer = await client.post(f"/api/schedule/{send['id']}/cancel")
    assert answer.json()["state"] == "cancelled"
    assert (await client.post(f"/api/schedule/{send['id']}/cancel")).status_code == 409
    _, other = await scheduled(client, clock)
    dive(world)
    surface(world)
    await send_in(client, other["id"], "done")
    assert len(world.uploads) == 1


async def test_cancelling_one_that_is_sent_meanwhile_withdraws_it(
    client, world, clock, station, monkeypatch
):
    world.hear(MINI, LinkState.STALE)
    plan, send = await scheduled(client, clock, 600.0)
    store = station.foundation.store
    write = store.write

    async def sent_meanwhile(function):
        if function.__qualname__.startswith("Schedule.cancel"):
            clock.move(seconds=600)
            await send_in(client, send["id"], "sent")
        return await write(function)

    monkeypatch.setattr(store, "write", sent_meanwhile)
    answer = await client.post(f"/api/schedule/{send['id']}/cancel")
    assert answer.json()["state"] == "cancelled"
    assert (await transfer_of(station, plan)).state == "withdrawn"
    assert (await client.get(f"/api/plans/{plan}")).json()["state"] == "draft"


async def test_one_that_the_robot_has_is_not_cancelled(client, clock, monkeypatch):
    async def unseen(_self, _send, _now):
        """Let the arrival be in the table of transfers alone."""

    monkeypatch.setattr(Schedule, "_follow", unseen)
    plan, send = await scheduled(client, clock, 60.0, start=False)
    clock.move(seconds=60)
    await plan_in(client, plan, "on_board")
    answer = await client.post(f"/api/schedule/{send['id']}/cancel")
    assert answer.status_code == 409, answer.text
    assert f"{plan} is on board of {MINI}" in answer.json()["detail"]
    assert (await send_of(client, send["id"]))["state"] == "sent"


async def test_one_whose_transfer_is_unknown_has_failed(client, clock, station):
    _, send = await scheduled(client, clock)
    at = clock.now()
    await station.foundation.store.write(
        lambda session: apply(session, send["id"], SendEvidence.BEGUN, "It is sent.", at)
    )
    found = await send_in(client, send["id"], "failed", "done")
    assert found["state"] == "failed"
    assert "its transfer is not known" in found["text"]


async def test_one_that_waits_on_board_is_said_to_wait(client, world, clock):
    world.robots[MINI].may_end.clear()
    first = await draft(client)
    await upload(client, first, start=True)
    await plan_in(client, first, "running")
    plan, send = await scheduled(client, clock, 60.0, confirmed=True)
    clock.move(seconds=60)
    done = await send_in(client, send["id"], "done", "failed")
    assert done["text"] == f"{plan} waits on board of {MINI} behind the plan that it flies."


async def test_order_to_surface_purges_what_waits_for_its_robot_alone(
    client, world, clock, station, looks
):
    world.hear(GRACE)
    world.tell(state_report(GRACE, (150.0, 150.0, 0.0)))
    world.tell(current_report(GRACE))
    _, mine = await scheduled(client, clock)
    body = {"kind": "primitives", "legs": [{"kind": "dive", "end_ned": [0, 0, d]} for d in (3, 0)]}
    other = (await client.post(f"/api/robots/{GRACE}/plans", json=body)).json()["id"]
    await plan_in(client, other, "draft")
    kept = (await later(client, clock, other)).json()
    await client.post(f"/api/robots/{MINI}/commands", json={"kind": "surface"})
    await send_in(client, mine["id"], "withdrawn")
    await looked_at(station, looks, kept["id"], GRACE)
    found = await send_of(client, kept["id"], GRACE)
    assert (found["state"], found["can_cancel"]) == ("waiting", True)
    assert world.uploads == []


async def held(client, schedule, text):
    async def there():
        found = await send_of(client, schedule)
        return found if text in found["text"] else None

    return await until(there)


async def test_more_than_the_limit_of_an_hour_is_held_with_the_reason(client, world, clock):
    await limit(client, 1)
    _, first = await scheduled(client, clock, 60.0)
    clock.move(seconds=60)
    await send_in(client, first["id"], "done")
    await until(lambda: world.robots[MINI].state is OnboardPlanState.DONE)
    _, second = await scheduled(client, clock, 60.0, confirmed=True)
    clock.move(seconds=60)
    found = await held(client, second["id"], "the limit is 1")
    assert found["state"] == "waiting"
    assert len(world.uploads) == 1
    await limit(client, 2)
    await send_in(client, second["id"], "done")


async def test_held_one_is_looked_at_again_when_the_hour_is_over(client, clock, monkeypatch):
    await limit(client, 1)
    _, first = await scheduled(client, clock, 60.0)
    clock.move(seconds=60)
    sent_at = (await send_in(client, first["id"], "done"))["sent_at"]
    _, second = await scheduled(client, clock, 60.0, confirmed=True)
    due = []
    set_due = wakeups.Wakeups.set_due
    monkeypatch.setattr(
        wakeups.Wakeups,
        "set_due",
        lambda self, key, moment: (due.append((key, moment)), set_due(self, key, moment)),
    )
    clock.move(seconds=60)
    await held(client, second["id"], "held until")
    free_at = datetime.fromisoformat(sent_at) + timedelta(hours=1)
    await until(lambda: (MINI, free_at) in due)


CHEESE = {"kind": "value", "channel": "cheese", "side": "over", "limit": 1}


@pytest.mark.parametrize(
    ("condition", "at_h", "expires_h", "field"),
    [
        (SURFACING, None, None, "expires_at"),
        (SURFACING, None, -1.0, "expires_at"),
        (SURFACING, None, 30.0 * 24.0, "expires_at"),
        ({"kind": "time"}, 3.0, 1.0, "at"),
        ({"kind": "time"}, -1.0, 1.0, "at"),
        (CHEESE, None, 1.0, "channel"),
        ({"kind": "moon"}, None, 1.0, "condition"),
    ],
)
async def test_what_cannot_be_is_refused_by_its_field(
    client, clock, condition, at_h, expires_h, field
):
    plan = await draft(client)
    body = {"condition": dict(condition)}
    if at_h is not None:
        body["condition"]["at"] = clock.ahead(hours=at_h)
    if expires_h is not None:
        body["expires_at"] = clock.ahead(hours=expires_h)
    answer = await client.post(f"/api/plans/{plan}/schedule", json=body)
    assert answer.status_code == 422, answer.text
    assert any(field in one["loc"] for one in answer.json()["errors"])


async def test_plan_that_breaks_a_limit_and_one_that_waits_already_are_refused(client, clock):
    assert (await later(client, clock, await draft(client, DEEP))).status_code == 409
    plan, _ = await scheduled(client, clock)
    again = await later(client, clock, plan)
    assert again.status_code == 409
    assert "already" in again.json()["detail"]


async def test_same_wish_twice_acts_once(client, clock):
    plan = await draft(client)
    wish = {"condition": SURFACING, "expires_at": clock.ahead(hours=1)}
    headers = {"Idempotency-Key": "once"}
    answers = [
        await client.post(f"/api/plans/{plan}/schedule", json=wish, headers=headers)
        for _ in range(2)
    ]
    assert answers[0].json() == answers[1].json()
    assert len(await sends_of(client)) == 1


async def test_what_waits_survives_a_restart_and_what_came_meanwhile_counts(tmp_path, world, clock):
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        world.hear(MINI)
        surface(world)
        world.tell(current_report(MINI))
        dive(world)
        surface(world)
        await logged(station, SURFACED)
        plan, send = await scheduled(client, clock, 480.0)
        old, gone = await scheduled(client, clock, life_s=360.0)
        assert old != plan
    assert world.uploads == []
    clock.move(seconds=480)
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        await send_in(client, gone["id"], "expired")
        world.hear(MINI)
        surface(world)
        await send_in(client, send["id"], "done")
        assert len(world.uploads) == 1
