"""What a task is to look at next: what an event named, and what is due by the clock."""

import asyncio
from datetime import datetime

from robot_link.clock import Clock, set_or_after

LONGEST_S = 60.0
"""Longest wait by the wall for a moment of the clock, which may be set meanwhile."""


class Wakeups:
    """Lets a task sleep until something is to be looked at. Belongs to one event loop.

    Moments are of the robots' clock, which a demo runs faster than the wall.

    Args:
        clock: The robots' clock.
        rest_s: Wall time between two looks, so that a burst of events is looked at once.
    """

    def __init__(self, clock: Clock, rest_s: float = 0.0) -> None:
        self._clock = clock
        self._rest_s = rest_s
        self._named: set[str] = set()
        self._due: dict[str, datetime] = {}
        self._news = asyncio.Event()

    def wake(self, key: str = "") -> None:
        """Have something looked at as soon as that may be."""
        self._named.add(key)
        self._news.set()

    def set_due(self, key: str, moment: datetime | None) -> None:
        """Have something looked at once a moment has come; ``None`` if time changes nothing."""
        self._due.pop(key, None)
        if moment is not None:
            self._due[key] = moment
        self._news.set()

    async def next(self) -> list[str]:
        """Wait until there is something to look at, and return all of it."""
        await asyncio.sleep(self._rest_s)
        while True:
            self._news.clear()
            now = self._clock.now()
            come = {key for key, moment in self._due.items() if moment <= now}
            found, self._named = self._named | come, set()
            for key in found:
                self._due.pop(key, None)
            if found:
                return sorted(found)
            await set_or_after(self._news, self._longest_s(now))

    def _longest_s(self, now: datetime) -> float | None:
        if not self._due:
            return None
        first_s = (min(self._due.values()) - now).total_seconds() / self._clock.speed
        return min(first_s, LONGEST_S)
