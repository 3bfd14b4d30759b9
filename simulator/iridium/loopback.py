"""TCP servers of this machine for this machine: an emulator never speaks to the world."""

import asyncio
import ipaddress
from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress

_PATIENCE_S = 10.0
"""A client that has not said all by then is turned away."""
_LINE_BYTES = 16384


@asynccontextmanager
async def connections(
    take: Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]],
    host: str,
    port: int,
) -> AsyncGenerator[int]:
    """Serve TCP connections of this machine; no task of theirs outlives the context.

    Yields:
        The port's number.
    """
    check_loopback(host)
    tasks: set[asyncio.Task[None]] = set()

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        if task is not None:
            tasks.add(task)
            task.add_done_callback(tasks.discard)
        try:
            async with asyncio.timeout(_PATIENCE_S):
                await take(reader, writer)
        except (TimeoutError, OSError, asyncio.IncompleteReadError):
            pass
        finally:
            with suppress(OSError):
                writer.close()

    server = await asyncio.start_server(serve, host, port, limit=_LINE_BYTES, reuse_address=True)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task in tuple(tasks):
            task.cancel()
        if tasks:
            await asyncio.wait(tuple(tasks))
        await server.wait_closed()


def check_loopback(host: str | None) -> None:
    """Refuse every host but this machine.

    Raises:
        ValueError: If the host is another one.
    """
    with suppress(ValueError):
        if host == "localhost" or ipaddress.ip_address(host or "").is_loopback:
            return
    raise ValueError(f"an emulator speaks to this machine only, not to {host}")
