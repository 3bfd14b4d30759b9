"""Where an emulated radio's bytes leave: a pseudo-terminal or a TCP connection."""

import asyncio
import os
from collections import deque
from pathlib import Path
from typing import Final

_OVERRUN_S: Final = 1.0
"""Frames that nobody takes from the pseudo-terminal for so long are lost."""
_OVERRUN_BYTES: Final = 2**18
"""More than so many bytes that a TCP client does not take are lost."""


class PtyOutlet:
    """Writes to a pseudo-terminal without blocking; what nobody takes is lost, as on a UART."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._is_open = True

    def write(self, frame: bytes) -> None:
        """Write a frame now or when the terminal takes it."""
        if self._is_open:
            loop = asyncio.get_running_loop()
            if not self._waiting:
                loop.add_writer(self._descriptor, self._drain)
            self._waiting.append((loop.time(), frame))
            self._drain()

    def close(self) -> None:
        """Forget what waits."""
        self._is_open = False
        self._waiting.clear()
        asyncio.get_running_loop().remove_writer(self._descriptor)

    def _drain(self) -> None:
        loop = asyncio.get_running_loop()
        while self._waiting:
            queued_at, frame = self._waiting.popleft()
            if loop.time() - queued_at > _OVERRUN_S:
                continue
            try:
                written = os.write(self._descriptor, frame)
            except BlockingIOError:
                written = 0
            if written < len(frame):
                self._waiting.appendleft((queued_at, frame[written:]))
                return
        loop.remove_writer(self._descriptor)


def write_unless_full(writer: asyncio.StreamWriter, frame: bytes) -> None:
    """Write a frame, or lose it where the client takes too little."""
    if writer.transport.get_write_buffer_size() < _OVERRUN_BYTES:
        writer.write(frame)


def unlink(link: Path) -> None:
    """Take the symbolic link away, if it is there."""
    link.unlink(missing_ok=True)


def point(link: Path, target: str) -> None:
    """Make the symbolic link point to the target, replacing an older one at once."""
    link.parent.mkdir(parents=True, exist_ok=True)
    fresh = link.with_name(f".{link.name}.new")
    fresh.unlink(missing_ok=True)
    fresh.symlink_to(target)
    fresh.replace(link)
