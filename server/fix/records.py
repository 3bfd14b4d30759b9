"""Fixes on their way into the database: never waited for, and told once they are there."""

import asyncio
import logging
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future
from datetime import datetime
from typing import Final

from sqlalchemy.orm import Session

from db.fault import StoreUnavailableError
from db.ingest import Telemetry
from db.query.camera.fixes import FixRecord, mark_sent
from db.store import Store
from db.writer import Kept
from robot_link.camera.fix import CameraFix
from robot_link.clock import Clock
from robot_link.report import Reading
from server.base.event_bus import EventBus
from server.fix.event import FixesStored, FixFound
from server.fleet.fleet import Fleet
from server.link.event import ReadingsStored, ValuesStored

log = logging.getLogger(__name__)
_SENT_PERIOD_S: Final = 0.5
"""What was sent is noted so often, in one transaction for all robots."""


SENT_MAX: Final = 20_000
"""So many wait to be noted as sent while storage fails; of more, the oldest are not noted."""


class FixRecords:
    """Keeps fixes. Belongs to one event loop.

    While storage fails, they wait as all telemetry does (``db.writer``).
    """

    def __init__(self, store: Store, clock: Clock, bus: EventBus, fleet: Fleet) -> None:
        self._store, self._fleet = store, fleet
        self._clock = clock
        self._bus = bus
        self._sent: deque[tuple[CameraFix, datetime]] = deque(maxlen=SENT_MAX)
        loop = asyncio.get_running_loop()

        def bridged(rows: Sequence[Telemetry]) -> None:
            robots = {row.robot for row in rows if isinstance(row, FixRecord)}
            if robots and not loop.is_closed():
                loop.call_soon_threadsafe(bus.publish, *map(FixesStored, robots))

        store.add_bridged_listener(bridged)

    def take(self, event: FixFound) -> None:
        """Have a fix written with the next batch."""
        fix, loop = event.fix, asyncio.get_running_loop()

        def written(future: "Future[Kept]") -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(self._written, future, fix)

        record = FixRecord(fix, self._clock.now(), None)
        self._store.append([record]).add_done_callback(written)

    def take_error(self, reading: Reading) -> None:
        """Keep how far a robot is from where cameras saw it, as a reading of it."""
        loop = asyncio.get_running_loop()

        def written(future: "Future[Kept]") -> None:
            if not loop.is_closed() and _is_in_database(future):
                told = ReadingsStored([reading]), ValuesStored(reading.robot)
                loop.call_soon_threadsafe(self._bus.publish, *told)

        self._fleet.take_reading(reading)
        self._store.append([reading]).add_done_callback(written)

    def note_sent(self, fix: CameraFix, at: datetime) -> None:
        """Note that a fix was sent to its robot."""
        self._sent.append((fix, at))

    async def run(self) -> None:
        """Write what was sent until cancelled."""
        while True:
            await asyncio.sleep(_SENT_PERIOD_S)
            await self.flush()

    async def flush(self) -> None:
        """Write what was sent; what cannot be written waits."""
        sent = list(self._sent)
        self._sent.clear()
        if not sent:
            return

        def write(session: Session) -> None:
            for fix, at in sent:
                mark_sent(session, fix.robot, fix.measured_at, at)

        try:
            await self._store.write(write)
        except StoreUnavailableError:
            room = SENT_MAX - len(self._sent)
            self._sent.extendleft(reversed(sent[max(len(sent) - room, 0) :]))
        else:
            for robot in {fix.robot for fix, _ in sent}:
                self._bus.publish(FixesStored(robot))

    def _written(self, future: "Future[Kept]", fix: CameraFix) -> None:
        if _is_in_database(future):
            self._bus.publish(FixesStored(fix.robot))
        elif (error := future.exception()) is not None:
            log.error("a fix of %s was not kept: %s", fix.robot, error)


def _is_in_database(future: "Future[Kept]") -> bool:
    """Tell whether a row is in the database; one in the bridge journal is told of later."""
    return future.exception() is None and future.result() is Kept.DATABASE
