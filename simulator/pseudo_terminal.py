"""Pseudo-terminals that stand for serial lines to devices that do not exist."""

import asyncio
import os
import tty
from collections import deque
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

_CHUNK_BYTES = 65536
_OVERRUN_S = 1.0
"""Bytes that nobody takes from the terminal for so long are lost."""


@asynccontextmanager
async def pseudo_terminal(
    link: Path, feed: Callable[[bytes], None]
) -> AsyncGenerator[Callable[[bytes], None]]:
    """Put a device on a pseudo-terminal, reached through the symbolic link.

    Leaving the context pulls the plug: whoever has the port open sees it vanish.

    Args:
        link: Where the terminal is found; an older link there is replaced.
        feed: Takes what is written to the terminal.

    Yields:
        What writes to the terminal: never blocks; what nobody reads is lost, as on a UART.
    """
    loop = asyncio.get_running_loop()
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    os.set_blocking(ours, False)
    outlet = _Outlet(ours)

    def take() -> None:
        with suppress(BlockingIOError):
            feed(os.read(ours, _CHUNK_BYTES))

    loop.add_reader(ours, take)
    _point(link, os.ttyname(theirs))
    try:
        yield outlet.write
    finally:
        _unlink(link)
        loop.remove_reader(ours)
        outlet.close()
        os.close(theirs)
        os.close(ours)


class _Outlet:
    """Writes to a terminal without blocking."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._is_open = True

    def write(self, data: bytes) -> None:
        """Write now or when the terminal takes it."""
        if self._is_open and data:
            loop = asyncio.get_running_loop()
            if not self._waiting:
                loop.add_writer(self._descriptor, self._drain)
            self._waiting.append((loop.time(), data))
            self._drain()

    def close(self) -> None:
        """Forget what waits."""
        self._is_open = False
        self._waiting.clear()
        asyncio.get_running_loop().remove_writer(self._descriptor)

    def _drain(self) -> None:
        loop = asyncio.get_running_loop()
        while self._waiting:
            queued_at, data = self._waiting.popleft()
            if loop.time() - queued_at > _OVERRUN_S:
                continue
            try:
                written = os.write(self._descriptor, data)
            except BlockingIOError:
                written = 0
            if written < len(data):
                self._waiting.appendleft((queued_at, data[written:]))
                return
        loop.remove_writer(self._descriptor)


def _point(link: Path, target: str) -> None:
    """Make the symbolic link point to the target, replacing an older one at once."""
    link.parent.mkdir(parents=True, exist_ok=True)
    fresh = link.with_name(f".{link.name}.new")
    fresh.unlink(missing_ok=True)
    fresh.symlink_to(target)
    fresh.replace(link)


def _unlink(link: Path) -> None:
    link.unlink(missing_ok=True)
