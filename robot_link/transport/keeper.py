"""Keeping a port open: again after every failure, and not at all while it is disabled."""

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from typing import Any

from robot_link.transport.datagram import PortChanged, TransportEvent
from robot_link.transport.shelf import Place

DISABLED = "unplugged by the operator"
"""Reason that a port gives while it is disabled."""

HANDED_OVER = "handed over to another process"
"""Reason that a port gives when it is let go."""

_log = logging.getLogger(__name__)


class PortKeeper:
    """Opens a port again and again, and hands on what it brings. Belongs to one event loop.

    A reason is told once, however often the same attempt fails for it. A fault of the program
    itself counts as one more reason, with its trace in the log: the other radios must go on.
    """

    def __init__(self, name: str, serve: Callable[[], Awaitable[str]], reopen_s: float) -> None:
        """Keep a port.

        Args:
            name: What it is, for the log.
            serve: Opens the port, calls ``opened``, serves it and returns why that ended; it
                closes the port whenever it ends.
            reopen_s: Time between two attempts, s.
        """
        self._name = name
        self._serve = serve
        self._reopen_s = reopen_s
        self._events: asyncio.Queue[TransportEvent] = asyncio.Queue()
        self._in = asyncio.Event()
        self._in.set()
        self._out = asyncio.Event()
        self._has_opened = False
        self._why_not = DISABLED
        self._is_closed = asyncio.Event()
        self._is_closed.set()

    @property
    def is_enabled(self) -> bool:
        """Whether the operator lets the port be open."""
        return self._in.is_set()

    def set_enabled(self, is_enabled: bool) -> None:
        """Enable the port, or disable it, which closes it."""
        setting, clearing = (self._in, self._out) if is_enabled else (self._out, self._in)
        setting.set()
        clearing.clear()

    def opened(self) -> None:
        """Tell that the port serves."""
        self._has_opened = True
        self.bring(PortChanged(is_open=True, reason=""))

    def bring(self, event: TransportEvent) -> None:
        """Hand on what the port brought."""
        self._events.put_nowait(event)

    async def events(self) -> AsyncIterator[TransportEvent]:
        """Yield what was brought, in order, until cancelled; for one reader."""
        while True:
            yield await self._events.get()

    async def run(self) -> None:
        """Open, serve and open again until cancelled."""
        told = ""
        while True:
            self._has_opened = False
            reason = await self._serve_while_enabled() if self.is_enabled else self._why_not
            if reason != told or self._has_opened:
                _log.warning("%s port closed: %s", self._name, reason)
                self.bring(PortChanged(is_open=False, reason=reason))
                told = reason
            if self.is_enabled:
                await self._sleep()
            else:
                await self._in.wait()

    async def let_go(self) -> None:
        """Give the port up for good, and return once what it brought was taken."""
        self._why_not = HANDED_OVER
        self.set_enabled(False)
        await self._is_closed.wait()
        # Whoever takes an event has dealt with it before anybody else runs.
        while not self._events.empty():  # noqa: ASYNC110 - it waits for one round of the loop
            await asyncio.sleep(0)

    async def _serve_while_enabled(self) -> str:
        self._is_closed.clear()
        serving = asyncio.ensure_future(self._serve())
        pulled = asyncio.create_task(self._out.wait(), name=f"{self._name} disabled")
        try:
            await asyncio.wait((serving, pulled), return_when=asyncio.FIRST_COMPLETED)
            if not serving.done():
                return self._why_not
            if (fault := serving.exception()) is None:
                return serving.result()
            _log.error("%s port: a fault of this program", self._name, exc_info=fault)
            return f"a fault of this program ({type(fault).__name__}); its log says more"
        finally:
            serving.cancel()
            pulled.cancel()
            await asyncio.gather(serving, pulled, return_exceptions=True)
            self._is_closed.set()

    async def _sleep(self) -> None:
        """Wait before the next attempt, not while the port is disabled."""
        try:
            async with asyncio.timeout(self._reopen_s):
                await self._out.wait()
        except TimeoutError:
            pass


class KeptTransport:
    """The part of a ``DatagramTransport`` that is the same for all whose port is kept open."""

    def __init__(self, name: str, serve: Callable[[], Awaitable[str]], reopen_s: float) -> None:
        """Keep a port; see ``PortKeeper``."""
        self._keeper = PortKeeper(name, serve, reopen_s)
        self.is_mute = False
        """Whether the port could be opened, but what is at its end does not answer."""
        self.place = Place()
        """Where the line comes from and goes to."""

    @property
    def is_enabled(self) -> bool:
        """Whether the operator lets the port be open."""
        return self._keeper.is_enabled

    def set_enabled(self, is_enabled: bool) -> None:
        """Enable the port, or disable it, which closes it."""
        self._keeper.set_enabled(is_enabled)

    async def let_go(self) -> None:
        """Give the port up for good, and return once what it brought was taken."""
        await self._keeper.let_go()

    async def run(self) -> None:
        """Open, serve and open again until cancelled."""
        await self._keeper.run()

    def events(self) -> AsyncIterator[TransportEvent]:
        """Yield what the port brings, in order, until cancelled; for one reader."""
        return self._keeper.events()


async def first_to_end(*works: tuple[str, Coroutine[Any, Any, str]]) -> str:
    """Do several things about an open port until one of them ends; return what that one says.

    Args:
        works: Each with a name for people.
    """
    tasks = [asyncio.create_task(work, name=name) for name, work in works]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        return next(task for task in tasks if task in done).result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
