"""The fleet follows what others write into the database, and nothing that robots alone say."""

import asyncio
from datetime import UTC, datetime

from db.query.fleet.robots import change_robot
from db.query.station.events import add_event
from server.base.event_bus import EventLogged
from server.link.moments import CONTACT, DIVE_BEGUN, DIVE_ENDED, SURFACED
from tests.server.conftest import GRACE, MINI, until

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
