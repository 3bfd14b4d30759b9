"""Who is on watch, from when to when."""

from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import or_, select
from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.fault import StoreError
from db.identity import public_id
from db.log_book_tables import ShiftRow
from db.query.station.events import add_event
from db.record import same

KIND = "shift"


class ShiftStateError(StoreError):
    """The person is on watch already, or is not."""


@dataclass(frozen=True, slots=True)
class Shift:
    """The time that a person is on watch."""

    id: str
    person: str
    began_at: datetime
    ended_at: datetime | None
    """``None`` while it lasts."""

    def hours_in(self, first: datetime, last: datetime) -> float:
        """Return how many of its hours are between two moments."""
        begin, end = max(self.began_at, first), min(self.ended_at or last, last)
        return max(0.0, (end - begin).total_seconds() / 3600.0)


def begin_shift(session: Session, person: str, at: datetime) -> Shift:
    """Let a person be on watch from now on.

    Raises:
        ShiftStateError: If they are already.
    """
    row = _open(session, person)
    if row is not None:
        raise ShiftStateError(f"{person} is on watch since {row.began_at:%Y-%m-%d %H:%M}Z already.")
    row = ShiftRow(person=person, began_at=at, ended_at=None)
    session.add(row)
    session.flush()
    shift = _record(row)
    add_event(session, at, "shift.begun", f"{person} is on watch.", data={"shift": shift.id})
    return shift


def end_shift(session: Session, person: str, at: datetime) -> Shift:
    """Let a person be on watch no more.

    Raises:
        ShiftStateError: If they are not.
    """
    row = _open(session, person)
    if row is None:
        raise ShiftStateError(f"{person} is not on watch.")
    row.ended_at = at
    shift = _record(row)
    hours = shift.hours_in(row.began_at, at)
    text = f"{person} is off watch after {hours:.1f} hours."
    add_event(session, at, "shift.ended", text, data={"shift": shift.id, "hours": round(hours, 3)})
    return shift


def open_shift(session: Session, person: str) -> Shift | None:
    """Return the shift that a person is on, if they are."""
    row = _open(session, person)
    return None if row is None else _record(row)


def newest_shift(session: Session, person: str) -> Shift | None:
    """Return the shift that a person is on, or was on last."""
    row = session.scalar(
        select(ShiftRow)
        .where(ShiftRow.person == person)
        .order_by(ShiftRow.began_at.desc(), ShiftRow.key.desc())
        .limit(1)
    )
    return None if row is None else _record(row)


def newest_shifts(session: Session, limit: int) -> list[Shift]:
    """Return the shifts of everybody, the newest first."""
    newest_first = (ShiftRow.began_at.desc(), ShiftRow.key.desc())
    return [
        _record(row)
        for row in session.scalars(select(ShiftRow).order_by(*newest_first).limit(limit))
    ]


def shifts_in(session: Session, period: Period) -> list[Shift]:
    """Return the shifts that have a part in a period, the oldest first."""
    statement = select(ShiftRow).where(
        or_(ShiftRow.ended_at.is_(None), ShiftRow.ended_at > period.first)
    )
    if period.last is not None:
        statement = statement.where(ShiftRow.began_at < period.last)
    return [_record(row) for row in session.scalars(statement.order_by(ShiftRow.began_at))]


def _open(session: Session, person: str) -> ShiftRow | None:
    return session.scalar(
        select(ShiftRow).where(ShiftRow.person == person, ShiftRow.ended_at.is_(None))
    )


def _record(row: ShiftRow) -> Shift:
    return same(Shift, row, id=public_id(KIND, row.key))
