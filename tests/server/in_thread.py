"""Tasks in a thread of this process, which loads compiled code once, instead of one each."""

import asyncio
import importlib
import threading

from server.base.worker import WorkerTaskError


async def run_in_thread(pool, task, payload, *, on_progress=None):
    """Do what ``WorkerPool.run`` does, for tests of which processes are not the subject."""
    del pool
    module, _, name = task.partition(":")
    function = getattr(importlib.import_module(module), name)
    loop, cancelled = asyncio.get_running_loop(), threading.Event()

    def report(news):
        if on_progress is not None:
            loop.call_soon_threadsafe(on_progress, news)

    work = asyncio.ensure_future(asyncio.to_thread(function, payload, report, cancelled.is_set))
    try:
        return await asyncio.shield(work)
    except asyncio.CancelledError:
        cancelled.set()
        await asyncio.wait([work])
        raise
    except Exception as error:
        raise WorkerTaskError(f"{type(error).__name__}: {error}") from error
