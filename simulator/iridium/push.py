"""How a gateway brings messages to its customer: again and again until it takes them."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from robot_link.clock import Clock
from simulator.iridium.session import MobileOriginatedMessage

LIFETIME = timedelta(hours=12)
CAPACITY = 10_000


@dataclass(frozen=True, slots=True)
class RetrySchedule:
    """When a message that was not taken is offered again."""

    delays_s: Sequence[float]
    """After the first failure, the second, and so on; the last one holds from then on."""
    keeps_order: bool = False
    """A message waits for the older ones, however long they take."""

    def delay_s(self, failures: int) -> float:
        """Return how long to wait after so many failures, from 1."""
        return self.delays_s[min(failures, len(self.delays_s)) - 1]


@dataclass(slots=True)
class _Parcel:
    """A message that is to be delivered."""

    message: MobileOriginatedMessage
    dies_at: datetime
    due_at: datetime
    failures: int = 0


class Pusher:
    """Delivers messages one at a time; belongs to one event loop.

    A message that could not be delivered within twelve hours is dropped, and so is the oldest
    one when too many wait. ``settle`` is told of each message that has come to its end.
    """

    def __init__(
        self,
        deliver: Callable[[MobileOriginatedMessage], Awaitable[bool]],
        schedule: RetrySchedule,
        clock: Clock,
        settle: Callable[[MobileOriginatedMessage], None],
    ) -> None:
        self.delivered = 0
        self.dropped = 0
        self._deliver = deliver
        self._schedule = schedule
        self._clock = clock
        self._settle = settle
        self._parcels: list[_Parcel] = []
        self._arrived = asyncio.Event()

    @property
    def waiting(self) -> int:
        """How many messages are not delivered yet."""
        return len(self._parcels)

    def put(self, message: MobileOriginatedMessage) -> None:
        """Take a message to deliver."""
        now = self._clock.now()
        if len(self._parcels) >= CAPACITY:
            self._forget(self._parcels[0])
            self.dropped += 1
        self._parcels.append(_Parcel(message, now + LIFETIME, now))
        self._arrived.set()

    async def run(self) -> None:
        """Deliver until cancelled."""
        while True:
            parcel = self._next()
            if parcel is None:
                await self._wait(None)
                continue
            delay_s = (parcel.due_at - self._clock.now()).total_seconds()
            if delay_s > 0.0:
                await self._wait(delay_s)
                continue
            await self._offer(parcel)

    async def _offer(self, parcel: _Parcel) -> None:
        is_taken = await self._deliver(parcel.message)
        if is_taken:
            self.delivered += 1
            self._forget(parcel)
            return
        parcel.failures += 1
        delay = timedelta(seconds=self._schedule.delay_s(parcel.failures))
        parcel.due_at = self._clock.now() + delay
        if parcel.due_at > parcel.dies_at:
            self.dropped += 1
            self._forget(parcel)

    def _next(self) -> _Parcel | None:
        if self._schedule.keeps_order:
            return next(iter(self._parcels), None)
        return min(self._parcels, key=lambda parcel: parcel.due_at, default=None)

    def _forget(self, parcel: _Parcel) -> None:
        self._parcels = [other for other in self._parcels if other is not parcel]
        self._settle(parcel.message)

    async def _wait(self, duration_s: float | None) -> None:
        """Wait for a new message, by the robots' clock no longer than so long."""
        self._arrived.clear()
        timeout_s = None if duration_s is None else duration_s / self._clock.speed
        try:
            async with asyncio.timeout(timeout_s):
                await self._arrived.wait()
        except TimeoutError:
            pass
