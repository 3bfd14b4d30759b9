"""Time as an argument: the real clock, and the scaled one of a demo."""

import asyncio
import time
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Protocol


class Clock(Protocol):
    """Tells the time; everything that needs one is given one."""

    def now(self) -> datetime:
        """Return the aware UTC time."""
        ...

    @property
    def speed(self) -> float:
        """Seconds of this clock per second of the wall."""
        ...


class SystemClock:
    """The machine's own UTC clock."""

    speed = 1.0

    def now(self) -> datetime:
        """Return the machine's UTC time."""
        return datetime.now(UTC)


@dataclass(frozen=True, slots=True)
class ScaledClock:
    """A clock that runs ``speed`` times as fast as the wall from an agreed moment on.

    Station and simulator are given the same numbers, so their clocks agree without talking.
    """

    wall_anchor: datetime
    """Wall time at which this clock showed ``time_anchor``."""
    time_anchor: datetime
    speed: float

    def now(self) -> datetime:
        """Return the scaled UTC time."""
        elapsed_s = (datetime.now(UTC) - self.wall_anchor).total_seconds()
        return self.time_anchor + timedelta(seconds=elapsed_s * self.speed)


def monotonic_s() -> float:
    """Return seconds of the wall that never go back, for time-outs on a wire."""
    return time.monotonic()


async def set_or_after(event: asyncio.Event, longest_s: float | None) -> None:
    """Wait until an event is set, at most so many seconds of the wall; without a limit if None."""
    with suppress(TimeoutError):
        async with asyncio.timeout(longest_s):
            await event.wait()
