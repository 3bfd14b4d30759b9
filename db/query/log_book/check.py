"""The log book held against the hashes in the chain of events."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from db.identity import public_id
from db.log_book_tables import LogEntryRow, ShiftPageRow
from db.query.log_book.entries import (
    CHANGED,
    KIND,
    PAGE_KIND,
    STRUCK,
    WRITTEN,
    entry_versions,
    version_hash,
)
from db.query.log_book.pages import SIGNED, TAKEN
from db.tables import Event


@dataclass(slots=True)
class _Told:
    """What the chain of events tells of the log book."""

    versions: dict[tuple[str, int], str] = field(default_factory=dict[tuple[str, int], str])
    signed: dict[str, tuple[str, str]] = field(default_factory=dict[str, tuple[str, str]])
    """Hash and who left, by page."""
    taken: dict[str, tuple[str, str]] = field(default_factory=dict[str, tuple[str, str]])


def complaints(session: Session) -> list[str]:
    """Return what of the log book is not as the events tell, a sentence each; none where all is.

    The events themselves are ``db.query.station.event_chain``'s to check.
    """
    told = _told(session)
    return [*_of_entries(session, told), *_of_pages(session, told)]


def size(session: Session) -> tuple[int, int]:
    """Return how many versions of entries and how many signed pages the events tell of."""
    told = _told(session)
    return len(told.versions), len(told.signed)


def _told(session: Session) -> _Told:
    told = _Told()
    kinds = (WRITTEN, CHANGED, STRUCK, SIGNED, TAKEN)
    statement = select(Event.kind, Event.data).where(Event.kind.in_(kinds)).order_by(Event.cursor)
    for kind, data in session.execute(statement):
        said: dict[str, Any] = data
        if kind in (SIGNED, TAKEN):
            pages = told.signed if kind == SIGNED else told.taken
            pages[said["page"]] = (said["sha256"], said["by"])
        else:
            told.versions[said["entry"], said["version"]] = said["sha256"]
    return told


def _of_entries(session: Session, told: _Told) -> Iterator[str]:
    seen = set[tuple[str, int]]()
    for row in session.scalars(select(LogEntryRow).order_by(LogEntryRow.key)):
        entry = public_id(KIND, row.key)
        corrects = None if row.corrects_key is None else public_id(KIND, row.corrects_key)
        versions = entry_versions(session, entry)
        for version in versions:
            place = entry, version.number
            seen.add(place)
            if told.versions.get(place) != version_hash(entry, corrects, version):
                yield f"{entry}, version {version.number}, is not what was written"
        first = versions[0] if versions else None
        is_as_told = first is not None and (row.written_by, row.written_at, row.versions) == (
            first.written_by,
            first.written_at,
            len(versions),
        )
        if not is_as_told:
            yield f"{entry} tells of another author, time or number of versions"
    for entry, number in sorted(told.versions.keys() - seen):
        yield f"{entry}, version {number}, is missing"


def _of_pages(session: Session, told: _Told) -> Iterator[str]:
    seen = set[str]()
    for row in session.scalars(select(ShiftPageRow).order_by(ShiftPageRow.key)):
        page = public_id(PAGE_KIND, row.key)
        seen.add(page)
        digest = sha256(row.content.encode()).hexdigest()
        if told.signed.get(page) != (digest, row.left_by) or row.sha256 != digest:
            yield f"{page} is not what was signed"
        if told.taken.get(page, (digest, None)) != (digest, row.taken_by):
            yield f"{page} tells of another who took over than signed"
        yield from _of_entries_on(session, row, page)
    for page in sorted(told.signed.keys() - seen):
        yield f"{page} is missing"


def _of_entries_on(session: Session, row: ShiftPageRow, page: str) -> Iterator[str]:
    """Tell whether a page still has the entries that were signed with it."""
    try:
        listed = {(one["id"], one["version"]) for one in json.loads(row.content)["entries"]}
    except (ValueError, KeyError, TypeError):
        return
    kept = {
        (public_id(KIND, entry), versions)
        for entry, versions in session.execute(
            select(LogEntryRow.key, LogEntryRow.versions).where(LogEntryRow.page_key == row.key)
        )
    }
    if kept != listed:
        yield f"{page} has other entries, or other versions of them, than were signed"
