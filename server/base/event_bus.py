"""Typed events between the capabilities of one station.

A capability publishes what happened to what it owns, after the commit that made it true; others
subscribe when they are installed. Nobody asks again and again for what could be told.

Whoever changes the database leaves the event in the transaction (``db.writer.tell_after_commit``),
so that it is told exactly if that is committed, whichever capability began it.
"""

import logging
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from sqlalchemy.orm import Session

from db.query.station.alarms import AlarmRecord
from db.query.station.events import EventRecord
from db.query.station.jobs import JobRecord
from db.writer import tell_after_commit

log = logging.getLogger(__name__)
E = TypeVar("E")


class EventBus:
    """Hands each event to everyone who subscribed to its type, in the order of subscription.

    Belongs to one event loop. A handler must return at once: longer work goes into a task or a
    ``RetryQueue``. It must not raise; if it does, the others hear of the event all the same. Events
    published by a handler are handed on after the present one, so that all subscribers see events
    in one order.
    """

    def __init__(self) -> None:
        self._handlers: dict[type, list[Callable[[Any], object]]] = defaultdict(list)
        self._within: dict[type, list[Callable[[Session, Any], object]]] = defaultdict(list)
        self._waiting: list[object] = []
        self._is_publishing = False
        self.on_failure: Callable[[str, Exception], None] | None = None
        """Told of a handler that raised."""

    def subscribe(self, kind: type[E], handler: Callable[[E], object]) -> None:
        """Have every event of exactly this type handed to a handler."""
        self._handlers[kind].append(handler)

    def subscribe_within(self, kind: type[E], handler: Callable[[Session, E], object]) -> None:
        """Have what follows from an event written with it, both or neither.

        The handler runs on the writer's thread and touches nothing but the session; if it raises,
        nothing is written.
        """
        self._within[kind].append(handler)

    def write(self, session: Session, event: object, about: str) -> None:
        """Write what follows from an event with it, and tell everyone else after the commit.

        Args:
            session: The transaction of the event.
            event: What is true once that is committed.
            about: A later event of its type about this takes its place.
        """
        for handler in self._within[type(event)]:
            handler(session, event)
        tell_after_commit(session, event, about)

    def publish(self, *events: object) -> None:
        """Tell everyone who subscribed to the types of these events; call it after the commit."""
        self._waiting += events
        if self._is_publishing:
            return
        self._is_publishing = True
        try:
            while self._waiting:
                current = self._waiting.pop(0)
                for handler in self._handlers[type(current)]:
                    try:
                        handler(current)
                    except Exception as error:
                        name = type(current).__name__
                        log.exception("a handler of %s failed", name)
                        if self.on_failure is not None:
                            self.on_failure(f"what follows {name}", error)
        finally:
            self._is_publishing = False


@dataclass(frozen=True, slots=True)
class SettingsChanged:
    """A new version of tunable settings was saved."""

    kind: str
    robot: str | None
    """Whose; ``None`` for every robot that has none of its own."""


@dataclass(frozen=True, slots=True)
class ChannelsChanged:
    """The catalogue of channels is another one."""

    key: str
    """The channel that was added or changed."""


@dataclass(frozen=True, slots=True)
class JobChanged:
    """A job began, got further or ended."""

    job: JobRecord


@dataclass(frozen=True, slots=True)
class AlarmChanged:
    """An alarm was raised, changed, acknowledged or closed."""

    alarm: AlarmRecord


@dataclass(frozen=True, slots=True)
class EventLogged:
    """The event log has a new row, of this process or of another such as the command line."""

    event: EventRecord
