"""Alarms on their way to people: told, digested, escalated, kept through a kill."""

import asyncio
import time
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from db.notice_tables import NoticeItem
from db.query.station.events import add_event, events_after, last_cursor
from db.query.station.people import change_person
from db.query.station.settings import put_setting
from robot_link.clock import SystemClock
from server.access.role import Role
from server.base.event_bus import AlarmChanged, EventLogged
from server.notice import delivery, outbox
from tests.server.conftest import GRACE, MINI, until
from tests.server.fake_link import World, state_report
from tests.server.notice.conftest import NoticeStation, move, notice_station, settled, words
from tests.server.notice.receiver import Taken, web_service


async def test_a_leak_reaches_a_webhook_within_five_seconds_with_all_that_matters(
    here: NoticeStation, world: World
):
    async with web_service() as service:
        contact = await here.contact("ann", service.url)
        await here.wish("ann", position="minutes")
        assert (await here.notices.deliveries.test(contact))[1].is_handed  # the sender is warm
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        took_s = []
        for number in range(3):  # the machine may stand still once
            begun = time.monotonic()
            await here.alarms.raise_(
                f"leak {number}", "mini-1: Leak says yes.", level="critical", robot="mini-1"
            )
            await service.until_taken(2 + number)
            took_s.append(time.monotonic() - begun)
        assert min(took_s) < 5.0
    taken = service.taken[1]
    assert taken.json["title"].startswith("SIMULATION Critical: mini-1: Leak says yes.")
    text = words(taken)
    assert "mini-1: Leak says yes." in text
    assert "Page: http://127.0.0.1:8000/robot/mini-1" in text
    assert "Acknowledge (once, within 24 h): http://127.0.0.1:8000/ack/" in text
    assert (taken.json["robot"], taken.json["alarm"]) == ("mini-1", "alarm-1")
    await until(lambda: here.told_states(["handed"] * 4))


async def test_the_position_is_written_as_the_person_wants_it(here: NoticeStation, world: World):
    async with web_service() as service:
        await here.contact("ann", service.url)
        await here.wish("ann", position="seconds")
        world.hear(MINI)
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        await until(lambda: outbox_places(here).get("mini-1"))
        await here.alarms.raise_("leak", "mini-1: Leak says yes.", level="critical", robot="mini-1")
        (taken,) = await service.until_taken()
    assert "mini-1: last at " in words(taken)
    assert "\N{DOUBLE PRIME} N" in words(taken)


def outbox_places(here: NoticeStation):
    return here.notices._places()


async def test_without_an_address_of_the_station_messages_have_no_link_and_the_page_says_why(
    tmp_path: Path, world: World
):
    async with notice_station(tmp_path, world, public_origins=()) as here, web_service() as service:
        await here.person("ann")
        await here.contact("ann", service.url)
        await here.alarms.raise_("leak", "Leak.", level="critical")
        (taken,) = await service.until_taken()
        assert "http" not in words(taken)
        assert (await here.client.get("/api/notices/station")).json()["link_origin"] is None


async def test_a_viewer_gets_no_link_that_acknowledges(here: NoticeStation):
    async with web_service() as service:
        await here.person("eve", role="viewer")
        await here.contact("eve", service.url)
        await here.alarms.raise_("leak", "Leak.", level="critical")
        (taken,) = await service.until_taken()
        assert "/ack/" not in words(taken)
        assert "Page: " in words(taken)


async def test_ten_thousand_causes_in_a_minute_are_a_few_digests(here: NoticeStation):
    causes = 10_000
    async with web_service() as service:
        contact = await here.contact("ann", service.url)
        await here.notices.deliveries.test(contact)
        for number in range(causes):
            alarm = _made_up(number)
            here.notices.alarm_changed(alarm)
        begun = time.monotonic()
        await until(lambda: _total(service.taken[1:]) >= 1 and not here.notices._changed, 120.0)
        took_s = time.monotonic() - begun
        sent = len(service.taken) - 1
        assert sent <= outbox.BURST + took_s / outbox.REFILL_S + 1
        here.notices._buckets.clear()
        here.notices.deliveries.forgive()
        await until(lambda: _total(service.taken[1:]) == causes, 120.0)
    assert "more on the page" in words(service.taken[-1])


def _made_up(number: int):
    from db.query.station.alarms import AlarmRecord
    from server.base.event_bus import AlarmChanged

    return AlarmChanged(
        AlarmRecord(
            id=f"alarm-{number + 1}",
            cause=f"cause {number}",
            robot="mini-1",
            level="warning",
            text=f"Cause {number}.",
            state="unacknowledged",
            raised_at=SystemClock().now(),
        )
    )


def _total(taken: list[Taken]) -> int:
    total = 0
    for one in taken:
        title = one.json["title"].removeprefix("SIMULATION Warning: ")
        total += int(title.split(" notices")[0]) if " notices" in title else 1
    return total


async def test_nobody_acknowledges_so_the_next_is_called_and_then_it_ends(
    tmp_path: Path, world: World, moving: list[timedelta]
):
    async with notice_station(tmp_path, world) as here, web_service() as first, web_service() as on:
        for name, service in (("ann", first), ("ben", on)):
            await here.person(name)
            await here.contact(name, service.url)
        await here.wish("ben", alarms={"station": "none"})
        await here.set_up(steps=[{"people": ["ben"], "after_minutes": 10}], repeat_minutes=30)
        alarm = await here.alarms.raise_("leak", "Leak.", level="critical")
        await first.until_taken()
        await move(here, moving, minutes=9)
        assert on.taken == []
        await move(here, moving, minutes=2)
        (called,) = await on.until_taken()
        assert "Nobody has acknowledged this yet." in words(called)
        await move(here, moving, minutes=31)
        await on.until_taken(2)
        await here.alarms.acknowledge(alarm.id, "ben")
        await move(here, moving, minutes=120)
        assert (len(first.taken), len(on.taken)) == (1, 2)


async def test_a_step_that_reaches_nobody_is_left_out_at_once(
    tmp_path: Path, world: World, moving: list[timedelta]
):
    async with notice_station(tmp_path, world) as here, web_service() as service:
        for name in ("ann", "ben", "cat"):
            await here.person(name)
        await here.contact("cat", service.url)
        await here.wish("cat", alarms={"station": "none"})
        steps = [
            {"people": ["ann"], "after_minutes": 10},
            {"people": ["cat"], "after_minutes": 10},
        ]
        await here.set_up(steps=steps)
        await here.alarms.raise_("leak", "Leak.", level="critical")
        await service.until_taken()  # with no time passing: nobody else has a contact


async def test_an_alarm_that_comes_and_goes_is_told_once_in_ten_minutes(
    tmp_path: Path, world: World, moving: list[timedelta]
):
    async with notice_station(tmp_path, world) as here, web_service() as service:
        await here.person("ann")
        await here.contact("ann", service.url)
        for _ in range(5):
            await here.alarms.raise_("leak", "Leak.", level="critical")
            await service.until_taken()
            await here.alarms.clear("leak")
            await move(here, moving, minutes=1)
        await here.alarms.raise_("leak", "Leak.", level="critical")
        assert len(service.taken) == 1
        await move(here, moving, minutes=6)
        await service.until_taken(2)


async def test_one_that_gets_worse_is_told_anew(here: NoticeStation):
    async with web_service() as service:
        await here.contact("ann", service.url)
        await here.alarms.raise_("battery", "20 % left.", level="warning")
        await service.until_taken()
        await here.alarms.raise_("battery", "9 % left.", level="critical")
        _, worse = await service.until_taken(2)
        assert worse.json["title"].startswith("SIMULATION Critical: 9 % left.")


async def test_quiet_hours_hold_a_warning_until_they_end_unless_somebody_saw_it(
    tmp_path: Path, world: World, moving: list[timedelta]
):
    async with notice_station(tmp_path, world) as here, web_service() as service:
        await here.person("ann")
        await here.contact("ann", service.url)
        now = here.foundation.clock.now()
        begin, end = now - timedelta(hours=1), now + timedelta(hours=2)
        await here.wish("ann", quiet={"begin": f"{begin:%H:%M}", "end": f"{end:%H:%M}"})
        kept = await here.alarms.raise_("kept", "Kept.", level="warning")
        seen = await here.alarms.raise_("seen", "Seen.", level="warning")
        await here.alarms.raise_("leak", "Leak.", level="critical")
        (loud,) = await service.until_taken()
        assert "Leak." in words(loud)
        await here.alarms.acknowledge(seen.id, "ben")
        await move(here, moving, minutes=125)
        _, morning = await service.until_taken(2)
        assert "Kept." in words(morning)
        assert "Seen." not in words(morning)
        assert kept.state == "unacknowledged"


async def test_surfacings_and_plans_are_told_to_who_wants_them(here: NoticeStation):
    from db.query.station.events import add_event

    async with web_service() as ann, web_service() as ben:
        await here.contact("ann", ann.url)
        await here.contact("ben", ben.url)
        await here.wish("ann", surfaced=True)
        await here.wish("ben", plan=True)
        for kind in ("robot.surfaced", "plan.done"):
            await here.foundation.store.write(
                lambda session, kind=kind: add_event(
                    session, here.foundation.clock.now(), kind, f"It is {kind}.", robot="mini-1"
                )
            )
        (surfaced,), (plan,) = await ann.until_taken(), await ben.until_taken()
        assert "It is robot.surfaced." in words(surfaced)
        assert "It is plan.done." in words(plan)
        assert "/ack/" not in words(plan)


async def test_a_service_that_fails_is_one_alarm_and_is_tried_until_it_takes_it(
    here: NoticeStation, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(delivery, "BACK_OFF_S", (0.2,))
    async with web_service("break") as service, web_service() as good:
        await here.contact("ann", service.url)
        await here.contact("ben", good.url)
        await here.alarms.raise_("leak", "Leak.", level="critical")
        await good.until_taken()  # one that fails holds up no other
        await service.until_called(3)
        own = [alarm for alarm in here.alarms.open if alarm.cause == delivery.OWN_CAUSE]
        assert len(own) == 1
        assert own[0].text.startswith("Notices to ann (phone) cannot be sent since ")
        assert "HTTP 500 Trouble" in own[0].text
        service.mode = "take"
        (taken,) = (await service.until_taken())[:1]
        assert "Leak." in words(taken)
        await until(
            lambda: all(
                alarm.cleared_at for alarm in here.alarms.open if alarm.cause == delivery.OWN_CAUSE
            )
        )


async def test_a_service_that_refuses_is_given_up_with_its_reply(
    here: NoticeStation, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(delivery, "BACK_OFF_S", (0.1,))
    async with web_service("refuse") as service:
        await here.contact("ann", service.url)
        await here.alarms.raise_("leak", "Leak.", level="critical")
        leak = await until(lambda: _ended(here))
        assert (leak["state"], leak["attempts"]) == ("given_up", delivery.REFUSALS_MAX)
        assert leak["reply"] == "HTTP 403 Forbidden: thank you"


async def _ended(here: NoticeStation):
    """Return the notice of the leak once it has ended."""
    told = [one for one in await here.told() if "Leak." in one["title"]]
    return next((one for one in told if one["ended_at"] is not None), None)


async def test_what_somebody_has_seen_is_not_sent_any_more(
    here: NoticeStation, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(delivery, "BACK_OFF_S", (0.3,))
    async with web_service("break") as service:
        await here.contact("ann", service.url)
        alarm = await here.alarms.raise_("leak", "Leak.", level="critical", robot="mini-1")
        await service.until_called()
        await here.alarms.acknowledge(alarm.id, "ben")
        ended = await until(lambda: _ended(here))
        assert ended["state"] == "withdrawn"


async def test_a_notice_that_was_written_and_not_sent_is_sent_after_a_restart(
    tmp_path: Path, world: World, monkeypatch: pytest.MonkeyPatch
):
    async with web_service() as service:
        async with notice_station(tmp_path, world) as here:
            await here.person("ann")
            await here.contact("ann", service.url)
            monkeypatch.setattr(here.notices.deliveries, "begin", lambda _: None)
            await here.alarms.raise_("leak", "Leak.", level="critical")
            (queued,) = await until(here.told)
            assert queued["state"] == "queued"
        assert service.taken == []
        async with notice_station(tmp_path, world) as again:
            (taken,) = await service.until_taken()
            assert taken.headers["idempotency-key"] == queued["id"]
            await until(lambda: _ended(again))


async def test_an_alarm_raised_just_before_a_stop_is_told_after_it(tmp_path: Path, world: World):
    async with web_service() as service:
        async with notice_station(tmp_path, world) as here:
            await here.person("ann")
            await here.contact("ann", service.url)
            here.foundation.bus._handlers.clear()  # the station dies before anybody heard
            await here.alarms.raise_("leak", "Leak.", level="critical")
        async with notice_station(tmp_path, world):
            (taken,) = await service.until_taken()
            assert "Leak." in words(taken)


async def grant(here: NoticeStation, role: Role, robot: str, granted: Role) -> None:
    """Let ben have a role for all robots and another one for one of them."""
    grants = [{"robot": robot, "role": granted}]
    changed = await here.client.patch("/api/people/ben", json={"role": role, "grants": grants})
    assert changed.status_code == 200, changed.text


async def test_who_may_see_chosen_robots_is_told_of_those_alone(
    moving: list[timedelta], here: NoticeStation
):
    await here.person("dan", Role.ADMIN)
    await grant(here, Role.NONE, MINI, Role.PILOT)
    async with web_service() as of_ann, web_service() as of_ben:
        await here.contact("ann", of_ann.url)
        await here.contact("ben", of_ben.url)
        await here.set_up(steps=[{"people": ["ben"], "after_minutes": 10}])
        await here.alarms.raise_("leak", "It leaks.", level="critical", robot=GRACE)
        await here.alarms.raise_("storage", "The disk is full.", level="critical")
        await of_ann.until_taken(2)
        await move(here, moving, minutes=11)
        await here.alarms.raise_("hot", "It is hot.", level="critical", robot=MINI)
        await of_ann.until_taken(3)
        (told,) = await of_ben.until_taken()
    assert told.json["robot"] == MINI
    assert "It is hot." in words(told)
    of_ben_alone = [one for one in await here.told() if one["person"] == "ben"]
    assert [one["items"] for one in of_ben_alone] == [1]


async def test_what_waits_is_not_told_to_who_may_not_see_it_any_more(
    moving: list[timedelta], here: NoticeStation
):
    await here.person("dan", Role.ADMIN)
    await grant(here, Role.NONE, MINI, Role.PILOT)
    async with web_service() as service:
        await here.contact("ben", service.url)
        now = here.foundation.clock.now()
        begin, end = now - timedelta(hours=1), now + timedelta(hours=2)
        await here.wish("ben", quiet={"begin": f"{begin:%H:%M}", "end": f"{end:%H:%M}"})
        await here.alarms.raise_("kept", "It waits.", level="warning", robot=MINI)
        await here.alarms.raise_("leak", "It leaks.", level="critical", robot=MINI)
        (loud,) = await service.until_taken()
        assert "It waits." not in words(loud)
        await grant(here, Role.NONE, GRACE, Role.PILOT)
        await here.alarms.raise_("slow", "It is slow.", level="warning", robot=GRACE)
        await move(here, moving, minutes=125)
        _, morning = await service.until_taken(2)
    assert morning.json["robot"] == GRACE
    assert "It is slow." in words(morning)
    assert "It waits." not in words(morning)


async def test_what_waits_for_who_was_shut_out_holds_up_nobody_else(
    moving: list[timedelta], here: NoticeStation
):
    async with web_service() as of_ben, web_service() as of_ann:
        await here.contact("ben", of_ben.url)
        now = here.foundation.clock.now()
        begin, end = now - timedelta(hours=1), now + timedelta(hours=2)
        await here.wish("ben", quiet={"begin": f"{begin:%H:%M}", "end": f"{end:%H:%M}"})
        await here.alarms.raise_("kept", "It waits.", level="warning")
        await until(lambda: here.foundation.store.query(one_item_waits))
        await here.foundation.store.write(
            lambda session: change_person(session, "ben", disabled=True, at=now)
        )
        await here.contact("ann", of_ann.url)
        await move(here, moving, minutes=125)
        await here.alarms.raise_("leak", "It leaks.", level="critical")
        (taken,) = await of_ann.until_taken()
        assert "It leaks." in words(taken)
        assert of_ben.taken == []


def one_item_waits(session: Session) -> bool:
    return session.scalar(select(func.count()).select_from(NoticeItem)) == 1


async def test_a_contact_that_goes_just_before_its_message_is_written_ends_nothing(
    here: NoticeStation,
):
    assert await here.notices._take_up("contact-7", "station", SystemClock().now()) is None


async def test_link_acknowledges_alarms_of_robots_that_its_person_may_pilot_and_no_others(
    here: NoticeStation,
):
    await here.person("dan", Role.ADMIN)
    await grant(here, Role.VIEWER, MINI, Role.PILOT)
    async with web_service() as service:
        await here.contact("ben", service.url)
        await here.alarms.raise_("leak", "It leaks.", level="critical", robot=GRACE)
        (foreign,) = await service.until_taken()
        assert "/ack/" not in words(foreign)
        await here.alarms.raise_("leak", "It leaks.", level="critical", robot=MINI)
        _, own = await service.until_taken(2)
    address = words(own).split("24 h): ")[1].split()[0]
    await grant(here, Role.VIEWER, GRACE, Role.PILOT)
    assert (await here.client.post(address)).status_code == 410
    assert all(alarm.acknowledged_at is None for alarm in here.alarms.open)
    await grant(here, Role.VIEWER, MINI, Role.PILOT)
    assert (await here.client.post(address)).status_code == 200
    seen = {alarm.robot for alarm in here.alarms.open if alarm.acknowledged_at is not None}
    assert seen == {MINI}


async def test_a_station_that_starts_takes_up_every_event_and_what_happens_meanwhile(
    here: NoticeStation, monkeypatch: pytest.MonkeyPatch
):
    store, at = here.foundation.store, SystemClock().now()
    monkeypatch.setattr(here.notices, "event_logged", lambda event: None)
    count = 2 * outbox._AT_ONCE + 3
    await settled(here)

    def write(session: Session) -> int:
        cursor = last_cursor(session)
        put_setting(session, outbox._CURSOR, {"cursor": cursor})
        for number in range(count):
            add_event(session, at, "plan.done", f"Plan {number} is done.", robot=MINI)
        return cursor

    with monkeypatch.context() as patch:
        patch.setattr(here.notices, "_plan", _nothing)  # no round has begun: it would tell them
        alarm = await here.alarms.raise_("leak", "It leaks.")
        cursor = await store.write(write)
        fresh = outbox.Notices(here.foundation, dict, here.notices.deliveries._sender)
        patch.setattr(fresh.deliveries, "load", _nothing)
        loading = asyncio.create_task(fresh.load())
        await asyncio.sleep(0)
        worse = replace(alarm, level="critical")
        fresh.alarm_changed(AlarmChanged(worse))
        (late,) = await store.query(lambda session: events_after(session, cursor, limit=1))
        late = replace(late, cursor=cursor + count + 10)
        fresh.event_logged(EventLogged(late))
        await loading
    assert len(fresh._events) == count + 1
    assert fresh._events[-1] is late
    assert fresh._changed == {alarm.id: worse}


async def _nothing() -> None:
    return None
