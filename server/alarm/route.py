"""Alarms and their life: seen, noted, assigned, shelved (ISA-18.2)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query
from pydantic import AwareDatetime, Field
from sqlalchemy.orm import Session

from autonomy.channel import ALARM_LEVELS
from db.query.fleet.subject import robot_of
from db.query.station.alarms import AlarmRecord, alarms_of, closed_alarms
from db.record import same
from server.access.caller import may_pilot
from server.access.dependency import Pilot, Viewer
from server.base.alarm_board import ALARM_STATES, WAITING
from server.base.dependency import DeploymentDep, FoundationDep, period_of
from server.base.problem import FieldError, unprocessable
from server.base.text import Name
from server.base.view import Body, RobotLevel, View, one_of

router = APIRouter(prefix="/api/alarms", tags=["alarms"])
NOTE_LENGTH_MAX = 500
SHELF_MINUTES_MAX = 7 * 24 * 60
_UNSAID: Mapping[str, Any] = MappingProxyType(
    {
        "acknowledged_by": None,
        "note": "",
        "noted_by": None,
        "assigned_to": None,
        "assigned_by": None,
        "shelved_by": None,
    }
)
"""What a read-only link is told in place of people and their words."""
Note = Annotated[str, Field(min_length=1, max_length=NOTE_LENGTH_MAX, pattern=r"\S")]


@dataclass(frozen=True, slots=True)
class AlarmView(View):
    """One alarm and where it stands in its life cycle."""

    id: str
    robot: str | None
    level: RobotLevel
    text: str
    state: Annotated[str, one_of(*ALARM_STATES)]
    """``unacknowledged``, ``acknowledged``, ``returned`` (normal again, unseen), ``closed``; or it
    stands aside: ``shelved``, ``suppressed`` by design, its rule ``out_of_service``."""
    raised_at: datetime
    acknowledged_at: datetime | None
    acknowledged_by: str | None
    cleared_at: datetime | None
    rule: str | None
    """The rule that raised it; see `GET /api/alarm-rules`."""
    action: str
    """What a person may do about it."""
    count: int
    """How often its cause came back since ``first_raised_at``."""
    first_raised_at: datetime | None
    note: str
    noted_by: str | None
    assigned_to: str | None
    """Who looks after it."""
    assigned_by: str | None
    """Who said so last."""
    shelved_until: datetime | None
    shelved_by: str | None


@dataclass(frozen=True, slots=True)
class AlarmsView(View):
    """Alarms, the open ones the oldest first, closed ones the newest first."""

    alarms: list[AlarmView]
    total: int
    """How many there are; more than are listed where the limit cut them."""


class Acknowledgement(Body):
    """What who acknowledges says of it."""

    note: str = Field(default="", max_length=NOTE_LENGTH_MAX)
    """What is said of the alarm; empty for nothing."""


class Shelf(Body):
    """For how long an alarm is set aside, and why."""

    minutes: int = Field(ge=1, le=SHELF_MINUTES_MAX)
    """So long it stands aside, in minutes of the station's clock; then it comes back by itself."""
    note: Note
    """Why it is set aside."""


class NoteBody(Body):
    """What a person says of an alarm."""

    note: Note
    """What is said of the alarm."""


class Assignment(Body):
    """Who looks after an alarm."""

    person: Name | None
    """``null`` for nobody any more."""
    note: str = Field(default="", max_length=NOTE_LENGTH_MAX)
    """What is said with it; empty for nothing."""


@router.get("")
async def list_alarms(
    caller: Viewer,
    foundation: FoundationDep,
    deployment: DeploymentDep,
    state: Annotated[Literal["open", "closed"], Query()] = "open",
    limit: Annotated[int, Query(ge=1, le=1000)] = 200,
) -> AlarmsView:
    """Return the open alarms or the closed ones; of a deployment all, the newest first.

    Where there are more open ones than the limit, those that wait for a person and the gravest
    are returned.
    """
    rights = caller.rights

    def view(alarm: AlarmRecord) -> AlarmView:
        return replace(_view(alarm), **_UNSAID) if caller.is_link else _view(alarm)

    if deployment is not None:
        period = period_of(deployment) or deployment.period
        alarms = await foundation.store.query(
            lambda session: alarms_of(session, deployment.robot, period, limit)
        )
    elif state == "open":
        found = [alarm for alarm in foundation.alarms.open if rights.sees(alarm.robot)]
        first = sorted(found, key=_urgency)[:limit] if len(found) > limit else found
        return AlarmsView([view(alarm) for alarm in sorted(first, key=_age)], len(found))
    else:
        alarms = await foundation.store.query(
            lambda session: closed_alarms(session, limit, rights.robots)
        )
    return AlarmsView([view(alarm) for alarm in alarms], len(alarms))


@router.post("/{alarm}/ack")
async def acknowledge(
    caller: Pilot,
    alarm: str,
    foundation: FoundationDep,
    body: Acknowledgement | None = None,
    raised_at: Annotated[
        AwareDatetime | None, Query(description="Since when it stood as it was seen.")
    ] = None,
    level: Annotated[str | None, Query(description="Its level as it was seen.")] = None,
) -> AlarmView:
    """Say that one has seen an alarm; doing so twice changes nothing.

    409 if it was raised anew, or is of another level, since it was seen.
    """
    note = "" if body is None else body.note.strip()
    return _view(
        await foundation.alarms.acknowledge(
            alarm, caller.name, raised_at=raised_at, level=level, note=note
        )
    )


@router.post("/{alarm}/shelve")
async def shelve(caller: Pilot, alarm: str, shelf: Shelf, foundation: FoundationDep) -> AlarmView:
    """Set an alarm aside for some time; it comes back by itself. A shelved one is shelved anew."""
    until = foundation.clock.now() + timedelta(minutes=shelf.minutes)
    return _view(await foundation.alarms.shelve(alarm, caller.name, until, shelf.note.strip()))


@router.post("/{alarm}/unshelve")
async def unshelve(caller: Pilot, alarm: str, foundation: FoundationDep) -> AlarmView:
    """Take an alarm back from its shelf before its time."""
    del caller
    return _view(await foundation.alarms.unshelve(alarm))


@router.post("/{alarm}/note")
async def note_alarm(
    caller: Pilot, alarm: str, note: NoteBody, foundation: FoundationDep
) -> AlarmView:
    """Keep what one says of an alarm; the earlier notes stay in the event log."""
    return _view(await foundation.alarms.note(alarm, caller.name, note.note.strip()))


@router.post("/{alarm}/assign")
async def assign(
    caller: Pilot, alarm: str, assignment: Assignment, foundation: FoundationDep
) -> AlarmView:
    """Say who looks after an alarm: a person who may pilot its robot, or nobody.

    Another person than the caller gets a notice of it; nobody else does.
    """
    person = assignment.person

    def check(session: Session) -> None:
        robot = robot_of(session, "alarm", alarm)
        if person is not None and not may_pilot(session, person, robot):
            whole = "what belongs to the station as a whole"
            wrong = FieldError(loc=["person"], msg=f"{person!r} may not pilot {robot or whole}.")
            raise unprocessable("1 field is wrong.", [wrong])

    await foundation.store.query(check)
    note = assignment.note.strip()
    return _view(await foundation.alarms.assign(alarm, caller.name, person, note))


def _urgency(alarm: AlarmRecord) -> tuple[bool, int, datetime]:
    return alarm.state not in WAITING, -ALARM_LEVELS.index(alarm.level), alarm.raised_at


def _age(alarm: AlarmRecord) -> int:
    return int(alarm.id.rpartition("-")[2])


def _view(alarm: AlarmRecord) -> AlarmView:
    return same(AlarmView, alarm)
