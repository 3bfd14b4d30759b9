"""Alarms: raised once for each cause, kept until they are both normal again and acknowledged.

Their life after ISA-18.2; ``new`` is an alarm that is not yet one:

======================================  ==============  ==============  ====================
in state                                evidence        follows         event
======================================  ==============  ==============  ====================
new, returned                           raised          unacknowledged  alarm.raised
suppressed, out_of_service              raised          unacknowledged  alarm.raised
shelved                                 raised          shelved         alarm.changed
acknowledged                            worse           unacknowledged  alarm.changed
unacknowledged                          normal          returned        alarm.returned
acknowledged, suppressed                normal          closed          alarm.closed
out_of_service                          normal          closed          alarm.closed
shelved                                 normal          shelved         alarm.changed
unacknowledged                          seen            acknowledged    alarm.acknowledged
returned                                seen            closed          alarm.acknowledged
unacknowledged, acknowledged, returned  shelve          shelved         alarm.shelved
shelved                                 shelve          shelved         alarm.shelved
shelved                                 back            unacknowledged  alarm.unshelved
shelved                                 back_normal     closed          alarm.unshelved
unacknowledged, acknowledged, returned  suppress        suppressed      alarm.suppressed
out_of_service                          suppress        suppressed      alarm.suppressed
unacknowledged, acknowledged, returned  out_of_service  out_of_service  alarm.out_of_service
suppressed                              out_of_service  out_of_service  alarm.out_of_service
======================================  ==============  ==============  ====================

A shelved alarm was seen by who shelved it: normal again at the end of its shelf, it is closed;
standing still, it is to be seen anew.
"""

import asyncio
import itertools
import logging
from collections import deque
from collections.abc import Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from enum import StrEnum
from types import MappingProxyType
from typing import Any, Final

from sqlalchemy.orm import Session

from autonomy.channel import ALARM_LEVELS, AlarmLevel
from db.actor import Actor, acting
from db.fault import StoreUnavailableError
from db.query.station import alarms as query
from db.query.station.alarms import AlarmRecord
from db.query.station.events import add_event
from db.store import Store
from robot_link.clock import Clock
from server.base.event_bus import AlarmChanged, EventBus
from server.base.problem import conflict, not_found
from server.base.transition_table import Step, transitions

logger = logging.getLogger(__name__)
LEVELS = ALARM_LEVELS
_STANDS = ("alarm.raised", "alarm.changed")
"""Steps after which something is to be seen to."""
_DEEDS = ("alarm.acknowledged", "alarm.noted", "alarm.assigned", "alarm.shelved")
"""Steps that people do: they are told that it is done once it is written."""
_FLUTTER = ("alarm.raised", "alarm.returned")
_LOGGED_EACH = 10
"""So often a cause that comes and goes unseen is logged each time; then at powers of two."""
_SAVED_AT_ONCE = 200
_WRITE_PATIENCE_S: Final = 0.1
"""An alarm that cannot be written for so long, for something else is, is told before it is."""
_SUPPRESSED = ("suppressed", "out_of_service")
_UNSEEN: Mapping[str, None] = MappingProxyType({"acknowledged_at": None, "acknowledged_by": None})


ALARM_STATES: Final = (
    "unacknowledged",
    "acknowledged",
    "returned",
    "shelved",
    "suppressed",
    "out_of_service",
    "closed",
)
WAITING: Final = ("unacknowledged", "returned")
"""States in which somebody is asked to look."""
PARKED: Final = ("shelved", "suppressed", "out_of_service")
"""States in which an alarm stands aside, whatever its cause does."""


class AlarmEvidence(StrEnum):
    """What moves an alarm."""

    RAISED = "raised"
    WORSE = "worse"
    NORMAL = "normal"
    SEEN = "seen"
    SHELVE = "shelve"
    BACK = "back"
    BACK_NORMAL = "back_normal"
    SUPPRESS = "suppress"
    OUT_OF_SERVICE = "out_of_service"


_TABLE = transitions(__doc__, AlarmEvidence)


def step(state: str, evidence: AlarmEvidence) -> Step | None:
    """Return what follows from evidence in a state (``new`` of an alarm that is not yet one)."""
    return _TABLE.get((state, evidence))


@dataclass(frozen=True, slots=True)
class _Kept:
    """A step of an alarm's life as it is written."""

    alarm: AlarmRecord
    kind: str
    at: datetime
    note: str
    """What a person said with it."""
    actor: Actor | None
    """Whose doing it is."""


class AlarmBoard:
    """The open alarms of the station.

    They live in memory and are written through, so that an alarm about failing storage is shown
    while it cannot be written; it is written once storage works again. One that waits behind a long
    write is told before it is written, too: what a cause does is told without delay, and what a
    person does returns once it is written, or storage fails. Belongs to one event loop.
    """

    def __init__(self, store: Store, clock: Clock, bus: EventBus) -> None:
        self._store = store
        self._bus = bus
        self._clock = clock
        self._open: dict[str, AlarmRecord] = {}
        self._of_cause: dict[tuple[str, str | None], AlarmRecord] = {}
        """The same alarms, by cause and robot."""
        self._last_number = 0
        self._unsaved: deque[_Kept] = deque()
        self._saver: asyncio.Task[None] | None = None

    async def load(self) -> None:
        """Take up the alarms that were open when the station last ran."""

        def read(session: Session) -> tuple[list[AlarmRecord], int]:
            return query.open_alarms(session), query.last_alarm_number(session)

        alarms, self._last_number = await self._store.query(read)
        self._open = {alarm.id: alarm for alarm in alarms}
        self._of_cause = {(alarm.cause, alarm.robot): alarm for alarm in alarms}

    @property
    def open(self) -> list[AlarmRecord]:
        """Every alarm that is not closed, the oldest first."""
        return list(self._open.values())

    @property
    def unacknowledged(self) -> int:
        """How many alarms nobody has seen yet."""
        return self.unacknowledged_of(None)

    def unacknowledged_of(self, robots: Collection[str] | None) -> int:
        """Return how many alarms nobody has seen yet: all, or those of these robots."""
        return sum(
            alarm.state in WAITING and (robots is None or alarm.robot in robots)
            for alarm in self._open.values()
        )

    def worst_level(self, robot: str) -> str | None:
        """Return the highest level among the standing alarms of a robot that nobody parked."""
        levels = {
            alarm.level
            for alarm in self._open.values()
            if alarm.robot == robot and alarm.cleared_at is None and alarm.state not in PARKED
        }
        return max(levels, key=LEVELS.index, default=None)

    def standing(self, cause: str, robot: str | None) -> AlarmRecord | None:
        """Return the alarm of a cause whose condition stands, parked or not."""
        alarm = self._of_cause.get((cause, robot))
        return None if alarm is None or alarm.cleared_at is not None else alarm

    async def raise_(
        self,
        cause: str,
        text: str,
        *,
        level: AlarmLevel | str = "warning",
        robot: str | None = None,
        action: str = "",
        rule: str | None = None,
    ) -> AlarmRecord:
        """Raise an alarm, or return the one that stands for this robot and cause already.

        A cause that comes back after it was normal, and that nobody has acknowledged meanwhile,
        is the same alarm, standing since now and counted: one cause never floods the list. A
        standing alarm of another text or level takes the new ones; one that gets worse is to be
        seen anew. A shelved one stays on its shelf.
        """
        told: dict[str, Any] = {"text": text, "level": level, "action": action, "rule": rule}
        alarm = self._of_cause.get((cause, robot))
        if alarm is None:
            self._last_number += 1
            now = self._clock.now()
            alarm = AlarmRecord(
                id=f"alarm-{self._last_number}",
                cause=cause,
                robot=robot,
                state="new",
                raised_at=now,
                first_raised_at=now,
                **told,
            )
            return await self._move(alarm, AlarmEvidence.RAISED)
        changed = replace(alarm, **told)
        if alarm.cleared_at is not None or alarm.state in _SUPPRESSED:
            again = {"count": alarm.count + 1} if alarm.cleared_at is not None else {}
            changed = replace(changed, raised_at=self._clock.now(), cleared_at=None, **again)
            return await self._move(changed, AlarmEvidence.RAISED, **_UNSEEN)
        if changed == alarm:
            return alarm
        is_worse = LEVELS.index(changed.level) > LEVELS.index(alarm.level)
        if is_worse and alarm.state == "acknowledged":
            return await self._move(changed, AlarmEvidence.WORSE, **_UNSEEN)
        return await self._put(changed, "alarm.changed")

    async def clear(self, cause: str, *, robot: str | None = None, text: str = "") -> None:
        """Say that the cause is normal again; without a standing alarm this does nothing.

        Args:
            cause: What the alarm is about.
            robot: Whose.
            text: What it says from now on, which tells how it ended; "" keeps its words.
        """
        alarm = self.standing(cause, robot)
        if alarm is not None:
            over = replace(alarm, text=text or alarm.text, cleared_at=self._clock.now())
            await self._move(over, AlarmEvidence.NORMAL)

    async def park(self, cause: str, robot: str | None, why: AlarmEvidence) -> None:
        """Set a standing alarm aside: suppressed by design, or its rule is out of service."""
        alarm = self.standing(cause, robot)
        if alarm is not None and step(alarm.state, why) is not None:
            await self._move(alarm, why)

    async def acknowledge(
        self,
        alarm_id: str,
        by: str,
        *,
        raised_at: datetime | None = None,
        level: str | None = None,
        note: str = "",
    ) -> AlarmRecord:
        """Note that a person has seen the alarm; doing so twice changes nothing but its note.

        Args:
            alarm_id: Which.
            by: Who has seen it.
            raised_at: Since when it stood as they saw it; ``None`` where nobody says.
            level: Its level then.
            note: What they say of it; "" for nothing.

        Raises:
            Problem: 404 if there is no such alarm, or it is closed; 409 if it is another by now
                than the one that was seen.
        """
        alarm = self._find(alarm_id)
        if raised_at not in (None, alarm.raised_at) or level not in (None, alarm.level):
            raise conflict(f"{alarm_id} has changed since it was seen; it says now: {alarm.text}")
        noted = replace(alarm, note=note, noted_by=by) if note else alarm
        if step(alarm.state, AlarmEvidence.SEEN) is None:
            return await self._put(noted, "alarm.noted") if note else alarm
        seen = {"acknowledged_at": self._clock.now(), "acknowledged_by": by}
        return await self._move(noted, AlarmEvidence.SEEN, note, **seen)

    async def shelve(self, alarm_id: str, by: str, until: datetime, note: str) -> AlarmRecord:
        """Set an alarm aside until a moment, at which it comes back by itself.

        Raises:
            Problem: 404 without such an open alarm; 409 if it stands aside for another reason.
        """
        alarm = self._find(alarm_id)
        if step(alarm.state, AlarmEvidence.SHELVE) is None:
            raise conflict(f"{alarm_id} is {_words(alarm.state)} and stands aside already.")
        shelf = {"shelved_until": until, "shelved_by": by, "note": note, "noted_by": by}
        return await self._move(alarm, AlarmEvidence.SHELVE, **shelf)

    async def unshelve(self, alarm_id: str) -> AlarmRecord:
        """Take an alarm back from its shelf; standing still, it is to be seen anew.

        Raises:
            Problem: 404 without such an open alarm; 409 if it is not shelved.
        """
        alarm = self._find(alarm_id)
        if alarm.state != "shelved":
            raise conflict(f"{alarm_id} is not shelved; it is {_words(alarm.state)}.")
        ended = {"shelved_until": None, "shelved_by": None}
        if alarm.cleared_at is None:
            return await self._move(alarm, AlarmEvidence.BACK, **ended, **_UNSEEN)
        return await self._move(alarm, AlarmEvidence.BACK_NORMAL, **ended)

    async def note(self, alarm_id: str, by: str, note: str) -> AlarmRecord:
        """Keep what a person says of an alarm.

        Raises:
            Problem: 404 without such an open alarm.
        """
        alarm = self._find(alarm_id)
        return await self._put(replace(alarm, note=note, noted_by=by), "alarm.noted")

    async def assign(self, alarm_id: str, by: str, to: str | None, note: str = "") -> AlarmRecord:
        """Say who looks after an alarm; saying so twice changes nothing but its note.

        Args:
            alarm_id: Which.
            by: Who says so.
            to: Who looks after it; ``None`` for nobody any more.
            note: What is said with it; "" for nothing.

        Raises:
            Problem: 404 without such an open alarm.
        """
        alarm = self._find(alarm_id)
        noted = replace(alarm, note=note, noted_by=by) if note else alarm
        if alarm.assigned_to == to:
            return await self._put(noted, "alarm.noted") if note else alarm
        assigned = replace(noted, assigned_to=to, assigned_by=by)
        return await self._put(assigned, "alarm.assigned", note)

    async def save_waiting(self) -> None:
        """Write what is not kept yet, in the order in which it happened, many at a time."""
        if self._unsaved:
            await asyncio.shield(self._saving())

    async def stop(self) -> None:
        """Wait until what is being written is, or storage fails; the store must still be open."""
        if self._saver is not None:
            await asyncio.wait([self._saver])

    def _saving(self) -> asyncio.Task[None]:
        """Return the task that writes all that waits; whoever waits for it leaves it running."""
        if self._saver is None or self._saver.done():
            self._saver = asyncio.create_task(self._save(), name="saving alarms")
            self._saver.add_done_callback(_tell_failure)
        return self._saver

    async def _save(self) -> None:
        while self._unsaved:
            actor = self._unsaved[0].actor
            alike = itertools.takewhile(
                lambda kept, actor=actor: kept.actor is actor, self._unsaved
            )
            batch = list(itertools.islice(alike, _SAVED_AT_ONCE))
            acting.set(actor)
            await self._store.write(lambda session, batch=batch: _write(session, batch))
            for _ in batch:
                self._unsaved.popleft()

    def _find(self, alarm_id: str) -> AlarmRecord:
        alarm = self._open.get(alarm_id)
        if alarm is None:
            raise not_found(f"There is no open alarm {alarm_id!r}.")
        return alarm

    async def _move(
        self,
        alarm: AlarmRecord,
        evidence: AlarmEvidence,
        said: str = "",
        /,
        **changes: Any,  # noqa: ANN401 - the fields differ in type
    ) -> AlarmRecord:
        """Move an alarm by its table, and keep it."""
        following = step(alarm.state, evidence)
        if following is None:
            raise conflict(f"{alarm.id} is {_words(alarm.state)}; that changes nothing.")
        if following.state == "shelved" and evidence is AlarmEvidence.RAISED:
            changes = {}
        moved = replace(alarm, state=following.state, **changes)
        return await self._put(moved, following.event, said)

    async def _put(self, alarm: AlarmRecord, kind: str, said: str = "") -> AlarmRecord:
        about = (alarm.cause, alarm.robot)
        if alarm.state == "closed":
            self._open.pop(alarm.id, None)
            self._of_cause.pop(about, None)
        else:
            self._open[alarm.id] = self._of_cause[about] = alarm
        self._unsaved.append(_Kept(alarm, kind, self._clock.now(), said, acting.get()))
        saving = self._saving()
        try:
            await asyncio.wait([saving], timeout=_WRITE_PATIENCE_S)
        finally:
            self._bus.publish(AlarmChanged(alarm))
        if kind in _DEEDS or acting.get() is not None:
            with suppress(StoreUnavailableError):
                await asyncio.shield(saving)
        return alarm


def _tell_failure(saver: asyncio.Task[None]) -> None:
    error = None if saver.cancelled() else saver.exception()
    if isinstance(error, StoreUnavailableError):
        logger.warning("alarms wait for the storage: %s", error)
    elif error is not None:
        logger.error("alarms could not be written", exc_info=error)


def _words(state: str) -> str:
    return state.replace("_", " ")


def _sentence(kept: _Kept) -> str:
    """Return what the log says of a step of an alarm's life; each step has its own words."""
    alarm = kept.alarm
    said = f" ({kept.note})" if kept.note else ""
    match kept.kind:
        case "alarm.acknowledged":
            return f"{alarm.acknowledged_by} acknowledged: {alarm.text}{said}"
        case "alarm.returned" | "alarm.closed":
            return f"Back to normal: {alarm.text}"
        case "alarm.changed":
            return f"Now {alarm.level}: {alarm.text}"
        case "alarm.shelved":
            until = f"{alarm.shelved_until:%Y-%m-%d %H:%MZ}"
            return f"{alarm.shelved_by} shelved until {until} ({alarm.note}): {alarm.text}"
        case "alarm.unshelved":
            return f"Back from its shelf: {alarm.text}"
        case "alarm.suppressed":
            return f"Suppressed by design: {alarm.text}"
        case "alarm.out_of_service":
            return f"Its rule is out of service: {alarm.text}"
        case "alarm.noted":
            return f"{alarm.noted_by} noted on {alarm.id}: {alarm.note}"
        case "alarm.assigned":
            return _assignment(alarm, said)
        case _:
            times = "" if alarm.count == 1 else f" ({alarm.count} times)"
            return f"{alarm.text}{times}"


def _assignment(alarm: AlarmRecord, said: str) -> str:
    by, to = alarm.assigned_by, alarm.assigned_to
    if to is None:
        return f"{by} has nobody look after {alarm.id} any more{said}: {alarm.text}"
    asks = f"{by} looks" if by == to else f"{by} asks {to} to look"
    return f"{asks} after {alarm.id}{said}: {alarm.text}"


def _is_logged(alarm: AlarmRecord, kind: str) -> bool:
    """Tell whether a step goes into the log: what flutters does so ever more seldom."""
    flutters = kind in _FLUTTER and alarm.count > _LOGGED_EACH
    return not flutters or alarm.count & (alarm.count - 1) == 0


def _data(kept: _Kept) -> dict[str, str | None]:
    alarm = kept.alarm
    if kept.kind == "alarm.assigned":
        return {"alarm": alarm.id, "by": alarm.assigned_by, "to": alarm.assigned_to}
    return {"alarm": alarm.id, "by": alarm.acknowledged_by}


def _write(session: Session, batch: list[_Kept]) -> None:
    newest = {kept.alarm.id: kept.alarm for kept in batch}
    query.save_alarms(session, list(newest.values()))
    for kept in batch:
        alarm = kept.alarm
        if _is_logged(alarm, kept.kind):
            add_event(
                session,
                kept.at,
                kept.kind,
                _sentence(kept),
                level=alarm.level if kept.kind in _STANDS else "info",
                robot=alarm.robot,
                data=_data(kept),
            )
