"""Which time a shift is: *mine*, or the *last two*."""

from sqlalchemy.orm import Session

from db.deployment_span import Period
from db.query.fleet.deployments import INSTANT
from db.query.log_book.pages import newest_page
from db.query.log_book.shifts import Shift, newest_shift, newest_shifts

_LOOKED_AT = 50


def my_shift(session: Session, person: str) -> Period | None:
    """Return the time of the shift that a person is on, or was on last; half-open.

    ``None`` if they never were.
    """
    shift = newest_shift(session, person)
    return None if shift is None else _period(shift)


def last_two_shifts(session: Session) -> Period | None:
    """Return the time since the shift before the present one began.

    A signed page is a shift: the one before the present is the newest page. Where nobody has
    signed one, it is the newest shift that was over when a later one began or that is not the only
    one. ``None`` if nobody was on watch ever.
    """
    page = newest_page(session)
    if page is not None:
        return Period(page.began_at, None)
    shifts = newest_shifts(session, _LOOKED_AT)
    if not shifts:
        return None
    running = [shift for shift in shifts if shift.ended_at is None]
    present = min((shift.began_at for shift in running), default=shifts[0].began_at)
    before = [shift for shift in shifts if shift.ended_at is not None]
    earlier = [shift.began_at for shift in before if shift.began_at < present]
    return Period(max(earlier, default=present), None)


def _period(shift: Shift) -> Period:
    end = shift.ended_at
    return Period(shift.began_at, None if end is None else max(shift.began_at, end - INSTANT))
