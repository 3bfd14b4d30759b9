"""Signing in, and finding out who asks."""

import asyncio
import contextlib
import secrets
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from db.actor import Actor, acting
from db.fault import StoreError
from db.identity import key_of
from db.query.station import people as query
from db.query.station.events import add_event
from db.query.station.grants import Holder
from db.query.station.people import PersonRecord, SessionRecord
from db.store import Store
from robot_link.clock import Clock, monotonic_s
from server.access.caller import Browser, Caller, Proof, callers_of
from server.access.failure import SignInFailures
from server.access.role import Rights, Role
from server.access.secret import hash_password, new_code, new_secret, password_fits, secret_hash
from server.access.throttle import HashGate, KnownBrowsers, Origin, Throttle
from server.base.problem import FieldError, Problem, conflict, unprocessable

_WRONG = "Name or password is wrong."
_FIRST_START = "first start"
_LINK = "read-only link"
_NO_BROWSER = Browser()
BROWSER_LENGTH_MAX: Final = 200
EXPIRY_LOOK_S = 2.0
LOOK_S: Final = 0.3
"""How long a look at a sign-in is believed, unless this station changes something meanwhile: so
long one holds that another process has ended."""
SEEN_S: Final = 60.0
"""How often it is written down when sessions were seen last."""


@dataclass(frozen=True, slots=True)
class SignedIn:
    """A new session: its secret for the cookie, and who it stands for."""

    secret: str = field(repr=False)
    caller: Caller


@dataclass(frozen=True, slots=True)
class _Look:
    """Who came in by what, when the database was looked at."""

    caller: Caller
    changes: int
    """Of the database by this station, before the look."""
    at_s: float


class Access:
    """The door of one station.

    Whom it let in a moment ago it lets in again without a look into the database, unless the
    station has changed something there since: what it revokes ends at once, what another process
    does after ``LOOK_S``.

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
        self._seen: dict[str, datetime] = {}
        self._looks: dict[Proof, _Look] = {}

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
        self, name: str, password: str, code: str, browser: Browser
    ) -> SignedIn:
        """Create the first person, with the code that the station printed, and sign in.

        Raises:
            Problem: 409 when there is someone already, 403 for a wrong code, 429 after too many.
        """
        if self._first_code is None:
            raise conflict("The station has an administrator already; sign in instead.")
        origin = Origin.of(browser.host)
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
        return await self._sign_in(person, browser)

    async def sign_in(
        self, name: str, password: str, browser: Browser = _NO_BROWSER, mark: str | None = None
    ) -> SignedIn:
        """Sign a person in by name and password.

        Args:
            name: Who.
            password: What only they know.
            browser: From where.
            mark: What their browser kept of an earlier sign-in.

        Raises:
            Problem: 401 if they do not fit, 429 after too many failures, 503 if too many try.
        """
        origin = Origin.of(browser.host, self._browsers.identity(mark, name))
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
        return await self._sign_in(known, browser)

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

    async def sign_in_once(self, secret: str, browser: Browser = _NO_BROWSER) -> SignedIn:
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
        return await self._sign_in(person, browser)

    async def sign_in_as(self, person: PersonRecord, browser: Browser) -> SignedIn:
        """Sign a person in whom a provider of OpenID Connect has vouched for.

        Raises:
            Problem: 401 if the person was changed meanwhile.
        """
        return await self._sign_in(person, browser)

    async def open_link(self, secret: str, browser: Browser) -> SignedIn:
        """Let somebody in by a read-only link.

        Raises:
            Problem: 401 if it has expired, was revoked or never existed; 429 after many of those.
        """
        reserved = self._throttle.reserve(Origin.of(browser.host).keys(_LINK))
        wall, digest = self._wall.now(), secret_hash(secret)
        link = await self._store.query(lambda session: query.find_link(session, digest, wall))
        if link is None:
            raise Problem(401, "This read-only link has expired or was revoked; ask for a new one.")
        self._throttle.succeeded(reserved)
        until = min(link.expires_at, wall + self._session_length)
        return await self._open(Holder(token=key_of("link", link.id)), until, browser)

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
        found = self._known(proof) or (await self._look_at((proof,))).get(proof)
        if found is None:
            return await self._nobody()
        if proof.kind == "session":
            self._seen[proof.digest] = self._wall.now()
        return found

    async def rights_of(self, proofs: Collection[Proof]) -> dict[Proof, Rights]:
        """Return what each proof lets somebody do; those that are worth nothing are left out."""
        found, at = await self._look_at(proofs), self._wall.now()
        self._seen.update({proof.digest: at for proof in found if proof.kind == "session"})
        return {proof: caller.rights for proof, caller in found.items()}

    def is_over(self, caller: Caller) -> bool:
        """Tell whether that by which somebody came in has expired."""
        return self._wall.now() >= caller.expires_at

    def _known(self, proof: Proof) -> Caller | None:
        """Return who came in by this as it was found a moment ago, if that must hold still."""
        look = self._looks.get(proof)
        if look is None or look.changes != self._store.changes:
            return None
        is_fresh = monotonic_s() - look.at_s < LOOK_S
        return look.caller if is_fresh and not self.is_over(look.caller) else None

    async def _look_at(self, proofs: Collection[Proof]) -> dict[Proof, Caller]:
        """Look into the database, and forget what was found there too long ago."""
        at, changes, at_s = self._wall.now(), self._store.changes, monotonic_s()
        found = await self._store.query(lambda session: callers_of(session, proofs, at))
        self._looks = {key: one for key, one in self._looks.items() if at_s - one.at_s < LOOK_S}
        self._looks |= {proof: _Look(caller, changes, at_s) for proof, caller in found.items()}
        return found

    def seen_at(self, record: SessionRecord) -> datetime | None:
        """Return when a session was seen last, as far as it is not written down yet too."""
        moments = (record.seen_at, self._seen.get(record.secret_hash))
        return max((one for one in moments if one is not None), default=None)

    async def run(self) -> None:
        """End what expires and note who was seen, until cancelled.

        A clock that is set back brings nothing to life.
        """
        noted_s = monotonic_s()
        while True:
            await self._nobody()
            if monotonic_s() - noted_s >= SEEN_S:
                noted_s = monotonic_s()
                await self._note_seen()
            await asyncio.sleep(EXPIRY_LOOK_S)

    async def _note_seen(self) -> None:
        seen, self._seen = self._seen, {}
        if seen:
            with contextlib.suppress(StoreError, SQLAlchemyError):
                await self._store.write(lambda session: query.note_seen(session, seen))

    async def _nobody(self) -> None:
        """End what has expired by now."""
        at = self._wall.now()
        with contextlib.suppress(StoreError, SQLAlchemyError):
            if await self._store.query(lambda session: query.has_expired(session, at)):
                await self._store.write(lambda session: query.end_expired(session, at))

    async def _sign_in(self, person: PersonRecord, browser: Browser) -> SignedIn:
        """Open a session, unless the person is no longer who was looked at."""
        at = self._clock.now()

        def check(session: Session) -> None:
            now = query.find_person(session, person.name, held=True)
            if now is None or _proved_by(now) != _proved_by(person):
                raise Problem(401, "This person was changed meanwhile; sign in again.")
            add_event(session, at, "person.signed_in", f"{person.name} signed in.")

        acting.set(Actor(person.name, "person"))
        until = self._wall.now() + self._session_length
        return await self._open(Holder(person=person.key), until, browser, check)

    async def _open(
        self,
        holder: Holder,
        expires_at: datetime,
        browser: Browser,
        check: Callable[[Session], None] = lambda _: None,
    ) -> SignedIn:
        """Open a session of a person or a link in the transaction of a check."""
        secret, csrf_token = new_secret(), new_secret()
        proof, wall = Proof("session", secret_hash(secret)), self._wall.now()

        def add(session: Session) -> Caller:
            check(session)
            query.add_session(
                session,
                holder,
                secret_hash=proof.digest,
                csrf_token=csrf_token,
                at=wall,
                expires_at=expires_at,
                address=browser.host or "",
                browser=browser.name[:BROWSER_LENGTH_MAX],
            )
            session.flush()
            found = callers_of(session, (proof,), wall)
            if proof not in found:
                raise Problem(401, "This sign-in ended while it began; try again.")
            return found[proof]

        return SignedIn(secret, await self._store.write(add))


def _proved_by(person: PersonRecord) -> tuple[str | None, datetime | None]:
    return person.password_hash, person.disabled_at


def _bytes_of(text: str) -> bytes:
    return text.encode(errors="surrogatepass")
