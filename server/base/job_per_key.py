"""Jobs of which at most one is under way for each thing that they are about."""

import asyncio
from collections.abc import Awaitable, Callable, Hashable, Mapping
from typing import Any, Generic, TypeVar

from server.base.job import JobBoard, JobProgress

Key = TypeVar("Key", bound=Hashable)


class JobPerKey(Generic[Key]):
    """The jobs of one kind that are under way, by what they are about: a map, a robot, a file.

    Belongs to one event loop.
    """

    def __init__(self, board: JobBoard, kind: str) -> None:
        self._board = board
        self._kind = kind
        self._running: dict[Key, str] = {}
        self._newest: dict[Key, str] = {}
        self._starting = asyncio.Lock()

    def __bool__(self) -> bool:
        """Whether there is any."""
        return bool(self._running)

    def get(self, key: Key) -> str | None:
        """Return the id of the job about something, if one is under way."""
        return self._running.get(key)

    def newest(self, key: Key) -> str | None:
        """Return the id of the newest job about something since the station began, or ``None``."""
        return self._newest.get(key)

    async def start(
        self,
        key: Key,
        work: Callable[[JobProgress], Awaitable[Mapping[str, Any]]],
        *,
        by: str,
    ) -> str:
        """Begin a job; return its id, that of the one under way if there is one.

        Raises:
            StoreError: Nothing was begun.
        """
        is_over = False

        async def until_done(progress: JobProgress) -> Mapping[str, Any]:
            nonlocal is_over
            try:
                return await work(progress)
            finally:
                is_over = True
                self._running.pop(key, None)

        async with self._starting:
            running = self._running.get(key)
            if running is not None:
                return running
            job = await self._board.start(self._kind, until_done, by=by)
            self._newest[key] = job.id
            if not is_over and any(one.id == job.id for one in self._board.running):
                self._running[key] = job.id
            return job.id
