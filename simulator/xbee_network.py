"""A network of XBee radios that do not exist: one at the station's port, one in each robot.

The station's radio speaks API frames on a pseudo-terminal or a TCP port, as an XBee-PRO 900HP
does; the robots' radios are ``DatagramTransport`` objects in the simulator's own process.
"""

import asyncio
import os
import random
import tty
from collections import deque
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from robot_link.transport.datagram import (
    BROADCAST,
    Address,
    Delivery,
    Fate,
    PortChanged,
    Received,
    TransportEvent,
)
from robot_link.transport.xbee_frame import (
    ApiMode,
    AtCommand,
    AtReply,
    AtStatus,
    Frame,
    FrameReader,
    ReceivePacket,
    TransmitCode,
    TransmitRequest,
    TransmitStatus,
    encode,
    parse_content,
)

MAX_PAYLOAD = 256
"""NP of an XBee-PRO 900HP."""

_ROBOT_WINDOW = 8
_OVERRUN_S = 1.0
"""Frames that nobody takes from the pseudo-terminal for so long are lost."""
_OVERRUN_BYTES = 2**18
"""More than so many bytes that a TCP client does not take are lost."""

_ANSWER_S = 0.002
"""Time of the station's radio to answer an AT command; digi-xbee misses sooner answers."""

_STATUS_OF = {
    Fate.DELIVERED: TransmitCode.SUCCESS,
    Fate.NOT_ACKNOWLEDGED: TransmitCode.NETWORK_ACK_FAILURE,
    Fate.TOO_LARGE: TransmitCode.PAYLOAD_TOO_LARGE,
}


@dataclass(frozen=True, slots=True)
class AirConditions:
    """How bad the air is; every number holds for one transmission attempt."""

    loss: float = 0.0
    """Probability that a packet, or its confirmation, is not heard."""
    duplication: float = 0.0
    """Probability that a heard packet arrives twice."""
    delay_s: float = 0.005
    """Shortest time from radio to radio."""
    jitter_s: float = 0.005
    """Greatest extra time, uniformly distributed; packets may overtake one another."""
    mac_retries: int = 3
    """Further attempts of the radio itself before it reports 0x21."""
    rssi_dbm: float = -52.0
    """Strength of every packet."""


@dataclass(slots=True)
class _Flight:
    """A packet on its way."""

    source: Address
    destination: Address
    data: bytes
    fate: asyncio.Future[Delivery]
    attempt: int = 0
    is_heard: bool = False


class XBeeNetwork:
    """The air between the radios; belongs to one event loop.

    ``in_reach(a, b)`` says whether radio waves pass between two radios now; a submerged robot is
    out of everyone's reach, and packets under way to it are lost.
    """

    def __init__(
        self,
        rng: random.Random,
        conditions: AirConditions,
        in_reach: Callable[[Address, Address], bool] = lambda _a, _b: True,
    ) -> None:
        self.conditions = conditions
        """May be replaced at any time."""
        self._rng = rng
        self._in_reach = in_reach
        self._listeners: dict[Address, Callable[[Address, bytes], None]] = {}

    def robot_radio(self, address: Address) -> "RobotRadio":
        """Return the radio of a robot, in process.

        Raises:
            ValueError: If the address is taken.
        """
        radio = RobotRadio(address, self)
        self.listen(address, radio.hear)
        return radio

    @asynccontextmanager
    async def pty(
        self, address: Address, link: Path, mode: ApiMode = 1
    ) -> AsyncGenerator[None, None]:
        """Put the station's radio on a pseudo-terminal, reached through the symbolic link.

        Leaving the context pulls the plug: whoever has the port open sees it vanish.
        """
        loop = asyncio.get_running_loop()
        ours, theirs = os.openpty()
        tty.setraw(theirs)
        os.set_blocking(ours, False)
        outlet = _PtyOutlet(ours)
        module = _StationModule(address, mode, self, outlet.write)

        def take() -> None:
            with suppress(BlockingIOError):
                module.feed(os.read(ours, 65536))

        self.listen(address, module.hear)
        loop.add_reader(ours, take)
        _point(link, os.ttyname(theirs))
        try:
            yield
        finally:
            _unlink(link)
            del self._listeners[address]
            loop.remove_reader(ours)
            outlet.close()
            os.close(theirs)
            os.close(ours)

    @asynccontextmanager
    async def tcp(
        self, address: Address, host: str, port: int = 0, mode: ApiMode = 1
    ) -> AsyncGenerator[int, None]:
        """Put the station's radio on a TCP port, for one client at a time.

        Yields:
            The port's number; 0 asks the system to choose it.
        """
        clients: set[asyncio.StreamWriter] = set()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            if clients:
                writer.close()
                return
            clients.add(writer)
            module = _StationModule(address, mode, self, partial(_write_unless_full, writer))
            self.listen(address, module.hear)
            try:
                while data := await reader.read(65536):
                    module.feed(data)
            except ConnectionError:
                pass
            finally:
                del self._listeners[address]
                clients.discard(writer)
                writer.close()

        server = await asyncio.start_server(serve, host, port)
        try:
            yield server.sockets[0].getsockname()[1]
        finally:
            server.close()
            for writer in list(clients):
                writer.transport.abort()
            await server.wait_closed()

    def transmit(
        self, source: Address, destination: Address, data: bytes
    ) -> asyncio.Future[Delivery]:
        """Send a packet into the air; the future tells what its sender's radio will say."""
        fate: asyncio.Future[Delivery] = asyncio.get_running_loop().create_future()
        if len(data) > MAX_PAYLOAD:
            fate.set_result(Delivery(Fate.TOO_LARGE))
            return fate
        self._fly(_Flight(source, destination, data, fate))
        return fate

    def listen(self, address: Address, hear: Callable[[Address, bytes], None]) -> None:
        """Let a radio hear; ``hear`` is called with sender and data.

        Raises:
            ValueError: If the address is taken.
        """
        if address in self._listeners:
            raise ValueError(f"two radios cannot have the address {address:016X}")
        self._listeners[address] = hear

    def _fly(self, flight: _Flight) -> None:
        air = self.conditions
        delay_s = air.delay_s + air.jitter_s * self._rng.random()
        asyncio.get_running_loop().call_later(delay_s, self._land, flight)

    def _land(self, flight: _Flight) -> None:
        """End one attempt: heard or not, confirmed or not, repeated or given up."""
        if flight.destination == BROADCAST:
            for address in [a for a in self._listeners if a != flight.source]:
                if self._passes(flight.source, address):
                    self._hear(flight, address)
            self._settle(flight, Fate.DELIVERED)
            return
        passes = self._passes(flight.source, flight.destination)
        if passes and not flight.is_heard:
            flight.is_heard = True
            self._hear(flight, flight.destination)
        if passes and self._rng.random() >= self.conditions.loss:
            self._settle(flight, Fate.DELIVERED)
        elif flight.attempt < self.conditions.mac_retries:
            flight.attempt += 1
            self._fly(flight)
        else:
            self._settle(flight, Fate.NOT_ACKNOWLEDGED)

    def _passes(self, source: Address, destination: Address) -> bool:
        return (
            destination in self._listeners
            and self._in_reach(source, destination)
            and self._rng.random() >= self.conditions.loss
        )

    def _hear(self, flight: _Flight, address: Address) -> None:
        self._arrive(flight, address)
        if self._rng.random() < self.conditions.duplication:
            air = self.conditions
            delay_s = air.delay_s + air.jitter_s * self._rng.random()
            asyncio.get_running_loop().call_later(delay_s, self._arrive, flight, address)

    def _arrive(self, flight: _Flight, address: Address) -> None:
        listener = self._listeners.get(address)
        if listener is not None and self._in_reach(flight.source, address):
            listener(flight.source, flight.data)

    @staticmethod
    def _settle(flight: _Flight, fate: Fate) -> None:
        if not flight.fate.done():
            flight.fate.set_result(Delivery(fate, flight.attempt))


class RobotRadio:
    """A robot's own radio: a ``DatagramTransport`` without a port, always open."""

    carrier = "xbee"
    max_payload = MAX_PAYLOAD
    bytes_per_s = 6000.0
    is_plugged = True

    def __init__(self, address: Address, network: XBeeNetwork) -> None:
        self._address = address
        self._network = network
        self._window = asyncio.Semaphore(_ROBOT_WINDOW)
        self._events: asyncio.Queue[TransportEvent] = asyncio.Queue()
        self._events.put_nowait(PortChanged(is_open=True, reason=""))

    def set_plugged(self, is_plugged: bool) -> None:
        """Refuse: the plug is the station's.

        Raises:
            NotImplementedError: Always.
        """
        raise NotImplementedError("a robot's own radio has no plug")

    async def run(self) -> None:
        """Serve until cancelled."""
        await asyncio.get_running_loop().create_future()

    async def send(self, address: Address, data: bytes) -> asyncio.Future[Delivery]:
        """Hand a datagram to the radio; see ``DatagramTransport.send``."""
        await self._window.acquire()
        fate = self._network.transmit(self._address, address, data)
        fate.add_done_callback(lambda _: self._window.release())
        return fate

    async def events(self) -> AsyncIterator[TransportEvent]:
        """Yield what the radio hears, until cancelled."""
        while True:
            yield await self._events.get()

    def hear(self, source: Address, data: bytes) -> None:
        """Take a packet from the air."""
        self._events.put_nowait(Received(source, data, self._network.conditions.rssi_dbm))


class _StationModule:
    """The XBee at the station's port: API frames on one side, the air on the other."""

    def __init__(
        self,
        address: Address,
        mode: ApiMode,
        network: XBeeNetwork,
        write: Callable[[bytes], None],
    ) -> None:
        self._address = address
        self._mode: ApiMode = mode
        self._network = network
        self._write = write
        self._reader = FrameReader(mode)
        octets = address.to_bytes(8, "big")
        self._parameters = {
            b"AP": bytes((mode,)),
            b"AO": b"\x00",
            b"CE": b"\x00",
            b"HV": b"\x23\x4b",
            b"NI": b"STATION",
            b"NP": MAX_PAYLOAD.to_bytes(2, "big"),
            b"SH": octets[:4],
            b"SL": octets[4:],
            b"VR": b"\x80\x75",
        }

    def feed(self, data: bytes) -> None:
        """Take bytes from the port."""
        for content in self._reader.feed(data):
            match parse_content(content):
                case AtCommand() as command:
                    self._answer(command)
                case TransmitRequest() as request:
                    self._transmit(request)
                case _:
                    pass

    def hear(self, source: Address, data: bytes) -> None:
        """Take a packet from the air."""
        self._say(ReceivePacket(source, data))

    def _say(self, frame: Frame) -> None:
        self._write(encode(frame.content(), self._mode))

    def _answer(self, command: AtCommand) -> None:
        name = command.command.upper()
        status, value = AtStatus.OK, b""
        if name == b"DB":
            value = bytes((round(-self._network.conditions.rssi_dbm),))
        elif name not in self._parameters:
            status = AtStatus.BAD_COMMAND
        elif command.value:
            self._parameters[name] = command.value
        else:
            value = self._parameters[name]
        if command.frame_id:
            reply = AtReply(command.frame_id, command.command, status, value)
            asyncio.get_running_loop().call_later(_ANSWER_S, self._say, reply)

    def _transmit(self, request: TransmitRequest) -> None:
        def tell(fate: asyncio.Future[Delivery]) -> None:
            delivery = fate.result()
            status = _STATUS_OF[delivery.fate]
            self._say(TransmitStatus(request.frame_id, delivery.retries, status))

        fate = self._network.transmit(self._address, request.address, request.data)
        if request.frame_id:
            fate.add_done_callback(tell)


class _PtyOutlet:
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


def _write_unless_full(writer: asyncio.StreamWriter, frame: bytes) -> None:
    if writer.transport.get_write_buffer_size() < _OVERRUN_BYTES:
        writer.write(frame)


def _point(link: Path, target: str) -> None:
    """Make the symbolic link point to the target, replacing an older one at once."""
    link.parent.mkdir(parents=True, exist_ok=True)
    fresh = link.with_name(f".{link.name}.new")
    fresh.unlink(missing_ok=True)
    fresh.symlink_to(target)
    fresh.replace(link)


def _unlink(link: Path) -> None:
    link.unlink(missing_ok=True)
