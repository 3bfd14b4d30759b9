"""What becomes known of sign-ins that failed: the log has each, and many are an alarm."""

import asyncio
import contextlib
from collections import deque
from typing import Final

from db.fault import StoreError
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock, monotonic_s
from server.access.rate import RateLimit
from server.base.alarm_board import AlarmBoard
from server.base.lifetime import Background

CAUSE: Final = "sign-in"
MANY: Final = 20
WITHIN_S: Final = 600.0
EVENTS_AT_ONCE: Final = 50
EVENTS_PER_S: Final = 0.1
"""After that; whoever tries for days must not fill the log."""


class SignInFailures:
    """Tells people of failed sign-ins. Belongs to one event loop."""

    def __init__(
        self, store: Store, clock: Clock, alarms: AlarmBoard, background: Background
    ) -> None:
        self._store = store
        self._clock = clock
        self._alarms = alarms
        self._background = background
        self._times_s: deque[float] = deque(maxlen=MANY)
        self._rate = RateLimit(EVENTS_AT_ONCE, EVENTS_PER_S)
        self._is_many = False

    async def note(self, text: str) -> None:
        """Log a failure, unless there are too many to read, and raise the alarm at many."""
        now_s = monotonic_s()
        self._times_s.append(now_s)
        if self._rate.admits():
            at = self._clock.now()
            with contextlib.suppress(StoreError):
                await self._store.write(
                    lambda session: add_event(
                        session, at, "person.sign_in_failed", text, level="watch"
                    )
                )
        is_many = len(self._times_s) == MANY and now_s - self._times_s[0] < WITHIN_S
        if is_many and not self._is_many:
            self._is_many = True
            self._background.start("alarm about failed sign-ins", self._alarm())

    async def forget(self) -> None:
        """End the alarm of an earlier run."""
        await self._alarms.clear(CAUSE)

    async def _alarm(self) -> None:
        """Keep the alarm up until the failures have become few."""
        minutes = WITHIN_S / 60
        text = f"{MANY} sign-ins failed within {minutes:.0f} minutes: somebody may be guessing."
        await self._alarms.raise_(CAUSE, f"{text} The log names from where.")
        while True:
            left_s = self._times_s[0] + WITHIN_S - monotonic_s()
            if left_s <= 0:
                break
            await asyncio.sleep(left_s)
        self._is_many = False
        await self._alarms.clear(CAUSE)
