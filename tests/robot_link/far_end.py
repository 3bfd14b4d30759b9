"""What sits at the other end of a MAVLink line in a test, and a transport that runs meanwhile."""

import asyncio
import os
import tty
from collections.abc import AsyncGenerator, Generator
from contextlib import asynccontextmanager, contextmanager, suppress
from pathlib import Path
from typing import TypeVar

from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.transport.datagram import (
    DatagramTransport,
    PortChanged,
    TransportEvent,
)

Event = TypeVar("Event", bound=TransportEvent)


def heartbeat(number: int = 0, codec: Codec | None = None) -> bytes:
    """A robot's frame that a number tells from others."""
    message = grace.MAVLink_heartbeat_message(
        type=grace.MAV_TYPE_SUBMARINE,
        autopilot=grace.MAV_AUTOPILOT_GENERIC,
        base_mode=0,
        custom_mode=number,
        system_status=grace.MAV_STATE_ACTIVE,
        mavlink_version=3,
    )
    return (codec or Codec(SystemId(1), ROBOT_COMPONENT)).pack(message)


@asynccontextmanager
async def running(transport: DatagramTransport) -> AsyncGenerator[DatagramTransport, None]:
    task = asyncio.create_task(transport.run())
    try:
        yield transport
    finally:
        if task.done():
            task.result()
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def next_event(transport: DatagramTransport, kind: type[Event]) -> Event:
    async with asyncio.timeout(60):
        async for event in transport.events():
            if isinstance(event, kind):
                return event
    raise AssertionError


async def next_opening(transport: DatagramTransport) -> None:
    while not (await next_event(transport, PortChanged)).is_open:
        pass


class Line:
    """The far end of a pseudo-terminal."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor

    def write(self, data: bytes) -> None:
        os.write(self.descriptor, data)

    async def read(self) -> bytes:
        async with asyncio.timeout(60):
            return await asyncio.to_thread(os.read, self.descriptor, 65536)


@contextmanager
def line(link: Path) -> Generator[Line, None, None]:
    """A serial line that is there until the context ends."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    link.unlink(missing_ok=True)
    link.symlink_to(os.ttyname(theirs))
    try:
        yield Line(ours)
    finally:
        link.unlink()
        os.close(theirs)
        os.close(ours)
