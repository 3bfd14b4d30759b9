"""What REST tells of the log book, and what it takes."""

import unicodedata
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Final

from pydantic import AfterValidator, AwareDatetime, Field

from db.query.log_book.entries import LogEntry, LogVersion
from db.query.log_book.shifts import Shift
from db.query.log_book.told import GROUPS
from db.record import same
from server.base.text import Title
from server.base.view import Body, View, one_of
from server.logbook.markdown import html_of
from server.system.event_route import EventView

TEXT_LENGTH_MAX: Final = 20_000
TAGS_MAX, ATTACHMENTS_MAX = 12, 8
DIGEST: Final = "^[0-9a-f]{64}$"
_TURNING: Final = frozenset("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""Characters that have a text read in another order than it is written in."""


def _checked(text: str) -> str:
    for letter in text:
        is_control = unicodedata.category(letter) in ("Cc", "Cs", "Co", "Cn")
        if letter in _TURNING or (is_control and letter not in "\n\t"):
            raise ValueError("must not hold control characters")
    return text


def _unix_lines(text: str) -> str:
    return text.replace("\r\n", "\n")


Markdown = Annotated[
    str,
    AfterValidator(_unix_lines),
    AfterValidator(_checked),
    Field(min_length=1, max_length=TEXT_LENGTH_MAX, pattern=r"\S"),
]
Tag = Annotated[str, Field(min_length=1, max_length=40, pattern=r"^\w[\w .-]*$")]


class AttachmentBody(Body):
    """A picture that was sent before."""

    sha256: Annotated[str, Field(pattern=DIGEST)]
    """SHA-256 of a picture that was uploaded before, 64 hexadecimal digits."""
    name: Title
    """What the entry calls it."""


class EntryText(Body):
    """What somebody writes."""

    text: Markdown
    """Markdown; HTML in it is shown as text."""
    at: AwareDatetime | None = None
    """The moment that it is about; now where it is not given."""
    robot: str | None = None
    """Id of the robot that it is about; ``null`` for none."""
    tags: Annotated[tuple[Tag, ...], Field(max_length=TAGS_MAX)] = ()
    """Words to find it by."""
    attachments: Annotated[tuple[AttachmentBody, ...], Field(max_length=ATTACHMENTS_MAX)] = ()
    """Pictures that stand beside it."""


class NewEntry(EntryText):
    """An entry that somebody adds."""

    corrects: str | None = None
    """Id of the entry that it corrects."""


class EntryChanges(EntryText):
    """What an entry says from now on."""

    version: Annotated[int, Field(ge=1, le=2**31)]
    """The newest version that its author has seen."""


@dataclass(frozen=True, slots=True)
class AttachmentView(View):
    """A picture; its bytes are at `/api/logbook/attachments/{sha256}`."""

    sha256: str
    name: str
    media_type: Annotated[str, one_of("image/png", "image/jpeg", "image/webp")]
    size: int
    """Bytes."""


@dataclass(frozen=True, slots=True)
class VersionView(View):
    """What an entry says from one moment on."""

    number: int
    at: datetime
    robot: str | None
    deployment: str | None
    text: str
    html: str
    """The text as HTML that can do nothing."""
    tags: list[str]
    attachments: list[AttachmentView]
    is_struck: bool
    """Marked as deleted by ``written_by``."""
    written_at: datetime
    written_by: str
    sha256: str
    """Over all of it; the event of this version carries the same."""


@dataclass(frozen=True, slots=True)
class EntryView(View):
    """An entry as it reads now."""

    id: str
    written_at: datetime
    written_by: str
    corrects: str | None
    corrected_by: list[str]
    """Entries that correct it."""
    page: str | None
    """The signed page that it is on: it cannot be changed any more."""
    newest: VersionView


@dataclass(frozen=True, slots=True)
class EntryHistoryView(View):
    """An entry with everything that it ever said."""

    entry: EntryView
    versions: list[VersionView]
    """The first one first."""


@dataclass(frozen=True, slots=True)
class LogItemView(View):
    """One line of the log book: an entry of a person, or an event of the log."""

    at: datetime
    place: str
    """Where it stands; send it as ``before`` for what stands before it."""
    group: Annotated[str, one_of("entries", *GROUPS)]
    entry: EntryView | None
    event: EventView | None


@dataclass(frozen=True, slots=True)
class LogBookView(View):
    """A part of the log book, the last moments first."""

    items: list[LogItemView]
    has_more: bool
    """Whether something stands before the last of them."""
    since: datetime | None
    """Of the shift that was asked for."""
    until: datetime | None


@dataclass(frozen=True, slots=True)
class LogWordsView(View):
    """What entries can be found by."""

    authors: list[str]
    tags: list[str]


@dataclass(frozen=True, slots=True)
class ShiftView(View):
    """The time that a person is on watch."""

    id: str
    person: str
    began_at: datetime
    ended_at: datetime | None
    hours: float
    """Until now where it lasts."""


def version_view(version: LogVersion) -> VersionView:
    """Return a version as REST tells it."""
    return same(
        VersionView,
        version,
        html=html_of(version.text),
        tags=list(version.tags),
        attachments=[same(AttachmentView, one) for one in version.attachments],
    )


def entry_view(entry: LogEntry, corrected_by: list[str]) -> EntryView:
    """Return an entry as REST tells it."""
    return same(EntryView, entry, corrected_by=corrected_by, newest=version_view(entry.newest))


def shift_view(shift: Shift, now: datetime) -> ShiftView:
    """Return a shift as REST tells it."""
    return same(ShiftView, shift, hours=round(shift.hours_in(shift.began_at, now), 3))
