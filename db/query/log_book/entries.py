"""Entries of the log book: what they say is only ever added to, by versions."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from hashlib import sha256
from typing import Any, Final

from sqlalchemy import ColumnElement, Select, String, and_, cast, func, or_, select
from sqlalchemy.orm import InstrumentedAttribute, Session

from db.column import microseconds
from db.deployment_span import Period, live_spans
from db.fault import StoreError
from db.identity import key_of, public_id
from db.log_book_tables import LogEntryRow, LogEntryVersionRow
from db.query.change import row_of
from db.query.fleet.robots import robot_key
from db.query.station.events import add_event
from db.record import same
from db.tables import Robot

KIND: Final = "entry"
PAGE_KIND: Final = "page"
WRITTEN, CHANGED, STRUCK = "log.written", "log.changed", "log.struck"
"""Events that carry the hash of a version."""
_QUOTED = 80
_TAGS_OF = 500


class EntrySignedError(StoreError):
    """The entry is on a signed page."""


class EntryChangedError(StoreError):
    """Somebody changed or struck out the entry meanwhile."""


@dataclass(frozen=True, slots=True)
class Attachment:
    """A picture of an entry; its bytes are a file that is named by their hash."""

    sha256: str
    name: str
    """As its file was called."""
    media_type: str
    size: int
    """Bytes."""


@dataclass(frozen=True, slots=True)
class LogText:
    """What somebody writes."""

    at: datetime
    """The moment that it is about."""
    robot: str | None
    text: str
    """Markdown."""
    tags: tuple[str, ...] = ()
    attachments: tuple[Attachment, ...] = ()


@dataclass(frozen=True, slots=True)
class LogVersion:
    """What an entry says from one moment on."""

    number: int
    at: datetime
    robot: str | None
    deployment: str | None
    text: str
    tags: tuple[str, ...]
    attachments: tuple[Attachment, ...]
    is_struck: bool
    written_at: datetime
    written_by: str
    sha256: str


@dataclass(frozen=True, slots=True)
class LogEntry:
    """An entry as it reads now."""

    id: str
    corrects: str | None
    page: str | None
    """The signed page that it is on."""
    written_at: datetime
    written_by: str
    newest: LogVersion

    @property
    def place(self) -> "Place":
        """Where it stands in the log book."""
        return Place(self.newest.at, 1, key_of(KIND, self.id))


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """Where something stands: by its moment, there what was told before what was written."""

    at: datetime
    rank: int
    """0 of an event, 1 of an entry."""
    key: int


@dataclass(frozen=True, slots=True)
class LogFilter:
    """Which entries are wanted; what is not given takes all."""

    robot: str | None = None
    deployment: str | None = None
    author: str | None = None
    tag: str | None = None
    text: str = ""
    """A part of the text or of a tag, in any case."""
    period: Period | None = None
    before: Place | None = None
    robots: frozenset[str] | None = None
    """Only about these, and so nothing about the station as a whole; ``None`` for everything."""


def add_entry(
    session: Session, said: LogText, *, at: datetime, by: str, corrects: str | None = None
) -> LogEntry:
    """Add an entry with its first version, and the event that carries its hash.

    Raises:
        UnknownIdError: If there is no such robot, or nothing that it could correct.
    """
    corrected = None if corrects is None else row_of(session, LogEntryRow, KIND, corrects)
    row = LogEntryRow(
        corrects_key=None if corrected is None else corrected.key,
        page_key=None,
        versions=1,
        written_at=at,
        written_by=by,
    )
    session.add(row)
    session.flush()
    verb = f"corrected {corrects} in" if corrects else "wrote in"
    return _add_version(session, row, said, WRITTEN, verb, at=at, by=by)


def change_entry(
    session: Session, entry: str, said: LogText | None, *, version: int, at: datetime, by: str
) -> LogEntry:
    """Add a version to an entry; ``said`` is ``None`` to strike it out.

    Args:
        session: Of the writer.
        entry: Its id.
        said: What it says from now on.
        version: The newest that its author has seen.
        at: Now.
        by: Who.

    Raises:
        UnknownIdError: If there is none of this id, or no such robot.
        EntrySignedError: If it is on a signed page.
        EntryChangedError: If there is a newer version, or it was struck out.
    """
    row = row_of(session, LogEntryRow, KIND, entry)
    newest = get_entry(session, entry).newest
    if row.page_key is not None:
        raise EntrySignedError(
            f"{entry} is on the signed page {public_id(PAGE_KIND, row.page_key)} and stays as it "
            "is; write an entry that corrects it."
        )
    if newest.is_struck:
        raise EntryChangedError(f"{newest.written_by} struck {entry} out; write another.")
    if newest.number != version:
        raise EntryChangedError(f"{newest.written_by} changed {entry} meanwhile; read it again.")
    row.versions += 1
    if said is not None:
        return _add_version(session, row, said, CHANGED, "changed an entry of", at=at, by=by)
    kept = LogText(newest.at, newest.robot, newest.text, newest.tags, newest.attachments)
    return _add_version(session, row, kept, STRUCK, "struck out an entry of", at=at, by=by)


def _add_version(
    session: Session,
    row: LogEntryRow,
    said: LogText,
    kind: str,
    verb: str,
    *,
    at: datetime,
    by: str,
) -> LogEntry:
    key = None if said.robot is None else robot_key(session, said.robot)
    spans = [] if key is None else live_spans(session, [key])[key]
    deployment = next((span.key for span in spans if span.holds(said.at)), None)
    version = LogVersion(
        number=row.versions,
        at=said.at,
        robot=said.robot,
        deployment=None if deployment is None else public_id("deployment", deployment),
        text=said.text,
        tags=said.tags,
        attachments=said.attachments,
        is_struck=kind == STRUCK,
        written_at=at,
        written_by=by,
        sha256="",
    )
    entry = public_id(KIND, row.key)
    corrects = None if row.corrects_key is None else public_id(KIND, row.corrects_key)
    version = replace(version, sha256=version_hash(entry, corrects, version))
    session.add(
        LogEntryVersionRow(
            entry_key=row.key,
            number=version.number,
            at=version.at,
            robot_key=key,
            deployment_key=deployment,
            text=version.text,
            tags=list(version.tags),
            attachments=[_document(one) for one in version.attachments],
            is_struck=version.is_struck,
            written_at=at,
            written_by=by,
            sha256=version.sha256,
        )
    )
    quoted = " ".join(said.text.split())
    quoted = quoted if len(quoted) <= _QUOTED else f"{quoted[:_QUOTED]}..."
    data = {"entry": entry, "version": version.number, "sha256": version.sha256}
    text = f"{by} {verb} the log book: {quoted}"
    add_event(session, at, kind, text, robot=said.robot, data=data)
    session.flush()
    return get_entry(session, entry)


def version_hash(entry: str, corrects: str | None, version: LogVersion) -> str:
    """Return SHA-256 over all that a version says, hexadecimal."""
    told = [
        entry,
        corrects,
        version.number,
        microseconds(version.at),
        version.robot,
        version.deployment,
        version.text,
        list(version.tags),
        [_document(one) for one in version.attachments],
        version.is_struck,
        microseconds(version.written_at),
        version.written_by,
    ]
    return sha256(json.dumps(told, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def get_entry(session: Session, entry: str) -> LogEntry:
    """Return an entry as it reads now.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    row = row_of(session, LogEntryRow, KIND, entry)
    return _records(session, _newest().where(LogEntryRow.key == row.key))[0]


def entry_versions(session: Session, entry: str) -> list[LogVersion]:
    """Return every version of an entry, the first one first.

    Raises:
        UnknownIdError: If there is none of this id.
    """
    key = row_of(session, LogEntryRow, KIND, entry).key
    statement = (
        select(LogEntryVersionRow, Robot.id)
        .outerjoin(Robot, LogEntryVersionRow.robot_key == Robot.key)
        .where(LogEntryVersionRow.entry_key == key)
        .order_by(LogEntryVersionRow.number)
    )
    return [_version(row, robot) for row, robot in session.execute(statement)]


def newest_entries(session: Session, wanted: LogFilter, limit: int) -> list[LogEntry]:
    """Return entries as they read now, the last moments first; struck out ones are among them."""
    statement = _newest().where(*_conditions(session, wanted))
    at, key = LogEntryVersionRow.at, LogEntryRow.key
    return _records(session, statement.order_by(at.desc(), key.desc()).limit(limit))


def unsigned_entries(session: Session) -> list[LogEntry]:
    """Return the entries that are on no signed page yet, the oldest moments first."""
    statement = _newest().where(LogEntryRow.page_key.is_(None))
    return _records(session, statement.order_by(LogEntryVersionRow.at, LogEntryRow.key))


def entries_of_page(session: Session, page: str) -> list[LogEntry]:
    """Return the entries of a signed page, the oldest moments first."""
    statement = _newest().where(LogEntryRow.page_key == key_of(PAGE_KIND, page))
    return _records(session, statement.order_by(LogEntryVersionRow.at, LogEntryRow.key))


def corrections_of(session: Session, entries: Sequence[str]) -> dict[str, list[str]]:
    """Return the entries that correct others, by the id of what they correct."""
    keys = [key_of(KIND, entry) for entry in entries]
    statement = (
        select(LogEntryRow.corrects_key, LogEntryRow.key)
        .where(LogEntryRow.corrects_key.in_(keys))
        .order_by(LogEntryRow.key)
    )
    found: dict[str, list[str]] = {}
    for corrected, key in session.execute(statement):
        found.setdefault(public_id(KIND, corrected or 0), []).append(public_id(KIND, key))
    return found


def known_tags(session: Session, robots: frozenset[str] | None = None) -> list[str]:
    """Return the tags of the newest entries about some robots, or about anything, by name."""
    found = newest_entries(session, LogFilter(robots=robots), _TAGS_OF)
    return sorted({tag for entry in found for tag in entry.newest.tags})


def authors(session: Session, robots: frozenset[str] | None = None) -> list[str]:
    """Return everybody who wrote an entry about some robots, or about anything, by name."""
    statement = select(LogEntryRow.written_by).distinct()
    if robots is not None:
        about = is_about(robots, LogEntryVersionRow.robot_key)
        statement = statement.join(
            LogEntryVersionRow, LogEntryVersionRow.entry_key == LogEntryRow.key
        ).where(about)
    return sorted(session.scalars(statement))


def every_attachment(session: Session) -> Iterator[Attachment]:
    """Return the pictures of every version of every entry, each once."""
    seen = set[str]()
    statement = select(LogEntryVersionRow.attachments).order_by(LogEntryVersionRow.key)
    for attachments in session.scalars(statement):
        for one in attachments:
            if one["sha256"] not in seen:
                seen.add(one["sha256"])
                yield Attachment(**one)


def robots_of_attachment(session: Session, digest: str) -> set[str | None]:
    """Return whose entries had a picture in any version; ``None`` of the station as a whole."""
    statement = (
        select(Robot.id)
        .select_from(LogEntryVersionRow)
        .outerjoin(Robot, Robot.key == LogEntryVersionRow.robot_key)
        .where(cast(LogEntryVersionRow.attachments, String).contains(digest))
        .distinct()
    )
    return set(session.scalars(statement))


def _newest() -> Select[LogEntryRow, LogEntryVersionRow, str]:
    """Return a query for entries with their newest version and the id of its robot."""
    is_newest = and_(
        LogEntryVersionRow.entry_key == LogEntryRow.key,
        LogEntryVersionRow.number == LogEntryRow.versions,
    )
    return (
        select(LogEntryRow, LogEntryVersionRow, Robot.id)
        .join(LogEntryVersionRow, is_newest)
        .outerjoin(Robot, LogEntryVersionRow.robot_key == Robot.key)
    )


def _conditions(session: Session, wanted: LogFilter) -> list[ColumnElement[bool]]:
    version, found = LogEntryVersionRow, list[ColumnElement[bool]]()
    if wanted.robots is not None:
        found.append(is_about(wanted.robots, version.robot_key))
    if wanted.robot is not None:
        found.append(version.robot_key == robot_key(session, wanted.robot))
    if wanted.deployment is not None:
        found.append(version.deployment_key == key_of("deployment", wanted.deployment))
    if wanted.author is not None:
        found.append(LogEntryRow.written_by == wanted.author)
    if wanted.tag is not None:
        tags = cast(version.tags, String)
        found.append(tags.contains(json.dumps(wanted.tag), autoescape=True))
    if wanted.text:
        sought = wanted.text.lower()
        places = (version.text, cast(version.tags, String))
        found.append(or_(*(func.lower(one).contains(sought, autoescape=True) for one in places)))
    if wanted.period is not None:
        found.append(wanted.period.holds(version.at))
    if wanted.before is not None:
        found.append(is_before(wanted.before, 1, version.at, LogEntryRow.key))
    return found


def is_about(
    robots: frozenset[str], column: InstrumentedAttribute[int | None]
) -> ColumnElement[bool]:
    """Return what is true of rows about some robots."""
    return column.in_(select(Robot.key).where(Robot.id.in_(robots)))


def is_before(
    place: Place,
    rank: int,
    at: InstrumentedAttribute[datetime],
    key: InstrumentedAttribute[int],
) -> ColumnElement[bool]:
    """Return what is true of rows that stand before a place in the log book."""
    if rank != place.rank:
        return at < place.at if rank > place.rank else at <= place.at
    return or_(at < place.at, and_(at == place.at, key < place.key))


def _records(
    session: Session, statement: Select[LogEntryRow, LogEntryVersionRow, str]
) -> list[LogEntry]:
    return [
        LogEntry(
            id=public_id(KIND, entry.key),
            corrects=None if entry.corrects_key is None else public_id(KIND, entry.corrects_key),
            page=None if entry.page_key is None else public_id(PAGE_KIND, entry.page_key),
            written_at=entry.written_at,
            written_by=entry.written_by,
            newest=_version(version, robot),
        )
        for entry, version, robot in session.execute(statement)
    ]


def _version(row: LogEntryVersionRow, robot: str | None) -> LogVersion:
    deployment = row.deployment_key
    return same(
        LogVersion,
        row,
        robot=robot,
        deployment=None if deployment is None else public_id("deployment", deployment),
        tags=tuple(row.tags),
        attachments=tuple(Attachment(**one) for one in row.attachments),
    )


def _document(attachment: Attachment) -> Mapping[str, Any]:
    return {
        "sha256": attachment.sha256,
        "name": attachment.name,
        "media_type": attachment.media_type,
        "size": attachment.size,
    }
