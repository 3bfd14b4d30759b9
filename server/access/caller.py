"""Who asks, by what they came in, and what they may do: read together, in one look."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal

from sqlalchemy.orm import Session

from db.identity import key_of
from db.query.station.grants import Holder, robot_roles
from db.query.station.people import (
    SessionRecord,
    TokenRecord,
    find_person,
    find_sessions,
    find_tokens,
)
from server.access.role import Right, Rights, Role


@dataclass(frozen=True, slots=True)
class Proof:
    """By what somebody came in, so that it can be looked at again."""

    kind: Literal["session", "token"]
    digest: str
    """Hash of the secret."""


@dataclass(frozen=True, slots=True)
class Caller:
    """Who asks, once it is proved."""

    name: str
    rights: Rights
    expires_at: datetime
    csrf_token: str | None = field(repr=False)
    """The token that a browser's changes must carry; a script with a bearer token has none."""
    proof: Proof
    is_link: bool = False
    """Whether it is nobody by name, who came by a read-only link."""

    @property
    def role(self) -> Role:
        """What the caller is to the station as a whole."""
        return self.rights.for_all


@dataclass(frozen=True, slots=True)
class Browser:
    """Where a sign-in comes from."""

    host: str | None = None
    name: str = ""
    """What it calls itself."""


def callers_of(session: Session, proofs: Collection[Proof], at: datetime) -> dict[Proof, Caller]:
    """Return whose each proof is, with their rights; those that are worth nothing are left out."""
    sessions = [proof.digest for proof in proofs if proof.kind == "session"]
    tokens = [proof.digest for proof in proofs if proof.kind == "token"]
    found: dict[Proof, SessionRecord | TokenRecord] = {}
    if sessions:
        held = find_sessions(session, sessions, at)
        found |= {Proof("session", digest): record for digest, record in held.items()}
    if tokens:
        known = find_tokens(session, tokens, at)
        found |= {Proof("token", digest): record for digest, record in known.items()}
    roles = robot_roles(session, {holder_of(record) for record in found.values()})
    return {
        proof: _caller(proof, record, roles[holder_of(record)]) for proof, record in found.items()
    }


def may_pilot(session: Session, name: str, robot: str | None) -> bool:
    """Tell whether a person may pilot a robot, or the whole station, by their role or a grant."""
    person = find_person(session, name)
    if person is None or person.disabled_at is not None:
        return False
    holder = Holder(person=person.key)
    rights = Rights.of(person.role, robot_roles(session, [holder])[holder])
    return rights.may(Right.PILOT, robot)


def holder_of(record: SessionRecord | TokenRecord) -> Holder:
    """Return whose grants hold for a session or a token."""
    if isinstance(record, TokenRecord):
        return Holder(token=key_of("link" if record.is_link else "token", record.id))
    if record.person is not None:
        return Holder(person=record.person.key)
    return holder_of(_link_of(record))


def _caller(
    proof: Proof, record: SessionRecord | TokenRecord, roles: Iterable[tuple[str, str]]
) -> Caller:
    if isinstance(record, TokenRecord):
        rights = Rights.of(record.role, roles)
        return Caller(record.name, rights, record.expires_at, None, proof)
    if record.person is not None:
        rights = Rights.of(record.person.role, roles)
        name = record.person.name
        return Caller(name, rights, record.expires_at, record.csrf_token, proof)
    link = _link_of(record)
    rights = Rights.of(link.role, roles)
    return Caller(link.name, rights, record.expires_at, record.csrf_token, proof, is_link=True)


def _link_of(record: SessionRecord) -> TokenRecord:
    if record.link is None:
        raise LookupError(f"{record.id} is neither a person's nor a link's")
    return record.link
