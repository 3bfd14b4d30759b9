"""Who may do what: people and the bearer tokens of scripts."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final

from fastapi import APIRouter
from pydantic import Field
from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.query.station import people as query
from db.query.station.grants import GrantRecord, Holder, grants_of, list_grants
from db.query.station.people import PersonRecord, TokenRecord
from db.record import same
from server.access import register
from server.access.caller import Caller, holder_of
from server.access.dependency import AccessDep, Admin
from server.access.grant import GrantBody, GrantView, records_of, views_of
from server.access.role import Role, higher
from server.access.secret import NewPassword
from server.base.dependency import ClockDep, StoreDep
from server.base.problem import conflict
from server.base.text import Name
from server.base.view import Body, View

router = APIRouter(tags=["people"])
GRANTS_MAX: Final = 100


class PersonBody(Body):
    """A new person."""

    name: Name
    """Name by which the person signs in."""
    role: Role
    """For all robots, those to come too; ``none`` where the grants say all."""
    password: NewPassword
    grants: list[GrantBody] = Field(default_factory=list[GrantBody], max_length=GRANTS_MAX)
    """More for chosen robots and groups."""


class PersonPatch(Body):
    """What changes about a person; their sessions end with all but grants."""

    role: Role | None = None
    """What the person may do with every robot."""
    password: NewPassword | None = None
    """A new password; left out, the old one stays."""
    disabled: bool | None = None
    """Whether the person may not sign in any more."""
    grants: list[GrantBody] | None = Field(default=None, max_length=GRANTS_MAX)
    """In the place of all that they have for chosen robots and groups."""
    seen_grants: list[GrantBody] | None = Field(default=None, max_length=GRANTS_MAX)
    """What they had when somebody looked; 409 where that is not so any more."""
    confirm: bool = False
    """Say so to lower one's own rights."""


class TokenBody(Body):
    """A new bearer token."""

    name: Name
    """What the token is for; it stands in the log as who did something."""
    role: Role
    """For all robots; ``none`` where the grants say all."""
    grants: list[GrantBody] = Field(default_factory=list[GrantBody], max_length=GRANTS_MAX)
    """More for chosen robots and groups."""
    days: float = Field(default=30.0, gt=0, le=3650)
    """How long it is valid."""


@dataclass(frozen=True, slots=True)
class PersonView(View):
    """Someone who may sign in."""

    name: str
    role: Role
    created_at: datetime
    disabled: bool
    grants: list[GrantView]


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
    grants: list[GrantView]
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

    def views(session: Session) -> list[PersonView]:
        grants = list_grants(session)
        return [
            _person(person, grants.get(Holder(person=person.key), []))
            for person in query.list_people(session)
        ]

    return PeopleView(await store.query(views))


@router.post("/api/people", status_code=201)
async def add_person(
    caller: Admin, body: PersonBody, access: AccessDep, store: StoreDep, clock: ClockDep
) -> PersonView:
    """Add a person."""
    password_hash = await access.password_hash(body.password.get_secret_value())
    at, grants = clock.now(), records_of(body.grants)
    person = await store.write(
        lambda session: register.add_person(
            session, body.name, body.role, password_hash, grants=grants, at=at, by=caller.name
        )
    )
    return _person(person, grants)


@router.patch("/api/people/{name}")
async def change_person(
    caller: Admin,
    name: str,
    body: PersonPatch,
    access: AccessDep,
    store: StoreDep,
    clock: ClockDep,
) -> PersonView:
    """Change a person's role, password or grants, or take the door away.

    409 where one would lower one's own rights without ``confirm``.
    """
    _ask_before_own_loss(caller, name, body)
    password_hash = None
    if body.password is not None:
        password_hash = await access.password_hash(body.password.get_secret_value())
    at = clock.now()
    seen = None if body.seen_grants is None else records_of(body.seen_grants)

    def write(session: Session) -> PersonView:
        person = register.change_person(
            session,
            name,
            role=body.role,
            password_hash=password_hash,
            disabled=body.disabled,
            grants=None if body.grants is None else records_of(body.grants),
            seen_grants=seen,
            at=at,
            by=caller.name,
        )
        return _person(person, grants_of(session, Holder(person=person.key)))

    return await store.write(write)


@router.get("/api/tokens")
async def list_tokens(caller: Admin, store: StoreDep) -> TokensView:
    """Return every bearer token, the newest first."""
    del caller

    def views(session: Session) -> list[TokenView]:
        grants = list_grants(session)
        return [
            _token(token, grants.get(holder_of(token), [])) for token in query.list_tokens(session)
        ]

    return TokensView(await store.query(views))


@router.post("/api/tokens", status_code=201)
async def create_token(
    caller: Admin, body: TokenBody, store: StoreDep, clock: ClockDep
) -> NewTokenView:
    """Create a bearer token for a script."""
    at = clock.now()
    issued = await store.write(
        lambda session: register.create_token(
            session,
            body.name,
            body.role,
            timedelta(days=body.days),
            grants=records_of(body.grants),
            at=at,
            by=caller.name,
        )
    )
    return NewTokenView(issued.token.id, issued.secret, issued.token.expires_at)


@router.delete("/api/tokens/{token}", status_code=204)
async def revoke_token(caller: Admin, token: str, store: StoreDep, clock: ClockDep) -> None:
    """Revoke a bearer token at once."""
    at = clock.now()
    if not token.startswith("token-"):
        raise UnknownIdError("token", token)
    await store.write(lambda session: register.revoke_token(session, token, at=at, by=caller.name))


def _ask_before_own_loss(caller: Caller, name: str, body: PersonPatch) -> None:
    """Refuse what would lower the caller's own rights, unless they say that they mean it."""
    if body.confirm or caller.name != name or caller.proof.kind != "session":
        return
    if body.disabled:
        raise conflict("You would shut yourself out; send `confirm` if you mean it.")
    if body.role is not None and higher(body.role, caller.role) != body.role:
        text = f"You would be a {body.role} and no {caller.role} any more"
        raise conflict(f"{text}; another administrator must undo it. Send `confirm` to do it.")


def _person(person: PersonRecord, grants: Sequence[GrantRecord]) -> PersonView:
    return same(
        PersonView,
        person,
        role=Role(person.role),
        disabled=person.disabled_at is not None,
        grants=views_of(grants),
    )


def _token(token: TokenRecord, grants: Sequence[GrantRecord]) -> TokenView:
    return same(TokenView, token, role=Role(token.role), grants=views_of(grants))
