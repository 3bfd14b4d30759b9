"""Signing in, and finding out who asks."""

import asyncio
import contextlib
import secrets
from collections.abc import Collection
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Literal

from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from db.actor import Actor, acting
from db.fault import StoreError
from db.query.station import people as query
from db.query.station.events import add_event
from db.query.station.people import PersonRecord
from db.store import Store
from robot_link.clock import Clock
from server.access.failure import SignInFailures
from server.access.role import Rights, Role
from server.access.secret import hash_password, new_code, new_secret, password_fits, secret_hash
from server.access.throttle import HashGate, KnownBrowsers, Origin, Throttle
from server.base.problem import FieldError, Problem, conflict, unprocessable

_WRONG = "Name or password is wrong."
_FIRST_START = "first start"
EXPIRY_LOOK_S = 2.0


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

    @property
    def role(self) -> Role:
        """What the caller is to the station as a whole."""
        return self.rights.for_all


@dataclass(frozen=True, slots=True)
class SignedIn:
    """A new session: its secret for the cookie, and who it stands for."""

    secret: str = field(repr=False)
    caller: Caller


class Access:
    """The door of one station.

    Tokens and sessions run out by the wall's clock, which a demo's scaled clock does not change.
    """

    def __init__(
        self,
        store: Store,
        clock: Clock,
        wall: Clock,
        session_hours: float,
        failures: SignInFailures,
        browsers: KnownBrowsers,
    ) -> None:
        self._store = store
        self._failures = failures
        self._browsers = browsers
        self._clock = clock
        self._wall = wall
        self._session_length = timedelta(hours=session_hours)
        self._throttle = Throttle()
        self._gate, self._gate_of_known = HashGate(), HashGate()
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

    async def create_first_admin(
        self, name: str, password: str, code: str, host: str | None
    ) -> SignedIn:
        """Create the first person, with the code that the station printed, and sign in.

        Raises:
            Problem: 409 when there is someone already, 403 for a wrong code, 429 after too many.
        """
        if self._first_code is None:
            raise conflict("The station has an administrator already; sign in instead.")
        origin = Origin.of(host)
        reserved = self._throttle.reserve(origin.keys(_FIRST_START))
        if not secrets.compare_digest(_bytes_of(code.strip().upper()), self._first_code.encode()):
            await self._failures.note(f"A code of the first start from {origin.address} was wrong.")
            raise Problem(403, "The code is not the one that the station printed at its start.")
        self._throttle.succeeded(reserved)
        password_hash = await self.password_hash(password)
        at = self._clock.now()

        def create(session: Session) -> PersonRecord:
            if query.count_people(session) > 0:
                raise conflict("The station has an administrator already; sign in instead.")
            add_event(session, at, "person.created", f"{name} set up the station as administrator.")
            return query.add_person(session, name, Role.ADMIN, password_hash, at)

        person = await self._store.write(create)
        self._first_code = None
        return await self._sign_in(person)

    async def sign_in(
        self, name: str, password: str, host: str | None = None, mark: str | None = None
    ) -> SignedIn:
        """Sign a person in by name and password.

        Args:
            name: Who.
            password: What only they know.
            host: From which machine.
            mark: What their browser kept of an earlier sign-in.

        Raises:
            Problem: 401 if they do not fit, 429 after too many failures, 503 if too many try.
        """
        origin = Origin.of(host, self._browsers.identity(mark, name))
        reserved = self._throttle.reserve(origin.keys(name))
        try:
            person = await self._store.query(lambda session: query.find_person(session, name))
            known = None if person is None or person.disabled_at else person
            password_hash = None if known is None else known.password_hash
            gate = self._gate if origin.browser is None else self._gate_of_known
            fits = await gate.run(lambda: password_fits(password, password_hash))
        except Exception:
            self._throttle.give_back(reserved)  # the password was not judged
            raise
        if known is None or not fits:
            whose = "nobody's name" if person is None else f"the name {person.name}"
            await self._failures.note(f"A sign-in by {whose} from {origin.address} failed.")
            raise Problem(401, _WRONG)
        self._throttle.succeeded(reserved)
        return await self._sign_in(known)

    async def password_hash(self, password: str) -> str:
        """Hash a new password.

        Raises:
            Problem: 422 if it is too short, 503 if too many passwords are looked at already.
        """
        try:
            return await self._gate_of_known.run(lambda: hash_password(password))
        except ValueError as error:
            raise unprocessable(
                "1 field is wrong.", [FieldError(loc=["password"], msg=str(error))]
            ) from error

    def mark(self, name: str) -> str:
        """Return what a browser keeps so that nobody else's tries count against it."""
        return self._browsers.mark(name)

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

    async def sign_out(self, secret: str, name: str) -> None:
        """End the session of a cookie, which is of this person."""
        at = self._clock.now()

        def end(session: Session) -> None:
            query.end_session(session, secret_hash(secret))
            add_event(session, at, "person.signed_out", f"{name} signed out.")

        await self._store.write(end)

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
                return await self._nobody()
            return Caller(token.name, Rights(Role(token.role)), token.expires_at, None, proof)
        found = await self._store.query(
            lambda session: query.find_session(session, proof.digest, at)
        )
        if found is None:
            return await self._nobody()
        person = found.person
        rights = Rights(Role(person.role))
        return Caller(person.name, rights, found.expires_at, found.csrf_token, proof)

    async def rights_of(self, proofs: Collection[Proof]) -> dict[Proof, Rights]:
        """Return what each proof lets somebody do; those that are worth nothing are left out."""
        at = self._wall.now()

        def role(session: Session, proof: Proof) -> str | None:
            if proof.kind == "token":
                token = query.find_token(session, proof.digest, at)
                return None if token is None else token.role
            found = query.find_session(session, proof.digest, at)
            return None if found is None else found.person.role

        def rights(session: Session) -> dict[Proof, Rights]:
            told = {proof: role(session, proof) for proof in proofs}
            return {proof: Rights(Role(one)) for proof, one in told.items() if one is not None}

        return await self._store.query(rights)

    async def run(self) -> None:
        """End what expires, until cancelled: a clock that is set back brings nothing to life."""
        while True:
            await self._nobody()
            await asyncio.sleep(EXPIRY_LOOK_S)

    async def _nobody(self) -> None:
        """End what has expired by now."""
        at = self._wall.now()
        with contextlib.suppress(StoreError, SQLAlchemyError):
            if await self._store.query(lambda session: query.has_expired(session, at)):
                await self._store.write(lambda session: query.end_expired(session, at))

    async def _sign_in(self, person: PersonRecord) -> SignedIn:
        """Open a session, unless the person is no longer who was looked at."""
        secret, csrf_token = new_secret(), new_secret()
        wall, at = self._wall.now(), self._clock.now()
        expires_at = wall + self._session_length

        def add(session: Session) -> None:
            now = query.find_person(session, person.name, held=True)
            if now is None or _proved_by(now) != _proved_by(person):
                raise Problem(401, "This person was changed meanwhile; sign in again.")
            query.add_session(
                session,
                person.name,
                secret_hash=secret_hash(secret),
                csrf_token=csrf_token,
                at=wall,
                expires_at=expires_at,
            )
            add_event(session, at, "person.signed_in", f"{person.name} signed in.")

        acting.set(Actor(person.name, "person"))
        await self._store.write(add)
        proof = Proof("session", secret_hash(secret))
        caller = Caller(person.name, Rights(Role(person.role)), expires_at, csrf_token, proof)
        return SignedIn(secret, caller)


def _proved_by(person: PersonRecord) -> tuple[str | None, datetime | None]:
    return person.password_hash, person.disabled_at


def _bytes_of(text: str) -> bytes:
    return text.encode(errors="surrogatepass")
