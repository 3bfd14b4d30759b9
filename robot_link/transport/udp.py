"""MAVLink over UDP, ``udp://host:port`` or, to be called, ``udp://0.0.0.0:14550?listen=1``.

The wire: each UDP packet holds one or more whole MAVLink 2 frames. Packets may be lost, doubled
or overtake one another; nothing confirms them. Port 14550 is where a ground station usually
listens for vehicles.

``udp://host:port`` sends to that address from a port of the system's choice and hears that
address alone. Who listens talks with the first that is believed, until that one has been silent
for ten seconds and another is believed; packets of others are dropped, counted and told of, and so
is whoever takes the place (see ``far_end``).
"""

import asyncio
import math
import socket
from dataclasses import dataclass
from typing import Any

from robot_link.transport.datagram import (
    FAR_END,
    Address,
    Delivery,
    Fate,
    PortClosedError,
    Received,
)
from robot_link.transport.far_end import FAITHFUL_S, OpenPort
from robot_link.transport.keeper import KeptTransport
from robot_link.transport.uri import LinkUri

_PACKET_BYTES = 1200
"""Fits one packet of any network without being split."""
_Sender = tuple[Any, ...]
"""Host and port, as the system gives them."""


@dataclass(frozen=True, slots=True)
class UdpTiming:
    """Wall seconds of one socket."""

    faithful_s: float = FAITHFUL_S
    """Silence of the far end after which another may take its place."""
    reopen_s: float = 0.5
    """Time between two attempts to open the socket."""


class UdpTransport(KeptTransport):
    """Carries datagrams to one far end. Belongs to one event loop."""

    carrier = "udp"
    bytes_per_s = math.inf

    def __init__(
        self, host: str, port: int, *, listens: bool, timing: UdpTiming | None = None
    ) -> None:
        self.max_payload = 0
        """0 while the socket is closed."""
        self.trouble = ""
        """What the network last said of a packet that it did not take, for a person."""
        self._host = host
        self._port = port
        self._listens = listens
        self._timing = timing or UdpTiming()
        super().__init__(self.carrier, self._serve, self._timing.reopen_s)
        self._socket: asyncio.DatagramTransport | None = None
        self._open_port = OpenPort[_Sender](
            self._keeper.bring, _host, _named, self._timing.faithful_s
        )
        self._speaker: _Sender | None = None
        """Who spoke last while nobody is believed."""

    async def send(self, address: Address, data: bytes) -> asyncio.Future[Delivery]:
        """Send a packet to the far end, whatever the address."""
        del address
        fate: asyncio.Future[Delivery] = asyncio.get_running_loop().create_future()
        if self._socket is None or self._socket.is_closing():
            raise PortClosedError
        if len(data) > self.max_payload:
            detail = f"{len(data)} bytes do not fit a packet of {self.max_payload}"
            fate.set_result(Delivery(Fate.TOO_LARGE, detail=detail))
        elif self._listens and self._target is None:
            fate.set_result(Delivery(Fate.REFUSED, detail="nobody has spoken at this port yet"))
        else:
            self._socket.sendto(data, self._target)
            fate.set_result(Delivery(Fate.UNCONFIRMED))
        return fate

    def set_enabled(self, is_enabled: bool) -> None:
        """Enable the port, or disable it, which closes it and forgets who spoke there."""
        if not is_enabled:
            self._open_port.far_end.forget()
            self._speaker = None
        super().set_enabled(is_enabled)

    def hear(self, data: bytes, sender: _Sender) -> None:
        """Take a packet from the network."""
        self.trouble = ""
        if not data:
            return
        if not self._listens:
            self._keeper.bring(Received(FAR_END, data, None))
        elif self._open_port.hear(sender, data):
            self._speaker = sender

    @property
    def _target(self) -> _Sender | None:
        """Who is sent to; None is whom the socket is connected to, or nobody."""
        return self._open_port.far_end.caller or self._speaker

    async def _serve(self) -> str:
        """Serve one opening of the socket; return why it ended."""
        loop = asyncio.get_running_loop()
        closed: asyncio.Future[str] = loop.create_future()
        where = (self._host, self._port)
        kept, heard = await self.place.take_socket()
        try:
            self._socket, _ = await loop.create_datagram_endpoint(
                lambda: _Ear(self, closed),
                local_addr=where if self._listens and kept is None else None,
                remote_addr=None if self._listens or kept is not None else where,
                sock=kept,
            )
        except socket.gaierror as error:
            return f"{self._host} has no address: {error.strerror}"
        except OSError as error:
            return str(error)
        self.max_payload = _PACKET_BYTES
        self._keeper.opened()
        for data, sender in heard:
            self.hear(data, sender or where)
        try:
            return await closed
        finally:
            self.max_payload = 0
            self.place.keep_socket(self._socket.get_extra_info("socket"))
            self._socket.abort()
            self._socket = None


class _Ear(asyncio.DatagramProtocol):
    """Hands on what a socket hears."""

    def __init__(self, owner: UdpTransport, closed: asyncio.Future[str]) -> None:
        self._owner = owner
        self._closed = closed

    def datagram_received(self, data: bytes, addr: tuple[Any, ...]) -> None:
        self._owner.hear(data, addr)

    def error_received(self, exc: Exception) -> None:
        """Keep what the network said: a far end that is not there yet may come."""
        self._owner.trouble = (exc.strerror if isinstance(exc, OSError) else None) or str(exc)

    def connection_lost(self, exc: Exception | None) -> None:
        if not self._closed.done():
            self._closed.set_result(str(exc) if exc else "the socket was closed")


def _host(sender: _Sender) -> str:
    return str(sender[0])


def _named(sender: _Sender) -> str:
    return f"{sender[0]} port {sender[1]}"


def udp_link(uri: LinkUri) -> UdpTransport:
    """Return the transport of a UDP socket.

    Raises:
        ValueError: If the URI names none.
    """
    host, port = uri.host_and_port("UDP")
    listens = uri.switch("listen")
    uri.finish()
    return UdpTransport(host, port, listens=listens)
