"""Work that must happen in the order in which it came, and must not be lost while storage fails."""

import asyncio
import logging
from collections.abc import Awaitable, Callable

from db.fault import StoreUnavailableError

log = logging.getLogger(__name__)

RETRY_S = 0.5
Work = Callable[[], Awaitable[None]]


class Turns:
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
            while True:
                try:
                    await work()
                except StoreUnavailableError as error:
                    log.warning("%s wait for the storage: %s", self._name, error)
                    await asyncio.sleep(RETRY_S)
                except Exception:
                    log.exception("one of the %s was dropped", self._name)
                    break
                else:
                    break
