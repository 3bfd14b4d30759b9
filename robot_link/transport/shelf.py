"""Open radio lines that nobody serves for a while: heard, and handed to whoever serves them next.

A station that is replaced by another process leaves its lines here while it ends. Each line on the
shelf is read by a thread of its own, however busy the event loop is, so that no buffer of the
system overflows; whoever takes a line gets what it brought meanwhile first. So no byte is lost and
none comes twice. Serial lines and UDP sockets are kept; TCP connections are opened anew.
"""

import os
import select
import socket
import threading
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, Final

from robot_link.transport.port import Port, SerialPort

_CHUNK_BYTES: Final = 65536
Sender = tuple[Any, ...] | None
"""Who sent a datagram; nobody is named on a line."""


@dataclass(slots=True)
class KeptLine:
    """An open line and what it brought that nobody has taken yet."""

    descriptor: int
    name: str
    """Path of a serial line; empty for a socket."""
    heard: list[tuple[bytes, Sender]] = field(default_factory=list[tuple[bytes, Sender]])


class _Ear:
    """Reads a line into what it has brought, in a thread; nobody else may read it meanwhile."""

    def __init__(self, line: KeptLine) -> None:
        self.line = line
        self._told, self._tell = os.pipe()
        self._thread = threading.Thread(target=self._listen, name="kept line", daemon=True)
        self._thread.start()

    def stop(self) -> KeptLine:
        """Return the line once the thread has ended; what comes from now on is the caller's."""
        os.write(self._tell, b".")
        self._thread.join()
        os.close(self._tell)
        os.close(self._told)
        return self.line

    def _listen(self) -> None:
        poll = select.poll()
        poll.register(self._told, select.POLLIN)
        poll.register(self.line.descriptor, select.POLLIN)
        while True:
            ready = dict(poll.poll())
            if self._told in ready:
                return
            if not self._hear():
                poll.unregister(self.line.descriptor)

    def _hear(self) -> bool:
        """Read what there is; a line that has failed shows that to whoever serves it next too."""
        try:
            if self.line.name:
                data, sender = os.read(self.line.descriptor, _CHUNK_BYTES), None
            else:
                with socket.socket(fileno=os.dup(self.line.descriptor)) as ear:
                    data, sender = ear.recvfrom(_CHUNK_BYTES)
        except (BlockingIOError, ConnectionError):  # a far end of a socket that is not there yet
            return True
        except OSError:
            return False
        self.line.heard.append((data, sender))
        return bool(data or not self.line.name)


class Shelf:
    """Keeps open lines by the URI of their link. Belongs to one event loop."""

    def __init__(self) -> None:
        self.is_open = False
        """Whether lines that are given up are kept; otherwise they are closed."""
        self._ears: dict[str, _Ear] = {}

    @property
    def uris(self) -> tuple[str, ...]:
        """Links whose lines are kept."""
        return tuple(self._ears)

    async def filled(self) -> None:
        """Wait until all lines are here that an earlier process keeps."""

    def put(self, uri: str, line: KeptLine) -> None:
        """Keep a line, which is the shelf's from now on, and listen to it."""
        os.set_blocking(line.descriptor, False)
        self._ears[uri] = _Ear(line)

    def take(self, uri: str) -> KeptLine | None:
        """Return the line of a link, which is the caller's from now on; none if none is kept."""
        ear = self._ears.pop(uri, None)
        return None if ear is None else ear.stop()

    def close(self) -> None:
        """Close what nobody has taken."""
        self.is_open = False
        for uri in self.uris:
            if (line := self.take(uri)) is not None:
                os.close(line.descriptor)


class Place:
    """One link's place on a shelf: where its line comes from, and goes to.

    Args:
        uri: The link.
        shelf: Where its line may be; without one, lines are opened and closed.
    """

    def __init__(self, uri: str = "", shelf: Shelf | None = None) -> None:
        self._uri = uri
        self._shelf = shelf

    async def open(self, open_port: Callable[[], Awaitable[Port]]) -> Port:
        """Return the port of the link: a kept one, or one opened anew.

        Raises:
            OSError: If it cannot be opened.
        """
        line = await self._take()
        if line is None:
            return await open_port()
        return SerialPort(line.descriptor, line.name, b"".join(data for data, _ in line.heard))

    def close(self, port: Port) -> None:
        """Keep a serial line if lines are kept, else close the port."""
        if self._shelf is not None and self._shelf.is_open and isinstance(port, SerialPort):
            descriptor, unread = port.release()
            heard: list[tuple[bytes, Sender]] = [(unread, None)] if unread else []
            self._shelf.put(self._uri, KeptLine(descriptor, port.name, heard))
        port.close()

    async def take_socket(self) -> tuple[socket.socket | None, list[tuple[bytes, Sender]]]:
        """Return the kept socket of the link and what it heard; none if none is kept."""
        line = await self._take()
        if line is None:
            return None, []
        return socket.socket(fileno=line.descriptor), line.heard

    def keep_socket(self, kept: socket.socket) -> None:
        """Keep a socket that is about to be closed, if lines are kept."""
        if self._shelf is not None and self._shelf.is_open and kept.fileno() >= 0:
            self._shelf.put(self._uri, KeptLine(os.dup(kept.fileno()), ""))

    async def _take(self) -> KeptLine | None:
        if self._shelf is None:
            return None
        await self._shelf.filled()
        return self._shelf.take(self._uri)
