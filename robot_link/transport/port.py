"""Byte streams to a radio: a serial line or pseudo-terminal, and a TCP connection.

A port is opened once, used from one event loop and never blocks it; when it fails it raises
``OSError`` and is thrown away.
"""

import asyncio
import os
import socket
import termios
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

import serial

_CHUNK_BYTES = 65536
_LOOK_S = 1.0
"""Time between two looks whether the name of a line is still that line's."""
_CONNECT_S = 5.0
"""Longest wait for a TCP connection."""
_KEEPALIVE = tuple(
    (getattr(socket, name), value)
    for name, value in (
        ("TCP_KEEPIDLE", 4),
        ("TCP_KEEPINTVL", 2),
        ("TCP_KEEPCNT", 3),
        ("TCP_USER_TIMEOUT", 10_000),
    )
    if hasattr(socket, name)
)
"""Seconds, counts and milliseconds after which a far side that vanished without a word is noticed,
where the system lets them be set."""


class Port(Protocol):
    """One open byte stream."""

    async def read(self) -> bytes:
        """Return the next bytes; none means that the far side hung up."""
        ...

    async def write(self, data: bytes) -> None:
        """Write all of ``data``; one writer at a time."""
        ...

    def unread(self, data: bytes) -> None:
        """Take back the last bytes that were read; the next read returns them first."""
        ...

    def close(self) -> None:
        """Give the stream up; reads and writes under way must have been cancelled."""
        ...


class SerialPort:
    """A serial line, real or pseudo-terminal, locked against a second program.

    Its name may be a symbolic link, and lead elsewhere one day: adapters change places, and a
    number that a line has given up is soon another's.
    """

    def __init__(self, descriptor: int, name: str, heard: bytes = b"") -> None:
        """Take an open line.

        Args:
            descriptor: Of the line, which is closed with this object.
            name: By which the line was opened.
            heard: What was read of it already, to be read first.
        """
        self._descriptor = descriptor
        self.name = name
        """Path by which the line was opened."""
        self._unread = heard
        self._waiting: dict[asyncio.Future[None], Callable[[int], bool]] = {}
        """Who waits for the line, and what ends the watch of it."""

    @classmethod
    async def open(cls, path: str, *, baud: int, flow_control: bool) -> "SerialPort":
        """Open the line; the driver may block, so a worker thread does it.

        Raises:
            OSError: If there is no such line, another program has it, or it refuses the speed.
        """

        def opened() -> int:
            try:
                line = serial.Serial(path, baud, timeout=0, rtscts=flow_control, exclusive=True)
            except (ValueError, OverflowError, termios.error) as error:
                raise OSError(f"{path}: {error}") from error
            try:
                # Speed and lock belong to the opening, which a second number keeps open.
                return os.dup(line.fileno())
            finally:
                line.close()

        return cls(await asyncio.to_thread(opened), path)

    async def read(self) -> bytes:
        """Return the next bytes; none means that the line is gone.

        Raises:
            OSError: If the line failed, or its name leads to another one now.
        """
        if self._unread:
            data, self._unread = self._unread, b""
            return data
        loop = asyncio.get_running_loop()
        while not self._has_moved():
            try:
                async with asyncio.timeout(_LOOK_S):
                    await self._ready(loop.add_reader, loop.remove_reader)
            except TimeoutError:
                continue
            return os.read(self._descriptor, _CHUNK_BYTES)
        raise OSError(f"{self.name} leads to another line now")

    async def write(self, data: bytes) -> None:
        """Write all of ``data``."""
        loop = asyncio.get_running_loop()
        rest = memoryview(data)
        while rest:
            try:
                rest = rest[os.write(self._descriptor, rest) :]
            except BlockingIOError:
                await self._ready(loop.add_writer, loop.remove_writer)

    @property
    def is_awaited(self) -> bool:
        """Whether somebody waits for the line."""
        return bool(self._waiting)

    def unread(self, data: bytes) -> None:
        """Take back the last bytes that were read."""
        self._unread = data + self._unread

    def release(self) -> tuple[int, bytes]:
        """Return the open line and what was read of it and taken back; another has it now.

        Whoever still waits to write goes on at once, and fails. The line is watched no more: its
        number may soon be another's.
        """
        for ready, unwatch in self._waiting.items():
            unwatch(self._descriptor)
            if not ready.done():
                ready.set_result(None)
        self._waiting.clear()
        descriptor, self._descriptor = self._descriptor, -1
        return descriptor, self._unread

    def close(self) -> None:
        """Release the line, unless another has it."""
        if self._descriptor >= 0:
            os.close(self.release()[0])

    async def _ready(
        self,
        watch: Callable[[int, Callable[[], None]], None],
        unwatch: Callable[[int], bool],
    ) -> None:
        """Wait until the line can be read or written, has failed, or is released."""
        ready = asyncio.get_running_loop().create_future()

        def signal() -> None:
            if not ready.done():
                ready.set_result(None)

        watch(self._descriptor, signal)
        self._waiting[ready] = unwatch
        try:
            await ready
        finally:
            if self._waiting.pop(ready, None) is not None:
                unwatch(self._descriptor)

    def _has_moved(self) -> bool:
        """Tell whether the name leads to another line; a line may well outlive its name."""
        with suppress(OSError):
            named = os.stat(self.name).st_rdev
            return named != os.fstat(self._descriptor).st_rdev
        return False


class TcpPort:
    """A TCP connection to a radio behind a serial server, or to an emulated one."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer
        self._unread = b""
        connection: socket.socket = writer.get_extra_info("socket")
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in _KEEPALIVE:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)

    @classmethod
    async def open(cls, host: str, port: int) -> "TcpPort":
        """Connect.

        Raises:
            OSError: If nobody answers.
        """
        try:
            async with asyncio.timeout(_CONNECT_S):
                return cls(*await asyncio.open_connection(host, port))
        except TimeoutError as error:
            raise OSError(f"{host} port {port} does not answer") from error
        except socket.gaierror as error:
            raise OSError(f"{host} has no address: {error.strerror}") from error

    async def read(self) -> bytes:
        """Return the next bytes; none means that the far side closed."""
        if self._unread:
            data, self._unread = self._unread, b""
            return data
        return await self._reader.read(_CHUNK_BYTES)

    def unread(self, data: bytes) -> None:
        """Take back the last bytes that were read."""
        self._unread = data + self._unread

    async def write(self, data: bytes) -> None:
        """Write all of ``data``."""
        self._writer.write(data)
        await self._writer.drain()

    def close(self) -> None:
        """Close the connection."""
        if self._writer.transport.get_write_buffer_size():
            self._writer.transport.abort()
        else:
            self._writer.close()
