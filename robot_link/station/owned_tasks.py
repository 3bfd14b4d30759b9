"""Tasks of a running link that come and go with their owners."""

import asyncio
from collections.abc import Callable, Coroutine, Mapping
from typing import Any

Work = Callable[[], Coroutine[Any, Any, None]]


class OwnedTasks:
    """Starts the work of an owner when the link runs, and stops it when the owner is gone.

    The failure of a task ends the link, as in any task group.
    """

    def __init__(self) -> None:
        self._work: dict[str, Mapping[str, Work]] = {}
        self._tasks: dict[str, list[asyncio.Task[None]]] = {}
        self._group: asyncio.TaskGroup | None = None

    def add(self, owner: str, work: Mapping[str, Work]) -> None:
        """Take up the work of an owner, by names for people."""
        self._work[owner] = work
        if self._group is not None:
            self._start(self._group, owner)

    def remove(self, owner: str) -> None:
        """Stop the work of an owner."""
        del self._work[owner]
        for task in self._tasks.pop(owner, []):
            task.cancel()

    async def run(self) -> None:
        """Do all work until cancelled."""
        try:
            async with asyncio.TaskGroup() as group:
                self._group = group
                for owner in self._work:
                    self._start(group, owner)
                await asyncio.Event().wait()
        finally:
            self._group = None
            self._tasks.clear()

    def _start(self, group: asyncio.TaskGroup, owner: str) -> None:
        self._tasks[owner] = [
            group.create_task(work(), name=f"{owner} {name}")
            for name, work in self._work[owner].items()
        ]
