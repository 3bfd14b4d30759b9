"""Heavy work in processes of its own: cancellable, reporting progress, reused while warm.

A worker that dies takes nothing with it: the caller gets ``WorkerEndedError``, whatever it wanted
to change is as it was, and the next task starts a new process.
"""

import asyncio
import contextlib
import logging
import os
import pickle
import sys
from collections.abc import AsyncGenerator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from autonomy.chart import CHARTS, FOLDERS_VARIABLE
from server.base import worker_process as wire

log = logging.getLogger(__name__)

CANCEL_GRACE_S = 3.0
"""How long a task may take to notice that it was cancelled before its process is ended."""
UNUSED_S = 60.0
"""A process beyond the last of its pool ends when it had nothing to do for so long."""
_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
"""One thread a process: threads of algebra that wait for each other cost more than they bring."""
_LARGE_BYTES = 1 << 16
_ENDED = "The working process ended unexpectedly; nothing was changed."
Withdrawn = tuple[Any, int | None]
"""A task's result, and the number of the question whether to stop that was answered with yes first;
``None`` where none was."""
Report = Callable[[tuple[float, str]], None]
"""Tells how far a task is, 0 .. 1, and what it is at."""
IsCancelled = Callable[[], bool]
T = TypeVar("T")


class WorkCancelledError(Exception):
    """Raised by a task: whoever asked for the work wants it no more."""


class WorkerTaskError(Exception):
    """The task raised; the message is its own. Do not repeat it unchanged."""


class WorkerSpentError(Exception):
    """The task used up the processor time that it was given."""


class WorkerEndedError(Exception):
    """The process ended in the middle of a task; nothing was changed. It may be tried again."""


WORKER_FAILURES = (WorkerTaskError, WorkerEndedError)
"""What a task can come to beside its result."""


class _Process:
    """One running worker process, doing at most one task at a time."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process
        self.used_s = 0.0
        """When it ended its last task, by the event loop's clock."""
        self._received: asyncio.Queue[tuple[Any, ...] | None] = asyncio.Queue()
        self._reader = asyncio.create_task(self._read(), name="worker reader")

    @classmethod
    async def start(cls, niceness: int) -> "_Process":
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            "-m",
            wire.__name__,
            str(niceness),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            env={**os.environ, **_ENVIRONMENT, FOLDERS_VARIABLE: _chart_folders()},
        )
        worker = cls(process)
        try:
            await worker.receive()
        except BaseException:
            await worker.kill()
            raise
        return worker

    @property
    def is_alive(self) -> bool:
        return self.process.returncode is None

    async def send(self, frame: bytes) -> None:
        stdin = _pipe(self.process.stdin)
        try:
            stdin.write(frame)
            await stdin.drain()
        except (BrokenPipeError, ConnectionResetError) as error:
            raise WorkerEndedError(_ENDED) from error

    async def receive(self) -> tuple[Any, ...]:
        message = await self._received.get()
        if message is None:
            self._received.put_nowait(None)
            raise WorkerEndedError(_ENDED)
        return message

    async def kill(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        await self._reader

    async def stop(self) -> None:
        """Close the input, which ends the process; end it by force if that does not."""
        _pipe(self.process.stdin).close()
        try:
            async with asyncio.timeout(CANCEL_GRACE_S):
                await asyncio.shield(self._reader)
        except TimeoutError:
            await self.kill()

    async def _read(self) -> None:
        stdout = _pipe(self.process.stdout)
        with contextlib.suppress(asyncio.IncompleteReadError):
            while True:
                head = await stdout.readexactly(wire.LENGTH.size)
                body = await stdout.readexactly(wire.LENGTH.unpack(head)[0])
                self._received.put_nowait(await _unpacked(body))
        await self.process.wait()
        self._received.put_nowait(None)


def _chart_folders() -> str:
    return os.pathsep.join(map(str, CHARTS.folders))


async def _unpacked(body: bytes) -> tuple[Any, ...]:
    """Read a message; a large one beside the event loop, which others need meanwhile."""
    if len(body) < _LARGE_BYTES:
        return pickle.loads(body)
    return await asyncio.to_thread(pickle.loads, body)


def _pipe(end: T | None) -> T:
    if end is None:
        raise WorkerEndedError(_ENDED)
    return end


@dataclass(frozen=True, slots=True)
class PoolLoad:
    """What a pool of workers has to do."""

    busy: int
    idle: int
    queued: int
    """Tasks that wait for a process."""


class WorkerPool:
    """Runs tasks in up to ``size`` processes and keeps one of them warm in between.

    The others end when they had nothing to do for ``UNUSED_S``: each holds machine code of 200 MB
    and more, and is used only while tasks overlap.

    A task is named ``"module:function"`` so that its module is imported in the worker only; the
    function takes ``(payload, report, is_cancelled)``. With a ``niceness`` above 0 the processes
    give way to others. Belongs to one event loop.
    """

    def __init__(self, size: int = 1, niceness: int = 0) -> None:
        self._niceness = niceness
        self._places = asyncio.Semaphore(size)
        self._idle: list[_Process] = []
        self._busy: set[_Process] = set()
        self._ending: set[asyncio.Task[None]] = set()
        self._next_look: asyncio.TimerHandle | None = None
        self._queued = 0
        self._grace_s = CANCEL_GRACE_S

    async def run(
        self,
        task: str,
        payload: object,
        *,
        on_progress: Callable[[Any], None] | None = None,
        processor_limit_s: float | None = None,
        on_withdrawn: Callable[[Withdrawn | None], None] | None = None,
    ) -> Any:  # noqa: ANN401 - the task's own result
        """Run one task and return its result.

        With a ``processor_limit_s`` the task is told to stop once it has used so much of a
        processor: a machine that is busy with something else takes nothing of it.

        Cancelling the awaiting asyncio task cancels the work: the task is asked to stop and its
        process is ended if it does not within ``CANCEL_GRACE_S``. Where it had begun,
        ``on_withdrawn`` is told what it left, ``None`` if it was ended by force or raised.

        Raises:
            WorkerTaskError: The task raised.
            WorkerSpentError: It was told to stop since it had used ``processor_limit_s``.
            WorkerEndedError: The process died.
        """
        async with self._place():
            # A long recording takes its time to be packed, and the event loop is needed meanwhile.
            call = await asyncio.to_thread(
                wire.frame, (wire.CALL, task, payload, processor_limit_s)
            )
            worker = await self._acquire()
            self._busy.add(worker)
            try:
                await worker.send(call)
                return (await self._follow(worker, on_progress))[0]
            except asyncio.CancelledError:
                withdrawn = self._withdraw(worker, on_withdrawn)
                await asyncio.shield(asyncio.ensure_future(withdrawn))
                raise
            finally:
                self._busy.discard(worker)
                await self._release(worker)

    def load(self) -> PoolLoad:
        """Return what the pool has to do."""
        return PoolLoad(len(self._busy), len(self._idle), self._queued)

    def hurry(self) -> None:
        """From now on, end the process of a cancelled task at once: the station is stopping."""
        self._grace_s = 0.0

    async def stop(self) -> None:
        """End every process; tasks under way raise ``WorkerEndedError``."""
        workers = [*self._idle, *self._busy]
        self._idle.clear()
        if self._next_look is not None:
            self._next_look.cancel()
        await asyncio.gather(*(worker.stop() for worker in workers), *self._ending)

    def process_ids(self) -> tuple[int, ...]:
        """Return the ids of the processes that exist now."""
        return tuple(worker.process.pid for worker in (*self._idle, *self._busy))

    @asynccontextmanager
    async def _place(self) -> AsyncGenerator[None]:
        """Wait for room for one more task."""
        self._queued += 1
        try:
            await self._places.acquire()
        finally:
            self._queued -= 1
        try:
            yield
        finally:
            self._places.release()

    async def _acquire(self) -> _Process:
        while self._idle:
            worker = self._idle.pop()
            if worker.is_alive:
                return worker
        return await _Process.start(self._niceness)

    async def _release(self, worker: _Process) -> None:
        if worker.is_alive:
            worker.used_s = asyncio.get_running_loop().time()
            self._idle.append(worker)
            if self._next_look is None:
                self._end_unused()

    def _end_unused(self) -> None:
        """End what nobody used for long, the longest first; look again while more is idle."""
        loop, self._next_look = asyncio.get_running_loop(), None
        while self._idle and len(self._idle) + len(self._busy) > 1:
            left_s = self._idle[0].used_s + UNUSED_S - loop.time()
            if left_s > 0.0:
                self._next_look = loop.call_later(left_s, self._end_unused)
                return
            ending = asyncio.create_task(self._idle.pop(0).stop(), name="unused worker")
            self._ending.add(ending)
            ending.add_done_callback(self._ending.discard)

    async def _follow(
        self, worker: _Process, on_progress: Callable[[Any], None] | None
    ) -> Withdrawn:
        while True:
            kind, *values = await worker.receive()
            if kind == wire.PROGRESS and on_progress is not None:
                on_progress(values[0])
            elif kind == wire.RESULT:
                return values[0], values[1]
            elif kind == wire.FAILURE:
                raise WorkerTaskError(values[0])
            elif kind == wire.SPENT:
                raise WorkerSpentError

    async def _withdraw(
        self, worker: _Process, on_withdrawn: Callable[[Withdrawn | None], None] | None
    ) -> None:
        """Let a cancelled task end by itself, else end its process; tell what it left."""
        left: Withdrawn | None = None
        try:
            await worker.send(wire.frame((wire.CANCEL,)))
            async with asyncio.timeout(self._grace_s):
                left = await self._follow(worker, None)
        except TimeoutError:
            await worker.kill()
            if self._grace_s:
                log.warning("A worker did not stop when asked to and was ended")
        except (*WORKER_FAILURES, WorkerSpentError) as error:
            log.debug("a task that was cancelled left nothing: %s", error)
        if on_withdrawn is not None:
            on_withdrawn(left)
