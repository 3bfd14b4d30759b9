"""Tells the station which channels the robot measures, before it sends values of them."""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from datetime import datetime
from typing import NamedTuple

from robot_link.channel_table import ChannelTable
from robot_link.clock import Clock, set_or_after
from robot_link.mavlink.channel_page import page_messages
from robot_link.mavlink.wire import grace
from robot_link.sample_log import SampleKey, SampleLog

_log = logging.getLogger(__name__)
Page = grace.MAVLink_grace_channels_message


class TableInForce(NamedTuple):
    """What a robot measures now."""

    table: ChannelTable
    since: SampleKey
    """The first measurement for which it holds."""
    since_at: datetime


class ChannelAnnouncer:
    """Sends all pages of the table when it is due, and one now and then; on one event loop.

    A page now and then lets a station that was started meanwhile, or missed one, come to know of
    the table; it asks for what it lacks.

    Args:
        log: Whose next measurement is the first under a new table.
        clock: The robot's clock.
        payload_bytes: Returns what a packet of the radio has room for.
        send: Sends a page once, when the radio has room for it.
        period_s: Time between two pages, by the wall.
    """

    def __init__(
        self,
        log: SampleLog,
        clock: Clock,
        payload_bytes: Callable[[], int],
        send: Callable[[Page], Awaitable[None]],
        period_s: float,
    ) -> None:
        self._log = log
        self._clock = clock
        self._payload_bytes = payload_bytes
        self._send = send
        self._period_s = period_s
        self._since = SampleKey(log.next_key.log, 0)
        self._since_at: datetime = clock.now()
        self._due = asyncio.Event()
        self._turn = 0
        self.table: ChannelTable | None = None
        """What was announced last; None before the first."""

    @property
    def in_force(self) -> TableInForce | None:
        """What was announced last."""
        return None if self.table is None else TableInForce(self.table, self._since, self._since_at)

    def announce(self, table: ChannelTable) -> None:
        """Announce what is measured from now on; the same again changes nothing."""
        if self.table is not None and table.version == self.table.version:
            return
        self._since, self._since_at = self._log.next_key, self._clock.now()
        self.table = table
        self._due.set()

    def remind(self) -> None:
        """Send the whole table again: a station may be there that does not know it."""
        self._due.set()

    def pages(self) -> list[Page]:
        """Return the pages; none without a table, or where a packet has no room for a row."""
        if self.table is None:
            return []
        try:
            return page_messages(self.table, self._since, self._since_at, self._payload_bytes())
        except ValueError as error:
            _log.warning("the table of channels is not announced: %s", error)
            return []

    async def run(self) -> None:
        """Announce until cancelled."""
        while True:
            await set_or_after(self._due, self._period_s)
            pages = self.pages()
            if not self._due.is_set():
                self._turn += 1
                pages = [pages[self._turn % len(pages)]] if pages else []
            self._due.clear()
            for page in pages:
                await self._send(page)
