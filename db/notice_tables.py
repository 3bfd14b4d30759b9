"""Tables of notices: whom the station tells, of what, and what became of each message."""

from datetime import datetime

from sqlalchemy import ForeignKey, Index, Integer, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Document, Key


class NoticePerson(Base):
    """What a person wants to be told, and when."""

    __tablename__ = "notice_person"

    person_key: Mapped[int] = mapped_column(
        Key, ForeignKey("person.key"), primary_key=True, autoincrement=False
    )
    document: Mapped[Document]


class NoticeContact(Base):
    """One way to reach a person; its address is a secret and none of the database's."""

    __tablename__ = "notice_contact"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    person_key: Mapped[int] = mapped_column(ForeignKey("person.key"), index=True)
    title: Mapped[str]
    form: Mapped[str]
    hint: Mapped[str]
    enabled: Mapped[bool]
    created_at: Mapped[datetime]
    removed_at: Mapped[datetime | None]


class NoticeCase(Base):
    """Something that people are to be told of: an alarm until somebody has seen it, or an event."""

    __tablename__ = "notice_case"
    __table_args__ = (Index(None, "ended_at", "next_at"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    topic: Mapped[str]
    level: Mapped[str]
    robot: Mapped[str | None]
    text: Mapped[str]
    alarm: Mapped[str | None] = mapped_column(index=True)
    person: Mapped[str | None]
    raised_at: Mapped[datetime]
    cursor: Mapped[int | None] = mapped_column(Key, unique=True)
    step: Mapped[int] = mapped_column(Integer)
    told_at: Mapped[datetime | None]
    next_at: Mapped[datetime | None]
    ended_at: Mapped[datetime | None]


class NoticeItem(Base):
    """That a contact is to hear of a case; it waits until a message takes it up."""

    __tablename__ = "notice_item"
    __table_args__ = (
        UniqueConstraint("case_key", "contact_key", "step", "level", "raised_at"),
        Index(None, "notice_key", "contact_key"),
        APPENDED_ONLY,
    )

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    case_key: Mapped[int] = mapped_column(ForeignKey("notice_case.key"))
    contact_key: Mapped[int] = mapped_column(ForeignKey("notice_contact.key"))
    step: Mapped[int] = mapped_column(Integer)
    level: Mapped[str]
    raised_at: Mapped[datetime]
    not_before: Mapped[datetime]
    notice_key: Mapped[int | None] = mapped_column(ForeignKey("notice.key"))


class Notice(Base):
    """One message to one contact, and what is proved of it."""

    __tablename__ = "notice"
    __table_args__ = (Index(None, "state", "key"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    contact_key: Mapped[int] = mapped_column(ForeignKey("notice_contact.key"), index=True)
    topic: Mapped[str]
    level: Mapped[str]
    title: Mapped[str]
    text: Mapped[str]
    items: Mapped[int] = mapped_column(Integer)
    state: Mapped[str]
    attempts: Mapped[int] = mapped_column(Integer)
    unanswered: Mapped[int] = mapped_column(Integer, server_default="0")
    created_at: Mapped[datetime]
    tried_at: Mapped[datetime | None]
    ended_at: Mapped[datetime | None]
    reply: Mapped[str]
    link_expires_at: Mapped[datetime | None]
    link_used_at: Mapped[datetime | None]
