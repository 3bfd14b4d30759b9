"""DirectIP: messages of modems over plain TCP, one message to a connection.

From a robot, the gateway connects to the station and delivers; where it is provisioned so, it
waits for a confirmation, and delivers again when it gets none. To a robot, the station connects
to the gateway and waits for a confirmation. The layouts are in
``robot_link.station.gateway.directip_wire``.
"""

import asyncio
import contextlib
import logging
import socket
import struct
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from ipaddress import ip_address, ip_network
from typing import Final

from robot_link.clock import Clock
from robot_link.station.gateway.directip_wire import (
    HEAD_BYTES,
    DirectIpMessage,
    Disposition,
    MtConfirmation,
    MtHeader,
    MtStatus,
    WireError,
    encode,
    length_of,
    parse,
    read_message,
)
from robot_link.station.gateway.gateway import (
    GatewayFault,
    GatewayRefusal,
    GatewayUnreachableError,
    MobileOriginated,
    Retry,
    Taken,
    check_message,
)

__all__ = ["DirectIpGateway", "Listener", "ListenerTiming", "WireError", "read_message"]

CARRIER: Final = "directip"
_CONNECT_S: Final = 5.0
_ANSWER_S: Final = 10.0
_log = logging.getLogger(__name__)

_REFUSALS: Final[dict[int, tuple[GatewayFault, Retry, str]]] = {
    MtStatus.IMEI_FORMAT: (
        GatewayFault.UNKNOWN_IMEI,
        "never",
        "The gateway takes {imei} for no IMEI; check the robot's link.",
    ),
    MtStatus.IMEI_UNKNOWN: (
        GatewayFault.UNKNOWN_IMEI,
        "never",
        "The gateway does not know modem {imei}; check the robot's link.",
    ),
    MtStatus.TOO_LARGE: (
        GatewayFault.TOO_LONG,
        "never",
        "The gateway says that the message is too long.",
    ),
    MtStatus.PAYLOAD_EXPECTED: (
        GatewayFault.EMPTY,
        "never",
        "The gateway says that the message is empty.",
    ),
    MtStatus.QUEUE_FULL: (
        GatewayFault.QUEUE_FULL,
        "later",
        "50 messages wait for modem {imei} already; the rest goes once the robot fetched some.",
    ),
    MtStatus.NO_RESOURCES: (
        GatewayFault.BUSY,
        "later",
        "The gateway has no room at the moment; the message is tried again.",
    ),
    MtStatus.PROTOCOL: (
        GatewayFault.PROTOCOL,
        "never",
        "The gateway did not understand the station.",
    ),
    MtStatus.RING_DISABLED: (
        GatewayFault.RING_DISABLED,
        "never",
        "Ring alerts are switched off for modem {imei}; switch them on where it is provisioned.",
    ),
    MtStatus.NOT_ATTACHED: (
        GatewayFault.NOT_ATTACHED,
        "later",
        "Modem {imei} has not registered with the network; the message is tried again.",
    ),
    MtStatus.ADDRESS_REFUSED: (
        GatewayFault.ADDRESS_REFUSED,
        "never",
        "The gateway takes nothing from this station's network address; have it allowed there.",
    ),
    MtStatus.MTMSN_RANGE: (
        GatewayFault.SEQUENCE,
        "never",
        "The gateway refuses the message's sequence number.",
    ),
}


class DirectIpGateway:
    """Sends through DirectIP; a connection for each message.

    The number of the message becomes its MTMSN, so that the robot's modem tells which message
    it fetched.

    Args:
        host: The gateway's.
        port: The gateway's.
        answer_s: Longest wait for its confirmation.
    """

    carrier = CARRIER

    def __init__(self, host: str, port: int, answer_s: float = _ANSWER_S) -> None:
        self._host = host
        self._port = port
        self._answer_s = answer_s

    async def send(
        self, imei: str, data: bytes, *, client_id: int, flush: bool = False, priority: int = 5
    ) -> Taken:
        """Hand one message over; see ``SatelliteGateway.send``."""
        check_message(imei, data, client_id, priority)
        disposition = Disposition.ASSIGN_MTMSN | (Disposition.FLUSH if flush else Disposition(0))
        header = MtHeader(client_id.to_bytes(4, "big"), imei, int(disposition))
        message = DirectIpMessage(mt_header=header, mt_payload=data, mt_priority=priority)
        answer = await self._exchange(encode(message))
        is_nameless = answer.status < 0 and not any(answer.client_id)  # it was not understood
        if not is_nameless and (answer.client_id, answer.imei) != (header.client_id, imei):
            raise GatewayUnreachableError("The gateway answered to another message.")
        return _taken(answer, imei, client_id)

    async def close(self) -> None:
        """Hold nothing: each message has its own connection."""

    async def _exchange(self, request: bytes) -> MtConfirmation:
        try:
            async with asyncio.timeout(_CONNECT_S):
                reader, writer = await asyncio.open_connection(self._host, self._port)
        except (OSError, TimeoutError) as error:
            what = type(error).__name__
            raise GatewayUnreachableError(f"The gateway cannot be reached ({what}).") from None
        try:
            async with asyncio.timeout(self._answer_s):
                writer.write(request)
                await writer.drain()
                head = await reader.readexactly(HEAD_BYTES)
                answer = parse(head + await reader.readexactly(length_of(head)))
        except TimeoutError:
            raise GatewayUnreachableError(
                f"The gateway did not answer within {self._answer_s:.0f} s."
            ) from None
        except (OSError, asyncio.IncompleteReadError):
            raise GatewayUnreachableError("The gateway hung up without an answer.") from None
        except WireError as error:
            raise GatewayUnreachableError(f"The gateway's answer is none: {error}.") from None
        finally:
            await _hang_up(writer)
        if answer.mt_confirmation is None:
            raise GatewayUnreachableError("The gateway's answer confirms nothing.")
        return answer.mt_confirmation


async def _hang_up(writer: asyncio.StreamWriter) -> None:
    """Close at once: the answer is there, or none is waited for any more."""
    writer.transport.abort()
    with contextlib.suppress(OSError):
        await writer.wait_closed()


def _reset(writer: asyncio.StreamWriter) -> None:
    """Break a connection so that the far side cannot take it for an orderly end."""
    connection: socket.socket = writer.get_extra_info("socket")
    with contextlib.suppress(OSError):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    writer.transport.abort()


def _taken(answer: MtConfirmation, imei: str, client_id: int) -> Taken:
    if answer.status > 0:
        return Taken(str(answer.reference), client_id, answer.status)
    if answer.status == MtStatus.NO_PAYLOAD:
        raise GatewayRefusal(GatewayFault.EMPTY, "The gateway saw no payload in the message.")
    if answer.status in _REFUSALS:
        fault, retry, sentence = _REFUSALS[answer.status]
        raise GatewayRefusal(fault, sentence.format(imei=imei), retry)
    raise GatewayRefusal(
        GatewayFault.OTHER, f"The gateway refused the message for reason {answer.status}."
    )


@dataclass(frozen=True, slots=True)
class ListenerTiming:
    """Wall seconds and counts of the listener."""

    message_s: float = 30.0
    """Longest time for one message to come in."""
    rest_s: float = 0.2
    """How long bytes behind the end of a message are waited for, which would make it none."""
    connections: int = 32
    """Connections at once; further ones are closed."""


class Listener:
    """Takes the messages of robots that a DirectIP gateway delivers.

    Args:
        host: Address to listen on.
        port: Port to listen on; 0 takes a free one.
        on_message: Keeps a message; when it returns, the message is safe, and when it raises,
            the gateway is told to deliver it again.
        clock: Tells when a message came.
        confirms: Whether the gateway waits for a confirmation.
        allowed: Networks from which messages are taken, such as ``192.0.2.0/24``; none takes
            them from anywhere.
        timing: Time-outs.
    """

    def __init__(
        self,
        host: str,
        port: int,
        on_message: Callable[[MobileOriginated], Awaitable[object]],
        clock: Clock,
        *,
        confirms: bool = False,
        allowed: tuple[str, ...] = (),
        timing: ListenerTiming | None = None,
    ) -> None:
        self._host = host
        self._port = port
        self._on_message = on_message
        self._clock = clock
        self._confirms = confirms
        self._allowed = tuple(ip_network(network) for network in allowed)
        self._timing = timing or ListenerTiming()
        self._server: asyncio.Server | None = None
        self._serving: set[asyncio.Task[None]] = set()
        self.refused: Counter[str] = Counter()
        """Connections whose message was not taken, by reason."""
        self.on_stranger: Callable[[], None] = _ignore
        """Called when one comes from outside of ``allowed``."""

    @property
    def port(self) -> int:
        """The port that is listened on."""
        return self._port if self._server is None else self._server.sockets[0].getsockname()[1]

    async def start(self) -> None:
        """Begin to listen.

        Raises:
            OSError: If the address cannot be listened on.
        """
        self._server = await asyncio.start_server(self._connected, self._host, self._port)

    async def stop(self) -> None:
        """Listen no longer; messages that are being kept are kept."""
        if self._server is not None:
            self._server.close()
            self._server = None
        for task in self._serving:
            task.cancel()
        await asyncio.gather(*self._serving, return_exceptions=True)

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        if task is None:
            raise RuntimeError("a connection is served outside of a task")
        if self._server is None or not self._may_come(writer):
            _reset(writer)
            return
        self._serving.add(task)
        try:
            await self._serve(reader, writer)
        except asyncio.CancelledError:
            _reset(writer)  # the end of the station; the stream's own task must not fail
        finally:
            self._serving.discard(task)
            writer.close()

    def _may_come(self, writer: asyncio.StreamWriter) -> bool:
        if len(self._serving) >= self._timing.connections:
            self.refused["too_often"] += 1
            return False
        if not self._allowed:
            return True
        name = writer.get_extra_info("peername")  # None of a connection that is gone already
        if name is not None and any(ip_address(name[0]) in net for net in self._allowed):
            return True
        self.refused["address"] += 1
        self.on_stranger()
        return False

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            async with asyncio.timeout(self._timing.message_s):
                data = await self._message(reader)
            message = read_message(data, self._clock.now())
        except (WireError, asyncio.IncompleteReadError, TimeoutError, OSError) as error:
            self._refuse(writer, "malformed")
            _log.info("a DirectIP message was dropped: %s", error)
            return
        try:
            await self._on_message(message)
        except Exception as error:  # noqa: BLE001 - whatever it is, the gateway must keep the message
            self._refuse(writer, "not_kept")
            _log.warning("a DirectIP message could not be kept: %s", type(error).__name__)
            return
        if self._confirms:
            await self._confirm(writer)

    async def _message(self, reader: asyncio.StreamReader) -> bytes:
        head = await reader.readexactly(HEAD_BYTES)
        data = head + await reader.readexactly(length_of(head))
        try:
            async with asyncio.timeout(self._timing.rest_s):
                data += await reader.read(1)
        except TimeoutError:
            pass  # the gateway keeps the connection open for a confirmation
        return data

    def _refuse(self, writer: asyncio.StreamWriter, reason: str) -> None:
        """Say no, or break the connection where the gateway hears nothing else."""
        self.refused[reason] += 1
        if not self._confirms:
            _reset(writer)
        elif not writer.is_closing():
            writer.write(encode(DirectIpMessage(mo_confirmation=0)))

    async def _confirm(self, writer: asyncio.StreamWriter) -> None:
        writer.write(encode(DirectIpMessage(mo_confirmation=1)))
        try:
            async with asyncio.timeout(self._timing.message_s):
                await writer.drain()
        except (OSError, TimeoutError):
            _log.info("a DirectIP gateway hung up before its confirmation; it delivers again")


def _ignore() -> None:
    pass
