"""Sends what was said last, once: what is older than it is not worth the radio's time."""

import asyncio
from collections.abc import Awaitable, Callable

from robot_link.mavlink.codec import WireMessage


class NewestSender:
    """One kind of report of a robot; while the radio is busy a newer one replaces it.

    Args:
        wait_for_room: Waits until the radio has room for a report.
        send: Sends a message once.
    """

    def __init__(
        self,
        wait_for_room: Callable[[], Awaitable[None]],
        send: Callable[[WireMessage], Awaitable[None]],
    ) -> None:
        self._wait_for_room = wait_for_room
        self._send = send
        self._newest: Callable[[], WireMessage] | None = None
        self._changed = asyncio.Event()

    def put(self, message: Callable[[], WireMessage]) -> None:
        """Say something; it is encoded when the radio has room for it."""
        self._newest = message
        self._changed.set()

    async def run(self) -> None:
        """Send until cancelled."""
        while True:
            await self._changed.wait()
            await self._wait_for_room()
            self._changed.clear()
            if self._newest is not None:
                await self._send(self._newest())
