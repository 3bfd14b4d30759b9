"""The station's end of the process that hands messages to services."""

import asyncio
import contextlib
import itertools
import json
import logging
import sys
from dataclasses import asdict, dataclass
from typing import Any, Final

from robot_link.child_process import kill_child
from robot_link.clock import monotonic_s

log = logging.getLogger(__name__)

_MODULE: Final = "server.notice.sender_process"
"""Run, never imported: apprise is large, and changes what it stands on."""
PATIENCE_S: Final = 15.0
"""For the whole of one message; a service that drips bytes would never run into the socket's."""
STUCK_MAX: Final = 16
"""Threads that services may hold for ever before the process is replaced."""
LINE_BYTES_MAX: Final = 1 << 20


@dataclass(frozen=True, slots=True)
class Message:
    """What is handed to a service."""

    url: str
    """In apprise's form; a secret."""
    title: str
    text: str
    level: str


@dataclass(frozen=True, slots=True)
class Reply:
    """What came of it. That a service took a message is no proof that anybody read it."""

    is_handed: bool
    is_refusal: bool
    """Whether the service says that it will not take this, rather than not now."""
    is_doubtful: bool
    """Whether the service may have taken it although it did not say so."""
    text: str
    """The service's own words, or why there are none."""
    took_s: float


class _Process:
    """One running process and the messages that it has in hand."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process
        self.waiting: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self.stuck = 0
        self.is_open = True
        self.reader = asyncio.create_task(self._read(), name="notice sender")

    @property
    def is_alive(self) -> bool:
        return self.is_open and self.process.returncode is None

    @classmethod
    async def start(cls) -> "_Process":
        """Start one and wait until it listens.

        Raises:
            ConnectionError: If it ends instead.
        """
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            _MODULE,
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
            limit=LINE_BYTES_MAX,
        )
        does_listen = False
        try:
            does_listen = process.stdout is not None and bool(await process.stdout.readline())
        finally:
            if not does_listen:
                await kill_child(process)
        if not does_listen:
            raise ConnectionError("the sending process did not start")
        return cls(process)

    async def _read(self) -> None:
        stdout = self.process.stdout
        while stdout is not None and (line := await stdout.readline()):
            answer = json.loads(line)
            waiting = self.waiting.pop(answer["number"], None)
            if waiting is not None and not waiting.done():
                waiting.set_result(answer)
        self.is_open = False
        for left in self.waiting.values():
            if not left.done():
                left.set_exception(ConnectionError("the sending process ended"))
        await self.process.wait()

    async def kill(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        await self.reader


class Sender:
    """Hands messages to services, any number at once, each within ``patience_s``.

    Belongs to one event loop. A process that dies takes nothing with it: what it had in hand counts
    as not handed over, and the next message starts a new one.
    """

    def __init__(self, patience_s: float = PATIENCE_S) -> None:
        self._patience_s = patience_s
        self._numbers = itertools.count()
        self._process: _Process | None = None
        self._retired: list[_Process] = []
        self._starting = asyncio.Lock()

    async def warm_up(self) -> None:
        """Start the process, which takes a second, before a message is in a hurry."""
        await self._ready()

    async def send(self, message: Message) -> Reply:
        """Hand over one message and return what came of it; never raises for a service's fault."""
        begun_s, is_given = monotonic_s(), False
        try:
            process = await self._ready()
            is_given = True
            async with asyncio.timeout(self._patience_s):
                return await self._ask(process, message)
        except TimeoutError:
            reason = f"No whole answer within {self._patience_s:.0f} s."
        except (ConnectionError, OSError) as error:
            log.warning("the sending process failed: %s", type(error).__name__)
            reason = "The station's own sending process ended; it is started anew."
        return Reply(
            is_handed=False,
            is_refusal=False,
            is_doubtful=is_given,
            text=reason,
            took_s=monotonic_s() - begun_s,
        )

    async def stop(self) -> None:
        """End the process; what it has in hand counts as not handed over."""
        processes = [*self._retired, *([self._process] if self._process else [])]
        self._retired, self._process = [], None
        await asyncio.gather(*(process.kill() for process in processes))

    async def _ask(self, process: _Process, message: Message) -> Reply:
        stdin, number = process.process.stdin, next(self._numbers)
        if stdin is None:
            raise ConnectionError
        answered = process.waiting[number] = asyncio.get_running_loop().create_future()
        request = {"number": number, **asdict(message)}
        try:
            stdin.write(json.dumps(request).encode() + b"\n")
            await stdin.drain()
            answer = await answered
        finally:
            if process.waiting.pop(number, None) is not None:
                process.stuck += 1
        return Reply(
            is_handed=answer["is_handed"],
            is_refusal=answer["is_refusal"],
            is_doubtful=answer["is_doubtful"],
            text=answer["reply"],
            took_s=answer["took_s"],
        )

    async def _ready(self) -> _Process:
        async with self._starting:
            process = self._process
            if process is not None and process.is_alive and process.stuck < STUCK_MAX:
                return process
            if process is not None:
                self._retired.append(process)
            for old in [one for one in self._retired if not one.waiting]:
                self._retired.remove(old)
                await old.kill()
            self._process = await _Process.start()
            return self._process
