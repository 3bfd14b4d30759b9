"""Jobs about maps, at most one of a kind for each map."""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

from server.job import JobBoard, JobProgress
from server.service.map_group import MapGroup


class MapJobs:
    """The jobs of one kind that are under way, by the map that they are of.

    Belongs to one event loop.
    """

    def __init__(self, board: JobBoard, kind: str) -> None:
        self._board = board
        self._kind = kind
        self._running: dict[MapGroup, str] = {}
        self._starting = asyncio.Lock()

    def __bool__(self) -> bool:
        """Whether there is any."""
        return bool(self._running)

    def get(self, group: MapGroup) -> str | None:
        """Return the id of the job of a map, if one is under way."""
        return self._running.get(group)

    async def start(
        self,
        group: MapGroup,
        work: Callable[[JobProgress], Awaitable[Mapping[str, Any]]],
        *,
        by: str,
    ) -> str:
        """Begin a job; return its id, that of the one under way if there is one.

        Raises:
            StoreError: Nothing was begun.
        """

        async def until_done(progress: JobProgress) -> Mapping[str, Any]:
            try:
                return await work(progress)
            finally:
                self._running.pop(group, None)

        async with self._starting:
            running = self._running.get(group)
            if running is not None:
                return running
            job = await self._board.start(self._kind, until_done, by=by)
            if any(one.id == job.id for one in self._board.running):
                self._running[group] = job.id
            return job.id
