"""From what a provider vouches for to a person of the station, with a role by the settings."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from sqlalchemy.orm import Session

from db.query.station import people as query
from db.query.station.people import PersonRecord
from server.access import register
from server.access.role import Role, higher
from server.base.problem import Problem
from server.base.text import NAME_LENGTH_MAX

_NAMES = ("preferred_username", "email", "name")


def role_of(claims: Mapping[str, Any], roles: Mapping[str, Role], groups_claim: str) -> Role | None:
    """Return the highest role that the settings give to these claims, ``None`` for none.

    Args:
        claims: What the provider vouches for.
        roles: By ``group:NAME``, ``email:ADDRESS``, or ``*`` for everybody of the provider.
        groups_claim: Where the provider lists groups.
    """
    groups = claims.get(groups_claim)
    keys = {"*"} | {f"group:{one}" for one in (groups if isinstance(groups, list) else [])}
    if claims.get("email_verified") is True:
        keys.add(f"email:{str(claims.get('email', '')).lower()}")
    found: Role | None = None
    for key, role in roles.items():
        if (key.lower() if key.startswith("email:") else key) in keys:
            found = role if found is None else higher(found, role)
    return found


def person_of(
    session: Session, issuer: str, claims: Mapping[str, Any], role: Role, at: datetime
) -> PersonRecord:
    """Return the person of an issuer's subject with their role of today; a new one is added.

    A person is known by issuer and subject alone: a name that somebody chose elsewhere is no
    proof of being whoever has it here.

    Raises:
        Problem: 403 if they are shut out, 409 if their name is taken here, or if the last
            administrator would lose that role.
    """
    subject, by = str(claims["sub"]), "the sign-in provider"
    person = query.person_of_identity(session, issuer, subject)
    if person is None:
        name = next((str(claims[key]) for key in _NAMES if claims.get(key)), subject)
        name = name[:NAME_LENGTH_MAX]
        if query.find_person(session, name) is not None:
            raise Problem(
                409, f"Somebody is called {name} here already; sign in by that person's password."
            )
        person = register.add_person(session, name, role, None, at=at, by=by)
        query.add_identity(session, person, issuer, subject)
        return person
    if person.disabled_at is not None:
        raise Problem(403, f"{person.name} is shut out of this station.")
    if person.role != role:
        return register.change_person(session, person.name, role=role, at=at, by=by)
    return person
