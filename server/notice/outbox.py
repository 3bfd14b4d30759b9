"""Whom the station tells of what: from alarms and events to messages that are ready to be sent.

What is to be told is written before anything is sent, and what became of it after, so a station
that is killed in between sends it again: at least once, with one key (its notice's id). It says
that it may be a repetition where the answer to an earlier attempt is not known. What waits for a
contact on a topic becomes one message, and messages on a topic leave no faster than ``BURST`` and
then one in ``REFILL_S``: ten thousand causes are a few digests.
"""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Final

from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.identity import public_id
from db.query.station import notices as query
from db.query.station.alarms import AlarmRecord
from db.query.station.events import EventFilter, EventRecord, events_after, last_cursor
from db.query.station.notices import NoticeRecord, Reachable
from db.query.station.settings import get_setting, put_setting
from robot_link.clock import SystemClock, monotonic_s
from server.base.event_bus import AlarmChanged, EventLogged
from server.base.foundation import Foundation
from server.base.retry_queue import until_stored
from server.base.wakeups import Wakeups
from server.notice import escalation
from server.notice.delivery import LIFE, Deliveries
from server.notice.escalation import EVENT_TOPICS
from server.notice.message import Place, compose
from server.notice.sender import Sender
from server.notice.settings import read_settings
from server.notice.wish import Wishes

log = logging.getLogger(__name__)
REST_S: Final = 0.2
"""Wall time between two looks, so that a burst is one message."""
BURST: Final = 4
REFILL_S: Final = 20.0
_AT_ONCE: Final = 250
"""Alarms, cases and events in one transaction: others write too."""
_CURSOR: Final = "notices.cursor"
PlacesOfRobots = Callable[[], Mapping[str, Place]]


@dataclass(slots=True)
class _Bucket:
    """How many messages on a topic may leave for a contact at once."""

    tokens: float = BURST
    at_s: float = field(default_factory=monotonic_s)

    def wait_s(self) -> float:
        """Take one, or return how long that has to wait."""
        now_s = monotonic_s()
        self.tokens = min(BURST, self.tokens + (now_s - self.at_s) / REFILL_S)
        self.at_s = now_s
        if self.tokens < 1.0:
            return (1.0 - self.tokens) * REFILL_S
        self.tokens -= 1.0
        return 0.0


class Notices:
    """Decides who is told of what. Belongs to one event loop.

    Args:
        foundation: What the station stands on.
        places: Tells where robots were last.
        sender: Hands messages to services.
    """

    def __init__(self, foundation: Foundation, places: PlacesOfRobots, sender: Sender) -> None:
        self._alarms, self._store, self._clock = (
            foundation.alarms,
            foundation.store,
            foundation.clock,
        )
        self._places = places
        self._changed: dict[str, AlarmRecord] = {}
        self._events: list[EventRecord] = []
        self._wakeups = Wakeups(foundation.clock, REST_S)
        self._buckets: dict[tuple[str, str], _Bucket] = {}
        self.deliveries = Deliveries(foundation, sender, self._wakeups.wake)

    def alarm_changed(self, event: AlarmChanged) -> None:
        """Take that an alarm is another one."""
        self._changed[event.alarm.id] = event.alarm
        self._wakeups.wake()

    def event_logged(self, event: EventLogged) -> None:
        """Take that something happened that people may want to hear of."""
        if event.event.kind in EVENT_TOPICS:
            self._events.append(event.event)
            self._wakeups.wake()

    async def load(self) -> None:
        """Take up what the station was to tell when it last ran."""
        await self.deliveries.load()
        alarms, now = self._alarms.open, self._clock.now()

        def read(session: Session) -> list[EventRecord]:
            known = get_setting(session, _CURSOR)
            if known is None:
                put_setting(session, _CURSOR, {"cursor": last_cursor(session)})
                return []
            escalation.end_vanished(session, {alarm.id for alarm in alarms}, now)
            return _untold(session, int(known["cursor"]))

        untold = await self._store.write(read)
        # What was told meanwhile is newer, and may be among what was read.
        known = {event.cursor: event for event in (*untold, *self._events)}
        self._events = [known[cursor] for cursor in sorted(known)]
        self._changed = {alarm.id: alarm for alarm in alarms} | self._changed
        self._wakeups.wake()

    async def run(self) -> None:
        """Tell people until cancelled."""
        await until_stored("notices", self._warm_up)
        while True:
            await self._wakeups.next()
            await until_stored("notices", self._plan)
            await until_stored("notices", self._dispatch)
            await until_stored("notices", self._set_due)

    async def _warm_up(self) -> None:
        if any(person.contacts for person in await self._store.query(query.everybody)):
            self.deliveries.warm_up()

    async def _set_due(self) -> None:
        now = self._clock.now()
        due = await self._store.query(lambda session: query.next_due(session, now))
        self._wakeups.set_due("", due)

    async def _plan(self) -> None:
        while await self._plan_some():
            pass

    async def _plan_some(self) -> bool:
        """Write down who is to hear of what; tell whether there may be more to write."""
        changed = dict(list(self._changed.items())[:_AT_ONCE])
        events = self._events[:_AT_ONCE]
        now = self._clock.now()
        over = {one.id for one in self._alarms.open if one.cleared_at is not None}

        def write(session: Session) -> int:
            escalation.take_alarms(session, changed, now)
            for event in events:
                escalation.take_event(session, event, now)
            if events:
                put_setting(session, _CURSOR, {"cursor": events[-1].cursor})
            people, settings = query.everybody(session), read_settings(session)
            session.flush()
            return escalation.advance(session, people, settings, over, now, _AT_ONCE)

        looked_at = await self._store.write(write)
        for key, alarm in changed.items():
            if self._changed.get(key) is alarm:
                del self._changed[key]
        del self._events[: len(events)]
        return bool(looked_at == _AT_ONCE or self._changed or self._events)

    async def _dispatch(self) -> None:
        """Send what waits, each contact one message at a time."""
        now = self._clock.now()

        def read(session: Session) -> tuple[list[NoticeRecord], list[tuple[str, str]]]:
            return query.queued_notices(session), query.waiting_topics(session, now)

        queued, waiting = await self._store.query(read)
        for notice in queued:
            if notice.topic != "test" and self.deliveries.is_free(notice.contact):
                self.deliveries.begin(notice)
        for contact, topic in waiting:
            if not self.deliveries.is_free(contact):
                continue
            wait_s = self._buckets.setdefault((contact, topic), _Bucket()).wait_s()
            if wait_s > 0.0:
                self.deliveries.wake_in(f"{contact} {topic}", wait_s)
                continue
            notice = await self._take_up(contact, topic, now)
            if notice is not None:
                self.deliveries.begin(notice)

    async def _take_up(self, contact: str, topic: str, now: datetime) -> NoticeRecord | None:
        """Make a message of what waits; ``None`` if nothing does, or its contact has just gone."""
        places = self._places()
        expires_at = SystemClock().now() + LIFE

        def write(session: Session) -> NoticeRecord | None:
            person = query.find_reachable(session, query.get_contact(session, contact).person)
            _drop_unseen(session, contact, person)
            row = query.take_up(session, contact, topic, now)
            if row is None:
                return None
            notice = public_id("notice", row.key)
            wishes = Wishes.model_validate(person.wishes)
            words = compose(
                topic,
                query.items_of(session, notice),
                query.level_counts(session, notice),
                places,
                wishes.position,
                now,
            )
            row.title, row.text = self.deliveries.marked(words.title), words.text
            row.link_expires_at = expires_at
            session.flush()
            return query.get_notice(session, notice)

        try:
            return await self._store.write(write)
        except UnknownIdError:
            log.info("%s has gone since something waited for it", contact)
            return None


def _untold(session: Session, cursor: int) -> list[EventRecord]:
    """Return every event after a cursor that people are told of, the oldest first."""
    wanted, found = EventFilter(kinds=tuple(EVENT_TOPICS)), list[EventRecord]()
    while True:
        part = events_after(session, cursor, wanted, limit=_AT_ONCE)
        found += part
        if len(part) < _AT_ONCE:
            return found
        cursor = part[-1].cursor


def _drop_unseen(session: Session, contact: str, person: Reachable) -> None:
    """Forget what waited for a person who may not see it any more."""
    rights = escalation.rights_of(person)
    waiting = query.waiting_robots(session, contact)
    unseen = {robot for robot in waiting if not rights.sees(robot)}
    if unseen:
        query.drop_waiting(session, contact, unseen)
