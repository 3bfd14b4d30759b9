"""Alarms: raised once for each cause, kept until they are both normal again and acknowledged."""

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime

from sqlalchemy.orm import Session

from db.fault import StoreUnavailableError
from db.query.station import alarms as query
from db.query.station.alarms import AlarmRecord
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from server.base.event_bus import AlarmChanged, EventBus
from server.base.problem import conflict, not_found

logger = logging.getLogger(__name__)
LEVELS = ("watch", "warning", "critical")
_STANDS = ("alarm.raised", "alarm.changed")
"""Steps after which something is to be seen to."""


class AlarmBoard:
    """The open alarms of the station.

    They live in memory and are written through, so that an alarm about failing storage is shown
    while it cannot be written; it is written once storage works again. Belongs to one event loop.
    """

    def __init__(self, store: Store, clock: Clock, bus: EventBus) -> None:
        self._store = store
        self._bus = bus
        self._clock = clock
        self._open: dict[str, AlarmRecord] = {}
        self._last_number = 0
        self._unsaved: deque[tuple[AlarmRecord, str, datetime]] = deque()
        self._saving = asyncio.Lock()

    async def load(self) -> None:
        """Take up the alarms that were open when the station last ran."""

        def read(session: Session) -> tuple[list[AlarmRecord], int]:
            return query.open_alarms(session), query.last_alarm_number(session)

        alarms, self._last_number = await self._store.query(read)
        self._open = {alarm.id: alarm for alarm in alarms}

    @property
    def open(self) -> list[AlarmRecord]:
        """Every alarm that is not closed, the oldest first."""
        return list(self._open.values())

    @property
    def unacknowledged(self) -> int:
        """How many alarms nobody has seen yet."""
        return sum(alarm.acknowledged_at is None for alarm in self._open.values())

    def worst_level(self, robot: str) -> str | None:
        """Return the highest level among the standing alarms of a robot."""
        levels = {
            alarm.level
            for alarm in self._open.values()
            if alarm.robot == robot and alarm.cleared_at is None
        }
        return max(levels, key=LEVELS.index, default=None)

    async def raise_(
        self, cause: str, text: str, *, level: str = "warning", robot: str | None = None
    ) -> AlarmRecord:
        """Raise an alarm, or return the one that stands for this robot and cause already.

        A cause that comes back after it was normal, and that nobody has acknowledged meanwhile,
        is the same alarm, standing since now: one cause never floods the list. A standing alarm
        of another text or level takes the new ones; one that gets worse is to be seen anew.
        """
        alarm = self._of_cause(cause, robot)
        if alarm is not None and alarm.cleared_at is None:
            if (alarm.text, alarm.level) == (text, level):
                return alarm
            changed = replace(alarm, text=text, level=level)
            if LEVELS.index(level) > LEVELS.index(alarm.level):
                changed = replace(
                    changed, state="unacknowledged", acknowledged_at=None, acknowledged_by=None
                )
            return await self._put(changed, "alarm.changed")
        if alarm is not None and alarm.acknowledged_at is None:
            changed = replace(
                alarm,
                text=text,
                level=level,
                state="unacknowledged",
                raised_at=self._clock.now(),
                cleared_at=None,
            )
            return await self._put(changed, "alarm.raised")
        self._last_number += 1
        alarm = AlarmRecord(
            id=f"alarm-{self._last_number}",
            cause=cause,
            robot=robot,
            level=level,
            text=text,
            state="unacknowledged",
            raised_at=self._clock.now(),
        )
        return await self._put(alarm, "alarm.raised")

    async def clear(self, cause: str, *, robot: str | None = None, text: str = "") -> None:
        """Say that the cause is normal again; without a standing alarm this does nothing.

        Args:
            cause: What the alarm is about.
            robot: Whose.
            text: What it says from now on, which tells how it ended; "" keeps its words.
        """
        alarm = self._of_cause(cause, robot)
        if alarm is None or alarm.cleared_at is not None:
            return
        alarm = replace(alarm, text=text or alarm.text)
        seen = alarm.acknowledged_at is not None
        await self._put(
            replace(alarm, cleared_at=self._clock.now(), state="closed" if seen else "returned"),
            "alarm.closed" if seen else "alarm.returned",
        )

    async def acknowledge(
        self, alarm_id: str, by: str, *, raised_at: datetime | None = None, level: str | None = None
    ) -> AlarmRecord:
        """Note that a person has seen the alarm; doing so twice changes nothing.

        Args:
            alarm_id: Which.
            by: Who has seen it.
            raised_at: Since when it stood as they saw it; ``None`` where nobody says.
            level: Its level then.

        Raises:
            Problem: 404 if there is no such alarm, or it is closed; 409 if it is another by now
                than the one that was seen.
        """
        alarm = self._open.get(alarm_id)
        if alarm is None:
            raise not_found(f"There is no open alarm {alarm_id!r}.")
        if raised_at not in (None, alarm.raised_at) or level not in (None, alarm.level):
            raise conflict(f"{alarm_id} has changed since it was seen; it says now: {alarm.text}")
        if alarm.acknowledged_at is not None:
            return alarm
        normal = alarm.cleared_at is not None
        return await self._put(
            replace(
                alarm,
                acknowledged_at=self._clock.now(),
                acknowledged_by=by,
                state="closed" if normal else "acknowledged",
            ),
            "alarm.acknowledged",
        )

    async def save_waiting(self) -> None:
        """Write what storage refused, in the order in which it happened."""
        async with self._saving:
            while self._unsaved:
                await self._store.write(_saver(*self._unsaved[0]))
                self._unsaved.popleft()

    def _of_cause(self, cause: str, robot: str | None) -> AlarmRecord | None:
        for alarm in self._open.values():
            if (alarm.cause, alarm.robot) == (cause, robot):
                return alarm
        return None

    async def _put(self, alarm: AlarmRecord, kind: str) -> AlarmRecord:
        if alarm.state == "closed":
            self._open.pop(alarm.id, None)
        else:
            self._open[alarm.id] = alarm
        self._unsaved.append((alarm, kind, self._clock.now()))
        try:
            await self.save_waiting()
        except StoreUnavailableError:
            logger.warning("alarm %s (%s) waits for the storage", alarm.id, alarm.text)
        self._bus.publish(AlarmChanged(alarm))
        return alarm


def _sentence(alarm: AlarmRecord, kind: str) -> str:
    """Return what the log says of a step of an alarm's life; each step has its own words."""
    match kind:
        case "alarm.acknowledged":
            return f"{alarm.acknowledged_by} acknowledged: {alarm.text}"
        case "alarm.returned" | "alarm.closed":
            return f"Back to normal: {alarm.text}"
        case "alarm.changed":
            return f"Now {alarm.level}: {alarm.text}"
        case _:
            return alarm.text


def _saver(alarm: AlarmRecord, kind: str, at: datetime) -> Callable[[Session], None]:
    def save(session: Session) -> None:
        query.save_alarm(session, alarm)
        add_event(
            session,
            at,
            kind,
            _sentence(alarm, kind),
            level=alarm.level if kind in _STANDS else "info",
            robot=alarm.robot,
            data={"alarm": alarm.id, "by": alarm.acknowledged_by},
        )

    return save
