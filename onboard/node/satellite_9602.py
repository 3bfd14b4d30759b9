"""An Iridium 9602 or 9603 modem by AT commands, as a device of the satellite node.

The dialogue of one session: read what the modem already holds, write the record (``+SBDWB``) or
clear the outgoing buffer, run the session (``+SBDIX``, after a ring ``+SBDIXA``), read what came
(``+SBDRB``), clear what was sent. The modem keeps its outgoing buffer after a success, and a new
session overwrites an incoming record that nobody read; both orders above follow from that.
19200 baud, 8N1, no flow control.
"""

import asyncio
import logging
import re
from collections.abc import Awaitable, Callable
from pathlib import Path

from onboard.node.at_dialogue import Block, Dialogue, checksum
from onboard.node.satellite import SessionOutcome
from robot_link.transport.port import Port, SerialPort

_ANSWER_S = 5.0
_SESSION_S = 90.0
_REOPEN_S = 0.5
_ANSWERS_MAX = 256
"""Lines that wait to be looked at; no command is answered with so many."""
_SESSION_LINE = re.compile(r"\+SBDIXA?:\s*" + r"\s*,\s*".join([r"(-?\d+)"] * 6))
_STATUS_LINE = re.compile(r"\+SBDSX:\s*" + r"\s*,\s*".join([r"(-?\d+)"] * 6))
_WRITE_FAULTS = {"1": "it waited too long for the record", "2": "the record arrived damaged"}
_FAULTS = {
    10: "the gateway did not answer in time",
    13: "the session ended too early",
    15: "the gateway denies access",
    16: "the modem is locked",
    17: "the gateway does not answer",
    18: "the connection broke off",
    32: "no satellite in view",
    35: "the modem is busy",
    36: "the network asks to wait three minutes",
}
_SENT_MAX = 4
"""Outgoing statuses up to this one mean success."""

_log = logging.getLogger(__name__)


class ModemError(Exception):
    """The modem answered otherwise than it should; the port is opened again."""


class Driver9602:
    """Owns one modem; belongs to one event loop.

    Args:
        open_port: Opens its line.
    """

    kind = "iridium-9602"
    record_max = 340

    def __init__(self, open_port: Callable[[], Awaitable[Port]]) -> None:
        self._open_port = open_port
        self._port: Port | None = None
        self._answers: asyncio.Queue[str | bytes | Block] = asyncio.Queue(_ANSWERS_MAX)
        self._dialogue = Dialogue()
        self._held: bytes | None = None
        self._imei = ""
        self._failed = asyncio.Event()
        self._one = asyncio.Lock()

    @classmethod
    def at(cls, line: Path) -> "Driver9602":
        """Return the modem on a serial line or pseudo-terminal."""
        return cls(lambda: SerialPort.open(str(line), baud=19200, flow_control=False))

    @property
    def name(self) -> str:
        """Its IMEI; empty until the modem said it."""
        return self._imei

    async def run(self, on_ring: Callable[[], None]) -> None:
        """Open the line, serve and open it again until cancelled."""
        told = ""
        while True:
            reason = await self._serve(on_ring)
            if reason != told:
                _log.warning("9602 modem: %s", reason)
                told = reason
            await asyncio.sleep(_REOPEN_S)

    async def session(self, record: bytes | None, *, for_ring: bool) -> SessionOutcome:
        """Exchange records; a modem that is not there gives an outcome that says so."""
        if self._port is None:
            return SessionOutcome(False, None, 0, "there is no modem at the line")
        try:
            async with self._one:
                return await self._session(self._port, record, for_ring=for_ring)
        except asyncio.CancelledError:
            # Half a dialogue would spoil the next one; opened again, the modem is asked what it
            # holds, so that nothing that came is lost.
            self._failed.set()
            raise
        except (OSError, ModemError, TimeoutError) as error:
            self._failed.set()
            return SessionOutcome(False, None, 0, f"the modem failed: {error or 'no answer'}")

    async def signal(self) -> int:
        """Return the signal's strength in bars; 0 where there is no modem."""
        if self._port is None:
            return 0
        try:
            async with self._one:
                said = await self._command(self._port, "AT+CSQ")
        except (OSError, ModemError, TimeoutError):
            self._failed.set()
            return 0
        bars = next((line for line in said if line.startswith("+CSQ:")), "+CSQ:0")
        return int(bars.removeprefix("+CSQ:"))

    async def _serve(self, on_ring: Callable[[], None]) -> str:
        """Serve one opening of the line; return why it ended."""
        try:
            port = await self._open_port()
        except OSError as error:
            return str(error)
        self._dialogue.forget()
        self._answers = asyncio.Queue(_ANSWERS_MAX)
        self._failed.clear()
        reading = asyncio.create_task(self._read(port, on_ring), name="9602 read")
        failing = asyncio.create_task(self._failed.wait(), name="9602 failure")
        try:
            await self._set_up(port)
            self._port = port
            await asyncio.wait((reading, failing), return_when=asyncio.FIRST_COMPLETED)
            return reading.result() if reading.done() else "the modem failed"
        except (OSError, ModemError, TimeoutError) as error:
            return f"the modem does not answer as a 9602 does: {error or 'silence'}"
        finally:
            self._port = None
            for task in (reading, failing):
                task.cancel()
            await asyncio.gather(reading, failing, return_exceptions=True)
            port.close()

    async def _set_up(self, port: Port) -> None:
        for command in ("ATE0", "AT&K0", "AT+SBDMTA=1"):
            await self._command(port, command)
        said = await self._command(port, "AT+CGSN")
        self._imei = next((line for line in said if line.isdecimal()), "")
        await self._command(port, "AT+SBDD0")
        status = _match(_STATUS_LINE, await self._command(port, "AT+SBDSX"))
        if status[2]:
            self._held = await self._read_record(port)

    async def _read(self, port: Port, on_ring: Callable[[], None]) -> str:
        heard = self._dialogue.rings
        try:
            while data := await port.read():
                for part in self._dialogue.feed(data):
                    if self._answers.full():
                        return "it sends what nobody asked for"
                    self._answers.put_nowait(part)
                while heard < self._dialogue.rings:
                    heard += 1
                    on_ring()
        except OSError as error:
            return str(error)
        return "the line hung up"

    async def _session(self, port: Port, record: bytes | None, *, for_ring: bool) -> SessionOutcome:
        if self._held is not None:
            held, self._held = self._held, None
            return SessionOutcome(record is None, held, 0, "a record was still in the modem")
        if record is None:
            await self._command(port, "AT+SBDD0")
        else:
            await self._write_record(port, record)
        command = "AT+SBDIXA" if for_ring else "AT+SBDIX"
        said = await self._command(port, command, _SESSION_S)
        mo, momsn, mt, mtmsn, _, queued = _match(_SESSION_LINE, said)
        received = await self._read_record(port) if mt == 1 else None
        is_sent = 0 <= mo <= _SENT_MAX
        if is_sent:
            await self._command(port, "AT+SBDD0")
        fault = _FAULTS.get(mo, f"session status {mo}")
        return SessionOutcome(
            is_sent,
            received,
            max(queued, 0),
            "" if is_sent else fault,
            momsn if is_sent and record is not None else None,
            mtmsn if received is not None else None,
        )

    async def _write_record(self, port: Port, record: bytes) -> None:
        await self._say(port, f"AT+SBDWB={len(record)}")
        ready = await self._answer(_ANSWER_S)
        if ready != "READY":
            raise ModemError(f"{ready!r} instead of READY")
        await port.write(record + checksum(record))
        result = await self._answer(_ANSWER_S)
        await self._until_ok(_ANSWER_S)
        if result != "0":
            raise ModemError(_WRITE_FAULTS.get(str(result), f"+SBDWB answered {result!r}"))

    async def _read_record(self, port: Port) -> bytes:
        """Read and clear the incoming record."""
        self._forget_answers()
        self._dialogue.expect_block()
        await port.write(b"AT+SBDRB\r")
        block = await self._answer(_ANSWER_S)
        if not isinstance(block, bytes):
            raise ModemError("the incoming record is damaged")
        await self._until_ok(_ANSWER_S)
        await self._command(port, "AT+SBDD1")
        return block

    async def _command(self, port: Port, command: str, limit_s: float = _ANSWER_S) -> list[str]:
        """Give a command; return the lines before OK."""
        await self._say(port, command)
        return await self._until_ok(limit_s)

    async def _say(self, port: Port, command: str) -> None:
        self._forget_answers()
        await port.write(f"{command}\r".encode("ascii"))

    def _forget_answers(self) -> None:
        while not self._answers.empty():
            self._answers.get_nowait()

    async def _until_ok(self, limit_s: float) -> list[str]:
        lines: list[str] = []
        while (line := await self._answer(limit_s)) != "OK":
            if not isinstance(line, str) or line == "ERROR":
                raise ModemError(f"{line!r} instead of OK")
            lines.append(line)
        return lines

    async def _answer(self, limit_s: float) -> str | bytes | Block:
        async with asyncio.timeout(limit_s):
            return await self._answers.get()


def _match(pattern: re.Pattern[str], lines: list[str]) -> tuple[int, ...]:
    for line in lines:
        found = pattern.search(line)
        if found:
            return tuple(int(number) for number in found.groups())
    raise ModemError(f"{lines} instead of a status")
