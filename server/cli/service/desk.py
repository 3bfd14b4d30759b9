"""Where a running station is asked to hand over to another version of itself.

It is a socket in its data folder, which its own user and root may speak to.
"""

import asyncio
import contextlib
import json
import os
import socket
import struct
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self

_NAME: Final = "control.sock"
_ASKED_IN_S: Final = 10.0
_CREDENTIALS: Final = struct.Struct("3i")


@contextmanager
def control_address(folder: Path) -> Generator[str]:
    """Give the socket's address; a path of any length fits, by a descriptor of the folder."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{descriptor}/{_NAME}"
    finally:
        os.close(descriptor)


@dataclass(frozen=True, slots=True)
class UpgradeAsked:
    """Somebody asks for an upgrade, and waits for what becomes of it."""

    python: str
    """Interpreter of the installation that is to take over."""
    writer: asyncio.StreamWriter

    def tell(self, sentence: str, **more: bool) -> None:
        """Tell how it goes; whoever asked may have left."""
        self.writer.write(json.dumps({"said": sentence, **more}).encode() + b"\n")

    async def end(self, sentence: str, *, is_done: bool) -> None:
        """Tell how it ended."""
        with contextlib.suppress(OSError):
            self.tell(sentence, done=is_done)
            await self.writer.drain()
            self.writer.close()
            await self.writer.wait_closed()


class UpgradeDesk:
    """Takes what is asked, one at a time. Belongs to one event loop."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._asked: asyncio.Queue[UpgradeAsked] = asyncio.Queue()
        self._server: asyncio.Server | None = None

    async def __aenter__(self) -> Self:
        (self._folder / _NAME).unlink(missing_ok=True)
        ear = socket.socket(socket.AF_UNIX)
        with control_address(self._folder) as address:
            ear.bind(address)
        (self._folder / _NAME).chmod(0o600)
        self._server = await asyncio.start_unix_server(self._answer, sock=ear)
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._server is not None:
            self._server.close()

    async def next(self) -> UpgradeAsked:
        """Return the next that is asked."""
        return await self._asked.get()

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if _user_of(writer) not in (0, os.getuid()):
            writer.close()
            return
        try:
            async with asyncio.timeout(_ASKED_IN_S):
                asked: dict[str, Any] = json.loads(await reader.readline())
            self._asked.put_nowait(UpgradeAsked(str(asked["python"]), writer))
        except (TimeoutError, ValueError, KeyError, TypeError):
            writer.close()


def _user_of(writer: asyncio.StreamWriter) -> int:
    """Return the number of the user at the other end, as the system knows it."""
    end: socket.socket = writer.get_extra_info("socket")
    said = end.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    return _CREDENTIALS.unpack(said)[1]
