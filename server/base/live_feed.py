"""The live stream: one JSON batch a tick, encoded once, for everyone who watches.

Two kinds of news travel in it. *Parts* (a robot's gauges, a plan's progress) are latest-wins: each
client gets the newest value of what changed since its own last batch, so a slow client conflates
and nothing piles up for it. *Events* are never skipped: a client holds a cursor, and what is no
longer in memory for it comes from the database.

What is too large for the stream, or wanted by few, is read by REST. The section ``changed`` tells
when to read it again, so that nobody has to poll.
"""

import asyncio
import contextlib
import itertools
import logging
import time
from collections import deque
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Final

import msgspec

from db.query.station.events import EventRecord, events_after
from db.store import Store
from robot_link.clock import Clock
from server.base.event_bus import EventLogged
from server.base.event_log import EventLog

log = logging.getLogger(__name__)

TICK_S = 0.1
"""Batches go out no faster, but for what a person waits for."""
AT_FULL_RATE = 25
"""So many clients are told each tick."""
LONGER_S = 0.002
"""For each client more, everybody's tick is so much longer: what they cost together grows little,
from 250 batches a second to 400 of 100 clients, who are told four times a second each."""
SLOWEST_S = 0.5
QUIET_S = 1.0
"""A batch goes out this often even when nothing changed, so that a dead connection is noticed."""
EVENTS_IN_MEMORY = 1000
EVENTS_PER_BATCH = 500
PARTS_PER_SECTION = 100
CHANGED = "changed"
SECTIONS = ("robots", "plans", "missions", "jobs", "commands", "transfers", CHANGED)
"""What the stream carries; a capability puts into its own."""
_PROMPT = ("commands", "transfers")
"""Sections that are told as soon as may be: somebody is looking at what becomes of an order."""
_LEAST_S = 0.02
"""Between two batches in any case, so that a burst goes out together."""

Value = Callable[[], object]
Send = Callable[[str], Awaitable[None]]
CountAlarms = Callable[[frozenset[str] | None], int]
"""Returns how many alarms nobody has seen yet, of some robots or, for ``None``, of all."""
_encoder = msgspec.json.Encoder()


@dataclass(slots=True)
class _Part:
    robot: str | None
    value: Value | None
    """``None`` once it was asked for: it may hold a whole plan."""
    public: Value | None = None
    changed: int = 0
    """Tick of the newest encoding."""
    encoded: msgspec.Raw | None = None
    is_due: bool = False


@dataclass(frozen=True, slots=True)
class _Happening:
    cursor: int
    robot: str | None
    encoded: msgspec.Raw


@dataclass(frozen=True, slots=True)
class Audience:
    """What one client may be told."""

    robots: frozenset[str] | None = None
    """Only of these robots, and nothing of the station as a whole; ``None`` for everything."""
    is_public: bool = False
    """Whether it is anybody at all, who is told what a part says to the public."""


WHOLE: Final = Audience()


_Place = tuple[int, int, frozenset[str] | None, Audience]
"""Where a client is, and what it may be told: clients of the same place get the same text."""


@dataclass(slots=True)
class _Reader:
    """Where one client is."""

    robots: frozenset[str] | None
    """What it asked for."""
    audience: Audience
    cursor: int
    seen: int = -1

    @property
    def place(self) -> _Place:
        """What it shares with others."""
        return self.seen, self.cursor, self.robots, self.audience

    def wants(self, robot: str | None) -> bool:
        """Tell whether a part or an event is for this client."""
        may = self.audience.robots
        if may is not None and robot not in may:
            return False
        return self.robots is None or robot is None or robot in self.robots

    def wants_part(self, section: str, part: _Part) -> bool:
        """Tell whether a part is for this client; that something shared changed is for all."""
        if section == CHANGED and part.robot is None:
            return True
        if self.audience.is_public and section != CHANGED and part.public is None:
            return False
        return self.wants(part.robot)


class LiveFeed:
    """Keeps what the live stream says and hands it to any number of clients.

    Belongs to one event loop. ``run`` is its heartbeat; without it no client gets anything.
    """

    def __init__(
        self, store: Store, clock: Clock, count_alarms: CountAlarms, log: EventLog
    ) -> None:
        self._store = store
        self._clock = clock
        self._count_alarms = count_alarms
        self._log = log
        self._parts: dict[str, dict[str, _Part]] = {section: {} for section in SECTIONS}
        self._due: list[_Part] = []
        self._events: deque[_Happening] = deque(maxlen=EVENTS_IN_MEMORY)
        self._forgotten = 0
        self._cursor = 0
        self._ticks = 0
        self._tick = asyncio.Event()
        self._news = asyncio.Event()
        self._hurry = asyncio.Event()
        self._revisions = itertools.count(time.time_ns() // 1000)  # never one of an earlier run
        self._closed = False
        self.followers = 0
        """Clients that follow now."""
        self._batches: dict[_Place, str] = {}
        self._news_of: dict[_Place, bool] = {}

    def put(
        self,
        section: str,
        key: str,
        value: Value,
        robot: str | None = None,
        *,
        public: Value | None = None,
    ) -> None:
        """Note that a part changed; ``value`` is asked for it at most once a tick.

        What anybody may know of it, by a read-only link, is ``public``; by default nothing.

        Each section keeps its ``PARTS_PER_SECTION`` last changed parts for clients to come.
        """
        parts = self._parts[section]
        part = parts.pop(key, None) or _Part(robot, value)
        parts[key] = part
        part.value, part.public = value, public
        if not part.is_due:
            part.is_due = True
            self._due.append(part)
            self._news.set()
        if section in _PROMPT:
            self._hurry.set()
        if len(parts) > PARTS_PER_SECTION and section != CHANGED:
            del parts[next(iter(parts))]

    def mark(self, resource: str, robot: str | None = None) -> None:
        """Tell that what REST says of a resource, or of one robot's, is not what it said before."""
        revision = next(self._revisions)
        key = resource if robot is None else f"{resource}/{robot}"
        self.put(CHANGED, key, lambda: revision, robot)

    async def run(self) -> None:
        """Tick on news, at most once in ``tick_s`` but for ``_PROMPT``, until cancelled."""
        await self._log.is_known.wait()
        self._cursor = self._forgotten = max(self._cursor, self._log.cursor)
        while True:
            self._news.clear()
            self._hurry.clear()
            self._advance()
            await asyncio.sleep(_LEAST_S)
            tick_s = self.tick_s
            await _set_within(self._hurry, tick_s - _LEAST_S)
            await _set_within(self._news, QUIET_S - tick_s)

    @property
    def tick_s(self) -> float:
        """Time between two batches now, but for what a person waits for."""
        more = max(0, self.followers - AT_FULL_RATE)
        return min(TICK_S + LONGER_S * more, SLOWEST_S)

    async def follow(
        self,
        send: Send,
        robots: frozenset[str] | None,
        after: int | None,
        audience: Audience = WHOLE,
    ) -> None:
        """Send batches to one client until the feed closes or ``send`` fails.

        Args:
            send: Takes one JSON text; the next batch waits for it.
            robots: Robots that the client asked for; ``None`` for all.
            after: Cursor of the last event that the client knows; ``None`` for the events from
                now on.
            audience: What the client may be told.
        """
        self.followers += 1
        try:
            await self._follow(send, robots, after, audience)
        finally:
            self.followers -= 1

    async def _follow(
        self, send: Send, robots: frozenset[str] | None, after: int | None, audience: Audience
    ) -> None:
        while not (self._ticks or self._closed):
            await self._tick.wait()
        reader = _Reader(robots, audience, self._cursor if after is None else after)
        sent_s = -QUIET_S
        now_s = asyncio.get_running_loop().time
        while not self._closed:
            if self._has_news(reader) or now_s() - sent_s >= QUIET_S - TICK_S:
                batch = await self._batch(reader)
                sent_s = now_s()
                await send(batch)
            if not self._has_news(reader):
                await self._tick.wait()

    def close(self) -> None:
        """Let every ``follow`` return."""
        self._closed = True
        self._tick.set()

    def take(self, logged: EventLogged) -> None:
        """Take an event of the log for everyone who watches."""
        if len(self._events) == EVENTS_IN_MEMORY:
            self._forgotten = self._events[0].cursor
        event = logged.event
        self._events.append(_happening(event))
        self._cursor = event.cursor
        self._news.set()

    def _advance(self) -> None:
        self._ticks += 1
        self._batches.clear()
        self._news_of.clear()
        while self._due:
            part = self._due.pop()
            part.is_due = False
            value, part.value = part.value, None
            if value is None:
                continue
            try:
                part.encoded = msgspec.Raw(_encoder.encode(value()))
            except Exception:  # what one capability cannot show must not silence the others
                log.exception("a part of the live stream is not shown")
            else:
                part.changed = self._ticks
        tick, self._tick = self._tick, asyncio.Event()
        tick.set()

    def _has_news(self, reader: _Reader) -> bool:
        if reader.seen < 0 or reader.cursor < self._cursor:
            return True
        place = reader.place
        if place not in self._news_of:
            self._news_of[place] = any(
                part.changed > reader.seen and reader.wants_part(section, part)
                for section, parts in self._parts.items()
                for part in parts.values()
            )
        return self._news_of[place]

    async def _batch(self, reader: _Reader) -> str:
        key = reader.place
        at = self._clock.now()
        if reader.cursor < self._forgotten:
            events = [
                _happening(event)
                for event in await self._store.query(
                    lambda session: events_after(session, reader.cursor, limit=EVENTS_PER_BATCH)
                )
            ]
            cursor = events[-1].cursor if events else self._cursor
            text = self._encode(reader, events, cursor, at)
        else:
            cursor = max(reader.cursor, self._cursor)  # REST may have told more than this knows
            text = self._batches.get(key) or self._encode(reader, self._since(reader), cursor, at)
            self._batches[key] = text
        reader.cursor, reader.seen = cursor, self._ticks
        return text

    def _since(self, reader: _Reader) -> list[_Happening]:
        newest_first = itertools.takewhile(
            lambda event: event.cursor > reader.cursor, reversed(self._events)
        )
        return list(newest_first)[::-1]

    def _encode(self, reader: _Reader, events: list[_Happening], cursor: int, at: datetime) -> str:
        audience = reader.audience
        batch: dict[str, object] = {
            "at": at,
            "cursor": cursor,
            "events": [
                event.encoded
                for event in events
                if reader.wants(event.robot) and not audience.is_public
            ],
            "alarms": {"unacknowledged": self._count_alarms(audience.robots)},
        }
        for section, parts in self._parts.items():
            batch[section] = {
                key: part.public() if audience.is_public and part.public else part.encoded
                for key, part in parts.items()
                if part.encoded is not None
                and part.changed > reader.seen
                and reader.wants_part(section, part)
            }
        return _encoder.encode(batch).decode()


async def _set_within(event: asyncio.Event, limit_s: float) -> None:
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(limit_s):
            await event.wait()


def _happening(event: EventRecord) -> _Happening:
    return _Happening(event.cursor, event.robot, msgspec.Raw(_encoder.encode(event)))
