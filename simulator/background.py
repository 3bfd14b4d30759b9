"""Work that goes on while something else is done."""

import asyncio
import logging
from collections.abc import AsyncGenerator, Coroutine
from contextlib import asynccontextmanager

_log = logging.getLogger(__name__)


@asynccontextmanager
async def alongside(work: Coroutine[None, None, None], name: str) -> AsyncGenerator[None]:
    """Do the work in a task of its own as long as the context lasts.

    Should it fail, that is logged at once, and raised when the context is left.
    """
    task = asyncio.get_running_loop().create_task(work, name=name)
    task.add_done_callback(_tell)
    try:
        yield
    finally:
        task.cancel()
        await asyncio.wait((task,))
        if not task.cancelled():
            task.result()


def _tell(task: asyncio.Task[None]) -> None:
    if not task.cancelled() and task.exception() is not None:
        _log.error("%s has failed", task.get_name(), exc_info=task.exception())
