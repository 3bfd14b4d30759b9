"""What every service and route of one station stands on."""

import asyncio
import contextlib
from collections.abc import Sequence
from contextlib import AbstractContextManager, AsyncExitStack
from dataclasses import dataclass
from typing import Any, TypeVar

from db.fault import StoreUnavailableError
from db.query.station.settings import put_setting
from db.store import Store
from robot_link.clock import Clock
from server.base.alarm_board import AlarmBoard
from server.base.channels import Channels
from server.base.clock_file import read_clock
from server.base.configuration import ConfigurationBook
from server.base.decision.decisions import Decisions
from server.base.event_bus import EventBus, EventLogged, JobChanged
from server.base.event_log import EventLog
from server.base.job import JobBoard
from server.base.lifetime import Background, Lifetime
from server.base.live_feed import LiveFeed
from server.base.metric.metrics import Metrics
from server.base.secret import SecretStore
from server.base.settings import Settings
from server.base.work.changes import Changes
from server.base.worker import WorkerPool

S = TypeVar("S")


class Services:
    """What the capabilities of one station have made so far.

    A capability asks for what lies below it while it is installed; a route asks for its own
    service by ``server.base.dependency.service``.
    """

    def __init__(self) -> None:
        self._services: dict[type, Any] = {}

    def add(self, service: S, kind: type[S] | None = None) -> S:
        """Keep a service under its own type, or under the protocol that it stands for."""
        self._services[kind or type(service)] = service
        return service

    def get(self, kind: type[S]) -> S:
        """Return the service of a type.

        Raises:
            LookupError: If nobody has installed it.
        """
        try:
            return self._services[kind]
        except KeyError:
            raise LookupError(f"no {kind.__name__} is installed") from None


PLANNING_NICENESS = 5
"""Planning and fits of maps give way to the station itself, which must answer meanwhile."""
STUDY_NICENESS = 10
"""What-if runs and identifications give way to the planner and to the station itself."""
_ALARM_TASK = "alarm about"


@dataclass(frozen=True, slots=True)
class Foundation:
    """The shared parts of one station, opened before its capabilities and closed after them."""

    settings: Settings
    clock: Clock
    """Time of the robots: events, plans and measurements. A demo's runs faster than the wall."""
    store: Store
    bus: EventBus
    """What happened, told after it was committed."""
    background: Background
    alarms: AlarmBoard
    jobs: JobBoard
    channels: Channels
    """What robots can measure, as this station has it."""
    configurations: ConfigurationBook
    secrets: SecretStore
    """Keys of robots and accounts with gateways; what it holds is shown to nobody."""
    feed: LiveFeed
    event_log: EventLog
    changes: Changes
    """Wakes requests that wait for a change of one thing."""
    workers: WorkerPool
    study_workers: WorkerPool
    """Processes that give way to all others."""
    decisions: Decisions
    """What is decided in either, and can be decided once more."""
    metrics: Metrics
    """Where each capability says how it is, in figures."""
    services: Services
    """What the capabilities have installed."""
    lifetime: Lifetime
    """Where capabilities say what is to be loaded, started and ended."""


async def open_foundation(settings: Settings, stack: AsyncExitStack) -> Foundation:
    """Open the database and what works on it; the stack closes it.

    Raises:
        StoreUnavailableError: If the database cannot be opened.
        NewerSchemaError: If a later version of the station wrote it.
    """
    settings.data_dir.mkdir(parents=True, exist_ok=True, mode=0o700)
    clock = read_clock(settings.clock_file)
    store = await asyncio.to_thread(
        Store.open, settings.resolved_database_url, bridge_dir=settings.data_dir
    )
    stack.push_async_callback(asyncio.to_thread, store.close)
    bus = EventBus()
    stack.enter_context(_telling(store, bus))
    alarms = AlarmBoard(store, clock, bus)
    stack.push_async_callback(alarms.stop)
    background = Background(lambda name, error: _part_failed(background, alarms, name, error))
    bus.on_failure = lambda name, error: _part_failed(background, alarms, name, error)
    stack.push_async_callback(background.stop)
    jobs = JobBoard(store, clock, bus)
    stack.push_async_callback(jobs.stop)
    workers = WorkerPool(settings.worker_processes, niceness=PLANNING_NICENESS)
    study_workers = WorkerPool(settings.worker_processes, niceness=STUDY_NICENESS)
    stack.push_async_callback(workers.stop)
    stack.push_async_callback(study_workers.stop)
    event_log = EventLog(store, bus)
    feed = LiveFeed(store, clock, alarms.unacknowledged_of, event_log)
    bus.subscribe(EventLogged, feed.take)
    lifetime = Lifetime(background)
    lifetime.on_closing(feed.close)
    lifetime.on_closing(event_log.close)
    changes = Changes(bus)
    changes.follow(JobChanged, lambda event: event.job.id)
    lifetime.on_closing(changes.close)
    lifetime.run("live stream", feed.run)
    lifetime.run("event log", event_log.run)
    lifetime.on_closing(workers.hurry)
    lifetime.on_closing(study_workers.hurry)
    await alarms.load()
    await jobs.load()
    channels = Channels(store, clock, bus)
    await channels.load()
    background.start("storage watch", watch_storage(store, alarms, clock))
    return Foundation(
        settings=settings,
        clock=clock,
        store=store,
        bus=bus,
        background=background,
        alarms=alarms,
        jobs=jobs,
        channels=channels,
        configurations=ConfigurationBook(store, clock, bus, channels),
        secrets=SecretStore(settings.secret_dir),
        feed=feed,
        event_log=event_log,
        changes=changes,
        workers=workers,
        study_workers=study_workers,
        decisions=Decisions(store, clock, background),
        metrics=Metrics(),
        services=Services(),
        lifetime=lifetime,
    )


def _telling(store: Store, bus: EventBus) -> AbstractContextManager[None]:
    """Have the bus told, on this event loop, what each change left in its transaction."""
    loop = asyncio.get_running_loop()

    def tell(events: Sequence[object]) -> None:
        if events:
            loop.call_soon_threadsafe(bus.publish, *events)

    return store.listening(tell)


def _part_failed(
    background: Background, alarms: AlarmBoard, name: str, error: BaseException
) -> None:
    if name.startswith(_ALARM_TASK):
        return
    text = f"A part of the station stopped ({name}: {type(error).__name__}); restart the station."
    background.start(f"{_ALARM_TASK} {name}", alarms.raise_(f"part:{name}", text, level="critical"))


CAUSE = "storage"
PROBE_PERIOD_S = 2.0


async def watch_storage(store: Store, alarms: AlarmBoard, clock: Clock) -> None:
    """Raise and clear the alarm about storage until cancelled.

    While storage fails, a small write tries it every ``PROBE_PERIOD_S``: when nobody else writes,
    nothing else would notice that the disk has room again.
    """
    loop = asyncio.get_running_loop()
    changed = asyncio.Event()

    def tell(fault: str | None) -> None:
        del fault
        loop.call_soon_threadsafe(changed.set)

    store.add_fault_listener(tell)
    while True:
        changed.clear()
        fault = store.fault
        if fault is None:
            await alarms.clear(CAUSE)
            await changed.wait()
            continue
        await alarms.raise_(
            CAUSE,
            f"{fault} Plans and commands are refused; {_where_rows_wait(store)}",
            level="critical",
        )
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(PROBE_PERIOD_S):
                await changed.wait()
        with contextlib.suppress(StoreUnavailableError):
            at = clock.now().isoformat()
            await store.write(lambda session, at=at: put_setting(session, "storage", {"at": at}))
            await alarms.save_waiting()


def _where_rows_wait(store: Store) -> str:
    if store.bridge_fault is None:
        return "telemetry waits on the disk."
    return (
        f"telemetry waits in memory, as the disk does not take it ({store.bridge_fault}): robots "
        "keep their samples, but what they say only once is lost if the station ends."
    )
