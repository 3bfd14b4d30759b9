"""People and tokens: each change with its entry in the log, in one transaction.

Used by the routes and, on a data folder without a station, by the command line. ``at`` is the
moment for the log; how long a secret is valid is measured on the wall's clock.
"""

from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from db.query.station import people as query
from db.query.station.events import add_event
from db.query.station.people import PersonRecord, TokenRecord
from server.access.role import Role
from server.access.secret import new_secret, secret_hash
from server.base.problem import FieldError, conflict, unprocessable
from server.base.text import checked


@dataclass(frozen=True, slots=True)
class IssuedToken:
    """A fresh token with its secret, which is kept nowhere."""

    secret: str = field(repr=False)
    token: TokenRecord


def add_person(
    session: Session, name: str, role: Role, password_hash: str | None, *, at: datetime, by: str
) -> PersonRecord:
    """Add a person.

    Raises:
        Problem: 409 if the name is taken, 422 if it is none.
    """
    _check(name)
    try:
        person = query.add_person(session, name, role, password_hash, at)
    except query.PersonExistsError as error:
        raise conflict(str(error)) from error
    add_event(session, at, "person.created", f"{by} added {name} as {role}.")
    return person


def change_person(
    session: Session,
    name: str,
    *,
    role: Role | None = None,
    password_hash: str | None = None,
    disabled: bool | None = None,
    at: datetime,
    by: str,
) -> PersonRecord:
    """Change what is given; the person's sessions end.

    Raises:
        Problem: 409 if nobody could administer the station afterwards.
        UnknownIdError: If there is no such person.
    """
    person = query.change_person(
        session, name, role=role, password_hash=password_hash, disabled=disabled, at=at
    )
    if not any(
        other.role == Role.ADMIN for other in query.list_people(session) if not other.disabled_at
    ):
        raise conflict(f"{name} is the last administrator; make another one first.")
    add_event(session, at, "person.changed", f"{by} changed {name}.")
    return person


def create_token(
    session: Session, name: str, role: Role, lifetime: timedelta, *, at: datetime, by: str
) -> IssuedToken:
    """Create a bearer token for a script.

    Raises:
        Problem: 422 if its name is none.
    """
    _check(name)
    secret, wall = new_secret(), datetime.now(UTC)
    token = query.add_token(
        session,
        name,
        role,
        secret_hash=secret_hash(secret),
        at=wall,
        expires_at=wall + lifetime,
    )
    add_event(session, at, "token.created", f"{by} created {token.id} ({name}) as {role}.")
    return IssuedToken(secret, token)


def create_sign_in_link(
    session: Session, person: str, lifetime: timedelta, *, at: datetime, by: str
) -> IssuedToken:
    """Create a one-time sign-in of a person.

    Raises:
        UnknownIdError: If there is no such person.
    """
    secret, wall = new_secret(), datetime.now(UTC)
    token = query.add_token(
        session,
        f"sign-in of {person}",
        "",
        secret_hash=secret_hash(secret),
        at=wall,
        expires_at=wall + lifetime,
        person=person,
    )
    add_event(session, at, "token.created", f"{by} created a one-time sign-in of {person}.")
    return IssuedToken(secret, token)


def revoke_token(session: Session, token: str, *, at: datetime, by: str) -> None:
    """Revoke a bearer token at once.

    Raises:
        UnknownIdError: If there is no such token.
    """
    query.revoke_token(session, token, datetime.now(UTC))
    add_event(session, at, "token.revoked", f"{by} revoked {token}.")


def _check(name: str) -> None:
    try:
        checked(name)
    except ValueError as error:
        sentence = f"The name {error}."
        raise unprocessable(sentence, [FieldError(loc=["name"], msg=str(error))]) from error
