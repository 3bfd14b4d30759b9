"""An XBee radio in API mode as a datagram transport, ``xbee:///dev/ttyUSB0?baud=115200``.

The wire: 8N1 at ``baud`` (115200 where the URI does not say), with ``rtscts=1`` under hardware flow
control; ``xbee://host:port`` is the same stream over TCP. On it, API frames (see ``xbee_frame``) as
the radio's AP parameter has them, ``ap=1`` (plain) or ``ap=2`` (escaped):

- 0x08 asks a parameter and 0x88 answers: NP (bytes per packet), SH and SL (address) and BR (rate
  in the air) when the port opens, DB (strength of the last packet) every second, ND on request.
- 0x10 sends to a 64-bit address, FFFF to all; 0x8B says what became of it, 0x21 that the far radio
  did not confirm. 0x90 brings a packet and its sender's address.

Each packet holds one or more whole MAVLink frames. ``rate=10k`` or ``rate=200k`` says how fast the
radio is in the air where its firmware does not.
"""

import asyncio
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Final, Literal

from robot_link.transport.datagram import (
    Address,
    Delivery,
    Fate,
    Garbled,
    PortClosedError,
    Received,
)
from robot_link.transport.keeper import KeptTransport, first_to_end
from robot_link.transport.mavlink_stream import give_back
from robot_link.transport.port import Port, SerialPort, TcpPort
from robot_link.transport.uri import LinkUri
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
from robot_link.transport.xbee_neighbour import (
    REPORT_STRENGTH,
    NeighbourRadio,
    parse_neighbour,
)

_FATES: Final[dict[int, Fate]] = {
    TransmitCode.SUCCESS: Fate.DELIVERED,
    TransmitCode.MAC_ACK_FAILURE: Fate.NOT_ACKNOWLEDGED,
    TransmitCode.NETWORK_ACK_FAILURE: Fate.NOT_ACKNOWLEDGED,
    TransmitCode.ROUTE_NOT_FOUND: Fate.NOT_ACKNOWLEDGED,
    TransmitCode.PAYLOAD_TOO_LARGE: Fate.TOO_LARGE,
}
BYTES_PER_S: Final = {10: 300.0, 200: 6000.0}
"""Telemetry of a whole fleet by the radio's rate in the air, kbit/s: a quarter of what it carries
at best, so that commands, acknowledgements and repetitions find their place."""
_MODES: Final[Mapping[str, ApiMode]] = MappingProxyType({"1": 1, "2": 2})
_RATES: Final[Mapping[str, Literal[10, 200] | None]] = MappingProxyType({"10k": 10, "200k": 200})
_LONGEST_DISCOVERY_S = 60.0
_DISCOVERY_MARGIN_S = 0.3
"""For the last answer's way through the port."""
_UNANSWERED_QUESTIONS = 3
"""After so many in a row the radio counts as gone."""


@dataclass(frozen=True, slots=True)
class XBeeTiming:
    """Wall seconds and counts of one radio."""

    window: int = 4
    """Datagrams handed to the radio and not yet answered; its own buffers hold few."""
    status_timeout_s: float = 2.0
    """Longest wait for a transmit status."""
    slow_status_timeout_s: float = 10.0
    """The same of a radio of 10 kbit/s, or of unknown rate: it retries for seconds."""
    question_timeout_s: float = 1.0
    """Longest wait for an answer to an AT command."""
    signal_period_s: float = 1.0
    """Time between two questions for the signal strength, which prove that the radio lives."""
    quiet_s: float = 0.3
    """Silence after which half a frame is given up; a radio writes each of its own at once."""
    reopen_s: float = 0.5
    """Time between two attempts to open the port."""


class XBeeTransport(KeptTransport):
    """Carries datagrams to the radios of one XBee network through one port.

    Belongs to one event loop. A port that fails, hangs up or falls silent is opened again until
    ``run`` is cancelled. What the radio may carry at once (NP) is read when it opens.
    """

    carrier = "xbee"

    def __init__(
        self,
        open_port: Callable[[], Awaitable[Port]],
        mode: ApiMode = 1,
        timing: XBeeTiming | None = None,
        rate_kbit_s: Literal[10, 200] | None = None,
    ) -> None:
        """Describe a radio; ``run`` opens it.

        Args:
            open_port: Opens the port to the radio, raising ``OSError`` where it cannot.
            mode: The radio's AP parameter.
            timing: Its time-outs.
            rate_kbit_s: Its rate in the air; None asks the radio.
        """
        self._open_port = open_port
        self._rate_kbit_s = rate_kbit_s
        self._mode: ApiMode = mode
        self._timing = timing or XBeeTiming()
        self._port: Port | None = None
        super().__init__("XBee", self._serve, self._timing.reopen_s)
        self._writing = asyncio.Lock()
        self._window = asyncio.Semaphore(self._timing.window)
        self._sent: dict[int, tuple[asyncio.Future[Delivery], asyncio.TimerHandle]] = {}
        self._asked: dict[int, asyncio.Future[AtReply]] = {}
        self._discovery: _Discovery | None = None
        self._status_timeout_s = self._timing.slow_status_timeout_s
        self._last_id = 0
        self._last_sender: Address | None = None
        self._brought = 0
        """Packets that came."""
        self._rssi_dbm: dict[Address, float] = {}
        self.max_payload = 0
        """The radio's NP parameter; 0 while the port is closed."""
        self.address: Address | None = None
        """The radio's own address; None while the port is closed."""
        self.bytes_per_s = BYTES_PER_S[rate_kbit_s or 200]
        """Telemetry that the network's air may carry."""

    async def send(self, address: Address, data: bytes) -> asyncio.Future[Delivery]:
        """Hand a datagram to the radio; see ``DatagramTransport.send``."""
        fate: asyncio.Future[Delivery] = asyncio.get_running_loop().create_future()
        if self.max_payload and len(data) > self.max_payload:
            detail = f"{len(data)} bytes do not fit the radio's {self.max_payload}"
            fate.set_result(Delivery(Fate.TOO_LARGE, detail=detail))
            return fate
        await self._window.acquire()
        if not self.max_payload:
            self._window.release()
            raise PortClosedError
        frame_id = self._next_id()
        timer = asyncio.get_running_loop().call_later(
            self._status_timeout_s,
            self._settle,
            frame_id,
            Delivery(Fate.UNKNOWN, detail="the radio did not say"),
        )
        self._sent[frame_id] = (fate, timer)
        try:
            await self._write(TransmitRequest(frame_id, address, data))
        except BaseException:
            self._settle(frame_id, Delivery(Fate.UNKNOWN, detail="the port closed"))
            raise
        return fate

    async def _serve(self) -> str:
        """Serve one opening of the port; return why it ended."""
        try:
            self._port = await self.place.open(self._open_port)
        except OSError as error:
            self.is_mute = False
            return str(error)
        try:
            return await first_to_end(
                ("XBee read", self._read(self._port)), ("XBee watch", self._watch())
            )
        finally:
            self._close()

    def _close(self) -> None:
        self.max_payload = 0
        self.address = None
        if self._port is not None:
            self.place.close(self._port)
            self._port = None
        for frame_id in list(self._sent):
            self._settle(frame_id, Delivery(Fate.UNKNOWN, detail="the port closed"))

    async def _read(self, port: Port) -> str:
        reader = FrameReader(self._mode)
        garbled = 0
        next_bytes = asyncio.ensure_future(port.read())
        try:
            while True:
                done, _ = await asyncio.wait((next_bytes,), timeout=self._timing.quiet_s)
                data = next_bytes.result() if done else b""
                if done and not data:
                    return "the port hung up"
                for content in reader.feed(data) if done else reader.flush():
                    self._handle(parse_content(content))
                if reader.bad > garbled:
                    self._keeper.bring(Garbled(reader.bad - garbled, reader.take_dropped()))
                    garbled = reader.bad
                if done:
                    next_bytes = asyncio.ensure_future(port.read())
        except OSError as error:
            return str(error)
        finally:
            await give_back(port, reader.unfinished, next_bytes)

    def _handle(self, frame: Frame | None) -> None:
        match frame:
            case ReceivePacket(address, data):
                self._last_sender = address
                self._brought += 1
                self._keeper.bring(Received(address, data, self._rssi_dbm.get(address)))
            case TransmitStatus(frame_id, retries, status):
                fate = _FATES.get(status, Fate.REFUSED)
                detail = f"status 0x{status:02X} from the radio" if fate is Fate.REFUSED else ""
                self._settle(frame_id, Delivery(fate, retries, detail))
            case AtReply(frame_id) if self._discovery and frame_id == self._discovery.frame_id:
                self._discovery.take(frame)
            case AtReply(frame_id):
                asked = self._asked.get(frame_id)
                if asked is not None and not asked.done():
                    asked.set_result(frame)
            case _:
                pass

    def _settle(self, frame_id: int, delivery: Delivery) -> None:
        entry = self._sent.pop(frame_id, None)
        if entry is None:
            return
        fate, timer = entry
        timer.cancel()
        if not fate.done():
            fate.set_result(delivery)
        self._window.release()

    async def _watch(self) -> str:
        """Learn who the radio is, then ask for its signal strength; return why that ended."""
        try:
            limit = int.from_bytes(await self._ask(b"NP"), "big")
            if not limit:
                return "the radio does not say how many bytes a packet carries (NP)"
            high, low = await self._ask(b"SH"), await self._ask(b"SL")
            self._set_rate(await self._ask(b"BR"))
            self.address = Address(int.from_bytes(high + low.rjust(4, b"\0"), "big"))
            self.max_payload = limit
            self.is_mute = False
            self._keeper.opened()
            while True:
                await asyncio.sleep(self._timing.signal_period_s)
                if self._discovery is None:
                    await self._ask_strength()
        except TimeoutError:
            self.is_mute = True
            return f"no XBee in API mode {self._mode} answers"
        except (OSError, PortClosedError) as error:
            return str(error) or "the port closed"

    def _set_rate(self, answer: bytes) -> None:
        """Take the rate in the air from the URI, or from the radio's BR parameter: 0 is 10 kbit/s.

        A radio that does not say is waited for as if it were slow, and used as if it were fast.
        """
        rate = self._rate_kbit_s
        if rate is None and answer:
            rate = 200 if int.from_bytes(answer, "big") else 10
        timing = self._timing
        self._status_timeout_s = (
            timing.status_timeout_s if rate == 200 else timing.slow_status_timeout_s
        )
        self.bytes_per_s = BYTES_PER_S[rate or 200]

    async def discover(self) -> list[NeighbourRadio]:
        """Ask which other radios are in the network; takes as long as the radio waits for them.

        Raises:
            PortClosedError: If no port is open.
        """
        if not self.max_payload or self._discovery is not None:
            raise PortClosedError("the port is closed, or the radio is already asking")
        self._discovery = discovery = _Discovery(self._next_id())
        options = b""
        try:
            options = await self._ask(b"NO")
            if options:
                await self._ask(b"NO", bytes((options[-1] | REPORT_STRENGTH,)))
            longest_s = await self._discovery_s()
            await self._write(AtCommand(discovery.frame_id, b"ND"))
            with suppress(TimeoutError):
                async with asyncio.timeout(longest_s):
                    await discovery.is_over.wait()
            if options:
                await self._ask(b"NO", options)
        except TimeoutError as error:
            raise PortClosedError("the radio does not answer") from error
        finally:
            self._discovery = None
        return list(discovery.found.values())

    async def _discovery_s(self) -> float:
        """Return how long the radio waits for the others, by N? (ms), else by NT (0.1 s)."""
        if answer := await self._ask(b"N?"):
            wait_s = int.from_bytes(answer, "big") / 1000
        elif answer := await self._ask(b"NT"):
            wait_s = int.from_bytes(answer, "big") / 10
        else:
            wait_s = _LONGEST_DISCOVERY_S
        return min(wait_s, _LONGEST_DISCOVERY_S) + _DISCOVERY_MARGIN_S

    async def _ask_strength(self) -> None:
        """Keep the strength of the last packet; it is the sender's whose packet came last.

        Raises:
            TimeoutError: If the radio answers nothing and brings nothing either: an answer may
                come late, behind many packets that this machine has not read yet.
        """
        brought = self._brought
        try:
            answer = await self._ask(b"DB")
        except TimeoutError:
            if self._brought == brought:
                raise
            return
        if answer and self._last_sender is not None:
            self._rssi_dbm[self._last_sender] = -float(answer[-1])
            self._last_sender = None

    async def _ask(self, command: bytes, value: bytes = b"") -> bytes:
        """Return the value of a parameter, empty where the radio does not know it; or set it.

        Raises:
            TimeoutError: If the radio stays silent.
        """
        for _ in range(_UNANSWERED_QUESTIONS):
            frame_id = self._next_id()
            self._asked[frame_id] = asyncio.get_running_loop().create_future()
            try:
                async with asyncio.timeout(self._timing.question_timeout_s):
                    await self._write(AtCommand(frame_id, command, value))
                    reply = await self._asked[frame_id]
            except TimeoutError:
                continue
            else:
                return reply.value if reply.status == AtStatus.OK else b""
            finally:
                del self._asked[frame_id]
        raise TimeoutError

    async def _write(self, frame: Frame) -> None:
        async with self._writing:
            if self._port is None:
                raise PortClosedError
            try:
                await self._port.write(encode(frame.content(), self._mode))
            except OSError as error:
                raise PortClosedError(str(error)) from error

    def _next_id(self) -> int:
        """Return a frame number of 1..255 that nothing waits for."""
        while True:
            self._last_id = self._last_id % 255 + 1
            taken = self._discovery.frame_id if self._discovery else 0
            if self._last_id not in (taken, *self._sent, *self._asked):
                return self._last_id


class _Discovery:
    """Answers to one ND command, all under its frame number."""

    def __init__(self, frame_id: int) -> None:
        self.frame_id = frame_id
        self.found: dict[Address, NeighbourRadio] = {}
        self.is_over = asyncio.Event()
        """Set by an empty answer, with which some radios say that no more comes."""

    def take(self, reply: AtReply) -> None:
        """Take one answer."""
        if not reply.value:
            self.is_over.set()
        elif (radio := parse_neighbour(reply.value)) is not None:
            self.found[radio.address] = radio


def xbee_radio(uri: LinkUri) -> XBeeTransport:
    """Return the transport of an XBee.

    Raises:
        ValueError: If the URI names none.
    """
    mode: ApiMode = uri.choice("ap", _MODES, default=1)
    rate: Literal[10, 200] | None = uri.choice("rate", _RATES, default=None)
    if uri.host or uri.port is not None:
        opener = partial(TcpPort.open, *uri.host_and_port("TCP"))
    else:
        baud = uri.whole("baud", 115200, 300, 4_000_000)
        opener = partial(SerialPort.open, uri.line(), baud=baud, flow_control=uri.switch("rtscts"))
    uri.finish()
    return XBeeTransport(opener, mode, rate_kbit_s=rate)
