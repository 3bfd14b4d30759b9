"""Who is to hear of what, and who next when nobody acknowledges. Functions of one transaction.

A case is opened when an alarm is to be seen and ends when somebody has seen it, or it was shelved.
While it is open, its escalation goes on: first everyone who wants to hear of it, then each step of
the settings. A cause that comes and goes unseen is one case: it is told again at most once in
``TELL_AGAIN``, and its escalation goes on where it was. One that gets worse begins anew.

That a person is asked to look after an alarm is a case of that person alone: told once, whatever
topics they chose, but within their hours. It ends when somebody else looks after it, or it is
closed.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from db.notice_tables import NoticeCase
from db.query.station import notices as query
from db.query.station.alarms import AlarmRecord, get_alarm
from db.query.station.events import EventRecord
from db.query.station.notices import Reachable
from server.access.role import Rights
from server.base.alarm_board import WAITING
from server.notice.settings import NoticeSettings
from server.notice.wish import Topic, Wishes, gate, rank

TELL_AGAIN: Final = timedelta(minutes=10)
"""By the station's clock."""
REPEATS_MAX: Final = 48
"""So often the last step is told again; then the page alone knows."""
EVENT_TOPICS: Final[dict[str, Topic]] = {
    "robot.surfaced": "surfaced",
    "plan.done": "plan",
    "plan.failed": "plan",
    "alarm.assigned": "assigned",
}
"""Events that people are told of: who wants it, or whom alone it is about."""
_CONTACT: Final = frozenset({"silence", "overdue", "contact", "system", "port"})
_STATION: Final = frozenset({"satellite", "clock"})
"""First words of causes that are about more than the robot."""


def topic_of(alarm: AlarmRecord) -> Topic:
    """Return what an alarm is about, as people choose it."""
    cause = alarm.cause.split(" ")[0].split(":")[0]
    if alarm.robot is None or cause in _STATION:
        return "station"
    if cause in _CONTACT:
        return "contact"
    return "battery" if "battery" in alarm.cause else "alarm"


def is_to_be_seen(alarm: AlarmRecord) -> bool:
    """Tell whether an alarm waits for somebody to see it: neither acknowledged nor set aside."""
    return alarm.state in WAITING


def rights_of(person: Reachable) -> Rights:
    """Return what a person may do: they are told of what they may see, and of nothing else."""
    return Rights.of(person.role, person.roles)


def take_alarms(session: Session, alarms: Mapping[str, AlarmRecord], now: datetime) -> None:
    """Open, change or end the cases of alarms, each by its id, as they stand now."""
    rows = query.open_cases(session, alarms.keys())
    for alarm in alarms.values():
        row = rows.get(alarm.id)
        if row is None:
            is_grave = alarm.level == "critical"  # told even if it was normal before it could be
            if is_to_be_seen(alarm) and (alarm.cleared_at is None or is_grave):
                session.add(_alarm_case(alarm, now))
        elif is_to_be_seen(alarm):
            _change(row, alarm, now)
        else:
            query.end_case(session, row, now)
    for row in query.open_assignments(session, alarms.keys()):
        if not _is_theirs(alarms[row.alarm or ""], row.person):
            query.end_case(session, row, now)


def _is_theirs(alarm: AlarmRecord, person: str | None) -> bool:
    return alarm.assigned_to == person and alarm.state != "closed"


def _change(row: NoticeCase, alarm: AlarmRecord, now: datetime) -> None:
    row.text = alarm.text
    if rank(alarm.level) > rank(row.level):
        row.level, row.raised_at = alarm.level, alarm.raised_at
        row.step, row.next_at = -1, now
    elif alarm.cleared_at is None and alarm.raised_at != row.raised_at:
        row.raised_at = alarm.raised_at
        if row.next_at is None:
            row.step = -1
            row.next_at = max(now, (row.told_at or now) + TELL_AGAIN)


def end_vanished(session: Session, open_alarms: Collection[str], now: datetime) -> None:
    """End the cases of alarms that are not open any more, as after a restart."""
    for row in query.open_alarm_cases(session):
        if row.alarm not in open_alarms:
            query.end_case(session, row, now)


def take_event(session: Session, event: EventRecord, now: datetime) -> None:
    """Open the case of an event; twice is once."""
    if query.has_case_of(session, event.cursor):
        return
    if event.kind == "alarm.assigned":
        _take_assignment(session, event, now)
        return
    session.add(
        _case(
            topic=EVENT_TOPICS[event.kind],
            level=event.level,
            robot=event.robot,
            text=event.text,
            raised_at=event.at,
            cursor=event.cursor,
            now=now,
        )
    )


def _take_assignment(session: Session, event: EventRecord, now: datetime) -> None:
    """Tell who is to look after an alarm, unless they said so themselves or it is over by now.

    What was to be told of an earlier assignment of the alarm is over with it.
    """
    person = event.data["to"]
    is_own = event.by_kind == "person" and event.by == person
    alarm = get_alarm(session, event.data["alarm"])
    session.flush()
    for row in query.open_assignments(session, [alarm.id]):
        if row.cursor is not None and row.cursor < event.cursor:
            query.end_case(session, row, now)
    if person is None or is_own or not _is_theirs(alarm, person):
        return
    session.add(
        _case(
            topic=EVENT_TOPICS[event.kind],
            level=alarm.level,
            robot=alarm.robot,
            text=event.text,
            raised_at=alarm.raised_at,
            cursor=event.cursor,
            alarm=alarm.id,
            person=person,
            now=now,
        )
    )


def advance(
    session: Session,
    people: Sequence[Reachable],
    settings: NoticeSettings,
    over: Collection[str],
    now: datetime,
    limit: int,
) -> int:
    """Have everyone told who is to be told by now; return how many cases were looked at.

    Args:
        session: The transaction.
        people: Everyone who may be told.
        settings: The escalation.
        over: Alarms whose condition is normal again, though nobody has seen them.
        now: The station's time.
        limit: Cases at most.
    """
    due = query.due_cases(session, now, limit)
    told = [(person, Wishes.model_validate(person.wishes)) for person in people]
    for row in due:
        if row.alarm in over and row.level != "critical" and row.step >= 0:
            row.next_at = None  # it stands on the page; nobody is called for what is over
        else:
            _advance_one(session, row, told, settings, now)
    return len(due)


def _advance_one(
    session: Session,
    row: NoticeCase,
    people: Sequence[tuple[Reachable, Wishes]],
    settings: NoticeSettings,
    now: datetime,
) -> None:
    is_for_all = row.alarm is not None and row.person is None
    escalates = is_for_all and rank(row.level) >= rank(settings.escalate_from)
    steps = settings.steps if escalates else []
    while True:
        row.step += 1
        called = None
        if row.step > 0 and steps:
            called = steps[min(row.step, len(steps)) - 1].people
        is_told = _tell(session, row, people, called, now)
        if row.step >= len(steps):
            break
        if is_told:
            row.told_at = now
            row.next_at = now + timedelta(minutes=steps[row.step].after_minutes)
            return
    row.told_at, row.next_at = now, None
    if row.alarm is None:
        row.ended_at = now
    elif escalates and settings.repeat_minutes and row.step < len(steps) + REPEATS_MAX:
        row.next_at = now + timedelta(minutes=settings.repeat_minutes)


def _tell(
    session: Session,
    row: NoticeCase,
    people: Iterable[tuple[Reachable, Wishes]],
    called: Collection[str] | None,
    now: datetime,
) -> bool:
    """Let a case wait for the contacts of those who are to hear of it now.

    Args:
        session: The transaction.
        row: The case.
        people: Everyone, with their wishes.
        called: Who is called by the escalation, whatever topics they chose; ``None`` for everyone
            who chose this one.
        now: The station's time.

    Returns:
        Whether anybody is told now rather than later.
    """
    items: list[tuple[str, datetime]] = []
    is_told = False
    for person, wishes in people:
        if row.person is not None:
            chosen = person.name == row.person
        else:
            chosen = (
                person.name in called if called is not None else wishes.wants(row.topic, row.level)
            )
        contacts = [contact.id for contact in person.contacts if contact.enabled]
        if not chosen or not contacts or not rights_of(person).sees(row.robot):
            continue
        found = gate(wishes, row.level, now)
        if not found.is_open and found.until is None:
            continue
        is_told = is_told or found.is_open
        items += [(contact, found.until or now) for contact in contacts]
    query.add_items(session, row, items)
    return is_told


def _alarm_case(alarm: AlarmRecord, now: datetime) -> NoticeCase:
    return _case(
        topic=topic_of(alarm),
        level=alarm.level,
        robot=alarm.robot,
        text=alarm.text,
        raised_at=alarm.raised_at,
        alarm=alarm.id,
        now=now,
    )


def _case(
    *,
    topic: Topic,
    level: str,
    robot: str | None,
    text: str,
    raised_at: datetime,
    now: datetime,
    alarm: str | None = None,
    person: str | None = None,
    cursor: int | None = None,
) -> NoticeCase:
    """Return a case of which nobody was told yet; of one person alone where they are given."""
    return NoticeCase(
        topic=topic,
        level=level,
        robot=robot,
        text=text,
        alarm=alarm,
        person=person,
        raised_at=raised_at,
        cursor=cursor,
        step=-1,
        told_at=None,
        next_at=now,
        ended_at=None,
    )
