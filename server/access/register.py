"""People and tokens: each change with its entry in the log, in one transaction.

Used by the routes and, on a data folder without a station, by the command line. ``at`` is the
moment for the log; how long a secret is valid is measured on the wall's clock.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from db.identity import key_of
from db.query.station import grants as grant_query
from db.query.station import people as query
from db.query.station.events import add_event
from db.query.station.grants import GrantRecord, Holder
from db.query.station.people import PersonRecord, TokenRecord
from server.access.grant import words_of
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
    session: Session,
    name: str,
    role: Role,
    password_hash: str | None,
    *,
    grants: Sequence[GrantRecord] = (),
    at: datetime,
    by: str,
) -> PersonRecord:
    """Add a person.

    Raises:
        Problem: 409 if the name is taken, 422 if it is none.
        UnknownIdError: If there is no such robot or group.
    """
    _check(name)
    try:
        person = query.add_person(session, name, role, password_hash, at)
    except query.PersonExistsError as error:
        raise conflict(str(error)) from error
    grant_query.set_grants(session, Holder(person=person.key), grants)
    text = f"{by} added {name} as {words_of(role, grants)}."
    add_event(session, at, "person.created", text)
    return person


def change_person(
    session: Session,
    name: str,
    *,
    role: Role | None = None,
    password_hash: str | None = None,
    disabled: bool | None = None,
    grants: Sequence[GrantRecord] | None = None,
    seen_grants: Sequence[GrantRecord] | None = None,
    at: datetime,
    by: str,
) -> PersonRecord:
    """Change what is given; the person's sessions end, unless only grants change.

    Args:
        session: The transaction.
        name: Who.
        role: For all robots.
        password_hash: Of a new password.
        disabled: Whether they are shut out.
        grants: In the place of all that they have for chosen robots and groups.
        seen_grants: What stood there when that was asked for, where somebody looked.
        at: The moment, for the log.
        by: Who changes it.

    Raises:
        Problem: 409 if it takes away the last person who can administer the station, or where the
            grants are not those that were seen.
        UnknownIdError: If there is no such person, robot or group.
    """
    had_administrator = _has_administrator(session)
    person = query.change_person(
        session, name, role=role, password_hash=password_hash, disabled=disabled, at=at
    )
    if had_administrator and not _has_administrator(session):
        raise conflict(f"{name} is the last administrator; make another one first.")
    text = f"{by} changed {name}."
    if grants is not None:
        holder = Holder(person=person.key)
        if seen_grants is not None and grant_query.grants_of(session, holder) != list(seen_grants):
            raise conflict(f"The rights of {name} were changed meanwhile; look at them again.")
        grant_query.set_grants(session, holder, grants)
        text = f"{by} changed {name}, who is now {words_of(person.role, grants)}."
    add_event(session, at, "person.changed", text)
    return person


def create_token(
    session: Session,
    name: str,
    role: Role,
    lifetime: timedelta,
    *,
    grants: Sequence[GrantRecord] = (),
    at: datetime,
    by: str,
) -> IssuedToken:
    """Create a bearer token for a script.

    Raises:
        Problem: 422 if its name is none.
        UnknownIdError: If there is no such robot or group.
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
    grant_query.set_grants(session, Holder(token=key_of("token", token.id)), grants)
    text = f"{by} created {token.id} ({name}) as {words_of(role, grants)}."
    add_event(session, at, "token.created", text)
    return IssuedToken(secret, token)


def create_link(
    session: Session,
    name: str,
    shown: Sequence[GrantRecord],
    lifetime: timedelta,
    *,
    at: datetime,
    by: str,
) -> IssuedToken:
    """Create a read-only link for whoever gets it.

    Args:
        session: The transaction.
        name: What it is for.
        shown: The robots and groups that it shows.
        lifetime: How long it is valid.
        at: The moment, for the log.
        by: Who makes it.

    Raises:
        Problem: 422 if its name is none.
        UnknownIdError: If there is no such robot or group.
    """
    _check(name)
    secret, wall = new_secret(), datetime.now(UTC)
    link = query.add_token(
        session,
        name,
        Role.NONE,
        secret_hash=secret_hash(secret),
        at=wall,
        expires_at=wall + lifetime,
        is_link=True,
    )
    grant_query.set_grants(session, Holder(token=key_of("link", link.id)), shown)
    robots = ", ".join(one.robot or f"the group {one.group}" for one in shown)
    text = f"{by} created {link.id} ({name}), which shows {robots}."
    add_event(session, at, "link_access.created", text)
    return IssuedToken(secret, link)


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
    """Revoke a bearer token or a read-only link at once.

    Raises:
        UnknownIdError: If there is no such token.
    """
    query.revoke_token(session, token, datetime.now(UTC))
    kind = "link_access" if token.startswith("link-") else "token"
    add_event(session, at, f"{kind}.revoked", f"{by} revoked {token}.")


def put_group(
    session: Session,
    name: str,
    robots: Sequence[str],
    *,
    seen: Sequence[str] | None = None,
    at: datetime,
    by: str,
) -> None:
    """Let a group have these robots; it is made if there is none of this name.

    Raises:
        Problem: 409 where its robots are not those that were seen, 422 if its name is none.
        UnknownIdError: If there is no such robot.
    """
    _check(name)
    groups = {group.name: set(group.robots) for group in grant_query.list_groups(session)}
    if seen is not None and groups.get(name, set()) != set(seen):
        raise conflict(f"The group {name} was changed meanwhile; look at it again.")
    grant_query.put_group(session, name, robots)
    text = f"{by} let the group {name} have {', '.join(robots) or 'no robot'}."
    add_event(session, at, "group.changed", text)


def remove_group(session: Session, name: str, *, at: datetime, by: str) -> None:
    """Remove a group.

    Raises:
        Problem: 409 if somebody has a right by it.
        UnknownIdError: If there is none of this name.
    """
    try:
        grant_query.remove_group(session, name)
    except grant_query.GroupInUseError as error:
        raise conflict(str(error)) from error
    add_event(session, at, "group.removed", f"{by} removed the group {name}.")


def _has_administrator(session: Session) -> bool:
    """Tell whether some person can administer the station; scripts do not count."""
    people = query.list_people(session)
    return any(one.role == Role.ADMIN and one.disabled_at is None for one in people)


def _check(name: str) -> None:
    try:
        checked(name)
    except ValueError as error:
        sentence = f"The name {error}."
        raise unprocessable(sentence, [FieldError(loc=["name"], msg=str(error))]) from error
