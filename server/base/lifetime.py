"""When the services of one station are loaded, begin to work, and end."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Coroutine
from contextvars import copy_context
from typing import Any

from db.actor import acting

logger = logging.getLogger(__name__)
FailureListener = Callable[[str, BaseException], None]


class Background:
    """Starts named tasks, tells of each that fails, and cancels them all at the end."""

    def __init__(self, on_failure: FailureListener) -> None:
        self._on_failure = on_failure
        self._tasks: set[asyncio.Task[Any]] = set()

    def start(self, name: str, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        """Run ``work`` as a task of this name; its failure is logged and told.

        What it changes is the station's doing, whoever had it started.
        """
        context = copy_context()
        context.run(acting.set, None)
        task = asyncio.create_task(work, name=name, context=context)
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    async def stop(self) -> None:
        """Cancel every task and wait until all have ended."""
        tasks = list(self._tasks)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _ended(self, task: asyncio.Task[Any]) -> None:
        self._tasks.discard(task)
        if task.cancelled():
            return
        error = task.exception()
        if error is not None:
            logger.error("the background task %r failed", task.get_name(), exc_info=error)
            self._on_failure(task.get_name(), error)


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
