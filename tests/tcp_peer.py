"""TCP of a test on this machine that ends with the test: no task and no transport outlives it."""

import asyncio
from collections.abc import AsyncGenerator, Callable, Coroutine
from contextlib import asynccontextmanager, suppress

Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]
Handler = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Coroutine[object, object, None]]

_LOCAL = "127.0.0.1"


@asynccontextmanager
async def serving(handler: Handler) -> AsyncGenerator[int, None]:
    """Serve connections, each hung up on when its handler returns; one that fails fails the test.

    Yields:
        The port's number.
    """
    peers: dict[asyncio.Task[None], asyncio.StreamWriter] = {}

    def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.create_task(handler(reader, writer))
        task.add_done_callback(lambda _task: writer.close())
        peers[task] = writer

    server = await asyncio.start_server(meet, _LOCAL, 0)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task in peers:
            task.cancel()
        ends = await asyncio.gather(*peers, return_exceptions=True)
        await asyncio.gather(*map(_hang_up, peers.values()))
    for end in ends:
        if isinstance(end, Exception) and not isinstance(end, ConnectionError | EOFError):
            raise end


@asynccontextmanager
async def connected(port: int) -> AsyncGenerator[Streams, None]:
    """Connect, and hang up at the end."""
    reader, writer = await asyncio.open_connection(_LOCAL, port)
    try:
        yield reader, writer
    finally:
        await _hang_up(writer)


async def _hang_up(writer: asyncio.StreamWriter) -> None:
    writer.transport.abort()
    with suppress(ConnectionError):
        await writer.wait_closed()
