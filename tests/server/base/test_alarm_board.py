"""Alarms do not wait for other work of the database: what stands is told while that goes on."""

import asyncio
import threading
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path

import pytest
import pytest_asyncio

from db.query.station.alarms import open_alarms
from server.base import alarm_board
from server.base.event_bus import AlarmChanged
from server.base.foundation import Foundation, open_foundation
from server.base.settings import Settings
from tests.server.busy_writer import busy_writer
from tests.server.conftest import until

BAR_S = 2.0
"""So soon people are to hear of an alarm, on a machine that does nothing else."""


@pytest_asyncio.fixture
async def here(tmp_path: Path) -> AsyncIterator[Foundation]:
    async with AsyncExitStack() as stack:
        yield await open_foundation(Settings(data_dir=tmp_path), stack)


@pytest.fixture
def told(here: Foundation) -> list[str]:
    """Texts and states of the alarms that were told of."""
    found: list[str] = []
    here.bus.subscribe(
        AlarmChanged, lambda event: found.append(f"{event.alarm.text} {event.alarm.state}")
    )
    return found


def kept(here: Foundation) -> list[tuple[str, str]]:
    with here.store.read() as session:
        return [(one.text, one.state) for one in open_alarms(session)]


async def test_an_alarm_is_told_while_something_long_is_written(here: Foundation, told: list[str]):
    async with busy_writer(here.store):
        async with asyncio.timeout(60):
            await here.alarms.raise_("leak", "Leak.", level="critical", robot="mini-1")
            await here.alarms.raise_("silence", "Silent.", robot="mini-1")
            await here.alarms.clear("silence", robot="mini-1")
        assert told == ["Leak. unacknowledged", "Silent. unacknowledged", "Silent. returned"]
        assert kept(here) == []
    await here.alarms.save_waiting()
    assert kept(here) == [("Leak.", "unacknowledged"), ("Silent.", "returned")]
    assert len(told) == 3


def test_an_alarm_waits_for_the_database_no_longer_than_people_do():
    assert alarm_board._WRITE_PATIENCE_S < BAR_S / 2


async def test_a_person_hears_that_an_alarm_is_acknowledged_once_that_is_written(
    here: Foundation, told: list[str]
):
    alarm = await here.alarms.raise_("leak", "Leak.")
    async with busy_writer(here.store):
        seeing = asyncio.create_task(here.alarms.acknowledge(alarm.id, "ann"))
        await until(lambda: told[-1] == "Leak. acknowledged")
        assert not seeing.done()
        assert kept(here) == [("Leak.", "unacknowledged")]
    await seeing
    assert kept(here) == [("Leak.", "acknowledged")]


async def test_a_caller_that_goes_away_has_a_step_neither_lost_nor_written_twice(
    here: Foundation, told: list[str]
):
    async with busy_writer(here.store):
        raising = asyncio.create_task(here.alarms.raise_("leak", "Leak."))
        await asyncio.sleep(0.01)
        raising.cancel()
        await asyncio.gather(raising, return_exceptions=True)
        assert told == ["Leak. unacknowledged"]
    await here.alarms.save_waiting()
    assert kept(here) == [("Leak.", "unacknowledged")]


async def test_what_waits_is_written_before_the_store_is_closed(tmp_path: Path):
    async with AsyncExitStack() as stack:
        here = await open_foundation(Settings(data_dir=tmp_path), stack)
        end = threading.Event()
        here.store.change(lambda _: end.wait(60.0))
        await here.alarms.raise_("leak", "Leak.")
        end.set()
    async with AsyncExitStack() as stack:
        here = await open_foundation(Settings(data_dir=tmp_path), stack)
        assert [one.text for one in here.alarms.open] == ["Leak."]
