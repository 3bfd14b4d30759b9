"""Puts a station together: what is opened, in which order, and closed in reverse."""

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import Protocol

from db.store import Store
from robot_link.clock import SystemClock
from server.access.access import Access
from server.access.foundation import Foundation
from server.access.guard import Guard
from server.base.alarm_board import AlarmBoard
from server.base.background import Background
from server.base.clock_file import read_clock
from server.base.configuration import ConfigurationBook
from server.base.event_bus import EventBus
from server.base.job import JobBoard
from server.base.secret import SecretStore
from server.base.settings import Settings
from server.base.storage_watch import watch_storage

_ALARM_TASK = "alarm about"


class Service(Protocol):
    """What runs on a foundation: ``server.station.Station``, or a test's stand-in."""

    async def start(self) -> None:
        """Begin to work."""
        ...

    async def stop(self) -> None:
        """End all work."""
        ...


MakeService = Callable[[Foundation], Service]


@dataclass(frozen=True, slots=True)
class RunningStation:
    """A station that is open for work."""

    foundation: Foundation
    station: Service
    first_code: str | None
    """Code that creates the first admin, while nobody can sign in."""


@asynccontextmanager
async def run_station(
    settings: Settings, make_service: MakeService
) -> AsyncGenerator[RunningStation]:
    """Open a station, and close it in reverse order when the block ends.

    Raises:
        StoreUnavailableError: If the database cannot be opened.
        NewerSchemaError: If a later version of the station wrote it.
    """
    async with AsyncExitStack() as stack:
        foundation = await _open_foundation(settings, stack)
        first_code = await foundation.access.prepare()
        station = make_service(foundation)
        stack.push_async_callback(station.stop)
        await station.start()
        yield RunningStation(foundation, station, first_code)


async def _open_foundation(settings: Settings, stack: AsyncExitStack) -> Foundation:
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    clock = read_clock(settings.clock_file)
    store = await asyncio.to_thread(Store.open, settings.resolved_database_url)
    stack.push_async_callback(asyncio.to_thread, store.close)
    alarms = AlarmBoard(store, clock)
    background = Background(lambda name, error: _part_failed(background, alarms, name, error))
    stack.push_async_callback(background.stop)
    jobs = JobBoard(store, clock)
    stack.push_async_callback(jobs.stop)
    access = Access(store, clock, SystemClock(), settings.session_hours)
    await alarms.load()
    await jobs.load()
    background.start("storage watch", watch_storage(store, alarms, clock))
    return Foundation(
        settings=settings,
        clock=clock,
        store=store,
        bus=EventBus(),
        access=access,
        guard=Guard(access, settings),
        background=background,
        alarms=alarms,
        jobs=jobs,
        configurations=ConfigurationBook(store, clock),
        secrets=SecretStore(settings.secret_dir),
    )


def _part_failed(
    background: Background, alarms: AlarmBoard, name: str, error: BaseException
) -> None:
    if name.startswith(_ALARM_TASK):
        return
    text = f"A part of the station stopped ({name}: {type(error).__name__}); restart the station."
    background.start(f"{_ALARM_TASK} {name}", alarms.raise_(f"part:{name}", text, level="critical"))
