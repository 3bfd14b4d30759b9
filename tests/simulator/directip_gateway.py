"""Iridium's own gateway: a TCP server that takes messages to modems, a TCP client for the others.

One message a connection each way. The wire is described in ``directip_wire``.

Source: Iridium Short Burst Data Service Developers Guide 3.0, sections 6, 7 and 11.
"""

import asyncio
from collections.abc import AsyncGenerator
from contextlib import asynccontextmanager, suppress
from enum import IntEnum
from urllib.parse import urlsplit

from simulator.background import alongside
from simulator.iridium.acceptance import Reason, RefusedError
from simulator.iridium.loopback import check_loopback, connections
from simulator.iridium.network import IridiumNetwork
from simulator.iridium.push import Pusher, RetrySchedule
from simulator.iridium.session import MobileOriginatedMessage
from tests.simulator import directip_wire as wire

SCHEDULE = RetrySchedule((1, 5, 10, 20, 30, 60, 120, 240, 360), keeps_order=True)
_CUSTOMER_S = 10.0
"""How long a customer may take for one message, by the wall's clock."""
_IMEI_DIGITS = 15
_LONGEST_BODY = 65535


class Status(IntEnum):
    """What a confirmation says where it is no position in the queue."""

    DONE = 0
    BAD_IMEI = -1
    UNKNOWN_IMEI = -2
    TOO_LONG = -3
    NO_PAYLOAD = -4
    QUEUE_FULL = -5
    NO_RESOURCES = -6
    PROTOCOL = -7
    RING_DISABLED = -8
    NOT_ATTACHED = -9
    ADDRESS_REFUSED = -10
    BAD_MTMSN = -11


_STATUSES = {
    Reason.UNKNOWN_IMEI: Status.UNKNOWN_IMEI,
    Reason.TOO_LONG: Status.TOO_LONG,
    Reason.EMPTY: Status.NO_PAYLOAD,
    Reason.QUEUE_FULL: Status.QUEUE_FULL,
    Reason.RING_DISABLED: Status.RING_DISABLED,
    Reason.NOT_ATTACHED: Status.NOT_ATTACHED,
    Reason.BAD_MTMSN: Status.BAD_MTMSN,
}


class DirectIpGateway:
    """The gateway of one network; belongs to one event loop.

    Args:
        network: The network behind it; its subscribers of carrier ``directip`` are served.
        push_url: ``tcp://host:port`` where messages from modems go; None keeps them.
        confirms: Whether the customer confirms each message.

    Raises:
        ValueError: If the customer is not this machine itself.
    """

    def __init__(
        self, network: IridiumNetwork, push_url: str | None, *, confirms: bool = False
    ) -> None:
        self._network = network
        self._confirms = confirms
        self._customer: tuple[str, int] | None = None
        self.refuses_address = False
        """Whether the customer's network address is not among those agreed on."""
        self.pusher = Pusher(self._push, SCHEDULE, network.clock, network.settle)
        self.point_to(push_url)

    def point_to(self, push_url: str | None) -> None:
        """Deliver to another customer from now on.

        Raises:
            ValueError: If it is not this machine itself.
        """
        self._customer = None
        if push_url is not None:
            parts = urlsplit(push_url)
            check_loopback(parts.hostname)
            if parts.scheme != "tcp" or not parts.hostname or not parts.port:
                raise ValueError(f"{push_url}: DirectIP delivers to tcp://host:port")
            self._customer = (parts.hostname, parts.port)

    @asynccontextmanager
    async def serve(self, host: str = "127.0.0.1", port: int = 0) -> AsyncGenerator[str]:
        """Serve until the context is left.

        Yields:
            ``tcp://host:port`` that takes messages to modems.

        Raises:
            ValueError: If the host is not this machine itself.
            OSError: If the port is taken.
        """
        stop_listening = self._network.on_message("directip", self.pusher.put)
        try:
            async with (
                connections(self._take, host, port) as chosen,
                alongside(self.pusher.run(), "DirectIP pushes"),
            ):
                yield f"tcp://{host}:{chosen}"
        finally:
            stop_listening()

    async def _take(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Take one message to a modem; a message that is cut is dropped without a word."""
        revision, length = wire.HEAD.unpack(await reader.readexactly(wire.HEAD.size))
        body = await reader.readexactly(length)
        if revision != wire.REVISION or self._network.conditions.gateway_outage:
            return
        answer = self._confirmation(body)
        if self._network.draw(self._network.conditions.answer_loss):
            writer.transport.abort()
            return
        writer.write(answer)
        await writer.drain()

    def _confirmation(self, body: bytes) -> bytes:
        try:
            request = wire.read_mobile_terminated(body)
        except wire.WireError:
            return wire.pack_confirmation(bytes(4), bytes(15), 0, Status.PROTOCOL)
        message_id, status = self._accept(request)
        return wire.pack_confirmation(request.client_id, request.imei, message_id, status)

    def _accept(self, request: wire.MobileTerminatedRequest) -> tuple[int, int]:
        """Do what a customer asks; return the message's id and the status."""
        if self.refuses_address:
            return 0, Status.ADDRESS_REFUSED
        imei = request.imei.decode("latin-1")
        if not (imei.isascii() and imei.isdecimal() and len(imei) == _IMEI_DIGITS):
            return 0, Status.BAD_IMEI
        subscriber = self._network.subscriber(imei)
        if subscriber is None or subscriber.carrier != "directip":
            return 0, Status.UNKNOWN_IMEI
        if request.has(wire.RING_ONLY) and request.has(wire.ASSIGN_MTMSN):
            return 0, Status.PROTOCOL
        if self._network.draw(self._network.conditions.gateway_failure):
            return 0, Status.NO_RESOURCES
        try:
            return self._queue(imei, request)
        except RefusedError as error:
            return 0, _STATUSES.get(error.reason, Status.NO_RESOURCES)

    def _queue(self, imei: str, request: wire.MobileTerminatedRequest) -> tuple[int, int]:
        """Queue a message, or flush or ring without one.

        Raises:
            RefusedError: If the network does not take it.
        """
        flushes = request.has(wire.FLUSH)
        if request.has(wire.RING_ONLY):
            if request.data is not None:
                return 0, Status.PROTOCOL
            self._network.ring(imei)
            return 0, Status.DONE
        if request.data is None and flushes:
            self._network.flush(imei)
            return 0, Status.DONE
        if request.data is None:
            return 0, Status.NO_PAYLOAD
        assigns = request.has(wire.ASSIGN_MTMSN)
        accepted = self._network.accept(
            imei,
            request.data,
            priority=1 if request.has(wire.HIGH_PRIORITY) else request.priority,
            flush=flushes,
            mtmsn=int.from_bytes(request.client_id, "big") if assigns else None,
        )
        return accepted.message_id, accepted.position

    async def _push(self, message: MobileOriginatedMessage) -> bool:
        """Tell the customer of a session; return whether it took the message."""
        if self._customer is None or self._network.conditions.gateway_outage:
            return False
        try:
            async with asyncio.timeout(_CUSTOMER_S):
                reader, writer = await asyncio.open_connection(*self._customer)
                try:
                    return await self._hand_over(message, reader, writer)
                finally:
                    writer.close()
                    with suppress(OSError):
                        await writer.wait_closed()
        except (TimeoutError, OSError):
            return False

    async def _hand_over(
        self,
        message: MobileOriginatedMessage,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> bool:
        writer.write(wire.pack_mobile_originated(message))
        await writer.drain()
        if self._confirms:
            answer = await reader.read(len(wire.MO_CONFIRMATION))
            return answer == wire.MO_CONFIRMATION
        writer.write_eof()
        # A customer that has everything hangs up; one that fails breaks the connection.
        await reader.read(_LONGEST_BODY)
        return True
