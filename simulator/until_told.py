"""A process that works until somebody ends it."""

import asyncio
import signal
from collections.abc import Callable, Coroutine


def run_until_told(serve: Callable[[asyncio.Event], Coroutine[None, None, None]]) -> None:
    """Run on an event loop of its own what ends once its event is set: by SIGTERM or SIGINT."""
    asyncio.run(_run(serve))


async def _run(serve: Callable[[asyncio.Event], Coroutine[None, None, None]]) -> None:
    stopped = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, stopped.set)
    await serve(stopped)
