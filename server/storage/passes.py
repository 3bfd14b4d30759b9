"""Passes over what is kept: daily at an hour, or when somebody asks; and looks at what would go."""

import asyncio
from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any, Final

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.fault import StoreError
from db.query.station.events import add_event
from db.query.station.settings import get_setting, put_setting
from db.query.storage.prunable import PRUNABLE
from db.storage_tables import ArchiveFileRow
from robot_link.storage_config import StorageConfig
from server.base.event_bus import SettingsChanged
from server.base.foundation import Foundation
from server.base.job import JobError, JobPerKey, JobProgress, ThreadWork
from server.base.retry_queue import until_stored
from server.base.wakeups import Wakeups
from server.storage.archive import FOLDER, ArchiveError, write_manifest
from server.storage.preview import Previewer
from server.storage.pruning import Pruner, rule_of
from server.storage.result import pass_result, preview_result
from server.storage.sizes import Sizes

SETTING: Final = "storage.pass"
CAUSE: Final = "storage:pass"
_PASS: Final = "storage pass"
_PREVIEW: Final = "storage preview"
_NOT_ALL: Final = "It did not see to everything."
_STATION: Final = "the station"


class Passes:
    """Begins passes, one at a time. Belongs to one event loop; ``run`` is its task."""

    def __init__(self, foundation: Foundation, sizes: Sizes) -> None:
        self._foundation = foundation
        self._store, self._clock = foundation.store, foundation.clock
        self._sizes = sizes
        self._passes = JobPerKey[str](foundation.jobs, _PASS)
        self._previews = JobPerKey[str](foundation.jobs, _PREVIEW)
        self._wakeups = Wakeups(foundation.clock)
        self.last: Mapping[str, Any] | None = None
        """What the last pass did: ``at``, ``message``, ``is_whole``."""
        self.next_at: datetime | None = None
        """``None`` while everything is kept for ever."""

    async def load(self) -> None:
        """Take up what the last pass did."""
        self.last = await self._store.query(lambda session: get_setting(session, SETTING))
        self._set_due(await self._config())

    async def run(self) -> None:
        """Begin the daily pass whenever it is due, until cancelled."""
        while True:
            await self._wakeups.next()
            await until_stored("the daily pass over what is kept", self._begin_if_due)

    async def _begin_if_due(self) -> None:
        config = await self._config()
        if self.next_at is not None and self.next_at <= self._clock.now():
            await self._passes.start(_PASS, self._daily, by=_STATION)
        self._set_due(config)

    def settings_changed(self, event: SettingsChanged) -> None:
        """Wait for the hour that is set now."""
        if event.kind == "storage":
            self._wakeups.wake()
            self._foundation.feed.mark("storage")

    @property
    def job(self) -> str | None:
        """Id of the pass under way."""
        return self._passes.get(_PASS)

    @property
    def preview_job(self) -> str | None:
        """Id of the newest look at what would go since the station began."""
        return self._previews.newest(_PREVIEW)

    async def start(self, *, by: str) -> str:
        """Begin a pass over everything; return the id of its job, of the one under way if any.

        Raises:
            StoreError: Nothing was begun.
        """

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            return await self._pass(progress, again=True)

        return await self._passes.start(_PASS, work, by=by)

    async def preview(self, config: StorageConfig, *, by: str) -> str:
        """Begin to look at what would go by some rules; return the id of the job.

        Raises:
            StoreError: Nothing was begun.
            Problem: 409 while another look is under way.
        """

        async def work(progress: JobProgress) -> Mapping[str, Any]:
            thread = ThreadWork(progress)
            looking = Previewer(self._store, self._clock.now(), thread.go_on, thread.report)
            found = await thread.result(asyncio.to_thread(looking.run, config))
            return preview_result(found)

        refusal = "Another look at what would go is under way; cancel it or wait for it."
        return await self._previews.start_alone(_PREVIEW, work, refusal=refusal, by=by)

    async def _daily(self, progress: JobProgress) -> Mapping[str, Any]:
        try:
            result = await self._pass(progress, again=False)
        except (JobError, StoreError) as error:
            await self._alarm(str(error))
            raise
        await self._foundation.alarms.clear(CAUSE)
        return result

    async def _pass(self, progress: JobProgress, *, again: bool) -> Mapping[str, Any]:
        config = await self._config()
        thread = ThreadWork(progress)
        folder = self._foundation.settings.data_dir
        pruner = Pruner(self._store, folder, self._clock.now(), thread.go_on, thread.report)
        is_whole = False
        try:
            await thread.result(asyncio.to_thread(pruner.run, config, again=again))
            is_whole = True
        except ArchiveError as error:
            raise JobError(str(error)) from error
        finally:
            result = pass_result(pruner.result)
            await self._note(result, pruner.result.rows, is_whole=is_whole)
            for kind in PRUNABLE:
                gone = sum(pruner.result.of(way)[kind] for way in ("thin", "move", "delete"))
                self._sizes.went(kind, {PRUNABLE[kind].table.name: gone})
            self._sizes.wake()
        await self._write_manifest()
        return result

    async def _note(self, result: Mapping[str, Any], rows: int, *, is_whole: bool) -> None:
        at = self._clock.now()
        message = result["message"] if is_whole else f"{result['message']} {_NOT_ALL}"
        self.last = {"at": at.isoformat(), "message": message, "is_whole": is_whole}

        def change(session: Session) -> None:
            put_setting(session, SETTING, self.last or {})
            if rows:
                add_event(session, at, "storage.pruned", message, data=result)

        await self._store.write(change)
        self._foundation.feed.mark("storage")

    async def _write_manifest(self) -> None:
        def read(session: Session) -> list[dict[str, Any]]:
            return [
                {
                    "path": row.path,
                    "kind": row.kind,
                    "rows": row.rows,
                    "bytes": row.bytes,
                    "sha256": row.sha256,
                    "first_at": row.first_at.isoformat(),
                    "last_at": row.last_at.isoformat(),
                }
                for row in session.scalars(select(ArchiveFileRow).order_by(ArchiveFileRow.path))
            ]

        files = await self._store.query(read)
        if not files:
            return
        folder = self._foundation.settings.data_dir / FOLDER
        try:
            await asyncio.to_thread(write_manifest, folder, files)
        except ArchiveError as error:
            raise JobError(str(error)) from error

    async def _config(self) -> StorageConfig:
        current = await self._foundation.configurations.current("storage", None)
        return current.value_as(StorageConfig)

    def _set_due(self, config: StorageConfig) -> None:
        has_rules = any(rule_of(config, kind).then != "keep" for kind in PRUNABLE)
        self.next_at = next_hour(self._clock.now(), config.hour) if has_rules else None
        self._wakeups.set_due(_PASS, self.next_at)

    async def _alarm(self, reason: str) -> None:
        await self._foundation.alarms.raise_(
            CAUSE,
            f"The daily pass over what is kept did not see to everything: {reason}",
            level="watch",
            action="See Settings, Sizes and retention; it is tried again at its hour.",
        )


def next_hour(now: datetime, hour: int) -> datetime:
    """Return the first moment after now at which an hour of the day begins, UTC."""
    today = now.replace(hour=hour, minute=0, second=0, microsecond=0)
    return today if today > now else today + timedelta(days=1)
