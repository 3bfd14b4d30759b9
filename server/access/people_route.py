"""Who may do what: people and the bearer tokens of scripts."""

from dataclasses import dataclass, field
from datetime import datetime, timedelta

from fastapi import APIRouter
from pydantic import Field

from db.query.station import people as query
from db.query.station.people import PersonRecord, TokenRecord
from server.access import register
from server.access.dependency import AccessDep, Admin
from server.access.role import Role
from server.access.secret import NewPassword
from server.base.dependency import ClockDep, StoreDep
from server.base.text import Name
from server.base.view import Body, View

router = APIRouter(tags=["people"])


class PersonBody(Body):
    """A new person."""

    name: Name
    role: Role
    password: NewPassword


class PersonPatch(Body):
    """What changes about a person; their sessions end with it."""

    role: Role | None = None
    password: NewPassword | None = None
    disabled: bool | None = None


class TokenBody(Body):
    """A new bearer token."""

    name: Name
    """What the token is for; it stands in the log as who did something."""
    role: Role
    days: float = Field(default=30.0, gt=0, le=3650)
    """How long it is valid."""


@dataclass(frozen=True, slots=True)
class PersonView(View):
    """Someone who may sign in."""

    name: str
    role: Role
    created_at: datetime
    disabled: bool


@dataclass(frozen=True, slots=True)
class PeopleView(View):
    """Everyone who may sign in."""

    people: list[PersonView]


@dataclass(frozen=True, slots=True)
class TokenView(View):
    """A bearer token, without its secret."""

    id: str
    name: str
    role: Role
    created_at: datetime
    expires_at: datetime
    revoked_at: datetime | None


@dataclass(frozen=True, slots=True)
class TokensView(View):
    """Every bearer token, the newest first."""

    tokens: list[TokenView]


@dataclass(frozen=True, slots=True)
class NewTokenView(View):
    """A fresh bearer token; its secret is shown here and never again."""

    id: str
    token: str = field(repr=False)
    expires_at: datetime


@router.get("/api/people")
async def list_people(caller: Admin, store: StoreDep) -> PeopleView:
    """Return everyone who may sign in."""
    del caller
    people = await store.query(query.list_people)
    return PeopleView([_person(person) for person in people])


@router.post("/api/people", status_code=201)
async def add_person(
    caller: Admin, body: PersonBody, access: AccessDep, store: StoreDep, clock: ClockDep
) -> PersonView:
    """Add a person."""
    password_hash = await access.password_hash(body.password.get_secret_value())
    at = clock.now()
    person = await store.write(
        lambda session: register.add_person(
            session, body.name, body.role, password_hash, at=at, by=caller.name
        )
    )
    return _person(person)


@router.patch("/api/people/{name}")
async def change_person(
    caller: Admin,
    name: str,
    body: PersonPatch,
    access: AccessDep,
    store: StoreDep,
    clock: ClockDep,
) -> PersonView:
    """Change a person's role or password, or take the door away; their sessions end."""
    password_hash = None
    if body.password is not None:
        password_hash = await access.password_hash(body.password.get_secret_value())
    at = clock.now()
    person = await store.write(
        lambda session: register.change_person(
            session,
            name,
            role=body.role,
            password_hash=password_hash,
            disabled=body.disabled,
            at=at,
            by=caller.name,
        )
    )
    return _person(person)


@router.get("/api/tokens")
async def list_tokens(caller: Admin, store: StoreDep) -> TokensView:
    """Return every bearer token, the newest first."""
    del caller
    tokens = await store.query(query.list_tokens)
    return TokensView([_token(token) for token in tokens])


@router.post("/api/tokens", status_code=201)
async def create_token(
    caller: Admin, body: TokenBody, store: StoreDep, clock: ClockDep
) -> NewTokenView:
    """Create a bearer token for a script."""
    at = clock.now()
    issued = await store.write(
        lambda session: register.create_token(
            session, body.name, body.role, timedelta(days=body.days), at=at, by=caller.name
        )
    )
    return NewTokenView(issued.token.id, issued.secret, issued.token.expires_at)


@router.delete("/api/tokens/{token}", status_code=204)
async def revoke_token(caller: Admin, token: str, store: StoreDep, clock: ClockDep) -> None:
    """Revoke a bearer token at once."""
    at = clock.now()
    await store.write(lambda session: register.revoke_token(session, token, at=at, by=caller.name))


def _person(person: PersonRecord) -> PersonView:
    return PersonView(
        person.name, Role(person.role), person.created_at, person.disabled_at is not None
    )


def _token(token: TokenRecord) -> TokenView:
    return TokenView(
        token.id, token.name, Role(token.role), token.created_at, token.expires_at, token.revoked_at
    )
