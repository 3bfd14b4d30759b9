"""The line to a WHOI Micro-Modem: opened, configured, asked whether it lives, and opened again.

19200 baud, 8 data bits, no parity, one stop bit; NMEA 0183 sentences with checksums both ways
(``robot_link.acoustic.nmea``, ``robot_link.acoustic.sentence``). When the port opens, and when
the modem says that it has restarted, it is told its address (SRC), what to report (REV, RXP,
CST) and the time. A command that is not echoed is sent again; a modem that echoes none is taken
for gone, and its port is opened anew.
"""

import asyncio
import contextlib
from collections.abc import AsyncGenerator, Awaitable, Callable
from dataclasses import dataclass
from typing import Any, Final

from robot_link.acoustic import sentence
from robot_link.acoustic.nmea import SentenceReader, encode
from robot_link.acoustic.sentence import Fields, Heard, ModemError, ModemStarted
from robot_link.clock import Clock
from robot_link.transport.datagram import Garbled, PortClosedError
from robot_link.transport.keeper import KeptTransport, first_to_end
from robot_link.transport.port import Port

_REPORTS: Final = (("REV", 1), ("RXP", 1), ("CST", 1))
_GARBLED_BYTES_MAX: Final = 1024
_CLOCK_AFTER_SECOND_S: Final = 0.075
"""The modem takes the time 50 to 100 ms after a full second."""


class ModemRefusedError(Exception):
    """The modem did not do what it was told; the text says why."""


class ModemSilentError(ModemRefusedError):
    """The modem does not even echo what it is told."""


@dataclass(frozen=True, slots=True)
class ModemTiming:
    """Wall seconds and counts of one modem."""

    echo_s: float = 2.0
    """Longest wait for the echo of a command."""
    tries: int = 3
    """How often a command is sent before the modem counts as gone."""
    check_s: float = 30.0
    """Time between two questions for the modem's address, which prove that it lives."""
    reopen_s: float = 0.5
    """Time between two attempts to open the port."""
    spare_s: float = 1.0
    """What an answer may be late beside the travel of its sound."""
    quiet_s: float = 1.0
    """What it may be later still, after it was given up; so long nobody is asked again."""


class ModemLine(KeptTransport):
    """Gives commands to one modem and hands on what it hears. Belongs to one event loop.

    Args:
        open_port: Opens the modem's port.
        us: The modem's own address, 0..15.
        clock: What the modem's clock is set to.
        timing: Time-outs on the line.
        hear: Takes what the modem says, but for echoes.
        closed: Told whenever the port has closed.
    """

    def __init__(
        self,
        open_port: Callable[[], Awaitable[Port]],
        us: int,
        clock: Clock,
        timing: ModemTiming,
        hear: Callable[[Heard], None],
        closed: Callable[[], None],
    ) -> None:
        super().__init__("Micro-Modem", self._serve, timing.reopen_s)
        self._open_port = open_port
        self._us = us
        self._clock = clock
        self._timing = timing
        self._pass_on = hear
        self._closed = closed
        self._port: Port | None = None
        self._commanding = asyncio.Lock()
        self._command: Fields | None = None
        self._echo: asyncio.Future[Fields] | None = None
        self._woken = asyncio.Event()
        self._has_restarted = False
        self._is_silent = False
        self.is_ready = False
        """Whether the modem is there and knows its settings."""

    async def tell(self, fields: Fields, echoed_as: Fields | None = None) -> Fields:
        """Give one command, again where the modem does not echo it; return the echo.

        Args:
            fields: The command.
            echoed_as: What its echo repeats, where that is not the command itself.

        Raises:
            ModemRefusedError: If the modem refuses the command.
            ModemSilentError: If it does not echo it.
            PortClosedError: If no port is open.
        """
        refusal = ModemRefusedError("the modem refused")
        async with self._commanding:
            for _ in range(self._timing.tries):
                if self._port is None:
                    raise PortClosedError("the port closed")
                try:
                    async with self._echo_of(echoed_as or fields) as echo:
                        await self._port.write(encode(fields))
                        async with asyncio.timeout(self._timing.echo_s):
                            return await echo
                except TimeoutError:
                    refusal = ModemSilentError("no Micro-Modem answers")
                except ModemRefusedError as error:
                    refusal = error
                except OSError as error:
                    raise PortClosedError(str(error)) from error
        if isinstance(refusal, ModemSilentError):
            self._is_silent = True
            self._woken.set()
        raise refusal

    async def _serve(self) -> str:
        """Serve one opening of the port; return why it ended."""
        try:
            self._port = await self._open_port()
        except OSError as error:
            self.is_mute = False
            return str(error)
        self._is_silent = self._has_restarted = False
        try:
            return await first_to_end(
                ("Micro-Modem read", self._read(self._port)),
                ("Micro-Modem watch", self._watch()),
            )
        finally:
            self._close()

    def _close(self) -> None:
        self.is_ready = False
        if self._port is not None:
            self._port.close()
            self._port = None
        if self._echo is not None and not self._echo.done():
            self._echo.set_exception(PortClosedError("the port closed"))
        self._closed()

    async def _read(self, port: Port) -> str:
        """Take what the modem says; return why that ended."""
        reader = SentenceReader()
        try:
            while data := await port.read():
                sentences, bad = reader.feed(data)
                for fields in sentences:
                    self._hear(fields)
                if bad:
                    self._keeper.bring(Garbled(len(bad), b"\n".join(bad)[:_GARBLED_BYTES_MAX]))
        except OSError as error:
            return str(error)
        return "the modem hung up"

    def _hear(self, fields: Fields) -> None:
        is_waiting = self._echo is not None and not self._echo.done()
        if self._command is not None and sentence.is_echo(self._command, fields):
            if self._echo is not None and is_waiting:
                self._echo.set_result(fields)
            return
        try:
            heard = sentence.meaning(fields)
        except ValueError:
            self._keeper.bring(Garbled(1, ",".join(fields).encode()[:_GARBLED_BYTES_MAX]))
            return
        if isinstance(heard, ModemStarted):
            self._has_restarted = True
            self.is_ready = False
            self._woken.set()
        if isinstance(heard, ModemError) and self._echo is not None and is_waiting:
            self._echo.set_exception(refused(heard))
        elif heard is not None:
            self._pass_on(heard)

    async def _watch(self) -> str:
        """Configure the modem, again when it restarts, and ask whether it lives; return why not."""
        try:
            await self._configure()
            self.is_mute = False
            self._keeper.opened()
            while not self._is_silent:
                await self._set_clock()
                await self._until_restart()
                if not self._is_silent:
                    await self._configure()
        except ModemSilentError as error:
            self.is_mute = True
            return str(error)
        except (ModemRefusedError, PortClosedError) as error:
            return str(error)
        self.is_mute = True
        return "no Micro-Modem answers"

    async def _configure(self) -> None:
        self._has_restarted = False
        await self.tell(sentence.setting("SRC", self._us))
        for name, value in _REPORTS:
            await self._tell_if_known(sentence.setting(name, value))
        self.is_ready = True

    async def _until_restart(self) -> None:
        """Wait until the modem has restarted; it is asked, for its word of it may be missed.

        Raises:
            ModemSilentError: If it is gone.
        """
        expected = sentence.setting("SRC", self._us)
        while not self._has_restarted and not self._is_silent:
            self._woken.clear()
            try:
                async with asyncio.timeout(self._timing.check_s):
                    await self._woken.wait()
            except TimeoutError:
                told = await self.tell(sentence.question("SRC"), echoed_as=expected[:2])
                self._has_restarted = not sentence.is_echo(expected, told)

    async def _set_clock(self) -> None:
        """Set the modem's clock just after a full second."""
        into_s = self._clock.now().microsecond / 1e6
        await asyncio.sleep(((1.0 + _CLOCK_AFTER_SECOND_S - into_s) % 1.0) / self._clock.speed)
        await self._tell_if_known(sentence.clock(self._clock.now()))

    async def _tell_if_known(self, fields: Fields) -> None:
        """Give a command that older modems refuse, and which they work without."""
        try:
            await self.tell(fields)
        except ModemSilentError:
            raise
        except ModemRefusedError:
            pass

    @contextlib.asynccontextmanager
    async def _echo_of(self, fields: Fields) -> AsyncGenerator[asyncio.Future[Fields]]:
        self._command = fields
        self._echo = asyncio.get_running_loop().create_future()
        try:
            yield self._echo
        finally:
            forget(self._echo)
            self._command = self._echo = None


def refused(error: ModemError) -> ModemRefusedError:
    """Return the error that the modem's own complaint is to whoever gave the command."""
    return ModemRefusedError(f"the modem refused: {error.text or 'it does not say why'}")


def forget(future: "asyncio.Future[Any]") -> None:
    """Let a future go, whatever may have become of it."""
    future.cancel()
    if not future.cancelled():
        future.exception()
