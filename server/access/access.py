"""Signing in, and finding out who asks."""

import asyncio
import secrets
from dataclasses import dataclass
from datetime import datetime, timedelta
from http import HTTPStatus
from typing import Literal

from sqlalchemy.orm import Session

from db.query import people as query
from db.query.events import add_event
from db.query.people import PersonRecord
from db.store import Store
from robot_link.clock import Clock, monotonic_s
from server.access.role import Role
from server.access.secret import hash_password, new_code, new_secret, password_fits, secret_hash
from server.base.problem import FieldError, Problem, conflict, unprocessable

_WRONG = "Name or password is wrong."


FREE_FAILURES = 5
PAUSE_S = 30.0
_NAMES_MAX = 10_000


class Throttle:
    """Counts failures by name and pauses after too many of them."""

    def __init__(self) -> None:
        self._failures: dict[str, tuple[int, float]] = {}

    def check(self, name: str) -> None:
        """Let the next try pass.

        Raises:
            Problem: 429 while the pause for this name lasts.
        """
        failures, last_s = self._failures.get(name, (0, 0.0))
        left_s = last_s + PAUSE_S - monotonic_s()
        if failures >= FREE_FAILURES and left_s > 0:
            raise Problem(
                HTTPStatus.TOO_MANY_REQUESTS,
                f"Too many failed tries; wait {left_s:.0f} s.",
                headers={"Retry-After": str(int(left_s) + 1)},
            )

    def failed(self, name: str) -> None:
        """Count a failure."""
        if len(self._failures) >= _NAMES_MAX:
            self._failures.clear()
        failures, _ = self._failures.get(name, (0, 0.0))
        self._failures[name] = (failures + 1, monotonic_s())

    def succeeded(self, name: str) -> None:
        """Forget the failures of a name."""
        self._failures.pop(name, None)


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
    role: Role
    expires_at: datetime
    csrf_token: str | None
    """The token that a browser's changes must carry; a script with a bearer token has none."""
    proof: Proof


@dataclass(frozen=True, slots=True)
class SignedIn:
    """A new session: its secret for the cookie, and who it stands for."""

    secret: str
    caller: Caller


class Access:
    """The door of one station.

    Tokens and sessions run out by the wall's clock, which a demo's scaled clock does not change.
    """

    def __init__(self, store: Store, clock: Clock, wall: Clock, session_hours: float) -> None:
        self._store = store
        self._clock = clock
        self._wall = wall
        self._session_length = timedelta(hours=session_hours)
        self._throttle = Throttle()
        self._first_code: str | None = None

    async def prepare(self) -> str | None:
        """Return the code that creates the first admin, or ``None`` when there are people."""
        if await self._store.query(query.count_people) == 0:
            self._first_code = new_code()
        return self._first_code

    @property
    def needs_first_admin(self) -> bool:
        """Whether nobody can sign in yet."""
        return self._first_code is not None

    async def create_first_admin(self, name: str, password: str, code: str) -> SignedIn:
        """Create the first person, with the code that the station printed, and sign in.

        Raises:
            Problem: 409 when there is someone already, 403 for a wrong code, 429 after too many.
        """
        if self._first_code is None:
            raise conflict("The station has an administrator already; sign in instead.")
        self._throttle.check("first start")
        if not secrets.compare_digest(code.strip().upper(), self._first_code):
            self._throttle.failed("first start")
            raise Problem(403, "The code is not the one that the station printed at its start.")
        password_hash = await password_hash_of(password)
        at = self._clock.now()

        def create(session: Session) -> PersonRecord:
            if query.count_people(session) > 0:
                raise conflict("The station has an administrator already; sign in instead.")
            add_event(session, at, "person.created", f"{name} set up the station as administrator.")
            return query.add_person(session, name, Role.ADMIN, password_hash, at)

        person = await self._store.write(create)
        self._first_code = None
        return await self._sign_in(person)

    async def sign_in(self, name: str, password: str) -> SignedIn:
        """Sign a person in by name and password.

        Raises:
            Problem: 401 if they do not fit, 429 after too many failures.
        """
        self._throttle.check(name)
        person = await self._store.query(lambda session: query.find_person(session, name))
        known = None if person is None or person.disabled_at else person
        fits = await asyncio.to_thread(
            password_fits, password, None if known is None else known.password_hash
        )
        if known is None or not fits:
            self._throttle.failed(name)
            raise Problem(401, _WRONG)
        self._throttle.succeeded(name)
        return await self._sign_in(known)

    async def sign_in_once(self, secret: str) -> SignedIn:
        """Use a one-time sign-in up.

        Raises:
            Problem: 401 if it was used, has expired or never existed.
        """
        at = self._wall.now()
        digest = secret_hash(secret)
        person = await self._store.write(
            lambda session: query.use_one_time_token(session, digest, at)
        )
        if person is None:
            raise Problem(401, "This sign-in link was used or has expired; ask for a new one.")
        return await self._sign_in(person)

    async def sign_out(self, secret: str) -> None:
        """End the session of a cookie."""
        await self._store.write(lambda session: query.end_session(session, secret_hash(secret)))

    async def caller_of_cookie(self, secret: str) -> Caller | None:
        """Return whose cookie this is, or ``None`` when it is nobody's any more."""
        return await self.caller_of(Proof("session", secret_hash(secret)))

    async def caller_of_token(self, secret: str) -> Caller | None:
        """Return whose bearer token this is, or ``None`` when it is nobody's any more."""
        return await self.caller_of(Proof("token", secret_hash(secret)))

    async def caller_of(self, proof: Proof) -> Caller | None:
        """Return who came in by this, or ``None`` when it is worth nothing any more."""
        at = self._wall.now()
        if proof.kind == "token":
            token = await self._store.query(
                lambda session: query.find_token(session, proof.digest, at)
            )
            if token is None:
                return None
            return Caller(token.name, Role(token.role), token.expires_at, None, proof)
        found = await self._store.query(
            lambda session: query.find_session(session, proof.digest, at)
        )
        if found is None:
            return None
        person = found.person
        return Caller(person.name, Role(person.role), found.expires_at, found.csrf_token, proof)

    async def _sign_in(self, person: PersonRecord) -> SignedIn:
        secret, csrf_token = new_secret(), new_secret()
        wall, at = self._wall.now(), self._clock.now()
        expires_at = wall + self._session_length

        def add(session: Session) -> None:
            query.add_session(
                session,
                person.name,
                secret_hash=secret_hash(secret),
                csrf_token=csrf_token,
                at=wall,
                expires_at=expires_at,
            )
            add_event(session, at, "person.signed_in", f"{person.name} signed in.")

        await self._store.write(add)
        proof = Proof("session", secret_hash(secret))
        caller = Caller(person.name, Role(person.role), expires_at, csrf_token, proof)
        return SignedIn(secret, caller)


async def password_hash_of(password: str) -> str:
    """Hash a password in a thread.

    Raises:
        Problem: 422 if it is too short.
    """
    try:
        return await asyncio.to_thread(hash_password, password)
    except ValueError as error:
        raise unprocessable(
            "1 field is wrong.", [FieldError(loc=["password"], msg=str(error))]
        ) from error
