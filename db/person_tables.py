"""Tables of people, and of what lets them in."""

from datetime import datetime

from sqlalchemy import ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, Base, Key


class Person(Base):
    """Someone who may sign in."""

    __tablename__ = "person"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)
    role: Mapped[str]
    password_hash: Mapped[str | None]
    created_at: Mapped[datetime]
    disabled_at: Mapped[datetime | None]


class Session(Base):
    """A browser that signed in; the secret itself is known to the browser alone."""

    __tablename__ = "session"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    secret_hash: Mapped[str] = mapped_column(unique=True)
    csrf_token: Mapped[str]
    person_key: Mapped[int] = mapped_column(ForeignKey("person.key"), index=True)
    created_at: Mapped[datetime]
    expires_at: Mapped[datetime]


class Token(Base):
    """A bearer token of a script, or a one-time sign-in."""

    __tablename__ = "token"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    secret_hash: Mapped[str] = mapped_column(unique=True)
    name: Mapped[str]
    role: Mapped[str]
    person_key: Mapped[int | None] = mapped_column(ForeignKey("person.key"), index=True)
    one_time: Mapped[bool]
    created_at: Mapped[datetime]
    expires_at: Mapped[datetime]
    used_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]
