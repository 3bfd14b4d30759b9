"""An answer that takes long, with how far it is ahead of it: one JSON a line."""

import asyncio
import json
from collections.abc import AsyncGenerator, Awaitable, Callable
from typing import Final

from fastapi import Request, Response
from fastapi.responses import StreamingResponse

from server.analysis.analyses import OnShare
from server.base.problem import Problem

LINES: Final = "application/x-ndjson"
"""Type of such an answer, to be named in ``Accept``."""
Work = Callable[[OnShare], Awaitable[Response]]


async def answer_with(request: Request, work: Work) -> Response:
    """Return what work leaves: as it is, or as lines for whoever accepts them."""
    if LINES not in request.headers.get("accept", ""):
        return await work(lambda _: None)
    return StreamingResponse(lines_of(work), media_type=LINES)


async def lines_of(work: Work) -> AsyncGenerator[bytes]:
    """Yield how far work is, and at last what it leaves; work that nobody waits for is ended."""
    news: asyncio.Queue[float | None] = asyncio.Queue()
    task = asyncio.ensure_future(work(news.put_nowait))
    task.add_done_callback(lambda _: news.put_nowait(None))
    try:
        while (share := await news.get()) is not None:
            yield _line("progress", json.dumps(round(share, 3)).encode())
        yield _line("answer", bytes((await task).body))
    except Problem as problem:
        yield _line("problem", json.dumps(problem.detail).encode())
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def _line(name: str, value: bytes) -> bytes:
    return b'{"%s":%s}\n' % (name.encode(), value)
