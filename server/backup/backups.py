"""Backs the station up by its schedule, and tells when that fails or was too long ago.

All times are of the wall, also where a demo's clock runs faster: a disk fails by the wall.
"""

import asyncio
import contextlib
import logging
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from sqlalchemy.orm import Session
from typing_extensions import TypedDict

from db.fault import StoreError
from db.query.station.events import add_event
from robot_link.clock import set_or_after
from server.backup import task
from server.backup.failure import BackupError
from server.backup.making import BackupOrder, MadeBackup, clear_staging
from server.backup.rotation import kept
from server.backup.settings import BackupSettings, read_settings
from server.backup.shelf import Room, Shelf, ShelvedBackup, station_mark
from server.base.event_bus import JobChanged
from server.base.foundation import STUDY_NICENESS, Foundation
from server.base.job import JobError, JobPerKey, JobProgress
from server.base.problem import conflict
from server.base.study import worked_out
from server.base.worker import WorkerPool

log = logging.getLogger(__name__)

FAILED: Final = "backup"
OLD: Final = "backup_age"
RESOURCE: Final = "backups"
RETRY: Final = timedelta(hours=1)
"""Rest after a backup that failed, or less where they are more frequent."""
AHEAD: Final = timedelta(hours=1)
"""A backup whose name is later than now by more was named by a clock that was wrong, now or then:
the schedule and the rotation leave it alone."""
_LOOK_S: Final = 60.0
"""Longest wait by the wall for a moment of the wall, which may be set meanwhile."""
_JOB: Final = "backup"
_SCHEDULE: Final = "schedule"
_ACTION: Final = (
    "See Settings, Sizes and retention, Backups; make one there once the reason is gone."
)


class BackupResult(TypedDict):
    """What a backup became."""

    file: str
    """Name in the folder of the settings."""
    bytes: int


@dataclass(frozen=True, slots=True)
class Standing:
    """What there is of backups now."""

    settings: BackupSettings
    backups: tuple[ShelvedBackup, ...]
    """The newest first."""
    room: Room | None
    fault: str
    """Why the folder cannot be read, or which backups in it are of a time to come, or ""."""
    last_good_at: datetime | None
    """When the newest whole backup was begun."""
    next_at: datetime | None
    """When the next one is due; None where none is scheduled."""
    failed: str
    """Why the last one failed; "" if none did since the last good one."""


def wall() -> datetime:
    """Return the time of the wall, UTC."""
    return datetime.now(UTC)


class Backups:
    """Belongs to one event loop.

    Args:
        foundation: The station.
        now: Time of the wall, UTC.
    """

    def __init__(self, foundation: Foundation, now: Callable[[], datetime] = wall) -> None:
        self._foundation, self._now = foundation, now
        self._jobs = JobPerKey[str](foundation.jobs, _JOB)
        self._changed = asyncio.Event()
        self._mark = ""
        self._began = now()
        self._tried: datetime | None = None
        """When one last failed or was called off."""

    async def load(self) -> None:
        """Learn by which mark this station's backups are known."""
        self._mark = await asyncio.to_thread(station_mark, self._foundation.settings.data_dir)

    @property
    def job(self) -> str | None:
        """Id of the job that makes a backup now."""
        return self._jobs.get("")

    def shelf(self, settings: BackupSettings) -> Shelf:
        """Return the backups in the folder of settings."""
        return Shelf(Path(settings.folder), self._mark)

    async def change(self, settings: BackupSettings) -> None:
        """Take that the settings are others; who ends the schedule needs no backup any more."""
        self._tried = None
        if not settings.is_scheduled:
            await self._foundation.alarms.clear(FAILED)
        self._foundation.feed.mark(RESOURCE)
        self.look()

    def look(self) -> None:
        """Have the next look at what is due now."""
        self._changed.set()

    async def start(self, *, by: str) -> str:
        """Begin a backup; return the id of its job, that of the one under way if there is one.

        Raises:
            Problem: 409 where no folder is set.
        """
        settings = await self._foundation.store.query(read_settings)
        if not settings.folder:
            raise conflict("Choose a folder for backups first.")
        job = await self._jobs.start("", lambda progress: self._work(settings, progress), by=by)
        self._foundation.feed.mark(RESOURCE)
        return job

    def take_job(self, event: JobChanged) -> None:
        """Take that a job changed: after a backup the next one may be due."""
        if event.job.kind == _JOB and event.job.ended_at is not None:
            self._foundation.feed.mark(RESOURCE)
            self.look()

    async def standing(self) -> Standing:
        """Return what there is of backups now."""
        settings = await self._foundation.store.query(read_settings)
        return await self._standing(settings)

    async def run(self) -> None:
        """Make backups when they are due, until cancelled."""
        while True:
            self._changed.clear()
            wait_s: float | None = _LOOK_S
            with contextlib.suppress(StoreError):
                wait_s = await self._look()
            await set_or_after(self._changed, wait_s)

    async def _look(self) -> float | None:
        """Do what is due; return for how long there is nothing to do."""
        standing = await self.standing()
        await self._tell_age(standing)
        if standing.next_at is None:
            return None
        left_s = (standing.next_at - self._now()).total_seconds()
        if left_s > 0:
            return min(left_s, _LOOK_S)
        if self.job is None:
            await self.start(by=_SCHEDULE)
        return _LOOK_S

    async def _standing(self, settings: BackupSettings) -> Standing:
        found: tuple[ShelvedBackup, ...] = ()
        room, fault = None, ""
        if settings.folder:
            shelf = self.shelf(settings)
            try:
                found = tuple(await asyncio.to_thread(shelf.backups))
                room = await asyncio.to_thread(shelf.room, self._foundation.settings.data_dir)
            except BackupError as error:
                fault = str(error)
        ahead = [one.name for one in found if not self._is_past(one)]
        if ahead:
            fault = (
                f"{ahead[0]} is of a time to come, by the station's clock: set the clock, or move "
                f"the file away. Until then it does not count ({len(ahead)} in all)."
            )
        last_good_at = next((one.at for one in found if self._is_past(one)), None)
        next_at = self._next_at(settings, last_good_at)
        alarm = self._foundation.alarms.standing(FAILED, None)
        failed = "" if alarm is None else alarm.text
        return Standing(settings, found, room, fault, last_good_at, next_at, failed)

    def _is_past(self, backup: ShelvedBackup) -> bool:
        return backup.at <= self._now() + AHEAD

    def _next_at(self, settings: BackupSettings, last: datetime | None) -> datetime | None:
        if not settings.is_scheduled:
            return None
        now = self._now()
        due = settings.next_after(last) if last else min(self._began, now)
        if self._tried is not None:
            due = max(due, min(self._tried, now) + min(RETRY, settings.period))
        return due

    async def _tell_age(self, standing: Standing) -> None:
        """Raise or clear the alarm about the age of the last good backup."""
        alarms, settings = self._foundation.alarms, standing.settings
        last = standing.last_good_at
        limit = 2 * settings.period
        is_old = self._now() - (last or self._began) > limit
        if not settings.is_scheduled or not is_old:
            await alarms.clear(OLD)
            return
        hours = limit.total_seconds() / 3600.0
        text = (
            "There is no good backup of the station."
            if last is None
            else f"The last good backup is of {last:%Y-%m-%d %H:%MZ}, more than {hours:.0f} h ago."
        )
        await alarms.raise_(OLD, text, action=_ACTION)

    async def _work(self, settings: BackupSettings, progress: JobProgress) -> BackupResult:
        try:
            made = await self._make(settings, progress)
        except JobError as error:
            await self._fail(str(error))
            raise
        except asyncio.CancelledError:
            self._tried = self._now()
            raise
        self._tried = None
        await self._foundation.alarms.clear(FAILED)
        await self._note(made)
        await self._rotate(settings)
        return {"file": made.name, "bytes": made.bytes}

    async def _make(self, settings: BackupSettings, progress: JobProgress) -> MadeBackup:
        shelf, station = self.shelf(settings), self._foundation.settings
        try:
            await asyncio.to_thread(shelf.check)
        except BackupError as error:
            raise JobError(str(error)) from error
        order = BackupOrder(
            data_dir=station.data_dir,
            database_url=station.resolved_database_url,
            target=shelf.place(self._now(), is_encrypted=settings.key is not None),
            lock=settings.key,
            staging=shelf.staging,
        )
        workers = WorkerPool(niceness=STUDY_NICENESS)
        try:
            return await worked_out(workers, task.TASK, order, lambda news: progress.report(*news))
        finally:
            await asyncio.shield(workers.stop())
            await asyncio.to_thread(clear_staging, shelf.folder, shelf.staging)

    async def _fail(self, reason: str) -> None:
        self._tried = self._now()
        await self._foundation.alarms.raise_(
            FAILED, f"A backup of the station failed: {reason}", action=_ACTION
        )

    async def _note(self, made: MadeBackup) -> None:
        """Log it; that this cannot be written harms no backup."""
        at, text = self._foundation.clock.now(), f"{made.name} was made and read again."
        data = {"file": made.name, "bytes": made.bytes}

        def write(session: Session) -> None:
            add_event(session, at, "backup.made", text, data=data)

        with contextlib.suppress(StoreError):
            await self._foundation.store.write(write)

    async def _rotate(self, settings: BackupSettings) -> None:
        """Remove the backups that no rule keeps, after one that is good."""
        shelf = self.shelf(settings)

        def rotate() -> list[str]:
            found = [one for one in shelf.backups() if self._is_past(one)]
            stay = kept(
                (one.at for one in found),
                days=settings.keep_days,
                weeks=settings.keep_weeks,
                months=settings.keep_months,
            )
            gone = [one.name for one in found if one.at not in stay]
            shelf.remove(gone)
            return gone

        try:
            gone = await asyncio.to_thread(rotate)
        except (BackupError, OSError) as error:
            await self._fail(f"Older ones could not be removed: {error}")
            return
        if gone:
            log.info("backups that no rule keeps were removed: %s", ", ".join(gone))
