"""Long work that a request starts and that answers later, with progress and a way to cancel."""

import asyncio
import logging
import shutil
import tempfile
import threading
from collections.abc import Awaitable, Callable, Hashable, Mapping
from dataclasses import replace
from typing import IO, Any, Generic, TypeVar

from db.fault import StoreError
from db.query.station import jobs as query
from db.query.station.jobs import JobRecord
from db.store import Store
from robot_link.clock import Clock
from server.base.event_bus import EventBus, JobChanged
from server.base.problem import conflict

logger = logging.getLogger(__name__)
Key = TypeVar("Key", bound=Hashable)
T = TypeVar("T")


class JobError(Exception):
    """The work failed for a reason that the message tells a person; ``result`` has details."""

    def __init__(self, message: str, result: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.result = result


class JobProgress:
    """What running work uses to say how far it is; a figure that means something, in words."""

    def __init__(self, tell: Callable[[float, str], None]) -> None:
        self._tell = tell

    def report(self, progress: float, message: str) -> None:
        """Say how far the work is, 0 .. 1, and what it is at. Call it on the event loop."""
        self._tell(min(1.0, max(0.0, progress)), message)

    def wait_for_process(self) -> None:
        """Say that the work begins once a process is free, which other work may still need."""
        self.report(0.0, "Waiting for a free process")


class WorkStoppedError(Exception):
    """The job that work of another thread belongs to was cancelled; nothing of it is kept."""


class ThreadWork:
    """Work of other threads for one job: it tells its progress, and ends where the job does."""

    def __init__(self, progress: JobProgress) -> None:
        self._loop = asyncio.get_running_loop()
        self._progress = progress
        self._stop = threading.Event()

    def go_on(self) -> None:
        """Call it from any thread between two steps.

        Raises:
            WorkStoppedError: If the job was cancelled meanwhile.
        """
        if self._stop.is_set():
            raise WorkStoppedError

    def report(self, progress: float, message: str) -> None:
        """Say from any thread how far the work is; raises as ``go_on`` does."""
        self.go_on()
        self._loop.call_soon_threadsafe(self._progress.report, progress, message)

    async def result(self, work: Awaitable[T]) -> T:
        """Await work of a thread; where that is cancelled, have it stop and wait until it has.

        Otherwise the thread would go on with a file that is closed, or hold up everybody's writing.
        """
        task = asyncio.ensure_future(work)
        try:
            return await asyncio.shield(task)
        except asyncio.CancelledError:
            self._stop.set()
            await asyncio.wait([task])
            fault = None if task.cancelled() else task.exception()
            if fault is not None and not isinstance(fault, WorkStoppedError):
                logger.exception("work that was to stop failed", exc_info=fault)
            raise


JobWork = Callable[[JobProgress], Awaitable[Mapping[str, Any]]]
"""The work itself: returns the job's result, or raises ``JobError``."""


def kept_upload(source: IO[bytes]) -> IO[bytes]:
    """Copy an upload into a nameless file: the request's own is gone before a job has read it."""
    kept = tempfile.TemporaryFile()  # noqa: SIM115 - closed by the job
    source.seek(0)
    shutil.copyfileobj(source, kept)
    kept.seek(0)
    return kept


class JobBoard:
    """Runs jobs as tasks of one event loop and keeps what became of them."""

    def __init__(self, store: Store, clock: Clock, bus: EventBus) -> None:
        self._store = store
        self._clock = clock
        self._bus = bus
        self._running: dict[str, JobRecord] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}

    async def load(self) -> None:
        """Close the jobs that the station left behind when it last stopped."""
        at = self._clock.now()
        message = "The station stopped before the work was done; start it again."
        await self._store.write(lambda session: query.fail_open_jobs(session, at, message))

    async def start(
        self,
        kind: str,
        work: JobWork,
        *,
        by: str,
        robot: str | None = None,
        about: str | None = None,
    ) -> JobRecord:
        """Start work, for a robot or the station; the answer is the job as it stands now.

        ``about`` is the id of what it works for, where that is kept beside the job.
        """
        at = self._clock.now()
        job = await self._store.write(
            lambda session: query.add_job(session, kind, at=at, by=by, robot=robot, about=about)
        )
        job = replace(job, state="running")
        self._show(job)
        task = asyncio.create_task(self._run(job.id, work), name=f"{kind} {job.id}")
        self._tasks[job.id] = task
        task.add_done_callback(lambda _: self._never_began(job.id))
        # A task that is cancelled before its first step would never note its own end.
        await asyncio.sleep(0)
        if task.cancelled():
            self._never_began(job.id)
        return self._running.get(job.id, job)

    @property
    def running(self) -> list[JobRecord]:
        """The jobs under way, with their newest progress."""
        return list(self._running.values())

    def is_running(self, job: str) -> bool:
        """Tell whether a job is under way."""
        return job in self._running

    async def get(self, job: str) -> JobRecord:
        """Return a job, running or ended.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        if job in self._running:
            return self._running[job]
        return await self._store.query(lambda session: query.get_job(session, job))

    async def cancel(self, job: str) -> JobRecord:
        """Cancel a running job and wait until it has stopped.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 409 if the job has ended already.
        """
        task = self._tasks.get(job)
        if task is None:
            ended = await self.get(job)
            raise conflict(f"{job} is {ended.state} already.")
        task.cancel()
        await asyncio.wait([task])
        return await self.get(job)

    async def stop(self) -> None:
        """Cancel everything that runs and wait for it."""
        tasks = list(self._tasks.values())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _run(self, job: str, work: JobWork) -> None:
        def tell(progress: float, message: str) -> None:
            self._show(replace(self._running[job], progress=progress, message=message))

        try:
            result = await work(JobProgress(tell))
        except asyncio.CancelledError:
            await self._end(job, state="cancelled", message="Cancelled.")
            raise
        except JobError as error:
            await self._end(job, state="failed", message=str(error), result=error.result)
        except StoreError as error:
            await self._end(job, state="failed", message=str(error))
        except Exception:
            logger.exception("%s failed", job)
            message = "The station failed at this; its log says why."
            await self._end(job, state="failed", message=message)
        else:
            await self._end(job, state="done", progress=1.0, result=dict(result))

    async def _end(self, job: str, **changes: Any) -> None:  # noqa: ANN401 - the fields differ in type
        record = replace(self._running[job], ended_at=self._clock.now(), **changes)
        try:
            await self._store.write(lambda session: query.save_job(session, record))
        except StoreError as error:
            logger.warning("what became of %s could not be kept: %s", job, error)
        finally:
            self._running.pop(job)
            self._tasks.pop(job)
            self._bus.publish(JobChanged(record))

    def _never_began(self, job: str) -> None:
        """Let go of a job that was cancelled before its first step, which has noted no end."""
        record = self._running.pop(job, None)
        self._tasks.pop(job, None)
        if record is not None:
            self._bus.publish(JobChanged(replace(record, state="cancelled")))

    def _show(self, job: JobRecord) -> None:
        self._running[job.id] = job
        self._bus.publish(JobChanged(job))


class JobPerKey(Generic[Key]):
    """The jobs of one kind that are under way, by what they are about: a map, a robot, a file.

    Belongs to one event loop.
    """

    def __init__(self, board: JobBoard, kind: str) -> None:
        self._board = board
        self._kind = kind
        self._running: dict[Key, str] = {}
        self._newest: dict[Key, str] = {}
        self._starting = asyncio.Lock()

    def __bool__(self) -> bool:
        """Whether there is any."""
        return any(map(self._board.is_running, self._running.values()))

    def get(self, key: Key) -> str | None:
        """Return the id of the job about something, if one is under way."""
        job = self._running.get(key)
        return job if job is not None and self._board.is_running(job) else None

    def newest(self, key: Key) -> str | None:
        """Return the id of the newest job about something since the station began, or ``None``."""
        return self._newest.get(key)

    async def start(
        self,
        key: Key,
        work: Callable[[JobProgress], Awaitable[Mapping[str, Any]]],
        *,
        by: str,
        robot: str | None = None,
    ) -> str:
        """Begin a job; return its id, that of the one under way if there is one.

        Raises:
            StoreError: Nothing was begun.
        """
        return await self._start(key, work, by, robot, refusal=None)

    async def start_alone(
        self,
        key: Key,
        work: Callable[[JobProgress], Awaitable[Mapping[str, Any]]],
        *,
        refusal: str,
        by: str,
        robot: str | None = None,
    ) -> str:
        """Begin a job; return its id.

        Raises:
            StoreError: Nothing was begun.
            Problem: 409 with the refusal while one is under way.
        """
        return await self._start(key, work, by, robot, refusal=refusal)

    async def _start(
        self,
        key: Key,
        work: Callable[[JobProgress], Awaitable[Mapping[str, Any]]],
        by: str,
        robot: str | None,
        *,
        refusal: str | None,
    ) -> str:
        is_over = False

        async def until_done(progress: JobProgress) -> Mapping[str, Any]:
            nonlocal is_over
            try:
                return await work(progress)
            finally:
                is_over = True
                self._running.pop(key, None)

        async with self._starting:
            running = self.get(key)
            if running is not None:
                if refusal is not None:
                    raise conflict(refusal)
                return running
            job = await self._board.start(self._kind, until_done, by=by, robot=robot)
            self._newest[key] = job.id
            if not is_over and self._board.is_running(job.id):
                self._running[key] = job.id
            return job.id
