"""Who may do what: people, their sessions, and the tokens of scripts.

Secrets never reach the database: sessions and tokens are found by the hash of theirs.
"""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import delete, func, select, update
from sqlalchemy.orm import Session

from db import person_tables
from db.fault import StoreError, UnknownIdError
from db.identity import key_of, public_id
from db.person_tables import Person, Token
from db.record import same


class PersonExistsError(StoreError):
    """Another person has this name already."""


@dataclass(frozen=True, slots=True)
class PersonRecord:
    """Someone who may sign in."""

    name: str
    role: str
    password_hash: str | None
    """Without a hash the person signs in by one-time tokens only."""
    created_at: datetime
    disabled_at: datetime | None


@dataclass(frozen=True, slots=True)
class SessionRecord:
    """A browser that signed in."""

    person: PersonRecord
    csrf_token: str
    expires_at: datetime


@dataclass(frozen=True, slots=True)
class TokenRecord:
    """A bearer token of a script, or a one-time sign-in of a person."""

    id: str
    name: str
    role: str
    one_time: bool
    created_at: datetime
    expires_at: datetime
    used_at: datetime | None
    revoked_at: datetime | None


def count_people(session: Session) -> int:
    """Return how many people exist; 0 means that the station was never set up."""
    return session.scalars(select(func.count()).select_from(Person)).one()


def add_person(
    session: Session, name: str, role: str, password_hash: str | None, at: datetime
) -> PersonRecord:
    """Add a person.

    Raises:
        PersonExistsError: If the name is taken.
    """
    if session.scalar(select(Person.key).where(Person.name == name)) is not None:
        raise PersonExistsError(f"There is a person {name!r} already.")
    row = Person(name=name, role=role, password_hash=password_hash, created_at=at)
    session.add(row)
    session.flush()
    return _person(row)


def find_person(session: Session, name: str, *, held: bool = False) -> PersonRecord | None:
    """Return the person of this name, if there is one.

    Where ``held``, nobody changes that person until the transaction ends.
    """
    statement = select(Person).where(Person.name == name)
    row = session.scalar(statement.with_for_update() if held else statement)
    return None if row is None else _person(row)


def list_people(session: Session) -> list[PersonRecord]:
    """Return everyone in the order in which they were added."""
    return [_person(row) for row in session.scalars(select(Person).order_by(Person.key))]


def change_person(
    session: Session,
    name: str,
    *,
    role: str | None = None,
    password_hash: str | None = None,
    disabled: bool | None = None,
    at: datetime,
) -> PersonRecord:
    """Change what is given; every session of the person ends, so that the change holds at once.

    Raises:
        UnknownIdError: If there is no such person.
    """
    row = session.scalar(select(Person).where(Person.name == name))
    if row is None:
        raise UnknownIdError("person", name)
    if role is not None:
        row.role = role
    if password_hash is not None:
        row.password_hash = password_hash
    if disabled is not None:
        row.disabled_at = at if disabled else None
    session.execute(
        delete(person_tables.Session).where(person_tables.Session.person_key == row.key)
    )
    session.flush()
    return _person(row)


def add_session(
    session: Session,
    person: str,
    *,
    secret_hash: str,
    csrf_token: str,
    at: datetime,
    expires_at: datetime,
) -> None:
    """Add a session of a person, and forget those that have expired.

    Raises:
        UnknownIdError: If there is no such person.
    """
    key = session.scalar(select(Person.key).where(Person.name == person))
    if key is None:
        raise UnknownIdError("person", person)
    session.execute(delete(person_tables.Session).where(person_tables.Session.expires_at <= at))
    session.add(
        person_tables.Session(
            secret_hash=secret_hash,
            csrf_token=csrf_token,
            person_key=key,
            created_at=at,
            expires_at=expires_at,
        )
    )


def find_session(session: Session, secret_hash: str, at: datetime) -> SessionRecord | None:
    """Return the session of this secret, unless it expired or its person was disabled."""
    found = session.execute(
        select(person_tables.Session, Person)
        .join(Person, person_tables.Session.person_key == Person.key)
        .where(
            person_tables.Session.secret_hash == secret_hash,
            person_tables.Session.expires_at > at,
            Person.disabled_at.is_(None),
        )
    ).one_or_none()
    if found is None:
        return None
    row, person = found
    return SessionRecord(_person(person), row.csrf_token, row.expires_at)


def has_expired(session: Session, at: datetime) -> bool:
    """Tell whether a session, token or sign-in has expired that ``end_expired`` would end."""
    row = person_tables.Session
    sessions = select(row.key).where(row.expires_at <= at).limit(1)
    tokens = select(Token.key).where(Token.expires_at <= at, Token.revoked_at.is_(None)).limit(1)
    return any(session.scalar(one) is not None for one in (sessions, tokens))


def end_expired(session: Session, at: datetime) -> None:
    """End for good what has expired, whatever the clock will say later."""
    session.execute(delete(person_tables.Session).where(person_tables.Session.expires_at <= at))
    session.execute(
        update(Token)
        .where(Token.expires_at <= at, Token.revoked_at.is_(None))
        .values(revoked_at=at)
    )


def end_session(session: Session, secret_hash: str) -> None:
    """End the session of this secret."""
    session.execute(
        delete(person_tables.Session).where(person_tables.Session.secret_hash == secret_hash)
    )


def add_token(
    session: Session,
    name: str,
    role: str,
    *,
    secret_hash: str,
    at: datetime,
    expires_at: datetime,
    person: str | None = None,
) -> TokenRecord:
    """Add a bearer token, or, where ``person`` is given, a one-time sign-in of that person.

    Raises:
        UnknownIdError: If there is no such person.
    """
    key = None
    if person is not None:
        key = session.scalar(select(Person.key).where(Person.name == person))
        if key is None:
            raise UnknownIdError("person", person)
    row = Token(
        secret_hash=secret_hash,
        name=name,
        role=role,
        person_key=key,
        one_time=person is not None,
        created_at=at,
        expires_at=expires_at,
    )
    session.add(row)
    session.flush()
    return _token(row)


def find_token(session: Session, secret_hash: str, at: datetime) -> TokenRecord | None:
    """Return the bearer token of this secret, unless it expired or was revoked."""
    row = session.scalar(
        select(Token).where(
            Token.secret_hash == secret_hash,
            Token.one_time.is_(False),
            Token.expires_at > at,
            Token.revoked_at.is_(None),
        )
    )
    return None if row is None else _token(row)


def use_one_time_token(session: Session, secret_hash: str, at: datetime) -> PersonRecord | None:
    """Use a one-time sign-in up and return its person; ``None`` if it is not valid any more."""
    found = session.execute(
        select(Token, Person)
        .join(Person, Token.person_key == Person.key)
        .where(
            Token.secret_hash == secret_hash,
            Token.one_time.is_(True),
            Token.expires_at > at,
            Token.used_at.is_(None),
            Token.revoked_at.is_(None),
            Person.disabled_at.is_(None),
        )
    ).one_or_none()
    if found is None:
        return None
    token, person = found
    token.used_at = at
    return _person(person)


def list_tokens(session: Session) -> list[TokenRecord]:
    """Return every bearer token, the newest first."""
    rows = session.scalars(
        select(Token).where(Token.one_time.is_(False)).order_by(Token.key.desc())
    )
    return [_token(row) for row in rows]


def revoke_token(session: Session, token: str, at: datetime) -> None:
    """Revoke a bearer token; doing so twice keeps the first moment.

    Raises:
        UnknownIdError: If there is no such token.
    """
    key = key_of("token", token)
    if session.get(Token, key) is None:
        raise UnknownIdError("token", token)
    session.execute(
        update(Token).where(Token.key == key, Token.revoked_at.is_(None)).values(revoked_at=at)
    )


def _person(row: Person) -> PersonRecord:
    return PersonRecord(row.name, row.role, row.password_hash, row.created_at, row.disabled_at)


def _token(row: Token) -> TokenRecord:
    return same(TokenRecord, row, id=public_id("token", row.key))
