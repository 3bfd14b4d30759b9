"""Who may do what: people, their sessions, and the tokens of scripts.

Secrets never reach the database: sessions and tokens are found by the hash of theirs.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from datetime import datetime

from sqlalchemy import Select, delete, func, or_, select, update
from sqlalchemy.orm import Session

from db import person_tables
from db.fault import StoreError, UnknownIdError
from db.identity import key_of, public_id
from db.person_tables import Person, PersonIdentity, Token
from db.query.station.grants import Holder
from db.record import same


class PersonExistsError(StoreError):
    """Another person has this name already."""


@dataclass(frozen=True, slots=True)
class PersonRecord:
    """Someone who may sign in."""

    key: int
    name: str
    role: str
    """For all robots; what more they may do with chosen ones is a grant."""
    password_hash: str | None
    """Without a hash the person signs in by one-time tokens only."""
    created_at: datetime
    disabled_at: datetime | None


@dataclass(frozen=True, slots=True)
class SessionRecord:
    """A browser that signed in: of a person, or of nobody by a read-only link."""

    id: str
    secret_hash: str
    person: PersonRecord | None
    link: "TokenRecord | None"
    csrf_token: str = field(repr=False)
    created_at: datetime
    expires_at: datetime
    address: str
    """Of the machine that it came from."""
    browser: str
    """What it called itself."""
    seen_at: datetime | None


@dataclass(frozen=True, slots=True)
class TokenRecord:
    """A bearer token of a script, a one-time sign-in of a person, or a read-only link."""

    id: str
    name: str
    role: str
    one_time: bool
    is_link: bool
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


def person_of_identity(session: Session, issuer: str, subject: str) -> PersonRecord | None:
    """Return the person whom a provider of OpenID Connect knows as this subject."""
    row = session.scalar(
        select(Person)
        .join(PersonIdentity, PersonIdentity.person_key == Person.key)
        .where(PersonIdentity.issuer == issuer, PersonIdentity.subject == subject)
    )
    return None if row is None else _person(row)


def add_identity(session: Session, person: PersonRecord, issuer: str, subject: str) -> None:
    """Let a subject of a provider be a person."""
    session.add(PersonIdentity(person_key=person.key, issuer=issuer, subject=subject))
    session.flush()


def change_person(
    session: Session,
    name: str,
    *,
    role: str | None = None,
    password_hash: str | None = None,
    disabled: bool | None = None,
    at: datetime,
) -> PersonRecord:
    """Change what is given; if anything is, every session of the person ends.

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
    if not (role is None and password_hash is None and disabled is None):
        session.execute(
            delete(person_tables.Session).where(person_tables.Session.person_key == row.key)
        )
    session.flush()
    return _person(row)


def add_session(
    session: Session,
    holder: Holder,
    *,
    secret_hash: str,
    csrf_token: str,
    at: datetime,
    expires_at: datetime,
    address: str = "",
    browser: str = "",
) -> None:
    """Add a session of a person or of a read-only link, and forget those that have expired."""
    session.execute(delete(person_tables.Session).where(person_tables.Session.expires_at <= at))
    session.add(
        person_tables.Session(
            secret_hash=secret_hash,
            csrf_token=csrf_token,
            person_key=holder.person,
            token_key=holder.token,
            created_at=at,
            expires_at=expires_at,
            address=address,
            browser=browser,
            seen_at=at,
        )
    )


def find_sessions(
    session: Session, secret_hashes: Collection[str], at: datetime
) -> dict[str, SessionRecord]:
    """Return the sessions of many secrets by their hashes, in one read.

    One that has ended is left out, and so is one that came in by what has ended.
    """
    statement = _sessions(at).where(person_tables.Session.secret_hash.in_(secret_hashes))
    return {row[0].secret_hash: _session(*row) for row in session.execute(statement)}


def list_sessions(session: Session, at: datetime, person: str | None = None) -> list[SessionRecord]:
    """Return the sessions that hold, the newest first: everybody's, or those of a person."""
    statement = _sessions(at).order_by(person_tables.Session.key.desc())
    if person is not None:
        statement = statement.where(Person.name == person)
    return [_session(*row) for row in session.execute(statement)]


def note_seen(session: Session, seen: Mapping[str, datetime]) -> None:
    """Note when sessions were seen last, by the hashes of their secrets."""
    row = person_tables.Session
    for digest, at in seen.items():
        session.execute(update(row).where(row.secret_hash == digest).values(seen_at=at))
    links = select(row.token_key).where(row.secret_hash.in_(seen), row.token_key.is_not(None))
    newest = max(seen.values(), default=None)
    session.execute(update(Token).where(Token.key.in_(links)).values(used_at=newest))


def end_session_of_id(session: Session, identity: str, person: str | None) -> SessionRecord:
    """End one session; of this person only, where one is given.

    Raises:
        UnknownIdError: If there is none.
    """
    key = key_of("session", identity)
    row = session.get(person_tables.Session, key)
    owner = None if row is None or row.person_key is None else session.get(Person, row.person_key)
    if row is None or (person is not None and (owner is None or owner.name != person)):
        raise UnknownIdError("session", identity)
    link = None if row.token_key is None else session.get(Token, row.token_key)
    record = _session(row, owner, link)
    session.delete(row)
    return record


def end_sessions_of(session: Session, person: str, but: str) -> int:
    """End every session of a person but the one of this secret's hash; return how many."""
    row = person_tables.Session
    ended = session.scalars(
        delete(row)
        .where(
            row.person_key == select(Person.key).where(Person.name == person).scalar_subquery(),
            row.secret_hash != but,
        )
        .returning(row.key)
    )
    return len(ended.all())


def _sessions(at: datetime) -> Select[person_tables.Session, Person, Token]:
    """Return a query for the sessions that hold, with what each came in by."""
    row = person_tables.Session
    return (
        select(row, Person, Token)
        .outerjoin(Person, row.person_key == Person.key)
        .outerjoin(Token, row.token_key == Token.key)
        .where(
            row.expires_at > at,
            Person.disabled_at.is_(None),
            or_(
                row.token_key.is_(None),
                (Token.revoked_at.is_(None) & (Token.expires_at > at)),
            ),
        )
    )


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
    is_link: bool = False,
) -> TokenRecord:
    """Add a bearer token, a read-only link, or, of a ``person``, their one-time sign-in.

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
        is_link=is_link,
        created_at=at,
        expires_at=expires_at,
    )
    session.add(row)
    session.flush()
    return _token(row)


def find_token(session: Session, secret_hash: str, at: datetime) -> TokenRecord | None:
    """Return the bearer token of this secret, unless it expired or was revoked."""
    return find_tokens(session, (secret_hash,), at).get(secret_hash)


def find_link(session: Session, secret_hash: str, at: datetime) -> TokenRecord | None:
    """Return the read-only link of this secret, unless it expired or was revoked."""
    return find_tokens(session, (secret_hash,), at, are_links=True).get(secret_hash)


def find_tokens(
    session: Session, secret_hashes: Collection[str], at: datetime, *, are_links: bool = False
) -> dict[str, TokenRecord]:
    """Return the bearer tokens, or the links, of many secrets by their hashes, in one read."""
    rows = session.scalars(
        select(Token).where(
            Token.secret_hash.in_(secret_hashes),
            Token.one_time.is_(False),
            Token.is_link.is_(are_links),
            Token.expires_at > at,
            Token.revoked_at.is_(None),
        )
    )
    return {row.secret_hash: _token(row) for row in rows}


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


def list_tokens(session: Session, *, are_links: bool = False) -> list[TokenRecord]:
    """Return every bearer token, or every read-only link, the newest first."""
    rows = session.scalars(
        select(Token)
        .where(Token.one_time.is_(False), Token.is_link.is_(are_links))
        .order_by(Token.key.desc())
    )
    return [_token(row) for row in rows]


def revoke_token(session: Session, token: str, at: datetime) -> None:
    """Revoke a bearer token or a read-only link; doing so twice keeps the first moment.

    Raises:
        UnknownIdError: If there is no such token or link.
    """
    kind = token.partition("-")[0]
    key = key_of("link" if kind == "link" else "token", token)
    row = session.get(Token, key)
    if row is None or row.is_link != (kind == "link"):
        raise UnknownIdError(kind, token)
    session.execute(
        update(Token).where(Token.key == key, Token.revoked_at.is_(None)).values(revoked_at=at)
    )


def _person(row: Person) -> PersonRecord:
    return same(PersonRecord, row)


def _session(
    row: person_tables.Session, person: Person | None, link: Token | None
) -> SessionRecord:
    return same(
        SessionRecord,
        row,
        id=public_id("session", row.key),
        person=None if person is None else _person(person),
        link=None if link is None else _token(link),
    )


def _token(row: Token) -> TokenRecord:
    return same(TokenRecord, row, id=public_id("link" if row.is_link else "token", row.key))
