"""Tables of the log book: what people write, their shifts, and the pages that they sign."""

from datetime import datetime

from sqlalchemy import JSON, ForeignKey, Index, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Document, Key


class LogEntryRow(Base):
    """One entry; what it says is in its versions, of which none is ever changed."""

    __tablename__ = "log_entry"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    corrects_key: Mapped[int | None] = mapped_column(ForeignKey("log_entry.key"), index=True)
    page_key: Mapped[int | None] = mapped_column(ForeignKey("shift_page.key"), index=True)
    """The signed page that it is on; from then on it has no more versions."""
    versions: Mapped[int]
    """Number of its newest version."""
    written_at: Mapped[datetime] = mapped_column(index=True)
    written_by: Mapped[str]


class LogEntryVersionRow(Base):
    """What an entry says from one moment on."""

    __tablename__ = "log_entry_version"
    __table_args__ = (UniqueConstraint("entry_key", "number"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    entry_key: Mapped[int] = mapped_column(ForeignKey("log_entry.key"))
    number: Mapped[int]
    at: Mapped[datetime] = mapped_column(index=True)
    """The moment that it is about."""
    robot_key: Mapped[int | None] = mapped_column(ForeignKey("robot.key"))
    deployment_key: Mapped[int | None] = mapped_column(ForeignKey("deployment.key"), index=True)
    text: Mapped[str]
    tags: Mapped[list[str]]
    attachments: Mapped[list[Document]] = mapped_column(JSON)
    is_struck: Mapped[bool]
    """Marked as deleted; it stays to be read."""
    written_at: Mapped[datetime]
    written_by: Mapped[str]
    sha256: Mapped[str]


class ShiftRow(Base):
    """The time that a person is on watch."""

    __tablename__ = "shift"
    __table_args__ = (Index(None, "person", "began_at"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    person: Mapped[str]
    began_at: Mapped[datetime] = mapped_column(index=True)
    ended_at: Mapped[datetime | None]


class ShiftPageRow(Base):
    """A page of the log book that somebody signed as they left; its content never changes."""

    __tablename__ = "shift_page"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    began_at: Mapped[datetime]
    ended_at: Mapped[datetime]
    content: Mapped[str]
    """JSON, letter by letter what ``sha256`` is of."""
    sha256: Mapped[str]
    left_by: Mapped[str]
    left_at: Mapped[datetime]
    taken_by: Mapped[str | None]
    taken_at: Mapped[datetime | None]
