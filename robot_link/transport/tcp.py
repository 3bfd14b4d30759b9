"""MAVLink over TCP, ``tcp://host:port`` or, to be called, ``tcp://0.0.0.0:5760?listen=1``.

The wire: MAVLink 2 frames one after another in both directions of one connection, nothing else
(see ``mavlink_stream``). Port 5760 is the usual one of a vehicle that waits for its ground station.

Who listens serves one caller; while it is connected nobody else is let in. A connection whose far
side vanished without a word is given up after some ten seconds.
"""

import asyncio
import math
from functools import partial

from robot_link.transport.mavlink_stream import MavlinkStream
from robot_link.transport.port import Port, TcpPort
from robot_link.transport.uri import LinkUri

_FRAME_BYTES = 1200
"""Frames handed over at once fit one packet of any network."""


def tcp_link(uri: LinkUri) -> MavlinkStream:
    """Return the transport of a TCP connection.

    Raises:
        ValueError: If the URI names none.
    """
    host, port = uri.host_and_port("TCP")
    listens = uri.switch("listen")
    uri.finish()
    opened = partial(_called if listens else TcpPort.open, host, port)
    return MavlinkStream("tcp", opened, bytes_per_s=math.inf, frame_bytes=_FRAME_BYTES)


async def _called(host: str, port: int) -> Port:
    """Wait for a caller.

    Raises:
        OSError: If the address cannot be listened on.
    """
    caller: asyncio.Future[TcpPort] = asyncio.get_running_loop().create_future()

    def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if caller.done():
            writer.transport.abort()
        else:
            caller.set_result(TcpPort(reader, writer))

    server = await asyncio.start_server(answer, host, port)
    try:
        return await caller
    except asyncio.CancelledError:
        if not caller.cancelled():  # somebody called in the same moment
            caller.result().close()
        raise
    finally:
        server.close()
