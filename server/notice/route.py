"""Contacts and wishes of people, escalation, mail server, heartbeat, and what became of notices."""

import asyncio
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query
from pydantic import Field, SecretStr, ValidationError
from sqlalchemy.orm import Session

from db.query.station import notices as query
from db.query.station.events import add_event
from db.query.station.notices import ContactRecord, NoticeRecord, Reachable
from db.record import same
from server.access.access import Caller
from server.access.dependency import Admin, Pilot
from server.access.role import Right
from server.base.dependency import FoundationDep, service
from server.base.foundation import Foundation
from server.base.problem import FieldError, Problem, invalid, unprocessable
from server.base.secret import SecretUnreadableError
from server.base.text import Title
from server.base.view import Body, RobotLevel, View, one_of
from server.notice.contact import Address, ContactForm, MailServer
from server.notice.delivery import MAIL_SERVER
from server.notice.escalation import rights_of
from server.notice.heartbeat import HEARTBEAT, Heartbeat, WatcherAddress
from server.notice.outbox import Notices
from server.notice.settings import NoticeSettings, read_settings, save_settings
from server.notice.wish import Wishes

router = APIRouter(prefix="/api/notices", tags=["notices"])
NoticesDep = Annotated[Notices, Depends(service(Notices))]
HeartbeatDep = Annotated[Heartbeat, Depends(service(Heartbeat))]


class ContactBody(Body):
    """A new way to reach a person."""

    title: Title
    """Such as ``phone``; it stands in the log."""
    form: ContactForm
    """How it is reached: mail, ntfy, webhook, or any service of apprise."""
    address: SecretStr = Field(max_length=1000)
    """A mail address, ``https://server/topic`` of ntfy, a webhook's URL, or apprise's URL; of the
    last three nothing but the kind and the host is shown again."""
    token: SecretStr = Field(default=SecretStr(""), max_length=500)
    """Access token of ntfy, where the topic needs one."""


class ContactPatch(Body):
    """What changes about a contact."""

    title: Title | None = None
    """What the contact is called."""
    enabled: bool | None = None
    """Whether notices are sent to it."""


class MailServerBody(Body):
    """The server by which the station sends mail; a password that is left out stays."""

    host: str = Field(max_length=200)
    """Name or address of the server."""
    port: int = Field(default=587, ge=1, le=65535)
    """Its TCP port, 1 to 65535."""
    security: Literal["starttls", "ssl", "none"] = "starttls"
    """How the connection is encrypted; ``none`` sends in the clear."""
    username: str = Field(default="", max_length=200)
    """Account at the server; empty where it asks for none."""
    password: SecretStr | None = Field(default=None, max_length=500)
    """Password of the account; left out, the one that is kept stays."""
    sender: str = Field(max_length=255)
    """Address that mails come from."""


class WatcherBody(Body):
    """Where signs of life go; ``null`` for nowhere."""

    url: SecretStr | None = Field(max_length=1000)
    """Address of the watching service, ``https://...``; kept like a password. ``null`` for
    nowhere."""


@dataclass(frozen=True, slots=True)
class ContactView(View):
    """One way to reach a person; its address is never told."""

    id: str
    person: str
    title: str
    form: ContactForm
    hint: str
    """What may be shown of the address."""
    enabled: bool
    created_at: datetime


@dataclass(frozen=True, slots=True)
class PersonNoticesView(View):
    """What one person is told, and by which contacts."""

    person: str
    wishes: Wishes
    contacts: list[ContactView]
    may_acknowledge: bool
    """Whether messages to this person hold a link that acknowledges."""


@dataclass(frozen=True, slots=True)
class NoticeView(View):
    """One message and what is proved of it."""

    id: str
    person: str
    contact_title: str
    topic: str
    level: RobotLevel
    title: str
    items: int
    """How many alarms or events it tells of."""
    state: Annotated[str, one_of("queued", "handed", "given_up", "withdrawn")]
    """``queued``; ``handed``: a service took it, which is no proof that anybody read it;
    ``given_up``; ``withdrawn``: all of it was seen, or given to somebody else,
    before a service took it."""
    attempts: int
    unanswered: int
    """Attempts of which no answer is known: the service may have it of each of them as well."""
    created_at: datetime
    tried_at: datetime | None
    ended_at: datetime | None
    reply: str
    """The service's last words, or why there are none."""
    link_used_at: datetime | None
    """When its link acknowledged what it told of."""


@dataclass(frozen=True, slots=True)
class NoticeListView(View):
    """Messages, the newest first."""

    notices: list[NoticeView]


@dataclass(frozen=True, slots=True)
class TestView(View):
    """What came of a test, in the service's own words."""

    notice: NoticeView
    is_handed: bool
    reply: str
    took_s: float


@dataclass(frozen=True, slots=True)
class MailServerView(View):
    """The mail server without its password."""

    host: str
    port: int
    security: Literal["starttls", "ssl", "none"]
    username: str
    has_password: bool
    sender: str


@dataclass(frozen=True, slots=True)
class HeartbeatView(View):
    """Signs of life to who watches the station."""

    hint: str
    """Host of the watcher; empty where nobody watches."""
    sent_at: datetime | None
    """When the last one left, since the station started."""
    is_heard: bool | None
    reply: str


@dataclass(frozen=True, slots=True)
class NoticeStationView(View):
    """What holds for everybody's notices."""

    settings: NoticeSettings
    people: list[str]
    """Everyone who could be told."""
    unreachable: list[str]
    """Who is named in the escalation and has no contact that could be used."""
    link_origin: str | None
    """Address that links in messages begin with; ``null``: the station was not told how people
    reach it, so messages have no links."""
    mail_server: MailServerView | None
    heartbeat: HeartbeatView


@router.get("")
async def list_notices(
    caller: Pilot,
    foundation: FoundationDep,
    limit: Annotated[int, Query(ge=1, le=500)] = 50,
) -> NoticeListView:
    """Return the last messages: an admin's view has everybody's, anyone else's their own."""
    _check_pilot(caller)
    person = None if _is_admin(caller) else _own_name(caller)
    found = await foundation.store.query(lambda session: query.list_notices(session, person, limit))
    return NoticeListView([_notice(record) for record in found])


@router.get("/station")
async def get_station(
    caller: Pilot, foundation: FoundationDep, notices: NoticesDep, heartbeat: HeartbeatDep
) -> NoticeStationView:
    """Return escalation, mail server and heartbeat."""
    _check_pilot(caller)
    return await _station(foundation, notices, heartbeat)


@router.put("/station")
async def put_station(
    caller: Admin,
    body: NoticeSettings,
    foundation: FoundationDep,
    notices: NoticesDep,
    heartbeat: HeartbeatDep,
) -> NoticeStationView:
    """Change escalation and the period of the heartbeat; it holds for what is open already."""

    def write(session: Session) -> None:
        known = {person.name for person in query.everybody(session)}
        for number, step in enumerate(body.steps):
            for name in step.people:
                if name not in known:
                    raise _wrong(["steps", number, "people"], f"there is no person {name!r}")
        save_settings(session, body)
        _log(session, foundation, caller, "notice.settings", "the escalation of notices")

    await foundation.store.write(write)
    heartbeat.change()
    notices.deliveries.forgive()
    foundation.feed.mark("notices")
    return await _station(foundation, notices, heartbeat)


@router.put("/mail-server")
async def put_mail_server(
    caller: Admin,
    body: MailServerBody,
    foundation: FoundationDep,
    notices: NoticesDep,
    heartbeat: HeartbeatDep,
) -> NoticeStationView:
    """Enter or change the mail server; its password is kept as other secrets are."""
    old = await _mail_server(foundation)
    given: dict[str, Any] = body.model_dump(exclude={"password"})
    if body.password is not None:
        given["password"] = body.password.get_secret_value()
    elif old is not None and old.password:
        if (old.host, old.port) != (body.host, body.port):
            text = "enter it again: it must not go to another server unasked"
            raise _wrong(["password"], text)
        given["password"] = old.password
    server = _checked(MailServer, given)
    await _keep(foundation, MAIL_SERVER, server.model_dump_json())
    await foundation.store.write(
        lambda session: _log(session, foundation, caller, "notice.settings", "the mail server")
    )
    notices.deliveries.forgive()
    return await _station(foundation, notices, heartbeat)


@router.put("/heartbeat")
async def put_heartbeat(
    caller: Admin,
    body: WatcherBody,
    foundation: FoundationDep,
    notices: NoticesDep,
    heartbeat: HeartbeatDep,
) -> NoticeStationView:
    """Say where signs of life go, and send one at once."""
    text = None
    if body.url is not None:
        text = _checked(WatcherAddress, {"url": body.url.get_secret_value()}).model_dump_json()
    await _keep(foundation, HEARTBEAT, text)
    await foundation.store.write(
        lambda session: _log(session, foundation, caller, "notice.settings", "the heartbeat")
    )
    await heartbeat.beat()
    heartbeat.change()
    return await _station(foundation, notices, heartbeat)


@router.get("/people/{person}")
async def get_person(caller: Pilot, person: str, foundation: FoundationDep) -> PersonNoticesView:
    """Return what a person is told; oneself, or anybody for an admin."""
    _check_whose(caller, person)
    return _person(await foundation.store.query(lambda s: query.find_reachable(s, person)))


@router.put("/people/{person}")
async def put_person(
    caller: Pilot, person: str, body: Wishes, foundation: FoundationDep, notices: NoticesDep
) -> PersonNoticesView:
    """Say what a person wants to be told, and when."""
    _check_whose(caller, person)

    def write(session: Session) -> Reachable:
        query.save_wishes(session, person, body.model_dump(mode="json"))
        _log(session, foundation, caller, "notice.wishes", f"what {person} is told")
        session.flush()
        return query.find_reachable(session, person)

    found = await foundation.store.write(write)
    notices.deliveries.forgive()
    foundation.feed.mark("notices")
    return _person(found)


@router.post("/people/{person}/contacts", status_code=201)
async def add_contact(
    caller: Pilot, person: str, body: ContactBody, foundation: FoundationDep, notices: NoticesDep
) -> ContactView:
    """Add a way to reach a person; send a test to see whether it works."""
    _check_whose(caller, person)
    given = {
        "form": body.form,
        "address": body.address.get_secret_value().strip(),
        "token": body.token.get_secret_value(),
    }
    address = _checked(Address, given)
    at = foundation.clock.now()

    def write(session: Session) -> ContactRecord:
        found = query.find_reachable(session, person)
        if len(found.contacts) >= CONTACTS_MAX:
            raise _wrong(["title"], f"a person has at most {CONTACTS_MAX} contacts")
        made = query.add_contact(session, person, body.title, body.form, address.hint(), at)
        _log(session, foundation, caller, "notice.contact", f"contact {made.title} of {person}")
        return made

    made = await foundation.store.write(write)
    await _keep(foundation, made.id, address.model_dump_json())
    notices.deliveries.warm_up()
    foundation.feed.mark("notices")
    return same(ContactView, made)


@router.patch("/contacts/{contact}")
async def change_contact(
    caller: Pilot, contact: str, body: ContactPatch, foundation: FoundationDep, notices: NoticesDep
) -> ContactView:
    """Rename a contact, or leave it out for a while."""

    def write(session: Session) -> ContactRecord:
        old = query.get_contact(session, contact)
        _check_whose(caller, old.person)
        _log(session, foundation, caller, "notice.contact", f"contact {old.title} of {old.person}")
        return query.change_contact(session, contact, title=body.title, enabled=body.enabled)

    changed = await foundation.store.write(write)
    notices.deliveries.forgive()
    foundation.feed.mark("notices")
    return same(ContactView, changed)


@router.delete("/contacts/{contact}", status_code=204)
async def remove_contact(
    caller: Pilot, contact: str, foundation: FoundationDep, notices: NoticesDep
) -> None:
    """Forget a contact, its address, and what waits for it."""
    at = foundation.clock.now()

    def write(session: Session) -> None:
        old = query.get_contact(session, contact)
        _check_whose(caller, old.person)
        query.remove_contact(session, contact, at)
        _log(session, foundation, caller, "notice.contact", f"contact {old.title} of {old.person}")

    await foundation.store.write(write)
    await _keep(foundation, contact, None)
    await notices.deliveries.forget(contact)
    foundation.feed.mark("notices")


@router.post("/contacts/{contact}/test")
async def test_contact(
    caller: Pilot, contact: str, foundation: FoundationDep, notices: NoticesDep
) -> TestView:
    """Send a test now and return the service's own reply; it takes as long as the service does."""
    found = await foundation.store.query(lambda session: query.get_contact(session, contact))
    _check_whose(caller, found.person)
    notice, reply = await notices.deliveries.test(contact)
    return TestView(
        notice=_notice(notice), is_handed=reply.is_handed, reply=reply.text, took_s=reply.took_s
    )


CONTACTS_MAX = 20


def _check_pilot(caller: Caller) -> None:
    """Refuse who pilots no robot, by their role or by a grant."""
    if not caller.rights.may_any(Right.PILOT):
        raise Problem(403, f"{caller.name} pilots no robot and may not do this.")


def _check_whose(caller: Caller, person: str) -> None:
    _check_pilot(caller)
    if not _is_admin(caller) and _own_name(caller) != person:
        raise Problem(403, f"Only {person} and admins may see or change how {person} is told.")


def _is_admin(caller: Caller) -> bool:
    return Right.ADMINISTER in caller.role.rights


def _own_name(caller: Caller) -> str:
    """Return whose contacts the caller's own are; a script, however it is named, has none."""
    return "" if caller.proof.kind == "token" else caller.name


def _log(session: Session, foundation: Foundation, caller: Caller, kind: str, what: str) -> None:
    add_event(session, foundation.clock.now(), kind, f"{caller.name} changed {what}.")


async def _keep(foundation: Foundation, name: str, text: str | None) -> None:
    await asyncio.to_thread(foundation.secrets.set_notice_address, name, text)


def _checked(model: Any, given: dict[str, Any]) -> Any:  # noqa: ANN401 - of three models
    try:
        return model.model_validate(given)
    except ValidationError as error:
        raise invalid(error) from None


def _wrong(path: list[str | int], message: str) -> Problem:
    return unprocessable("1 field is wrong.", [FieldError(loc=path, msg=message)])


async def _mail_server(foundation: Foundation) -> MailServer | None:
    try:
        text = await asyncio.to_thread(foundation.secrets.notice_address, MAIL_SERVER)
        return None if text is None else MailServer.model_validate_json(text)
    except (SecretUnreadableError, ValidationError):
        return None


async def _station(
    foundation: Foundation, notices: Notices, heartbeat: Heartbeat
) -> NoticeStationView:
    def read(session: Session) -> tuple[list[Reachable], NoticeSettings]:
        return query.everybody(session), read_settings(session)

    people, settings = await foundation.store.query(read)
    server = await _mail_server(foundation)
    reached = {one.name for one in people if any(contact.enabled for contact in one.contacts)}
    named = dict.fromkeys(name for step in settings.steps for name in step.people)
    mail = None
    if server is not None:
        mail = same(MailServerView, server, has_password=bool(server.password))
    return NoticeStationView(
        settings=settings,
        people=[person.name for person in people],
        unreachable=[name for name in named if name not in reached],
        link_origin=notices.deliveries.link_origin,
        mail_server=mail,
        heartbeat=await _heartbeat(foundation, heartbeat),
    )


async def _heartbeat(foundation: Foundation, heartbeat: Heartbeat) -> HeartbeatView:
    beat, hint = heartbeat.last, ""
    try:
        text = await asyncio.to_thread(foundation.secrets.notice_address, HEARTBEAT)
        if text is not None:
            hint = WatcherAddress.model_validate_json(text).host
    except (SecretUnreadableError, ValidationError):
        hint = "an address that cannot be read"
    return HeartbeatView(
        hint=hint,
        sent_at=None if beat is None else beat.at,
        is_heard=None if beat is None else beat.is_heard,
        reply="" if beat is None else beat.reply,
    )


def _person(found: Reachable) -> PersonNoticesView:
    return PersonNoticesView(
        person=found.name,
        wishes=Wishes.model_validate(found.wishes),
        contacts=[same(ContactView, contact) for contact in found.contacts],
        may_acknowledge=rights_of(found).may_any(Right.PILOT),
    )


def _notice(record: NoticeRecord) -> NoticeView:
    return same(NoticeView, record)
