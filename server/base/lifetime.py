"""When the services of one station are loaded, begin to work, and end."""

import asyncio
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from server.base.background import Background

Step = Callable[[], Awaitable[None]]


class Lifetime:
    """Loads and starts services in the order in which they were installed, ends them in reverse.

    Everything is loaded before anything starts, so that no event finds a service that does not
    know yet what the database does. Belongs to one event loop.
    """

    def __init__(self, background: Background) -> None:
        self._background = background
        self._loads: list[Step] = []
        self._starts: list[Step] = []
        self._ends: list[Step] = []
        self._first: list[Callable[[], None]] = []

    def on_load(self, step: Step) -> None:
        """Have something read from the database before anything works."""
        self._loads.append(step)

    def on_start(self, step: Step) -> None:
        """Have something begin to work."""
        self._starts.append(step)

    def on_stop(self, step: Step) -> None:
        """Have something ended, after everything that was installed later."""
        self._ends.append(step)

    def on_closing(self, tell: Callable[[], None]) -> None:
        """Have something told that the station is about to stop, before anything ends."""
        self._first.append(tell)

    def run(self, name: str, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Have a task of this name run from the start to the end."""
        tasks: list[asyncio.Task[Any]] = []

        async def start() -> None:
            tasks.append(self._background.start(name, work()))

        async def stop() -> None:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

        self.on_start(start)
        self.on_stop(stop)

    async def start(self) -> None:
        """Load everything, then start everything."""
        for step in (*self._loads, *self._starts):
            await step()

    async def stop(self) -> None:
        """End everything; what is under way goes on at the next start."""
        for tell in self._first:
            tell()
        for step in reversed(self._ends):
            await step()
