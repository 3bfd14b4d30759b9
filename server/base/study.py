"""What every study has in common: a row, a job, work in another process, an end that is kept.

A study is kept beside its job because it outlives it: its row says what was asked and what came of
it for ever, while a job is only how far the work is. What was asked, its news and its result are
models of the study's kind, kept as their JSON; REST shows one model that holds them all.
"""

import asyncio
import logging
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, fields, replace
from datetime import datetime
from typing import Annotated, Any, ClassVar, Generic, TypeVar

from pydantic import BaseModel, ValidationError
from sqlalchemy.orm import Session

from autonomy.result import Result
from db.fault import StoreError, StoreUnavailableError
from db.query.mission import studies as query
from db.query.mission.studies import StudyRecord
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from server.base.job import JobBoard, JobError, JobProgress
from server.base.problem import Problem, conflict
from server.base.view import one_of
from server.base.worker import WORKER_FAILURES, WorkerPool

log = logging.getLogger(__name__)

STOPPED = "The station stopped before the work was done."
RETRY_S = 0.5
"""What must not be lost is tried again this often while storage fails."""

Document = Mapping[str, Any]
"""A JSON object."""
Change = Callable[[Session], Any]
_Model = TypeVar("_Model", bound=BaseModel)
_Problem = TypeVar("_Problem")


@dataclass(frozen=True, slots=True)
class Refusal:
    """There is no answer, for a reason that a person can do something about."""

    message: str
    loc: tuple[str | int, ...] = ()
    """Which part of what was asked is to blame."""


class StudySummary(Result):
    """A study in a list."""

    id: str
    state: Annotated[str, one_of("running", "done", "failed", "cancelled", "interrupted")]
    """``running``, ``done``, ``failed``, ``cancelled`` or ``interrupted``; those whose kind says so
    can be resumed after the last three."""
    job: str | None
    created_at: datetime
    created_by: str


class StudyView(StudySummary):
    """One study."""

    robot: str
    message: str
    """How far it is, or why it has no result."""
    ended_at: datetime | None


def study_as(model: type[_Model], record: StudyRecord, **more: object) -> _Model:
    """Return a study as the model of its kind: what was asked, its news, its use and its result.

    Raises:
        Problem: 409 if another version of the station kept something that does not fit.
    """
    head = {field.name: getattr(record, field.name) for field in fields(record)}
    whole = {**record.asked, **record.news, **(record.use or {}), **head, **more}
    try:
        return model.model_validate(whole)
    except ValidationError as error:
        raise conflict(
            f"{record.id} was kept by another version of the station and does not fit this one: "
            f"{error.errors()[0]['msg']}."
        ) from error


async def worked_out(
    workers: WorkerPool,
    task: str,
    problem: object,
    on_news: Callable[[Any], None] = lambda _news: None,
) -> Any:  # noqa: ANN401 - what the task leaves
    """Return what a task leaves.

    Raises:
        JobError: As ``answer_of``.
    """
    return await answer_of(workers.run(task, problem, on_progress=on_news))


async def answer_of(work: Awaitable[Any]) -> Any:  # noqa: ANN401 - what the task leaves
    """Return what work of a worker leaves.

    Raises:
        JobError: The task failed, its process died, or there is no answer.
    """
    try:
        found = await work
    except WORKER_FAILURES as error:
        raise JobError(str(error)) from error
    if isinstance(found, Refusal):
        raise JobError(found.message)
    return found


@dataclass(frozen=True, slots=True)
class _Owed:
    """How a study ended while its row could not be changed."""

    state: str
    message: str
    write: Change


class Studies(ABC, Generic[_Problem]):
    """The studies of one kind. Belongs to one event loop.

    What is true of a study is known here before its row says so: which job works on it, and, after
    a failure of the storage, that nobody does.
    """

    kind: ClassVar[str]
    """Of their rows and jobs."""
    task: ClassVar[str]
    """Takes a problem, leaves a ``Result`` or a ``Refusal``."""
    event_key: ClassVar[str]
    """Under which events name a study."""
    can_resume: ClassVar[bool] = False

    def __init__(self, store: Store, jobs: JobBoard, clock: Clock, workers: WorkerPool) -> None:
        self._store = store
        self._jobs = jobs
        self._clock = clock
        self._workers = workers
        self._job_of: dict[str, str] = {}
        self._unnamed: set[str] = set()
        self._owed: dict[str, _Owed] = {}
        self._settling = asyncio.Lock()
        self._retry: asyncio.Task[None] | None = None
        self._stopping = False

    async def load(self) -> None:
        """Mark the studies that the station left behind."""
        at, message = self._clock.now(), self._with_remedy(STOPPED)
        await self._store.write(lambda s: query.interrupt_studies(s, self.kind, at, message))

    async def stop(self) -> None:
        """Interrupt every study: the station stops."""
        self._stopping = True
        for study in list(self._job_of):
            try:
                await self._call_off(study)
            except Problem:
                log.debug("%s ended by itself", study)
        if self._retry is not None:
            self._retry.cancel()
            await asyncio.wait([self._retry])

    @abstractmethod
    def _said(self, record: StudyRecord, state: str) -> str:
        """Return the sentence of the event that a study ended."""

    def _take(self, record: StudyRecord, news: Any, progress: JobProgress) -> None:  # noqa: ANN401 - the task's own news
        """Take news from the work."""
        del record
        progress.report(*news)

    def _news(self, study: str, *, is_done: bool) -> Document | None:
        """Return what a study's row is to keep of how far it came; none leaves what it says."""
        del study, is_done

    def _write_refusal(
        self, session: Session, record: StudyRecord, refusal: Refusal, news: Document | None
    ) -> None:
        self._write_end(session, record, "failed", refusal.message, news)

    async def _record(self, study: str) -> StudyRecord:
        """Return one study with its result, as it stands now.

        Raises:
            UnknownIdError: If there is none of this id.
        """
        record = await self._store.query(lambda s: query.get_study(s, self.kind, study))
        return self._as_it_stands(record)

    async def _records(self, robot: str, before: str | None, limit: int) -> list[StudyRecord]:
        """Return the studies of a robot without their results, the newest first."""
        records = await self._store.query(
            lambda s: query.list_studies(s, self.kind, robot, before=before, limit=limit)
        )
        return [self._as_it_stands(record) for record in records]

    def _as_it_stands(self, record: StudyRecord) -> StudyRecord:
        """Return a record with what its row does not say yet."""
        if record.state != "running":
            return record
        owed = self._owed.get(record.id)
        if owed is not None:
            return replace(record, state=owed.state, message=owed.message)
        return replace(record, job=self._job_of.get(record.id, record.job))

    async def _add(self, robot: str, asked: Result, by: str) -> StudyRecord:
        document, at = asked.model_dump(mode="json"), self._clock.now()
        return await self._store.write(
            lambda s: query.add_study(s, self.kind, robot, asked=document, at=at, by=by)
        )

    async def _begin(self, record: StudyRecord, problem: _Problem, by: str) -> str:
        """Begin to work on a study; return the id of its job.

        While storage fails the work goes on, and the row learns of the job together with its end.
        """
        study = record.id
        try:
            job = await self._jobs.start(
                self.kind,
                lambda progress: self._work(record, problem, progress),
                by=by,
                robot=record.robot,
                about=study,
            )
        except StoreError:
            remedy = "resume it" if self.can_resume else "start it again"
            await self._end(record, "failed", f"The storage failed; {remedy}.")
            self._ended(study)
            raise
        if all(one.id != job.id for one in self._jobs.running):
            return job.id
        self._job_of[study] = job.id
        self._unnamed.add(study)
        try:
            await self._store.write(lambda s: query.set_job(s, self.kind, study, job.id))
        except StoreError as error:
            log.warning("%s does not say yet that %s works on it: %s", study, job.id, error)
        else:
            self._unnamed.discard(study)
        return job.id

    async def _work(
        self, record: StudyRecord, problem: _Problem, progress: JobProgress
    ) -> Document:
        progress.wait_for_process()
        try:
            result = await self._workers.run(
                self.task, problem, on_progress=lambda news: self._take(record, news, progress)
            )
            await self._keep_result(record, result, progress)
        except WORKER_FAILURES as error:
            await self._end(record, "failed", self._with_remedy(str(error)))
            raise JobError(str(error)) from error
        except BaseException:
            # Cancelled: whoever did it waits until this is noted.
            if self._stopping:
                await self._end(record, "interrupted", self._with_remedy(STOPPED))
            else:
                await self._end(record, "cancelled", "Cancelled.")
            raise
        finally:
            self._ended(record.id)
        if isinstance(result, Refusal):
            raise JobError(result.message)
        return {self.kind: record.id}

    def _ended(self, study: str) -> None:
        """Note that nobody works on a study any longer."""
        self._job_of.pop(study, None)
        self._unnamed.discard(study)

    async def _call_off(self, study: str) -> bool:
        """Call a study off and wait until it has stopped; tell whether it was under way."""
        job = self._job_of.get(study)
        if job is None:
            return False
        await self._jobs.cancel(job)
        return True

    async def _keep_result(
        self, record: StudyRecord, result: Result | Refusal, progress: JobProgress
    ) -> None:
        """Keep what came of a study, waiting for as long as storage fails."""
        news = self._news(record.id, is_done=not isinstance(result, Refusal))

        def write(session: Session) -> None:
            if isinstance(result, Refusal):
                self._write_refusal(session, record, result, news)
            else:
                document = result.model_dump(mode="json")
                self._write_end(session, record, "done", "", news, document)

        whole = self._with_job(record.id, write)
        while True:
            try:
                await self._store.write(whole)
            except StoreUnavailableError as error:
                progress.report(1.0, f"Waiting for the storage to keep the result: {error}")
                await asyncio.sleep(RETRY_S)
            else:
                return

    async def _end(self, record: StudyRecord, state: str, message: str) -> None:
        """Keep how a study ended without a result, now or as soon as storage works.

        A station that stops before that notes it otherwise at its next start.
        """
        study, news = record.id, self._news(record.id, is_done=False)
        whole = self._with_job(
            study, lambda session: self._write_end(session, record, state, message, news)
        )
        try:
            await self._store.write(whole)
        except StoreError as error:
            log.warning("what became of %s could not be kept: %s", study, error)
            self._owed[study] = _Owed(state, message, whole)
            if not self._stopping and (self._retry is None or self._retry.done()):
                self._retry = asyncio.create_task(self._keep_trying(), name="ends of studies")

    async def _settle(self, study: str) -> None:
        """Make sure that the row of a study says how it ended.

        Raises:
            StoreError: It does not yet.
        """
        async with self._settling:
            owed = self._owed.get(study)
            if owed is not None:
                await self._store.write(owed.write)
                del self._owed[study]

    async def _keep_trying(self) -> None:
        while self._owed:
            await asyncio.sleep(RETRY_S)
            for study in list(self._owed):
                try:
                    await self._settle(study)
                except StoreError as error:
                    log.debug("what became of %s still waits: %s", study, error)

    def _with_job(self, study: str, write: Change) -> Change:
        job = self._job_of[study] if study in self._unnamed else None
        if job is None:
            return write

        def both(session: Session) -> None:
            query.set_job(session, self.kind, study, job)
            write(session)

        return both

    def _write_end(
        self,
        session: Session,
        record: StudyRecord,
        state: str,
        message: str,
        news: Document | None,
        result: Document | None = None,
    ) -> None:
        at = self._clock.now()
        query.end_study(
            session,
            self.kind,
            record.id,
            state,
            at=at,
            message=message,
            news=news,
            result=result,
        )
        add_event(
            session,
            at,
            f"{self.kind}.{state}",
            self._said(record, state),
            level="warning" if state == "failed" else "info",
            robot=record.robot,
            data={self.event_key: record.id, "message": message},
        )

    def _with_remedy(self, message: str) -> str:
        return f"{message} Resume it." if self.can_resume else message
