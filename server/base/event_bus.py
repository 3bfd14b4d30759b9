"""Typed events between the capabilities of one station.

A capability publishes what happened to what it owns, after the commit that made it true; others
subscribe when they are installed. Nobody asks again and again for what could be told.
"""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from db.query.alarms import AlarmRecord
from db.query.events import EventRecord
from db.query.jobs import JobRecord

E = TypeVar("E")


class EventBus:
    """Hands each event to everyone who subscribed to its type, in the order of subscription.

    Belongs to one event loop. A handler must return at once and must not raise: longer work goes
    into a task or a ``RetryQueue``. Events published by a handler are handed on after the present
    one, so that all subscribers see events in one order.
    """

    def __init__(self) -> None:
        self._handlers: dict[type, list[Callable[[Any], object]]] = defaultdict(list)
        self._waiting: list[object] = []
        self._is_publishing = False

    def subscribe(self, kind: type[E], handler: Callable[[E], object]) -> None:
        """Have every event of exactly this type handed to a handler."""
        self._handlers[kind].append(handler)

    def publish(self, event: object) -> None:
        """Tell everyone who subscribed to the type of this event; call it after the commit."""
        self._waiting.append(event)
        if self._is_publishing:
            return
        self._is_publishing = True
        try:
            while self._waiting:
                current = self._waiting.pop(0)
                for handler in self._handlers[type(current)]:
                    handler(current)
        finally:
            self._waiting.clear()
            self._is_publishing = False


@dataclass(frozen=True, slots=True)
class SettingsChanged:
    """A new version of tunable settings was saved."""

    kind: str
    robot: str | None
    """Whose; ``None`` for every robot that has none of its own."""


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
