"""MAVLink over TCP, ``tcp://host:port`` or, to be called, ``tcp://0.0.0.0:5760?listen=1``.

The wire: MAVLink 2 frames one after another in both directions of one connection, nothing else
(see ``mavlink_stream``). Port 5760 is the usual one of a vehicle that waits for its ground station.

Who listens lets several callers in, so that nobody keeps the robot out by being there first, and
talks with the first that is believed; the others are dropped, counted and told of (see
``far_end``). A connection whose far side vanished without a word is given up after some ten
seconds.
"""

import asyncio
import math
from contextlib import suppress
from functools import partial

from robot_link.transport.datagram import (
    Address,
    Delivery,
    Fate,
    PortClosedError,
)
from robot_link.transport.far_end import OpenPort
from robot_link.transport.keeper import KeptTransport
from robot_link.transport.mavlink_stream import HUNG_UP, MavlinkStream, StreamTiming, read_frames
from robot_link.transport.port import TcpPort
from robot_link.transport.uri import LinkUri

_FRAME_BYTES = 1200
"""Frames handed over at once fit one packet of any network."""
_CALLERS = 4
"""Callers at once; another takes the place of the one that is there longest and not believed."""


def tcp_link(uri: LinkUri) -> "TcpListener | MavlinkStream":
    """Return the transport of a TCP connection.

    Raises:
        ValueError: If the URI names none.
    """
    host, port = uri.host_and_port("TCP")
    listens = uri.switch("listen")
    uri.finish()
    if listens:
        return TcpListener(host, port)
    opened = partial(TcpPort.open, host, port)
    return MavlinkStream("tcp", opened, bytes_per_s=math.inf, frame_bytes=_FRAME_BYTES)


class _Caller:
    """One connection."""

    def __init__(self, port: TcpPort, host: str, number: int) -> None:
        self.port = port
        self.host = host
        self.where = f"{host} port {number}"
        self.writing = asyncio.Lock()


def _host(caller: _Caller) -> str:
    return caller.host


def _where(caller: _Caller) -> str:
    return caller.where


class TcpListener(KeptTransport):
    """Carries datagrams to the one caller that is believed. Belongs to one event loop."""

    carrier = "tcp"
    bytes_per_s = math.inf

    def __init__(self, host: str, port: int, timing: StreamTiming | None = None) -> None:
        self.max_payload = 0
        """0 while nobody has called."""
        self._host = host
        self._port = port
        self._timing = timing or StreamTiming()
        super().__init__(self.carrier, self._serve, self._timing.reopen_s)
        self._open_port = OpenPort[_Caller](self._keeper.bring, _host, _where)
        self._callers: dict[_Caller, asyncio.Task[None]] = {}
        self._all_gone = asyncio.Event()

    def set_enabled(self, is_enabled: bool) -> None:
        """Enable the port, or disable it, which closes it and forgets who called."""
        if not is_enabled:
            self._open_port.far_end.forget()
        super().set_enabled(is_enabled)

    async def send(self, address: Address, data: bytes) -> asyncio.Future[Delivery]:
        """Write frames to the far end; while nobody is believed, to everyone who called."""
        del address
        if not self.max_payload:
            raise PortClosedError
        believed = self._open_port.far_end.caller
        targets = [one for one in self._callers if believed in (None, one)]
        taken = await asyncio.gather(*(self._write(one, data) for one in targets))
        if not any(taken):
            raise PortClosedError("the far side is not there")
        fate: asyncio.Future[Delivery] = asyncio.get_running_loop().create_future()
        fate.set_result(Delivery(Fate.UNCONFIRMED))
        return fate

    async def _write(self, caller: _Caller, data: bytes) -> bool:
        async with caller.writing:
            try:
                async with asyncio.timeout(self._timing.write_timeout_s):
                    await caller.port.write(data)
            except OSError:  # a time-out is one, too
                self._drop(caller)
                return False
        return True

    async def _serve(self) -> str:
        """Listen until the last caller has gone; return why it ended."""
        self._all_gone.clear()
        try:
            server = await asyncio.start_server(self._answer, self._host, self._port)
        except OSError as error:
            return str(error)
        try:
            await self._all_gone.wait()
        finally:
            server.close()
            self._all_gone.set()
            self.max_payload = 0
            reading = list(self._callers.values())
            for caller in list(self._callers):
                self._drop(caller)
            await asyncio.gather(*reading, return_exceptions=True)
        return HUNG_UP

    def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        peer = writer.get_extra_info("peername")
        try:
            port = TcpPort(reader, writer)
        except OSError:  # it hung up in the same moment
            port = None
        if port is None or self._all_gone.is_set():
            writer.transport.abort()
            return
        if len(self._callers) >= _CALLERS:
            self._drop(
                next(one for one in self._callers if one is not self._open_port.far_end.caller)
            )
        caller = _Caller(port, str(peer[0]), int(peer[1]))
        read = asyncio.create_task(self._read(caller), name=f"tcp caller {caller.where}")
        self._callers[caller] = read
        if not self.max_payload:
            self.max_payload = _FRAME_BYTES
            self._keeper.opened()

    def _drop(self, caller: _Caller) -> None:
        """Hang up."""
        reading = self._callers.pop(caller, None)
        if reading is None:
            return
        reading.cancel()
        caller.port.close()
        self._open_port.far_end.left(caller)
        if not self._callers:
            self._all_gone.set()

    async def _read(self, caller: _Caller) -> None:
        hear = partial(self._open_port.hear, caller)
        with suppress(OSError):
            await read_frames(caller.port, self._timing.quiet_s, hear, self._keeper.bring)
        self._drop(caller)
