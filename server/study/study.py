"""What every study has in common: a row, a job, work in another process, an end that is kept.

A study is kept beside its job because it outlives it: its row says what was asked and what came of
it for ever, while a job is only how far the work is.
"""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from sqlalchemy.orm import Session

from db.fault import StoreError, StoreUnavailableError
from db.query.identifications import IdentificationRecord
from db.query.whatifs import WhatIfRecord
from db.store import Store
from server.base.job import JobBoard, JobProgress
from server.base.problem import Problem

log = logging.getLogger(__name__)

STOPPED = "The station stopped before the work was done."
RETRY_S = 0.5
"""What must not be lost is tried again this often while storage fails."""

Change = Callable[[Session], Any]
Record = TypeVar("Record", WhatIfRecord, IdentificationRecord)


@dataclass(frozen=True, slots=True)
class _Owed:
    """How a study ended while its row could not be changed."""

    state: str
    message: str
    write: Change


class RunningStudies:
    """The jobs of the studies of one kind that are under way. Belongs to one event loop.

    What is true of a study is known here before its row says so: which job works on it, and, after
    a failure of the storage, that nobody does.
    """

    def __init__(self, store: Store, jobs: JobBoard) -> None:
        self._store = store
        self._jobs = jobs
        self._job_of: dict[str, str] = {}
        self._unnamed: dict[str, Change] = {}
        self._owed: dict[str, _Owed] = {}
        self._settling = asyncio.Lock()
        self._retry: asyncio.Task[None] | None = None
        self.stopping = False

    async def begun(self, study: str, job: str, name: Change) -> None:
        """Note which job works on a study; ``name`` writes it into the study's row.

        While storage fails the work goes on, and the row learns it together with its end.
        """
        if all(one.id != job for one in self._jobs.running):
            return
        self._job_of[study] = job
        self._unnamed[study] = name
        try:
            await self._store.write(name)
        except StoreError as error:
            log.warning("%s does not say yet that %s works on it: %s", study, job, error)
        else:
            self._unnamed.pop(study, None)

    def ended(self, study: str) -> None:
        """Note that nobody works on a study any longer."""
        self._job_of.pop(study, None)
        self._unnamed.pop(study, None)

    def as_it_stands(self, record: Record) -> Record:
        """Return a record with what its row does not say yet."""
        if record.state != "running":
            return record
        owed = self._owed.get(record.id)
        if owed is not None:
            return replace(record, state=owed.state, message=owed.message)
        return replace(record, job=self._job_of.get(record.id, record.job))

    @property
    def state_when_cancelled(self) -> str:
        """What a study that was called off is: by a person, or by the end of the station."""
        return "interrupted" if self.stopping else "cancelled"

    async def cancel(self, study: str) -> bool:
        """Call a study off and wait until it has stopped; tell whether it was under way."""
        job = self._job_of.get(study)
        if job is None:
            return False
        await self._jobs.cancel(job)
        return True

    async def stop(self) -> None:
        """Interrupt every study: the station stops."""
        self.stopping = True
        for study in list(self._job_of):
            try:
                await self.cancel(study)
            except Problem:
                log.debug("%s ended by itself", study)
        if self._retry is not None:
            self._retry.cancel()
            await asyncio.wait([self._retry])

    async def keep(self, study: str, write: Change, progress: JobProgress) -> None:
        """Keep what came of a study, waiting for as long as storage fails."""
        whole = self._with_name(study, write)
        while True:
            try:
                await self._store.write(whole)
            except StoreUnavailableError as error:
                progress.report(1.0, f"Waiting for the storage to keep the result: {error}")
                await asyncio.sleep(RETRY_S)
            else:
                return

    async def keep_end(self, study: str, state: str, message: str, write: Change) -> None:
        """Keep how a study ended without a result, now or as soon as storage works.

        A station that stops before that notes it otherwise at its next start.
        """
        whole = self._with_name(study, write)
        try:
            await self._store.write(whole)
        except StoreError as error:
            log.warning("what became of %s could not be kept: %s", study, error)
            self._owed[study] = _Owed(state, message, whole)
            if not self.stopping and (self._retry is None or self._retry.done()):
                self._retry = asyncio.create_task(self._keep_trying(), name="ends of studies")

    async def settle(self, study: str) -> None:
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
                    await self.settle(study)
                except StoreError as error:
                    log.debug("what became of %s still waits: %s", study, error)

    def _with_name(self, study: str, write: Change) -> Change:
        name = self._unnamed.get(study)
        if name is None:
            return write

        def both(session: Session) -> None:
            name(session)
            write(session)

        return both
