"""A message on its way to its service: tried, kept, tried again, given up.

Each contact has its own patience: one that fails is left alone for ever longer and holds up no
other. That a service took a message is no proof that anybody read it.
"""

import asyncio
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final

from pydantic import ValidationError
from sqlalchemy.orm import Session

from db.fault import StoreUnavailableError
from db.identity import public_id
from db.query.station import notices as query
from db.query.station.notices import ItemRecord, NoticeRecord, Reachable
from robot_link.clock import SystemClock, monotonic_s
from server.access.role import Right, Rights, Role
from server.base.foundation import Foundation
from server.base.retry_queue import until_stored
from server.base.secret import SecretUnreadableError, secret_fault
from server.notice import state
from server.notice.contact import Address, MailServer, apprise_url
from server.notice.escalation import rights_of
from server.notice.link import link_word
from server.notice.message import page_of
from server.notice.sender import Message, Reply, Sender
from server.notice.state import NoticeEvidence

log = logging.getLogger(__name__)
BACK_OFF_S: Final = (5.0, 15.0, 60.0, 300.0, 900.0, 1800.0)
"""Between two attempts at a contact; the last for all that follow."""
LIFE: Final = timedelta(hours=24)
"""By the wall, of a message that no service takes and of the link in it: a demo's faster clock
does not shorten what a person has."""
REFUSALS_MAX: Final = 3
MAIL_SERVER: Final = "mail-server"
"""Name of the secret that holds the account with the mail server."""
OWN_CAUSE: Final = "notice"
"""Of the alarm that notices cannot be sent."""
_TEST = "Test: a notice of the ground station"
_TEST_TEXT = "Somebody asked for this test. If you can read it, this contact works."


REPEATED: Final = "This may be a repetition: the answer to an earlier attempt is not known."
_OVER: Final = "All of it was seen, or given to somebody else, meanwhile."
_STOPPED: Final = "The station stopped before the answer came."


@dataclass(slots=True)
class _Health:
    """How a contact does, as far as this run of the station knows."""

    is_busy: bool = False
    failures: int = 0
    not_before_s: float = 0.0
    failing_since: datetime | None = None
    reason: str = ""
    title: str = ""


@dataclass(frozen=True, slots=True)
class _Standing:
    """How a message stands just before it is handed over."""

    items: list[ItemRecord]
    notice: NoticeRecord
    robots: set[str | None]
    """Of which it tells; None for the station."""
    is_over: bool
    person: Reachable | None


@dataclass(frozen=True, slots=True)
class _Outcome:
    """What came of an attempt."""

    evidence: NoticeEvidence
    reply: str
    unanswered: int | None = None
    """After how many attempts in all the service may have it; ``None`` as noted before."""


class Deliveries:
    """Hands messages to services. Belongs to one event loop.

    Args:
        foundation: What the station stands on.
        sender: Speaks with the services.
        on_free: Told whenever a contact can be sent to again.
    """

    def __init__(self, foundation: Foundation, sender: Sender, on_free: Callable[[], None]) -> None:
        self._foundation = foundation
        self._store, self._clock = foundation.store, foundation.clock
        self._wall = SystemClock()
        self._sender = sender
        self._on_free = on_free
        self._health: dict[str, _Health] = {}
        self._timers: dict[str, asyncio.TimerHandle] = {}

    @property
    def link_origin(self) -> str | None:
        """Address at which people reach the station; ``None``: links cannot be written."""
        origins = self._foundation.settings.public_origins
        return origins[0].rstrip("/") if origins else None

    def warm_up(self) -> None:
        """Start what sends before a message is in a hurry."""
        self._foundation.background.start("notice sender", self._sender.warm_up())

    def forgive(self) -> None:
        """Try every contact again at once: something about them is another one."""
        for health in self._health.values():
            health.not_before_s = 0.0
        self._on_free()

    async def forget(self, contact: str) -> None:
        """Take that a contact is gone; whether notices can be sent is told without it."""
        self._health.pop(contact, None)
        await self._tell_of_health()

    def is_free(self, contact: str) -> bool:
        """Tell whether a contact can be sent to now; if not, ``on_free`` tells when it can."""
        health = self._health.setdefault(contact, _Health())
        wait_s = health.not_before_s - monotonic_s()
        if not health.is_busy and wait_s > 0.0:
            self.wake_in(contact, wait_s)
        return not health.is_busy and wait_s <= 0.0

    def wake_in(self, key: str, wait_s: float) -> None:
        """Have ``on_free`` called after a time of the wall."""
        old = self._timers.pop(key, None)
        if old is not None:
            old.cancel()
        self._timers[key] = asyncio.get_running_loop().call_later(wait_s, self._on_free)

    def begin(self, notice: NoticeRecord) -> None:
        """Send a message to a contact that is free."""
        self._health[notice.contact].is_busy = True
        self._foundation.background.start(f"send {notice.id}", self._deliver(notice))

    async def stop(self) -> None:
        """End what sends; what was in hand is sent again at the next start."""
        for timer in self._timers.values():
            timer.cancel()
        await self._sender.stop()

    async def load(self) -> None:
        """End the tests that were in hand when the station last stopped: nobody waits for them."""
        now = self._clock.now()

        def write(session: Session) -> None:
            for notice in query.queued_notices(session):
                if notice.topic == "test":
                    state.apply(session, notice.id, NoticeEvidence.HOPELESS, _STOPPED, now)

        await self._store.write(write)

    async def test(self, contact: str) -> tuple[NoticeRecord, Reply]:
        """Send a test to a contact now and return what came of it; it is sent once.

        Raises:
            UnknownIdError: If there is no such contact.
        """
        now = self._clock.now()

        def write(session: Session) -> str:
            query.get_contact(session, contact)
            row = query.add_notice(session, contact, "test", now)
            row.title, row.text = self.marked(_TEST), _TEST_TEXT
            return public_id("notice", row.key)

        notice = await self._store.write(write)
        try:
            record = await self._store.query(lambda session: query.get_notice(session, notice))
            reply = await self._hand_over(record, [], Rights(Role.NONE))
        except asyncio.CancelledError:
            cancelled = _Outcome(NoticeEvidence.HOPELESS, "It was cancelled.")
            await asyncio.shield(self._settle(notice, cancelled))
            raise
        evidence = NoticeEvidence.TAKEN if reply.is_handed else NoticeEvidence.HOPELESS
        await self._settle(notice, _Outcome(evidence, reply.text, int(reply.is_doubtful)))
        if reply.is_handed:
            self._health.setdefault(contact, _Health()).not_before_s = 0.0
            self._on_free()
        return await self._store.query(lambda session: query.get_notice(session, notice)), reply

    def marked(self, title: str) -> str:
        """Return a title that says where robots do not exist."""
        return f"SIMULATION {title}" if self._foundation.settings.simulation else title

    async def _deliver(self, notice: NoticeRecord) -> None:
        """Try once to have a service take a message, and keep what came of it."""
        health = self._health.setdefault(notice.contact, _Health())
        try:
            outcome = await self._try(notice.id)
            if outcome is not None:
                await until_stored("a notice", lambda: self._settle(notice.id, outcome))
                await self._tell_of_health()
        except StoreUnavailableError as error:
            log.warning("%s waits for the storage: %s", notice.id, error)
            health.not_before_s = monotonic_s() + BACK_OFF_S[0]
        finally:
            health.is_busy = False
            self._on_free()

    async def _try(self, notice_id: str) -> _Outcome | None:
        """Try a message once; ``None`` if it was settled since somebody listed it as queued."""

        def read(session: Session) -> _Standing:
            notice = query.get_notice(session, notice_id)
            people = {person.name: person for person in query.everybody(session)}
            return _Standing(
                notice=notice,
                items=query.items_of(session, notice_id),
                robots=query.robots_of(session, notice_id),
                is_over=query.is_all_over(session, notice_id),
                person=people.get(notice.person),
            )

        standing = await self._store.query(read)
        notice, person = standing.notice, standing.person
        if notice.state != "queued":
            return None
        if standing.is_over:
            return _Outcome(NoticeEvidence.SEEN, _OVER)
        if person is None or not any(one.id == notice.contact for one in person.contacts):
            return _Outcome(NoticeEvidence.HOPELESS, "There is no such contact any more.")
        rights = rights_of(person)
        if not all(rights.sees(robot) for robot in standing.robots):
            reason = f"{person.name} may not see all of it any more."
            return _Outcome(NoticeEvidence.HOPELESS, reason)
        reply = await self._hand_over(notice, standing.items, rights)
        evidence = self._judged(notice, reply)
        return _Outcome(evidence, reply.text, notice.unanswered + reply.is_doubtful)

    def _judged(self, notice: NoticeRecord, reply: Reply) -> NoticeEvidence:
        """Return what a reply proves, and take what it tells of its contact."""
        health = self._health.setdefault(notice.contact, _Health())
        if reply.is_handed:
            health.failures = 0
            health.failing_since = None
            return NoticeEvidence.TAKEN
        delay_s = BACK_OFF_S[min(health.failures, len(BACK_OFF_S) - 1)]
        health.failures += 1
        health.not_before_s = monotonic_s() + delay_s
        health.failing_since = health.failing_since or self._clock.now()
        health.reason, health.title = reply.text, f"{notice.person} ({notice.contact_title})"
        expires_at = notice.link_expires_at
        is_old = expires_at is not None and self._wall.now() >= expires_at
        is_refused = reply.is_refusal and notice.attempts + 1 >= REFUSALS_MAX
        return NoticeEvidence.HOPELESS if is_old or is_refused else NoticeEvidence.NOT_TAKEN

    async def _hand_over(
        self, notice: NoticeRecord, items: Sequence[ItemRecord], rights: Rights
    ) -> Reply:
        try:
            address, mail = await asyncio.to_thread(self._addresses, notice.contact)
        except (SecretUnreadableError, OSError) as error:
            return _no(secret_fault(error))
        if address is None:
            return _no("Its address is not known any more; enter it again.")
        origin, text = self.link_origin, notice.text
        if notice.unanswered:
            text = f"{REPEATED}\n\n{text}"
        page = "" if origin is None or not items else page_of(origin, items)
        if page:
            text += f"\n\nPage: {page}"
        theirs = [item for item in items if item.alarm and rights.may(Right.PILOT, item.robot)]
        if origin and theirs:
            text += await asyncio.to_thread(self._link_text, origin, notice)
        extras = {"notice": notice.id, "topic": notice.topic, "level": notice.level}
        extras["repeated"] = "maybe" if notice.unanswered else "no"
        if len(items) == 1:
            one = items[0]
            extras |= {"alarm": one.alarm or "", "robot": one.robot or ""}
        url = apprise_url(address, mail, notice.level, extras, page)
        if url is None:
            return _no("The station has no mail server; an administrator enters one.")
        text += f"\n\n{notice.id}"
        await until_stored("a notice", lambda: self._begin_attempt(notice.id))
        return await self._sender.send(Message(url, notice.title, text, notice.level))

    async def _begin_attempt(self, notice: str) -> None:
        await self._store.write(lambda session: query.begin_attempt(session, notice))

    def _link_text(self, origin: str, notice: NoticeRecord) -> str:
        expires_at = notice.link_expires_at
        if expires_at is None:
            return ""
        word = link_word(self._foundation.secrets.notice_key(), notice.id, expires_at)
        return f"\nAcknowledge (once, within 24 h): {origin}/ack/{word}"

    def _addresses(self, contact: str) -> tuple[Address | None, MailServer | None]:
        secrets = self._foundation.secrets
        try:
            address, mail = secrets.notice_address(contact), secrets.notice_address(MAIL_SERVER)
            return (
                None if address is None else Address.model_validate_json(address),
                None if mail is None else MailServer.model_validate_json(mail),
            )
        except ValidationError:
            raise SecretUnreadableError("A file of the secret folder holds no address.") from None

    async def _settle(self, notice: str, outcome: _Outcome) -> None:
        now = self._clock.now()
        told = (outcome.evidence, outcome.reply, now, outcome.unanswered)
        await self._store.write(lambda session: state.apply(session, notice, *told))
        self._foundation.feed.mark("notices")

    async def _tell_of_health(self) -> None:
        """Raise and clear the one alarm that notices cannot be sent."""
        failing = [one for one in self._health.values() if one.failing_since is not None]
        if not failing:
            await self._foundation.alarms.clear(OWN_CAUSE)
            return
        since = min(one.failing_since for one in failing if one.failing_since is not None)
        worst = min(failing, key=lambda one: one.failing_since or since)
        others = "" if len(failing) == 1 else f" and {len(failing) - 1} more"
        text = f"Notices to {worst.title}{others} cannot be sent since {since:%H:%MZ}: "
        await self._foundation.alarms.raise_(OWN_CAUSE, text + worst.reason)


def _no(reason: str) -> Reply:
    return Reply(is_handed=False, is_refusal=False, is_doubtful=False, text=reason, took_s=0.0)
