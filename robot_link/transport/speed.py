"""Trying the usual speeds of a serial line until one makes sense."""

import asyncio
from typing import Final
from urllib.parse import parse_qsl, urlencode, urlsplit

from robot_link.transport.datagram import DatagramTransport, PortChanged, Received
from robot_link.transport.opening import open_transport

SPEEDS: Final = (57600, 115200, 9600, 38400, 19200, 230400, 460800, 921600)
"""Baud, the likeliest first."""


async def find_speed(uri: str, listen_s: float) -> int | None:
    """Return the speed at which a serial line brings valid frames, None if none does.

    Args:
        uri: A ``serial`` or ``xbee`` link on a serial line; its own speed is not tried again.
        listen_s: How long to listen at each speed, s.
    """
    parts = urlsplit(uri)
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    for speed in SPEEDS:
        if str(speed) == options.get("baud"):
            continue
        query = urlencode({**options, "baud": speed})
        transport = open_transport(parts._replace(query=query).geturl())
        if await _makes_sense(transport, listen_s):
            return speed
    return None


async def _makes_sense(transport: DatagramTransport, listen_s: float) -> bool:
    """Tell whether a frame comes, or an XBee answers."""
    running = asyncio.create_task(transport.run(), name="speed trial")
    try:
        async with asyncio.timeout(listen_s):
            async for event in transport.events():
                match event:
                    case Received():
                        return True
                    case PortChanged(is_open=True) if transport.carrier == "xbee":
                        return True
                    case _:
                        pass
    except TimeoutError:
        pass
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
    return False
