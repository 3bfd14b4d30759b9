"""Starts child processes, starts one again that dies, and leaves none behind."""

import asyncio
import contextlib
import signal
import time
from asyncio.subprocess import DEVNULL, Process
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import httpx

SLOW_S = 60.0
"""After this a child that is not ready is told to be slow: the machine may be busy."""
READY_LIMIT_S = 600.0
HEALTH_TIMEOUT_S = 10.0
HEALTH_PERIOD_S = 0.1
AWAIT_LIMIT_S = 20.0
AWAIT_PERIOD_S = 0.05
STOP_LIMIT_S = 10.0
QUICK_DEATH_S = 5.0
QUICK_DEATHS_MAX = 3
TAIL_LINES = 15
LOOK_S = 1.0
"""Between two looks at the sources of a child that starts again when one changes."""


@dataclass(frozen=True, slots=True)
class Child:
    """One process to keep alive."""

    name: str
    command: Sequence[str]
    pass_fds: tuple[int, ...] = ()
    health_url: str | None = None
    """Where it says that it is ready; a child without one is ready when it runs."""
    folder: Path | None = None
    """Where it runs; where this process runs by default."""
    awaits: Sequence[Path] = ()
    """What an earlier child makes and this one opens; it starts once that is there."""
    sources: Sequence[Path] = ()
    """Folders whose Python files it is made of, if it is to start again when one changes."""


class Supervisor:
    """Keeps children alive until SIGINT or SIGTERM, then ends them all.

    What they print goes to one file each. Children run in sessions of their own, so that Ctrl-C
    on a terminal reaches them through here, the last one first.
    """

    def __init__(
        self, children: Sequence[Child], log_folder: Path, on_ready: Callable[[], None]
    ) -> None:
        self._children = children
        self._log_folder = log_folder
        self._on_ready = on_ready
        self._stop = asyncio.Event()
        self._status = 0

    async def run(self) -> int:
        """Return the exit status: 0 when told to stop, 1 when a child cannot be kept alive."""
        self._log_folder.mkdir(exist_ok=True)
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, self._stop.set)
        keepers: list[asyncio.Task[None]] = []
        for number, child in enumerate(self._children, start=1):
            keeper = self._keep(child, lambda number=number: keepers[number:])
            keepers.append(asyncio.create_task(keeper, name=f"keeper of the {child.name}"))
        announcer = asyncio.create_task(self._announce(), name="announcer")
        await self._stop.wait()
        announcer.cancel()
        await asyncio.gather(announcer, return_exceptions=True)
        await asyncio.gather(*keepers)
        return self._status

    def _log(self, child: Child) -> Path:
        return self._log_folder / f"{child.name}.log"

    async def _keep(self, child: Child, later: Callable[[], Sequence[asyncio.Task[None]]]) -> None:
        """Start a child, and start it again when it dies, until told to stop.

        It is ended after the ``later`` ones, which may use it.
        """
        quick_deaths = 0
        while not self._stop.is_set():
            await self._awaited(child)
            started_s = time.monotonic()
            process = await self._start(child)
            stop = asyncio.create_task(self._stop.wait(), name=f"stop of the {child.name}")
            end = asyncio.create_task(process.wait(), name=f"end of the {child.name}")
            change = asyncio.create_task(_changed(child.sources), name=f"sources of {child.name}")
            await asyncio.wait((stop, end, change), return_when=asyncio.FIRST_COMPLETED)
            is_changed = change.done() and not end.done() and not self._stop.is_set()
            stop.cancel()
            change.cancel()
            if not end.done():
                if not is_changed:
                    await asyncio.gather(*later())
                await _end(process)
            await end
            if self._stop.is_set():
                return
            if is_changed:
                print(f"A source changed; starting the {child.name} again.", flush=True)
                continue
            quick = time.monotonic() - started_s < QUICK_DEATH_S
            quick_deaths = quick_deaths + 1 if quick else 0
            if quick_deaths == QUICK_DEATHS_MAX:
                self._give_up(f"The {child.name} ends again and again", child)
                return
            print(f"The {child.name} ended unexpectedly; starting it again.", flush=True)

    async def _awaited(self, child: Child) -> None:
        """Wait for what a child awaits; one that waits too long starts without it."""
        deadline_s = time.monotonic() + AWAIT_LIMIT_S
        while not all(path.exists() for path in child.awaits):
            if self._stop.is_set() or time.monotonic() > deadline_s:
                return
            await asyncio.sleep(AWAIT_PERIOD_S)

    async def _start(self, child: Child) -> Process:
        with self._log(child).open("ab") as log:
            return await asyncio.create_subprocess_exec(
                *child.command,
                stdin=DEVNULL,
                stdout=log,
                stderr=log,
                cwd=child.folder,
                pass_fds=child.pass_fds,
                start_new_session=True,
            )

    async def _announce(self) -> None:
        began_s = time.monotonic()
        async with httpx.AsyncClient(timeout=HEALTH_TIMEOUT_S, trust_env=False) as client:
            for child in self._children:
                url = child.health_url
                if url is None or await _is_healthy(client, url, began_s + SLOW_S):
                    continue
                print(
                    f"The {child.name} takes longer than {SLOW_S:.0f} s to start; still waiting.",
                    flush=True,
                )
                if not await _is_healthy(client, url, began_s + READY_LIMIT_S):
                    self._give_up(f"The {child.name} was not ready in {READY_LIMIT_S:.0f} s", child)
                    return
        self._on_ready()

    def _give_up(self, sentence: str, child: Child) -> None:
        path = self._log(child)
        tail = path.read_text(errors="replace").splitlines()[-TAIL_LINES:]
        print(f"{sentence}. The end of {path}:", *tail, sep="\n  ", flush=True)
        self._status = 1
        self._stop.set()


async def _is_healthy(client: httpx.AsyncClient, url: str, deadline_s: float) -> bool:
    while time.monotonic() < deadline_s:
        with contextlib.suppress(httpx.HTTPError):
            answer = await client.get(url)
            if answer.is_success and answer.json()["ready"]:
                return True
        await asyncio.sleep(HEALTH_PERIOD_S)
    return False


async def _changed(folders: Sequence[Path]) -> None:
    """Wait until a Python file below one of the folders is another than now."""
    if not folders:
        await asyncio.Event().wait()
    known = await asyncio.to_thread(_times, folders)
    while True:
        await asyncio.sleep(LOOK_S)
        if await asyncio.to_thread(_times, folders) != known:
            return


def _times(folders: Sequence[Path]) -> dict[Path, int]:
    files = (path for folder in folders for path in folder.rglob("*.py"))
    return {path: path.stat().st_mtime_ns for path in files if path.exists()}


async def _end(process: Process) -> None:
    """Ask a process to stop, and stop it by force if it does not."""
    with contextlib.suppress(ProcessLookupError):
        process.terminate()
    try:
        async with asyncio.timeout(STOP_LIMIT_S):
            await process.wait()
    except TimeoutError:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
