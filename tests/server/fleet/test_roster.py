"""The fleet follows what others write into the database, and nothing that robots alone say."""

import asyncio
from dataclasses import replace
from datetime import UTC, datetime, timedelta

from db.query.fleet.robots import change_robot
from db.query.station.events import add_event
from robot_link.messages import LogId, Sample
from server.base.event_bus import EventLogged
from server.fleet.fleet import Memory
from server.link.moments import CONTACT, DIVE_BEGUN, DIVE_ENDED, SURFACED
from tests.server.conftest import GRACE, MINI, until
from tests.server.fake_link import state_report

CHANGED = "robot.changed"


async def test_fleet_is_read_anew_when_somebody_changed_a_robot_and_not_when_it_dives(
    station, monkeypatch
):
    read: list[str] = []
    told: list[str] = []

    async def note(robot):
        read.append(robot)

    def change(session, text="Ada changed it."):
        add_event(session, datetime.now(UTC), CHANGED, text, robot=GRACE)

    def dive_and_change(session):
        for kind in (CONTACT, DIVE_BEGUN, DIVE_ENDED, SURFACED):
            add_event(session, datetime.now(UTC), kind, "It said so.", robot=MINI)
        change(session, "Ben changed it.")

    station.foundation.bus.subscribe(EventLogged, lambda logged: told.append(logged.event.text))
    monkeypatch.setattr(station.roster, "refresh", note)
    await station.foundation.store.write(change)
    # so that what the start logged was followed before
    await until(lambda: "Ada changed it." in told and GRACE in read)
    read.clear()
    await station.foundation.store.write(dive_and_change)
    await until(lambda: "Ben changed it." in told and read)
    assert read == [GRACE]


async def test_what_was_read_before_a_change_is_not_taken_up_after_it(station, monkeypatch):
    roster, has_read, may_go_on = station.roster, asyncio.Event(), asyncio.Event()
    take_up = roster._take_up

    async def late(record):
        monkeypatch.setattr(roster, "_take_up", take_up)
        has_read.set()
        await may_go_on.wait()
        await take_up(record)

    def rename(session):
        change_robot(session, MINI, name="Ada")

    monkeypatch.setattr(roster, "_take_up", late)
    async with asyncio.TaskGroup() as both:
        both.create_task(roster.refresh(MINI))
        await has_read.wait()
        await station.foundation.store.write(rename)
        second = both.create_task(roster.refresh(MINI))
        await asyncio.wait([second], timeout=0.5)  # time enough to overtake the first
        may_go_on.set()
    assert station.fleet.status(MINI).record.name == "Ada"


async def test_what_was_heard_while_the_database_was_read_stays(station, world):
    at = station.foundation.clock.now()
    before = at - timedelta(hours=1)
    old = Sample(MINI, LogId(1), 1, "temperature", 4.0, (0.5, 0.5, 0.1), 0.02, before, before)
    known = [old, replace(old, variable="salinity", value=0.2, sequence=2)]
    world.tell(state_report(MINI, (1.0, 0.5, 0.0), at))
    world.tell(replace(old, value=9.0, sequence=3, measured_at=at, received_at=at))
    station.fleet.remember(
        MINI, Memory(state_report(MINI, (0.5, 0.5, 0.0), before), None, known, [], None)
    )
    status = station.fleet.status(MINI)
    assert status.state.measured_at == at
    assert {key: one.value for key, one in status.samples.items()} == {
        "temperature": 9.0,
        "salinity": 0.2,
    }
