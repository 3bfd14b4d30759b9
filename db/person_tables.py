"""Tables of people, and of what lets them in."""

from datetime import datetime

from sqlalchemy import ForeignKey, UniqueConstraint, false
from sqlalchemy.orm import Mapped, mapped_column

from db.tables import APPENDED_ONLY, CLUSTERED, Base, Key


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


class PersonIdentity(Base):
    """By which subject of a provider of OpenID Connect somebody signs in."""

    __tablename__ = "person_identity"
    __table_args__ = (UniqueConstraint("issuer", "subject"), APPENDED_ONLY)

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    person_key: Mapped[int] = mapped_column(ForeignKey("person.key"), index=True)
    issuer: Mapped[str]
    subject: Mapped[str]


class Session(Base):
    """A browser that signed in; the secret itself is known to the browser alone."""

    __tablename__ = "session"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    secret_hash: Mapped[str] = mapped_column(unique=True)
    csrf_token: Mapped[str]
    person_key: Mapped[int | None] = mapped_column(ForeignKey("person.key"), index=True)
    token_key: Mapped[int | None] = mapped_column(ForeignKey("token.key"), index=True)
    """The read-only link that it came in by, where it is nobody's."""
    created_at: Mapped[datetime]
    expires_at: Mapped[datetime]
    address: Mapped[str]
    browser: Mapped[str]
    """What it called itself."""
    seen_at: Mapped[datetime | None]


class Token(Base):
    """A bearer token of a script, a one-time sign-in, or a read-only link."""

    __tablename__ = "token"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    secret_hash: Mapped[str] = mapped_column(unique=True)
    name: Mapped[str]
    role: Mapped[str]
    person_key: Mapped[int | None] = mapped_column(ForeignKey("person.key"), index=True)
    one_time: Mapped[bool]
    is_link: Mapped[bool] = mapped_column(server_default=false())
    created_at: Mapped[datetime]
    expires_at: Mapped[datetime]
    used_at: Mapped[datetime | None]
    revoked_at: Mapped[datetime | None]


class RobotGroup(Base):
    """Robots under one name, so that a right on them is given once."""

    __tablename__ = "robot_group"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)


class RobotGroupMember(Base):
    """That a robot belongs to a group; it may belong to several."""

    __tablename__ = "robot_group_member"
    __table_args__ = CLUSTERED

    group_key: Mapped[int] = mapped_column(ForeignKey("robot_group.key"), primary_key=True)
    robot_key: Mapped[int] = mapped_column(ForeignKey("robot.key"), primary_key=True)


class RobotGrant(Base):
    """A role of a person or a token for one robot, or for the robots of one group."""

    __tablename__ = "robot_grant"
    __table_args__ = APPENDED_ONLY

    key: Mapped[int] = mapped_column(Key, primary_key=True)
    person_key: Mapped[int | None] = mapped_column(ForeignKey("person.key"), index=True)
    token_key: Mapped[int | None] = mapped_column(ForeignKey("token.key"), index=True)
    robot_key: Mapped[int | None] = mapped_column(ForeignKey("robot.key"))
    group_key: Mapped[int | None] = mapped_column(ForeignKey("robot_group.key"))
    role: Mapped[str]
