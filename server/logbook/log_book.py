"""The log book: written, changed by versions, struck out, and read with what happened."""

import asyncio
import logging
import time
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.query.log_book.entries import (
    EntryChangedError,
    EntrySignedError,
    LogEntry,
    LogFilter,
    LogText,
    Place,
    add_entry,
    change_entry,
    corrections_of,
    every_attachment,
    newest_entries,
)
from db.query.log_book.told import ToldFilter, place_of, told_events
from db.query.station.events import EventRecord
from server.base.foundation import Foundation
from server.base.problem import FieldError, conflict, unprocessable
from server.base.retry_queue import every
from server.logbook.picture import Pictures
from server.logbook.view import EntryText

AHEAD_MAX: Final = timedelta(minutes=1)
"""How far clocks of browsers may be ahead of the station's."""
UNUSED_KEPT_S: Final = 48.0 * 3600.0
"""So long a picture waits for the entry that it was sent for, s of the wall's clock."""
_CLEAN_EVERY_S: Final = 3600.0
log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class LogItem:
    """One line of the log book."""

    place: Place
    entry: LogEntry | None = None
    event: EventRecord | None = None


@dataclass(frozen=True, slots=True)
class LogPart:
    """A part of the log book, the last moments first."""

    items: list[LogItem]
    corrected_by: dict[str, list[str]]
    """By entry, what corrects it."""
    has_more: bool


class LogBook:
    """What people write. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._store, self._clock = foundation.store, foundation.clock
        self.pictures = Pictures(foundation.settings.data_dir)

    async def clean(self) -> None:
        """Throw away pictures that were never put into an entry, until cancelled."""
        await every(
            "throwing away unused pictures",
            _CLEAN_EVERY_S,
            lambda: self.clean_once(time.time() - UNUSED_KEPT_S),
        )

    async def clean_once(self, before_s: float) -> int:
        """Throw away pictures that no version of any entry has and that were sent before a time.

        Returns how many went. Whoever writes one down at the same moment either keeps it or is
        told that it is not there; see ``Pictures``.
        """
        old = await asyncio.to_thread(self.pictures.older_than, before_s)
        if not old:
            return 0
        kept = await self._store.query(
            lambda session: {one.sha256 for one in every_attachment(session)}
        )
        gone = await asyncio.to_thread(self.pictures.remove, old - kept, before_s)
        if gone:
            log.info("%d pictures that no entry has were thrown away", gone)
        return gone

    async def write(self, body: EntryText, *, by: str, corrects: str | None = None) -> LogEntry:
        """Add an entry; once this returns it is kept.

        Raises:
            UnknownIdError: If there is no such robot, or nothing that it could correct.
            Problem: 422 if it is about the future, or has a picture that was not sent.
        """
        said, at = await self._said(body), self._clock.now()
        return await self._store.write(
            lambda session: add_entry(session, said, at=at, by=by, corrects=corrects)
        )

    async def change(self, entry: str, body: EntryText, version: int, *, by: str) -> LogEntry:
        """Let an entry say something else from now on; what it said before is kept.

        Raises:
            UnknownIdError: If there is none of this id, or no such robot.
            Problem: 409 if it is on a signed page, struck out, or was changed meanwhile; 422 as
                ``write``.
        """
        return await self._add_version(entry, await self._said(body), version, by)

    async def strike(self, entry: str, version: int, *, by: str) -> LogEntry:
        """Strike an entry out; it stays to be read.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 409 as ``change``.
        """
        return await self._add_version(entry, None, version, by)

    async def _add_version(
        self, entry: str, said: LogText | None, version: int, by: str
    ) -> LogEntry:
        at = self._clock.now()
        try:
            return await self._store.write(
                lambda session: change_entry(session, entry, said, version=version, at=at, by=by)
            )
        except (EntrySignedError, EntryChangedError) as error:
            raise conflict(str(error)) from error

    async def _said(self, body: EntryText) -> LogText:
        now = self._clock.now()
        at = body.at or now
        if at > now + AHEAD_MAX:
            message = f"it is {now:%Y-%m-%d %H:%M:%S}Z; the log book tells of what was"
            raise unprocessable("1 field is wrong.", [FieldError(loc=["at"], msg=message)])
        attachments = [
            await asyncio.to_thread(self.pictures.take, one.sha256, one.name)
            for one in body.attachments
        ]
        kept = [one for one in attachments if one is not None]
        if len(kept) < len(attachments):
            number = attachments.index(None)
            message = "there is no picture of this hash; send it first"
            errors = [FieldError(loc=["attachments", number, "sha256"], msg=message)]
            raise unprocessable("1 field is wrong.", errors)
        tags = tuple(dict.fromkeys(tag.strip().lower() for tag in body.tags))
        return LogText(min(at, now), body.robot, body.text, tags, tuple(kept))


def log_part(session: Session, entries: LogFilter | None, told: ToldFilter, limit: int) -> LogPart:
    """Return entries and events in one order, the last moments first.

    Args:
        session: Reads one unchanging moment.
        entries: Which entries; ``None`` for none.
        told: Which events.
        limit: At most so many of both together.
    """
    found = [] if entries is None else newest_entries(session, entries, limit + 1)
    items = [LogItem(entry.place, entry=entry) for entry in found]
    items += [LogItem(place_of(one), event=one) for one in told_events(session, told, limit + 1)]
    items.sort(key=lambda item: item.place, reverse=True)
    shown = items[:limit]
    ids = [item.entry.id for item in shown if item.entry is not None]
    return LogPart(shown, corrections_of(session, ids), len(items) > limit)
