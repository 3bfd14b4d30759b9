"""What every study has in common: a row, a job, work in another process, an end that is kept.

A study is kept beside its job because it outlives it: its row says what was asked and what came of
it for ever, while a job is only how far the work is.
"""

import asyncio
import logging
from collections.abc import Callable
from typing import Any

from sqlalchemy.orm import Session

from db.fault import StoreError, StoreUnavailableError
from db.store import Store
from server.job import JobBoard, JobProgress
from server.problem import Problem

log = logging.getLogger(__name__)

STOPPED = "The station stopped before the work was done."
RETRY_S = 0.5
"""What must not be lost is tried again this often while storage fails."""


class RunningStudies:
    """The jobs of the studies of one kind that are under way. Belongs to one event loop."""

    def __init__(self, store: Store, jobs: JobBoard) -> None:
        self._store = store
        self._jobs = jobs
        self._job_of: dict[str, str] = {}
        self.stopping = False

    def begun(self, study: str, job: str) -> None:
        """Note which job works on a study."""
        self._job_of[study] = job

    def ended(self, study: str) -> None:
        """Note that nobody works on a study any longer."""
        self._job_of.pop(study, None)

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

    async def keep(self, write: Callable[[Session], Any], progress: JobProgress) -> None:
        """Keep what came of a study, waiting for as long as storage fails."""
        while True:
            try:
                await self._store.write(write)
            except StoreUnavailableError as error:
                progress.report(1.0, f"Waiting for the storage to keep the result: {error}")
                await asyncio.sleep(RETRY_S)
            else:
                return

    async def keep_if_possible(self, study: str, write: Callable[[Session], Any]) -> None:
        """Keep how a study that was called off stands; the next start notes it otherwise."""
        try:
            await self._store.write(write)
        except StoreError as error:
            log.warning("what became of %s could not be kept: %s", study, error)
