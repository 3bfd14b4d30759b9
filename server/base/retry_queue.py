"""Work that goes on after storage failed: in the order in which it came, or again and again."""

import asyncio
import logging
from collections.abc import Awaitable, Callable

from db.fault import StoreError, StoreUnavailableError

log = logging.getLogger(__name__)

RETRY_S = 0.5
Work = Callable[[], Awaitable[None]]


async def until_stored(name: str, work: Work) -> None:
    """Do a piece of work, again while storage fails under it; whatever else it raises is passed on.

    Args:
        name: What waits, for the log.
        work: Must mean the same if done twice.
    """
    level = logging.WARNING
    while True:
        try:
            return await work()
        except StoreUnavailableError as error:
            log.log(level, "%s waits for the storage: %s", name, error)
            level = logging.DEBUG  # it was told; a server may be away for hours
            await asyncio.sleep(RETRY_S)


async def every(name: str, period_s: float, work: Callable[[], Awaitable[object]]) -> None:
    """Do a piece of work now and then, until cancelled; what it raises otherwise is passed on.

    Args:
        name: What is done, for the log.
        period_s: Rest between two times, s of the wall's clock.
        work: What is done; a failure of files or of the storage leaves it to the next time.
    """
    while True:
        try:
            await work()
        except (StoreError, OSError) as error:
            log.warning("%s: not this time: %s", name, error)
        await asyncio.sleep(period_s)


class RetryQueue:
    """A queue of small pieces of work, done one after another by ``run``.

    A piece that meets failing storage is tried again until it works; one that fails otherwise is
    dropped, so that it cannot hold up the others.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._queue: asyncio.Queue[Work] = asyncio.Queue()

    def add(self, work: Work) -> None:
        """Put a piece of work at the end."""
        self._queue.put_nowait(work)

    async def run(self) -> None:
        """Work until cancelled."""
        while True:
            work = await self._queue.get()
            try:
                await until_stored(f"one of the {self._name}", work)
            except Exception:
                log.exception("one of the %s was dropped", self._name)
