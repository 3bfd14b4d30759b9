"""Who is signed in where, and ending that; and read-only links for people without a name here."""

from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Annotated, Final

from fastapi import APIRouter, Query
from pydantic import Field
from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.query.station import people as query
from db.query.station.events import add_event
from db.query.station.grants import GrantRecord, list_grants
from db.query.station.people import SessionRecord
from db.record import same
from server.access import register
from server.access.caller import Caller, holder_of
from server.access.dependency import AccessDep, Admin, Viewer
from server.access.grant import GrantView, views_of
from server.access.role import Right, Role
from server.base.dependency import ClockDep, StoreDep
from server.base.problem import Problem
from server.base.text import Name
from server.base.view import Body, View

router = APIRouter(prefix="/api", tags=["session"])

SHOWN_MAX: Final = 100
LINK_DAYS_MAX: Final = 366
_BROWSERS: Final = (
    ("Edg/", "Edge"),
    ("OPR/", "Opera"),
    ("SamsungBrowser/", "Samsung Internet"),
    ("Firefox/", "Firefox"),
    ("Chrome/", "Chrome"),
    ("Safari/", "Safari"),
    ("python-httpx/", "a Python program"),
    ("curl/", "curl"),
)
"""Marks in the order in which they tell: most browsers name others beside themselves."""
_SYSTEMS: Final = (
    ("Android", "Android"),
    ("iPhone", "iPhone"),
    ("iPad", "iPad"),
    ("Windows", "Windows"),
    ("Mac OS X", "macOS"),
    ("CrOS", "ChromeOS"),
    ("Linux", "Linux"),
)


@dataclass(frozen=True, slots=True)
class SignInView(View):
    """One browser that is signed in."""

    id: str
    name: str
    """Whose it is; of a read-only link, what that is for."""
    is_link: bool
    is_own: bool
    """Whether it is the one that asks."""
    browser: str
    """In words, such as *Firefox on Linux*."""
    address: str
    created_at: datetime
    seen_at: datetime | None
    expires_at: datetime


@dataclass(frozen=True, slots=True)
class SignInsView(View):
    """Browsers that are signed in, the newest first."""

    sessions: list[SignInView]


class LinkBody(Body):
    """A new read-only link."""

    name: Name
    """What it is for; whoever opens it sees it."""
    robots: list[str] = Field(default_factory=list[str], max_length=SHOWN_MAX)
    """Ids of the robots that it shows."""
    groups: list[Name] = Field(default_factory=list[Name], max_length=SHOWN_MAX)
    """Ids of the groups whose robots it shows."""
    days: float = Field(default=7.0, gt=0, le=LINK_DAYS_MAX)
    """How long it is valid."""


@dataclass(frozen=True, slots=True)
class LinkAccessView(View):
    """A read-only link, without its secret."""

    id: str
    name: str
    shows: list[GrantView]
    created_at: datetime
    expires_at: datetime
    revoked_at: datetime | None
    used_at: datetime | None
    """When somebody looked last."""


@dataclass(frozen=True, slots=True)
class LinkAccessesView(View):
    """Every read-only link, the newest first."""

    links: list[LinkAccessView]


@dataclass(frozen=True, slots=True)
class NewLinkView(View):
    """A fresh read-only link; its address is shown here and never again."""

    id: str
    address: str = field(repr=False)
    """Path and fragment at this station; the fragment is in no log."""
    expires_at: datetime


@router.get("/sessions")
async def list_sessions(
    caller: Viewer,
    store: StoreDep,
    access: AccessDep,
    everybody: Annotated[bool, Query(description="Of everybody; for administrators.")] = False,
) -> SignInsView:
    """Return where one is signed in."""
    person = None if everybody and caller.rights.may(Right.ADMINISTER) else _person_of(caller)
    at = datetime.now().astimezone()
    found = await store.query(lambda session: query.list_sessions(session, at, person))
    return SignInsView([_sign_in(one, caller, access.seen_at(one)) for one in found])


@router.delete("/sessions", status_code=204)
async def end_other_sessions(caller: Viewer, store: StoreDep, clock: ClockDep) -> None:
    """End every session of one's own but this one."""
    at, person = clock.now(), _person_of(caller)

    def end(session: Session) -> None:
        ended = query.end_sessions_of(session, person, caller.proof.digest)
        text = f"{person} ended {ended} other sessions of their own."
        add_event(session, at, "person.signed_out", text)

    await store.write(end)


@router.delete("/sessions/{session}", status_code=204)
async def end_session(caller: Viewer, session: str, store: StoreDep, clock: ClockDep) -> None:
    """End one session: of one's own, or as an administrator anybody's."""
    at = clock.now()
    person = None if caller.rights.may(Right.ADMINISTER) else _person_of(caller)

    def end(transaction: Session) -> None:
        ended = query.end_session_of_id(transaction, session, person)
        text = f"{caller.name} ended a session of {_name_of(ended)}."
        add_event(transaction, at, "person.signed_out", text)

    await store.write(end)


@router.get("/read-only-links")
async def list_links(caller: Admin, store: StoreDep) -> LinkAccessesView:
    """Return every read-only link."""
    del caller

    def views(session: Session) -> list[LinkAccessView]:
        grants = list_grants(session)
        return [
            same(LinkAccessView, link, shows=views_of(grants.get(holder_of(link), [])))
            for link in query.list_tokens(session, are_links=True)
        ]

    return LinkAccessesView(await store.query(views))


@router.post("/read-only-links", status_code=201)
async def create_link(
    caller: Admin, body: LinkBody, store: StoreDep, clock: ClockDep
) -> NewLinkView:
    """Make a link by which anybody may look at chosen robots for a while."""
    at = clock.now()
    shown = [GrantRecord(Role.VIEWER, robot=one) for one in dict.fromkeys(body.robots)]
    shown += [GrantRecord(Role.VIEWER, group=one) for one in dict.fromkeys(body.groups)]
    if not shown:
        raise Problem(409, "A read-only link shows at least one robot or group.")
    issued = await store.write(
        lambda session: register.create_link(
            session, body.name, shown, timedelta(days=body.days), at=at, by=caller.name
        )
    )
    return NewLinkView(issued.token.id, f"/#look={issued.secret}", issued.token.expires_at)


@router.delete("/read-only-links/{link}", status_code=204)
async def revoke_link(caller: Admin, link: str, store: StoreDep, clock: ClockDep) -> None:
    """Revoke a read-only link; whoever looks by it sees nothing more at once."""
    if not link.startswith("link-"):
        raise UnknownIdError("link", link)
    at = clock.now()
    await store.write(lambda session: register.revoke_token(session, link, at=at, by=caller.name))


def _person_of(caller: Caller) -> str:
    """Return the person who asks.

    Raises:
        Problem: 403 if it is a script, or somebody by a read-only link.
    """
    if caller.proof.kind == "token" or caller.is_link:
        raise Problem(403, f"{caller.name} is no person; sessions are of people.")
    return caller.name


def _name_of(record: SessionRecord) -> str:
    if record.person is not None:
        return record.person.name
    return "" if record.link is None else record.link.name


def _sign_in(record: SessionRecord, caller: Caller, seen_at: datetime | None) -> SignInView:
    return same(
        SignInView,
        record,
        name=_name_of(record),
        is_link=record.link is not None,
        is_own=record.secret_hash == caller.proof.digest,
        browser=_browser_name(record.browser),
        seen_at=seen_at,
    )


def _browser_name(agent: str) -> str:
    """Return such as *Firefox on Linux* of a User-Agent header; *unknown* of one that says less."""
    browser = next((name for mark, name in _BROWSERS if mark in agent), "unknown")
    system = next((name for mark, name in _SYSTEMS if mark in agent), None)
    return browser if system is None else f"{browser} on {system}"
