"""Long work that a request starts and that answers later, with progress and a way to cancel."""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import replace
from typing import Any

from db.fault import StoreError
from db.query import jobs as query
from db.query.jobs import JobRecord
from db.store import Store
from robot_link.clock import Clock
from server.base.event_bus import EventBus, JobChanged
from server.base.problem import conflict

logger = logging.getLogger(__name__)


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


JobWork = Callable[[JobProgress], Awaitable[Mapping[str, Any]]]
"""The work itself: returns the job's result, or raises ``JobError``."""


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

    async def start(self, kind: str, work: JobWork, *, by: str) -> JobRecord:
        """Start work; the answer is the job as it stands now."""
        at = self._clock.now()
        job = await self._store.write(lambda session: query.add_job(session, kind, at=at, by=by))
        job = replace(job, state="running")
        self._show(job)
        self._tasks[job.id] = asyncio.create_task(self._run(job.id, work), name=f"{kind} {job.id}")
        # A task that is cancelled before its first step would never note its own end.
        await asyncio.sleep(0)
        return self._running.get(job.id, job)

    @property
    def running(self) -> list[JobRecord]:
        """The jobs under way, with their newest progress."""
        return list(self._running.values())

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

    def _show(self, job: JobRecord) -> None:
        self._running[job.id] = job
        self._bus.publish(JobChanged(job))
