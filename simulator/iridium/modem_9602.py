"""A 9602 satellite modem on a pseudo-terminal: AT commands on one side, the network on the other.

19200 baud, 8N1. A command ends with CR; an answer is ``CR LF text CR LF`` and ends with ``OK`` or
``ERROR``; binary data have their own length and sum and no line ends::

    AT+SBDWB=5  ->  READY, then "hello" 02 14 from the host, then 0, OK
    AT+SBDRB    ->  00 05 "hello" 02 14, OK

Source: Iridium 9602 SBD Transceiver AT commands; the modem of a RockBLOCK.
"""

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path

from simulator.background import alongside
from simulator.iridium.network import MAX_MOBILE_ORIGINATED, IridiumNetwork
from simulator.iridium.session import Place, SessionResult
from simulator.pseudo_terminal import pseudo_terminal

_WRITTEN, _TIMED_OUT, _BAD_SUM, _BAD_SIZE = 0, 1, 2, 3
_SIZE_DIGITS = 3
_MAX_TEXT = 120
_LINE_BYTES = 4096
"""A host that sends more without an end of line is not speaking AT."""
_BACKLOG_BYTES = 65536
_EPOCH = datetime(2014, 5, 11, 14, 23, 55, tzinfo=UTC)
"""Beginning of the network's own time, which counts frames of 90 ms."""
_FRAME_S = 0.09

_INFORMATION = {
    "+CGMI": "Iridium",
    "+GMI": "Iridium",
    "+CGMM": "IRIDIUM 9600 Family SBD Transceiver",
    "+GMM": "IRIDIUM 9600 Family SBD Transceiver",
    "+CGMR": "Call Processor Version: TA19002",
    "+GMR": "Call Processor Version: TA19002",
    "+SBDGW": "+SBDGW: non-EMSS",
}
_ACCEPTED = ("", "&K0", "&K3", "&D0", "&D2", "&W0", "&Y0", "V1", "Q0", "+SBDDET")


class Modem9602:
    """One modem; belongs to one event loop, and to one pseudo-terminal at a time.

    The outbound message stays in its buffer after it was sent, and is sent again by the next
    session unless the host clears it. The inbound buffer is cleared by each session: a message
    that nobody has read by then is gone.

    Args:
        imei: Its number; the network must know it.
        network: The network.
        place: Tells where the modem is.
        write_timeout_s: How long it waits for the bytes of a message, by the wall's clock.
    """

    def __init__(
        self,
        imei: str,
        network: IridiumNetwork,
        place: Callable[[], Place | None] = lambda: None,
        *,
        write_timeout_s: float = 60.0,
    ) -> None:
        self._imei = imei
        self._network = network
        self._place = place
        self._write_timeout_s = write_timeout_s
        self._inlet = _Inlet()
        self._write: Callable[[bytes], None] = _nowhere
        self._outbound = b""
        self._inbound: bytes | None = None
        self._inbound_mtmsn = -1
        self._momsn = 0
        self._waiting = 0
        self._reset()

    @asynccontextmanager
    async def pty(self, link: Path) -> AsyncGenerator[None]:
        """Put the modem on a pseudo-terminal, reached through the symbolic link."""
        self._inlet = _Inlet()
        async with pseudo_terminal(link, self._inlet.feed) as write:
            self._write = write
            stop_ringing = self._network.on_ring(self._imei, self._take_ring)
            try:
                async with alongside(self._serve(), f"modem {self._imei}"):
                    yield
            finally:
                stop_ringing()
                self._write = _nowhere

    # ---- the dialogue --------------------------------------------------------------------------

    async def _serve(self) -> None:
        while True:
            line = await self._inlet.line()
            if self._echoes:
                self._write(line + b"\r")
            self._is_busy = True
            try:
                await self._obey(line.strip().decode("latin-1"))
            finally:
                self._is_busy = False
            if self._has_ring_to_tell:
                self._tell_ring()

    async def _obey(self, line: str) -> None:
        """Carry one command out."""
        name, _, argument = line[2:].partition("=")
        if line[:2].upper() != "AT":
            if line:
                self._say("ERROR")
            return
        match name.upper():
            case "+SBDWB":
                await self._take_binary(argument)
            case "+SBDWT":
                await self._take_text(argument)
            case "+SBDRB":
                data = self._inbound or b""
                self._write(len(data).to_bytes(2, "big") + data + _sum(data))
                self._say("OK")
            case "+SBDRT":
                self._write(b"\r\n+SBDRT:\r\n" + (self._inbound or b""))
                self._say("OK")
            case "+SBDIX" | "+SBDIXA":
                await self._session()
            case _:
                self._answer(name.upper(), argument)

    def _answer(self, name: str, argument: str) -> None:
        """Carry out a command that takes no time."""
        match name:
            case "+SBDSX":
                self._say(f"+SBDSX: {', '.join(str(n) for n in self._status())}", "OK")
            case "+SBDD0" | "+SBDD1" | "+SBDD2":
                self._clear(outbound=name[-1] in "02", inbound=name[-1] in "12")
                self._say("0", "OK")
            case "+SBDTC":
                self._inbound, self._inbound_mtmsn = self._outbound, 0
                size = len(self._outbound)
                self._say(f"SBDTC: Outbound SBD copied to Inbound SBD: size = {size}", "OK")
            case "+CSQ" | "+CSQF":
                self._say(f"+CSQ:{self._network.signal(self._imei)}", "OK")
            case "+CGSN" | "+GSN":
                self._say(self._imei, "OK")
            case "+SBDMTA" if argument in ("0", "1"):
                self._rings = argument == "1"
                self._say("OK")
            case "+SBDMTA?":
                self._say(f"+SBDMTA:{int(self._rings)}", "OK")
            case "+SBDREG" | "+SBDREG?":
                self._say(f"+SBDREG:{2 if self._network.has_signal(self._imei) else 1},0", "OK")
            case "+CRISX":
                self._say(f"+CRISX:0,{int(self._has_ring)},{self._frame():08x}", "OK")
            case "-MSSTM":
                is_known = self._network.has_signal(self._imei)
                time = f"{self._frame():08x}" if is_known else "no network service"
                self._say(f"-MSSTM: {time}", "OK")
            case _:
                self._set(name)

    def _set(self, name: str) -> None:
        """Carry out a command that changes how the modem speaks, or says what it is."""
        if name in ("Z", "Z0", "&F", "&F0"):
            self._reset()
        elif name in ("E", "E0", "E1"):
            self._echoes = name == "E1"
        elif name in _INFORMATION:
            self._say(_INFORMATION[name])
        elif name not in _ACCEPTED:
            self._say("ERROR")
            return
        self._say("OK")

    async def _take_binary(self, argument: str) -> None:
        """Take a message of a known size and its sum."""
        is_number = argument.isascii() and argument.isdecimal() and len(argument) <= _SIZE_DIGITS
        size = int(argument) if is_number else 0
        if not 1 <= size <= MAX_MOBILE_ORIGINATED:
            self._say(str(_BAD_SIZE), "OK")
            return
        self._say("READY")
        try:
            async with asyncio.timeout(self._write_timeout_s):
                received = await self._inlet.exactly(size + 2)
        except TimeoutError:
            self._inlet.clear()
            self._say(str(_TIMED_OUT), "OK")
            return
        data, tail = received[:size], received[size:]
        if tail != _sum(data):
            self._say(str(_BAD_SUM), "OK")
            return
        self._outbound = data
        self._say(str(_WRITTEN), "OK")

    async def _take_text(self, text: str) -> None:
        """Take a message as text, in the command itself or on the next line."""
        if not text:
            self._say("READY")
            try:
                async with asyncio.timeout(self._write_timeout_s):
                    text = (await self._inlet.line()).decode("latin-1")
            except TimeoutError:
                self._inlet.clear()
                self._say(str(_TIMED_OUT), "OK")
                return
        if len(text) > _MAX_TEXT:
            self._say("ERROR")
            return
        self._outbound = text.encode("latin-1")
        self._say("OK")

    async def _session(self) -> None:
        """Send what the outbound buffer holds and fetch one message."""
        self._clear(outbound=False, inbound=True)
        self._has_ring = self._has_ring_to_tell = False
        result = await self._network.session(self._imei, self._outbound or None, self._place())
        if result.mt_data is not None:
            self._inbound, self._inbound_mtmsn = result.mt_data, result.mtmsn
        self._momsn = result.momsn
        if result.is_ok:
            self._momsn = (result.momsn + 1) % 65536
            self._waiting = result.queued
        self._say(f"+SBDIX: {', '.join(str(number) for number in _numbers(result))}", "OK")

    # ---- within --------------------------------------------------------------------------------

    def _reset(self) -> None:
        """Go back to the manufacturer's settings; the messages stay."""
        self._echoes = True
        self._rings = True
        self._is_busy = False
        self._has_ring = False
        self._has_ring_to_tell = False

    def _clear(self, *, outbound: bool, inbound: bool) -> None:
        if outbound:
            self._outbound = b""
        if inbound:
            self._inbound, self._inbound_mtmsn = None, -1

    def _status(self) -> tuple[int, ...]:
        """Return the numbers of +SBDSX."""
        return (
            int(bool(self._outbound)),
            self._momsn,
            int(self._inbound is not None),
            self._inbound_mtmsn,
            int(self._has_ring),
            self._waiting,
        )

    def _take_ring(self) -> None:
        if not self._rings:
            return
        self._has_ring = True
        if self._is_busy:
            self._has_ring_to_tell = True
        else:
            self._tell_ring()

    def _tell_ring(self) -> None:
        self._has_ring_to_tell = False
        self._say("SBDRING")

    def _frame(self) -> int:
        elapsed_s = (self._network.clock.now() - _EPOCH).total_seconds()
        return int(elapsed_s / _FRAME_S) % 2**32

    def _say(self, *lines: str) -> None:
        self._write(b"".join(b"\r\n" + line.encode("ascii") + b"\r\n" for line in lines))


class _Inlet:
    """What the host has written and the modem has not yet taken."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._arrived = asyncio.Event()

    def feed(self, data: bytes) -> None:
        """Take bytes from the host; more than the modem can hold is lost."""
        self._bytes += data[: max(0, _BACKLOG_BYTES - len(self._bytes))]
        self._arrived.set()

    def clear(self) -> None:
        """Forget what was written so far."""
        self._bytes.clear()

    async def line(self) -> bytes:
        """Return the next line without its end."""
        while (end := self._bytes.find(b"\r")) < 0:
            if len(self._bytes) > _LINE_BYTES:
                self._bytes.clear()
            await self._more()
        line = bytes(self._bytes[:end])
        del self._bytes[: end + 1]
        return line

    async def exactly(self, size: int) -> bytes:
        """Return so many bytes."""
        while len(self._bytes) < size:
            await self._more()
        data = bytes(self._bytes[:size])
        del self._bytes[:size]
        return data

    async def _more(self) -> None:
        self._arrived.clear()
        await self._arrived.wait()


def _numbers(result: SessionResult) -> tuple[int, ...]:
    size = len(result.mt_data or b"")
    return (
        int(result.mo_status),
        result.momsn,
        int(result.mt_status),
        result.mtmsn,
        size,
        result.queued,
    )


def _sum(data: bytes) -> bytes:
    return (sum(data) & 0xFFFF).to_bytes(2, "big")


def _nowhere(_data: bytes) -> None:
    """Where a modem without a line writes."""
