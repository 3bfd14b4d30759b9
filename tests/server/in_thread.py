"""Tasks in a thread of this process, which loads compiled code once, instead of one each."""

import asyncio
import importlib
import threading
from collections.abc import Callable

from server.base.worker import Withdrawn, WorkerPool, WorkerTaskError
from server.base.worker_process import Question


async def run_in_thread(
    pool: WorkerPool,
    task: str,
    payload: object,
    *,
    on_progress: Callable[[object], None] | None = None,
    on_withdrawn: Callable[[Withdrawn | None], None] | None = None,
) -> object:
    """Do what ``WorkerPool.run`` does, for tests of which processes are not the subject."""
    del pool
    module, _, name = task.partition(":")
    function = getattr(importlib.import_module(module), name)
    loop, cancelled = asyncio.get_running_loop(), threading.Event()

    def report(news: object) -> None:
        if on_progress is not None:
            loop.call_soon_threadsafe(on_progress, news)

    question = Question(cancelled.is_set)
    work = asyncio.ensure_future(asyncio.to_thread(function, payload, report, question))
    try:
        return await asyncio.shield(work)
    except asyncio.CancelledError:
        cancelled.set()
        await asyncio.wait([work])
        if on_withdrawn is not None:
            failed = work.exception() is not None
            on_withdrawn(None if failed else (work.result(), question.stopped_at))
        raise
    except Exception as error:
        raise WorkerTaskError(f"{type(error).__name__}: {error}") from error
