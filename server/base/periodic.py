"""Work that is done again and again, and that a bad moment does not end."""

import asyncio
import logging
from collections.abc import Awaitable, Callable

from db.fault import StoreError

log = logging.getLogger(__name__)


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
