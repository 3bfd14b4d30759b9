"""Asks a robot for the pages of its table of channels that did not come."""

import asyncio
from collections.abc import Callable
from typing import Final

from robot_link.mavlink.codec import ROBOT_COMPONENT, WireMessage
from robot_link.mavlink.wire import grace
from robot_link.station.command_client import StandardCommand
from robot_link.station.exchange import Correspondent

_LONGEST_S: Final = 30.0
"""Between two requests to a robot whose pages stay away."""


class TableWatch:
    """Knows which pages of the newest table came; belongs to one event loop.

    A robot that never announced anything is never asked: it may be an old one.

    Args:
        peer: The robot.
        is_live: Tells whether it is in radio contact.
        answer_s: How long pages are waited for before they are asked for.
    """

    def __init__(
        self, peer: Correspondent, is_live: Callable[[], bool], *, answer_s: float
    ) -> None:
        self._peer = peer
        self._is_live = is_live
        self._answer_s = answer_s
        self._name: tuple[int, ...] = ()
        self._pages: set[int] = set()
        self._is_lacking = asyncio.Event()

    def hear(self, message: WireMessage) -> None:
        """Take a page."""
        if not isinstance(message, grace.MAVLink_grace_channels_message):
            return
        name = (message.version, message.log, message.sequence, message.pages)
        if name != self._name:
            self._name, self._pages = name, set()
        self._pages.add(message.page)
        lacks = len(self._pages) < message.pages
        (self._is_lacking.set if lacks else self._is_lacking.clear)()

    async def run(self) -> None:
        """Ask until cancelled."""
        while True:
            await self._is_lacking.wait()
            wait_s = self._answer_s
            while self._is_lacking.is_set():
                await asyncio.sleep(wait_s)
                if self._is_lacking.is_set() and self._is_live():
                    await self._peer.deliver([self._request()])
                    wait_s = min(2.0 * wait_s, _LONGEST_S)

    def _request(self) -> WireMessage:
        number = float(grace.MAVLINK_MSG_ID_GRACE_CHANNELS)
        command = StandardCommand(grace.MAV_CMD_REQUEST_MESSAGE, (number,))
        return command.message(self._peer.system, ROBOT_COMPONENT, 0)
