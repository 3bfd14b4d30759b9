"""Whom the station tells, of what, and what became of each message.

A *case* is something to be told, an *item* that one contact is to hear of it, a *notice* the
message that carries items. Items and the steps of their cases are written in one transaction, so
that a station that is killed goes on where it was.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from sqlalchemy import and_, case, delete, func, or_, select, update
from sqlalchemy.orm import Session

from db.fault import UnknownIdError
from db.identity import key_of, public_id
from db.notice_tables import Notice, NoticeCase, NoticeContact, NoticeItem, NoticePerson
from db.person_tables import Person
from db.query.change import row_of
from db.query.station.grants import Holder, robot_roles
from db.record import same

LISTED_MAX: Final = 10
"""Cases that a message names one by one; of more it tells how many."""


@dataclass(frozen=True, slots=True)
class ContactRecord:
    """One way to reach a person."""

    id: str
    person: str
    title: str
    form: str
    hint: str
    """What may be shown of the address."""
    enabled: bool
    created_at: datetime


@dataclass(frozen=True, slots=True)
class Reachable:
    """A person who may sign in, what they want to be told, and by which contacts."""

    name: str
    role: str
    roles: tuple[tuple[str, str], ...]
    """Robots that grants reach, with the role of each grant."""
    wishes: Mapping[str, Any]
    contacts: tuple[ContactRecord, ...]


@dataclass(frozen=True, slots=True)
class ItemRecord:
    """A case as a message told it."""

    alarm: str | None
    robot: str | None
    level: str
    """Level at which it was told."""
    text: str
    raised_at: datetime
    """Since when it stood as it was told."""
    step: int
    """Step of the escalation at which it was told; 0 is the first."""
    is_over: bool
    """Whether nobody needs to be told any more."""


@dataclass(frozen=True, slots=True)
class NoticeRecord:
    """One message to one contact, and what is proved of it."""

    id: str
    contact: str
    person: str
    contact_title: str
    topic: str
    level: str
    title: str
    text: str
    items: int
    state: str
    """``queued``, ``handed``, ``given_up`` or ``withdrawn``."""
    attempts: int
    unanswered: int
    """Attempts of which no answer is known: after each of them the service may have it."""
    created_at: datetime
    tried_at: datetime | None
    ended_at: datetime | None
    reply: str
    link_expires_at: datetime | None
    link_used_at: datetime | None


def everybody(session: Session) -> list[Reachable]:
    """Return everyone who may sign in, in the order in which they were added."""
    contacts: dict[int, list[ContactRecord]] = {}
    statement = (
        select(NoticeContact, Person.name)
        .join(Person, NoticeContact.person_key == Person.key)
        .where(NoticeContact.removed_at.is_(None))
        .order_by(NoticeContact.key)
    )
    for row, name in session.execute(statement):
        contacts.setdefault(row.person_key, []).append(_contact(row, name))
    people = (
        select(Person, NoticePerson.document)
        .outerjoin(NoticePerson, NoticePerson.person_key == Person.key)
        .where(Person.disabled_at.is_(None))
        .order_by(Person.key)
    )
    found = session.execute(people).all()
    roles = robot_roles(session, [Holder(person=person.key) for person, _ in found])
    return [
        Reachable(
            name=person.name,
            role=person.role,
            roles=tuple(roles[Holder(person=person.key)]),
            wishes=wishes or {},
            contacts=tuple(contacts.get(person.key, ())),
        )
        for person, wishes in found
    ]


def find_reachable(session: Session, name: str) -> Reachable:
    """Return one person who may sign in.

    Raises:
        UnknownIdError: If there is none of this name.
    """
    for person in everybody(session):
        if person.name == name:
            return person
    raise UnknownIdError("person", name)


def save_wishes(session: Session, person: str, wishes: Mapping[str, Any]) -> None:
    """Keep what a person wants to be told.

    Raises:
        UnknownIdError: If there is no such person.
    """
    session.merge(NoticePerson(person_key=_person_key(session, person), document=dict(wishes)))


def add_contact(
    session: Session, person: str, title: str, form: str, hint: str, at: datetime
) -> ContactRecord:
    """Add a way to reach a person.

    Raises:
        UnknownIdError: If there is no such person.
    """
    row = NoticeContact(
        person_key=_person_key(session, person),
        title=title,
        form=form,
        hint=hint,
        enabled=True,
        created_at=at,
        removed_at=None,
    )
    session.add(row)
    session.flush()
    return _contact(row, person)


def get_contact(session: Session, contact: str) -> ContactRecord:
    """Return a contact.

    Raises:
        UnknownIdError: If there is none, or it was removed.
    """
    row = _contact_row(session, contact)
    return _contact(row, session.scalars(_name_of(row)).one())


def change_contact(
    session: Session,
    contact: str,
    *,
    title: str | None = None,
    hint: str | None = None,
    enabled: bool | None = None,
) -> ContactRecord:
    """Change what is given of a contact.

    Raises:
        UnknownIdError: If there is none.
    """
    row = _contact_row(session, contact)
    row.title = row.title if title is None else title
    row.hint = row.hint if hint is None else hint
    row.enabled = row.enabled if enabled is None else enabled
    return _contact(row, session.scalars(_name_of(row)).one())


def remove_contact(session: Session, contact: str, at: datetime) -> ContactRecord:
    """Forget a contact and what waits for it; what was sent to it stays in the list.

    Raises:
        UnknownIdError: If there is none.
    """
    row = _contact_row(session, contact)
    row.removed_at, row.enabled = at, False
    session.execute(
        delete(NoticeItem).where(NoticeItem.contact_key == row.key, NoticeItem.notice_key.is_(None))
    )
    return _contact(row, session.scalars(_name_of(row)).one())


def open_cases(session: Session, alarms: Collection[str]) -> dict[str, NoticeCase]:
    """Return the open cases that tell everyone of these alarms, by alarm."""
    found = session.scalars(_open_of(alarms).where(NoticeCase.person.is_(None)))
    return {row.alarm: row for row in found if row.alarm is not None}


def open_assignments(session: Session, alarms: Collection[str]) -> list[NoticeCase]:
    """Return the open cases that tell one person that they are to look after these alarms."""
    return list(session.scalars(_open_of(alarms).where(NoticeCase.person.is_not(None))))


def open_alarm_cases(session: Session) -> list[NoticeCase]:
    """Return every open case of an alarm."""
    return list(
        session.scalars(
            select(NoticeCase).where(NoticeCase.ended_at.is_(None), NoticeCase.alarm.is_not(None))
        )
    )


def has_case_of(session: Session, cursor: int) -> bool:
    """Tell whether an event is a case already."""
    return session.scalar(select(NoticeCase.key).where(NoticeCase.cursor == cursor)) is not None


def due_cases(session: Session, now: datetime, limit: int) -> list[NoticeCase]:
    """Return open cases of which somebody is to be told now, the longest due first."""
    statement = (
        select(NoticeCase)
        .where(NoticeCase.ended_at.is_(None), NoticeCase.next_at <= now)
        .order_by(NoticeCase.next_at, NoticeCase.key)
        .limit(limit)
    )
    return list(session.scalars(statement))


def end_case(session: Session, row: NoticeCase, at: datetime) -> None:
    """End a case: who was not told yet need not be told any more."""
    row.ended_at, row.next_at = at, None
    session.execute(
        delete(NoticeItem).where(NoticeItem.case_key == row.key, NoticeItem.notice_key.is_(None))
    )


def add_items(session: Session, row: NoticeCase, contacts: Iterable[tuple[str, datetime]]) -> None:
    """Have contacts hear of a case, each from a moment on; twice is once."""
    about = {"step": row.step, "level": row.level, "raised_at": row.raised_at}
    told: set[int] = set()
    if row.told_at is not None:
        told |= set(
            session.scalars(select(NoticeItem.contact_key).filter_by(case_key=row.key, **about))
        )
    for contact, not_before in contacts:
        key = key_of("contact", contact)
        if key not in told:
            told.add(key)
            item = NoticeItem(case_key=row.key, contact_key=key, not_before=not_before, **about)
            session.add(item)


def next_due(session: Session, now: datetime) -> datetime | None:
    """Return the next moment at which time alone lets something be told; None for never."""
    moments = (
        session.scalar(select(func.min(NoticeCase.next_at)).where(NoticeCase.ended_at.is_(None))),
        session.scalar(
            select(func.min(NoticeItem.not_before)).where(
                NoticeItem.notice_key.is_(None), NoticeItem.not_before > now
            )
        ),
    )
    return min((moment for moment in moments if moment is not None), default=None)


def waiting_topics(session: Session, now: datetime) -> list[tuple[str, str]]:
    """Return contacts for which something waits, with its topic, the gravest first.

    What waits for a person who may not sign in stays where it is.
    """
    statement = (
        select(NoticeItem.contact_key, NoticeCase.topic)
        .join(NoticeCase, NoticeItem.case_key == NoticeCase.key)
        .join(NoticeContact, NoticeItem.contact_key == NoticeContact.key)
        .join(Person, NoticeContact.person_key == Person.key)
        .where(
            NoticeItem.notice_key.is_(None),
            NoticeItem.not_before <= now,
            NoticeContact.enabled.is_(True),
            Person.disabled_at.is_(None),
        )
        .group_by(NoticeItem.contact_key, NoticeCase.topic)
        .order_by(func.max(_rank()).desc(), func.min(NoticeItem.key))
    )
    return [(public_id("contact", key), topic) for key, topic in session.execute(statement)]


def take_up(session: Session, contact: str, topic: str, now: datetime) -> Notice | None:
    """Make one message of all that waits for a contact on a topic; None if nothing does.

    Its words are still to be written.
    """
    key = key_of("contact", contact)
    of_topic = select(NoticeCase.key).where(NoticeCase.topic == topic)
    waits = and_(
        NoticeItem.contact_key == key,
        NoticeItem.notice_key.is_(None),
        NoticeItem.not_before <= now,
        NoticeItem.case_key.in_(of_topic),
    )
    count = session.scalar(select(func.count(func.distinct(NoticeItem.case_key))).where(waits))
    if not count:
        return None
    row = add_notice(session, contact, topic, now, items=count)
    session.execute(update(NoticeItem).where(waits).values(notice_key=row.key))
    row.level = level_counts(session, public_id("notice", row.key))[0][0]
    return row


def add_notice(
    session: Session, contact: str, topic: str, at: datetime, *, items: int = 0
) -> Notice:
    """Add a message that waits to be sent."""
    row = Notice(
        contact_key=key_of("contact", contact),
        topic=topic,
        level="info",
        title="",
        text="",
        items=items,
        state="queued",
        attempts=0,
        unanswered=0,
        created_at=at,
        tried_at=None,
        ended_at=None,
        reply="",
        link_expires_at=None,
        link_used_at=None,
    )
    session.add(row)
    session.flush()
    return row


def notice_row(session: Session, notice: str) -> Notice:
    """Return the row of a message.

    Raises:
        UnknownIdError: If there is none.
    """
    return row_of(session, Notice, "notice", notice)


def get_notice(session: Session, notice: str) -> NoticeRecord:
    """Return a message.

    Raises:
        UnknownIdError: If there is none.
    """
    found = session.execute(_notices().where(Notice.key == key_of("notice", notice))).one_or_none()
    if found is None:
        raise UnknownIdError("notice", notice)
    return _notice(*found)


def begin_attempt(session: Session, notice: str) -> None:
    """Note that a message leaves now: until its answer is kept, the service may have it.

    Raises:
        UnknownIdError: If there is none.
    """
    notice_row(session, notice).unanswered += 1


def queued_notices(session: Session) -> list[NoticeRecord]:
    """Return messages that no service has taken yet and that are not given up, oldest first."""
    statement = _notices().where(Notice.state == "queued").order_by(Notice.key)
    return [_notice(*found) for found in session.execute(statement)]


def list_notices(session: Session, person: str | None, limit: int) -> list[NoticeRecord]:
    """Return the last messages, of one person or of all, the newest first."""
    statement = _notices().order_by(Notice.key.desc()).limit(limit)
    if person is not None:
        statement = statement.where(Person.name == person)
    return [_notice(*found) for found in session.execute(statement)]


def items_of(session: Session, notice: str, limit: int = LISTED_MAX) -> list[ItemRecord]:
    """Return what a message named one by one, the gravest first."""
    statement = (
        select(NoticeItem, NoticeCase)
        .join(NoticeCase, NoticeItem.case_key == NoticeCase.key)
        .where(NoticeItem.notice_key == key_of("notice", notice))
        .order_by(_rank().desc(), NoticeCase.key, NoticeItem.key.desc())
    )
    found: dict[int, ItemRecord] = {}
    for item, row in session.execute(statement):
        if row.key not in found and len(found) < limit:
            found[row.key] = ItemRecord(
                alarm=row.alarm,
                robot=row.robot,
                level=item.level,
                text=row.text,
                raised_at=item.raised_at,
                step=item.step,
                is_over=row.alarm is not None and row.ended_at is not None,
            )
    return list(found.values())


def robots_of(session: Session, notice: str) -> set[str | None]:
    """Return the robots that a message tells of, named in it or not; None for the station."""
    statement = (
        select(NoticeCase.robot)
        .join(NoticeItem, NoticeItem.case_key == NoticeCase.key)
        .where(NoticeItem.notice_key == key_of("notice", notice))
    )
    return set(session.scalars(statement))


def waiting_robots(session: Session, contact: str) -> set[str | None]:
    """Return the robots of which a contact is still to hear; None for the station."""
    statement = (
        select(NoticeCase.robot)
        .join(NoticeItem, NoticeItem.case_key == NoticeCase.key)
        .where(NoticeItem.contact_key == key_of("contact", contact))
        .where(NoticeItem.notice_key.is_(None))
    )
    return set(session.scalars(statement))


def drop_waiting(session: Session, contact: str, robots: Collection[str | None]) -> None:
    """Forget what waits for a contact of these robots; None for the station."""
    named = [robot for robot in robots if robot is not None]
    is_theirs = NoticeCase.robot.in_(named)
    if None in robots:
        is_theirs = or_(is_theirs, NoticeCase.robot.is_(None))
    session.execute(
        delete(NoticeItem).where(
            NoticeItem.contact_key == key_of("contact", contact),
            NoticeItem.notice_key.is_(None),
            NoticeItem.case_key.in_(select(NoticeCase.key).where(is_theirs)),
        )
    )


def is_all_over(session: Session, notice: str) -> bool:
    """Tell whether a message has nothing to say any more: somebody has seen all its alarms."""
    statement = (
        select(func.count())
        .select_from(NoticeItem)
        .join(NoticeCase, NoticeItem.case_key == NoticeCase.key)
        .where(NoticeItem.notice_key == key_of("notice", notice))
    )
    left = statement.where(or_(NoticeCase.alarm.is_(None), NoticeCase.ended_at.is_(None)))
    return bool(session.scalar(statement)) and not session.scalar(left)


def level_counts(session: Session, notice: str) -> Sequence[tuple[str, int]]:
    """Return how many cases of each level a message tells of, the gravest first."""
    of_notice = select(NoticeItem.case_key).where(NoticeItem.notice_key == key_of("notice", notice))
    statement = (
        select(NoticeCase.level, func.count())
        .where(NoticeCase.key.in_(of_notice))
        .group_by(NoticeCase.level)
        .order_by(_rank().desc())
    )
    return [(level, count) for level, count in session.execute(statement)]


def _open_of(alarms: Collection[str]) -> Any:  # noqa: ANN401 - a statement of SQL
    return select(NoticeCase).where(NoticeCase.alarm.in_(alarms), NoticeCase.ended_at.is_(None))


def _rank() -> Any:  # noqa: ANN401 - an expression of SQL
    """Order levels by how much they matter; one that this does not know matters little."""
    ranks = {"info": 1, "watch": 2, "warning": 3, "severe": 4, "critical": 5}
    return case(ranks, value=NoticeCase.level, else_=0)


def _notices() -> Any:  # noqa: ANN401 - a statement of SQL
    return (
        select(Notice, NoticeContact, Person.name)
        .join(NoticeContact, Notice.contact_key == NoticeContact.key)
        .join(Person, NoticeContact.person_key == Person.key)
    )


def _notice(row: Notice, contact: NoticeContact, person: str) -> NoticeRecord:
    return same(
        NoticeRecord,
        row,
        id=public_id("notice", row.key),
        contact=public_id("contact", contact.key),
        contact_title=contact.title,
        person=person,
    )


def _contact(row: NoticeContact, person: str) -> ContactRecord:
    return same(ContactRecord, row, id=public_id("contact", row.key), person=person)


def _contact_row(session: Session, contact: str) -> NoticeContact:
    row = row_of(session, NoticeContact, "contact", contact)
    if row.removed_at is not None:
        raise UnknownIdError("contact", contact)
    return row


def _name_of(row: NoticeContact) -> Any:  # noqa: ANN401 - a statement of SQL
    return select(Person.name).where(Person.key == row.person_key)


def _person_key(session: Session, name: str) -> int:
    key = session.scalar(
        select(Person.key).where(Person.name == name, Person.disabled_at.is_(None))
    )
    if key is None:
        raise UnknownIdError("person", name)
    return key
