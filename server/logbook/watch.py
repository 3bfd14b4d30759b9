"""Watches: people who come and go, and the pages that they sign to each other."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any

import msgspec
from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.query.log_book.entries import LogEntry, unsigned_entries
from db.query.log_book.pages import (
    NO_PAGE,
    NewPage,
    PageStateError,
    ShiftPage,
    newest_page,
    sign_page,
    take_page,
)
from db.query.log_book.shifts import (
    Shift,
    ShiftStateError,
    begin_shift,
    end_shift,
    open_shift,
    shifts_in,
)
from server.base.foundation import Foundation
from server.base.problem import conflict
from server.logbook.handover import standing
from server.logbook.page import HandoverView, PageToSign, WatchView, seen_of
from server.logbook.view import entry_view


@dataclass(frozen=True, slots=True)
class _Open:
    """What is on no page yet."""

    previous: str
    began_at: datetime
    entries: list[LogEntry]
    shifts: list[Shift]


class Watch:
    """Who is on watch, and what they sign. Belongs to one event loop."""

    def __init__(self, foundation: Foundation) -> None:
        self._foundation = foundation
        self._store, self._clock = foundation.store, foundation.clock

    async def begin(self, person: str) -> Shift:
        """Let a person be on watch.

        Raises:
            Problem: 409 if they are.
        """
        at = self._clock.now()
        try:
            return await self._store.write(lambda session: begin_shift(session, person, at))
        except ShiftStateError as error:
            raise conflict(str(error)) from error

    async def end(self, person: str) -> Shift:
        """Let a person be on watch no more, without a page.

        Raises:
            Problem: 409 if they are not.
        """
        at = self._clock.now()
        try:
            return await self._store.write(lambda session: end_shift(session, person, at))
        except ShiftStateError as error:
            raise conflict(str(error)) from error

    async def handover(self) -> HandoverView:
        """Return what would be signed now."""
        now = self._clock.now()
        stand = await standing(self._foundation)
        found = await self._store.query(lambda session: _open(session, now))
        entries = [entry_view(one, []) for one in found.entries]
        return HandoverView(
            began_at=found.began_at,
            now=now,
            previous=found.previous,
            people=[_watch(one, found.began_at, now) for one in found.shifts],
            standing=stand,
            entries=entries,
            seen=seen_of(found.previous, entries, stand),
        )

    async def sign(self, body: PageToSign, *, by: str) -> ShiftPage:
        """Sign what was shown, and leave: the entries on the page stay as they are from now on.

        Raises:
            Problem: 409 if it is not what was shown any more, or somebody else signed meanwhile.
        """
        shown = await self.handover()
        if shown.seen != body.seen:
            raise conflict("Something changed since you looked; look again and sign.")
        document: dict[str, Any] = {
            "people": msgspec.to_builtins(shown.people),
            "standing": msgspec.to_builtins(shown.standing),
            "weather": body.weather.model_dump(),
            "remarks": body.remarks,
        }
        versions = {one.id: one.newest.number for one in shown.entries}
        new = NewPage(shown.began_at, document, shown.previous, versions)
        at = self._clock.now()

        def write(session: Session) -> ShiftPage:
            page = sign_page(session, new, at=at, by=by)
            if open_shift(session, by) is not None:
                end_shift(session, by, at)
            return page

        try:
            return await self._store.write(write)
        except PageStateError as error:
            raise conflict(str(error)) from error

    async def take(self, page: str, digest: str, *, by: str) -> ShiftPage:
        """Take over what a page tells, and be on watch.

        Raises:
            UnknownIdError: If there is none of this id.
            Problem: 409 if somebody took it already, it is their own, or not what they saw.
        """
        at = self._clock.now()

        def write(session: Session) -> ShiftPage:
            taken = take_page(session, page, digest, at=at, by=by)
            if open_shift(session, by) is None:
                begin_shift(session, by, at)
            return taken

        try:
            return await self._store.write(write)
        except PageStateError as error:
            raise conflict(str(error)) from error


def _open(session: Session, now: datetime) -> _Open:
    """Return what is on no page yet; the first page begins with the first entry or shift."""
    page, entries = newest_page(session), unsigned_entries(session)
    if page is not None:
        began_at = page.ended_at
    else:
        first = shifts_in(session, Period(datetime.fromtimestamp(0, now.tzinfo), now))
        begun = [*(one.written_at for one in entries), *(one.began_at for one in first)]
        began_at = min(begun, default=now)
    shifts = shifts_in(session, Period(began_at, now))
    return _Open(NO_PAGE if page is None else page.id, began_at, entries, shifts)


def _watch(shift: Shift, first: datetime, last: datetime) -> WatchView:
    hours = round(shift.hours_in(first, last), 3)
    return WatchView(shift.person, max(shift.began_at, first), shift.ended_at, hours)
