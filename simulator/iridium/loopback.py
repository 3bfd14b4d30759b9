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
    """Serve TCP connections of this machine; none of them outlives the context.

    Yields:
        The port's number.
    """
    check_loopback(host)
    clients: dict[asyncio.Task[None], asyncio.StreamWriter] = {}

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(TimeoutError, OSError, asyncio.IncompleteReadError):
            async with asyncio.timeout(_PATIENCE_S):
                await take(reader, writer)

    def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.create_task(serve(reader, writer))
        clients[task] = writer
        task.add_done_callback(lambda done: clients.pop(done).close())

    server = await asyncio.start_server(meet, host, port, limit=_LINE_BYTES, reuse_address=True)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        left = dict(clients)
        for task in left:
            task.cancel()
        await asyncio.gather(*left, return_exceptions=True)
        for writer in left.values():
            writer.transport.abort()
        await asyncio.gather(*(w.wait_closed() for w in left.values()), return_exceptions=True)
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
