"""The messages that wait for one modem at the Iridium gateway.

Source: Iridium Short Burst Data Service Developers Guide 3.0, sections 7.2.4, 9.4.2 and 11.2.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta

CAPACITY = 50
LIFETIME = timedelta(days=5)
PURGE_AT = time(0, 6, 14, tzinfo=UTC)
"""Time of day at which a modem's messages are deleted if one of them is older than LIFETIME."""

LOWEST_PRIORITY = 5


@dataclass(frozen=True, slots=True)
class QueuedMessage:
    """One mobile-terminated message at the gateway."""

    message_id: int
    """The gateway's own number; unique in the network."""
    mtmsn: int
    data: bytes
    priority: int
    """1 (first) to 5."""
    queued_at: datetime
    ready_at: datetime
    """From when on a session can fetch it."""


class MessageQueue:
    """First in, first out within a priority; 1 is served before 5.

    A full queue makes room by dropping the oldest message of the lowest priority, and refuses a
    message whose priority is lower than all that it holds.
    """

    def __init__(self) -> None:
        self._messages: list[QueuedMessage] = []
        self._swept_at: datetime | None = None

    def __len__(self) -> int:
        return len(self._messages)

    def __iter__(self) -> Iterator[QueuedMessage]:
        return iter(sorted(self._messages, key=lambda m: (m.priority, m.message_id)))

    def has_room(self, priority: int) -> bool:
        """Say whether a message of this priority is taken."""
        return len(self) < CAPACITY or priority <= max(m.priority for m in self._messages)

    def put(self, message: QueuedMessage) -> int:
        """Append a message; return its position in the queue, from 1.

        Raises:
            OverflowError: If the queue is full of messages of higher priority.
        """
        if not self.has_room(message.priority):
            raise OverflowError(f"{CAPACITY} messages of higher priority wait already")
        if len(self) == CAPACITY:
            lowest = max(m.priority for m in self._messages)
            self._messages.remove(next(m for m in self if m.priority == lowest))
        self._messages.append(message)
        return list(self).index(message) + 1

    def ready(self, now: datetime) -> list[QueuedMessage]:
        """Return what a session can fetch at this time, the next one first."""
        return [message for message in self if message.ready_at <= now]

    def remove(self, message: QueuedMessage) -> None:
        """Take a message out; one that is gone already is none of our business."""
        if message in self._messages:
            self._messages.remove(message)

    def flush(self) -> int:
        """Delete everything; return how many messages that were."""
        count = len(self)
        self._messages.clear()
        return count

    def sweep(self, now: datetime) -> int:
        """Do the daily purges that were due since the last sweep; return how many are deleted."""
        since, self._swept_at = self._swept_at or now, now
        before = len(self)
        purge_at = datetime.combine(since.astimezone(UTC).date(), PURGE_AT)
        while purge_at <= now:
            if purge_at > since:
                self._purge(purge_at)
            purge_at += timedelta(days=1)
        return before - len(self)

    def _purge(self, at: datetime) -> None:
        present = [message for message in self._messages if message.queued_at <= at]
        if any(at - message.queued_at > LIFETIME for message in present):
            self._messages = [m for m in self._messages if m not in present]
