"""Signed pages of the log book: written once, taken over once, never changed."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from hashlib import sha256
from typing import Any, Final

from sqlalchemy import select, update
from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.fault import StoreError
from db.identity import key_of, public_id
from db.log_book_tables import LogEntryRow, ShiftPageRow
from db.query.change import row_of
from db.query.log_book.entries import PAGE_KIND, LogEntry, unsigned_entries
from db.query.station.events import add_event
from db.record import same

SIGNED, TAKEN = "page.signed", "page.taken"
"""Events that carry the hash of a page and who signed it."""
NO_PAGE: Final = ""


class PageStateError(StoreError):
    """The page cannot be signed, or not by this person."""


@dataclass(frozen=True, slots=True)
class ShiftPage:
    """A signed page."""

    id: str
    began_at: datetime
    ended_at: datetime
    content: str
    """JSON."""
    sha256: str
    left_by: str
    left_at: datetime
    taken_by: str | None
    taken_at: datetime | None

    @property
    def document(self) -> dict[str, Any]:
        """What its content says."""
        return json.loads(self.content)


@dataclass(frozen=True, slots=True)
class NewPage:
    """What somebody signs."""

    began_at: datetime
    document: Mapping[str, Any]
    """All but the entries."""
    previous: str
    """Id of the page before, as they saw it; ``NO_PAGE`` where there was none."""
    versions: Mapping[str, int]
    """Entries that they saw, each with its newest version."""


def sign_page(session: Session, new: NewPage, *, at: datetime, by: str) -> ShiftPage:
    """Write a page with every entry that is on none yet, and the event that carries its hash.

    Raises:
        PageStateError: If somebody else signed one meanwhile, or the entries are not those any
            more that were seen.
    """
    newest = newest_page(session)
    if (newest.id if newest else NO_PAGE) != new.previous:
        by_whom = "Nobody" if newest is None else newest.left_by
        raise PageStateError(f"{by_whom} signed a page meanwhile; look at what is left.")
    entries = unsigned_entries(session)
    if {entry.id: entry.newest.number for entry in entries} != dict(new.versions):
        raise PageStateError("The log book was written in since you looked; look again and sign.")
    document = {**new.document, "entries": [_signed(entry) for entry in entries]}
    content = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    row = ShiftPageRow(
        began_at=new.began_at,
        ended_at=at,
        content=content,
        sha256=sha256(content.encode()).hexdigest(),
        left_by=by,
        left_at=at,
        taken_by=None,
        taken_at=None,
    )
    session.add(row)
    session.flush()
    session.execute(
        update(LogEntryRow).where(LogEntryRow.page_key.is_(None)).values(page_key=row.key)
    )
    page = _record(row)
    data = {"page": page.id, "sha256": page.sha256, "by": by}
    add_event(session, at, SIGNED, f"{by} signed {page.id} of the log book.", data=data)
    return page


def _signed(entry: LogEntry) -> dict[str, Any]:
    """Return an entry as a page has it."""
    version = entry.newest
    return {
        "id": entry.id,
        "version": version.number,
        "sha256": version.sha256,
        "at": version.at.isoformat(),
        "by": entry.written_by,
        "robot": version.robot,
        "text": version.text,
        "tags": list(version.tags),
        "is_struck": version.is_struck,
        "corrects": entry.corrects,
        "attachments": [one.sha256 for one in version.attachments],
    }


def take_page(session: Session, page: str, digest: str, *, at: datetime, by: str) -> ShiftPage:
    """Note who takes over what a page tells.

    Args:
        session: Of the writer.
        page: Its id.
        digest: SHA-256 of the content that they saw.
        at: Now.
        by: Who takes over.

    Raises:
        UnknownIdError: If there is none of this id.
        PageStateError: If somebody took it already, it is their own, or not what they saw.
    """
    row = row_of(session, ShiftPageRow, PAGE_KIND, page)
    if row.taken_by is not None and row.taken_at is not None:
        raise PageStateError(f"{row.taken_by} took {page} over at {row.taken_at:%H:%M:%S}Z.")
    if row.left_by == by:
        raise PageStateError(f"{by} signed {page} to leave; somebody else has to take it over.")
    if row.sha256 != digest:
        raise PageStateError(f"{page} is not what was shown; read it again.")
    row.taken_by, row.taken_at = by, at
    text = f"{by} took over from {row.left_by} by {page} of the log book."
    add_event(session, at, TAKEN, text, data={"page": page, "sha256": digest, "by": by})
    return _record(row)


def newest_page(session: Session) -> ShiftPage | None:
    """Return the page that was signed last."""
    found = list_pages(session, limit=1)
    return found[0] if found else None


def get_page(session: Session, page: str) -> ShiftPage:
    """Return one page.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    return _record(row_of(session, ShiftPageRow, PAGE_KIND, page))


def list_pages(session: Session, *, before: str | None = None, limit: int = 100) -> list[ShiftPage]:
    """Return pages, the newest first; ``before`` continues a list after its last id."""
    statement = select(ShiftPageRow).order_by(ShiftPageRow.key.desc()).limit(limit)
    if before is not None:
        statement = statement.where(ShiftPageRow.key < key_of(PAGE_KIND, before))
    return [_record(row) for row in session.scalars(statement)]


def pages_in(session: Session, period: Period) -> list[ShiftPage]:
    """Return the pages that were signed in a period, the oldest first."""
    statement = select(ShiftPageRow).where(period.holds(ShiftPageRow.left_at))
    return [_record(row) for row in session.scalars(statement.order_by(ShiftPageRow.key))]


def _record(row: ShiftPageRow) -> ShiftPage:
    return same(ShiftPage, row, id=public_id(PAGE_KIND, row.key))
