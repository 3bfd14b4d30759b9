"""Tells the bus of every row of the event log, whichever process wrote it."""

import asyncio
import contextlib
import logging

from sqlalchemy.exc import SQLAlchemyError

from db.fault import StoreError
from db.query.station.events import EventRecord, events_after, last_cursor
from db.store import Store
from server.base.event_bus import EventBus, EventLogged

log = logging.getLogger(__name__)

EVENTS_PER_LOOK = 500
RETRY_S = 0.1
_REST_S = 0.05
"""Between two looks, so that several changes are read together."""
_FOREIGN_S = 1.0
"""Other processes write too, such as the command line, and their commits are told to nobody."""


class EventLog:
    """Reads the log after each change of the database. Belongs to one event loop."""

    def __init__(self, store: Store, bus: EventBus) -> None:
        self._store = store
        self._bus = bus
        self.cursor = 0
        """Of the newest event that was told."""
        self.is_known = asyncio.Event()
        """Set once it is known where the log ended when the station began to read it."""
        self._grown = asyncio.Event()
        self._is_closed = False
        self._is_waiting = False
        """Whether storage fails, and that was told."""

    async def run(self) -> None:
        """Tell of each new event in order, until cancelled."""
        loop, changed = asyncio.get_running_loop(), asyncio.Event()
        with self._store.listening(lambda _: loop.call_soon_threadsafe(changed.set)):
            self.cursor = await self._end()
            self.is_known.set()
            while True:
                changed.clear()
                for event in await self._new():
                    self.cursor = event.cursor
                    self._bus.publish(EventLogged(event))
                    grown, self._grown = self._grown, asyncio.Event()
                    grown.set()
                await asyncio.sleep(_REST_S)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(_FOREIGN_S):
                        await changed.wait()

    async def grown_beyond(self, cursor: int, longest_s: float) -> bool:
        """Wait for an event after a cursor; tell whether one came within so long by the wall."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(longest_s):
                while self.cursor <= cursor and not self._is_closed:
                    await self._grown.wait()
                return self.cursor > cursor
        return False

    def close(self) -> None:
        """Let nobody wait any longer."""
        self._is_closed = True
        self._grown.set()

    async def _end(self) -> int:
        """Return the cursor of the newest event, as soon as storage works."""
        while True:
            try:
                return await self._store.query(last_cursor)
            except (StoreError, SQLAlchemyError) as error:
                log.warning("the event log is read when storage works: %s", error)
            await asyncio.sleep(RETRY_S)

    async def _new(self) -> list[EventRecord]:
        """Return what is new, whole pages of it; nothing while storage fails."""
        events: list[EventRecord] = []
        while True:
            cursor = events[-1].cursor if events else self.cursor
            try:
                page = await self._store.query(
                    lambda session, cursor=cursor: events_after(
                        session, cursor, limit=EVENTS_PER_LOOK
                    )
                )
            except (StoreError, SQLAlchemyError) as error:
                level = logging.DEBUG if self._is_waiting else logging.WARNING
                log.log(level, "events wait until storage works: %s", error)
                self._is_waiting = True
                return events
            self._is_waiting = False
            events += page
            if len(page) < EVENTS_PER_LOOK:
                return events
