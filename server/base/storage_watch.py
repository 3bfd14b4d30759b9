"""Turns failing storage into an alarm, and notices when it works again."""

import asyncio
import contextlib

from db.fault import StoreUnavailableError
from db.query.settings import put_setting
from db.store import Store
from robot_link.clock import Clock
from server.base.alarm_board import AlarmBoard

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
            f"{fault} Plans and commands are refused; telemetry waits in memory.",
            level="critical",
        )
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(PROBE_PERIOD_S):
                await changed.wait()
        with contextlib.suppress(StoreUnavailableError):
            at = clock.now().isoformat()
            await store.write(lambda session, at=at: put_setting(session, "storage", {"at": at}))
            await alarms.save_waiting()
