"""Which backups are kept: the newest of each of so many days, weeks and months."""

from collections.abc import Callable, Iterable
from datetime import datetime


def kept(times: Iterable[datetime], *, days: int, weeks: int, months: int) -> set[datetime]:
    """Return the moments whose backups stay.

    A day, week (ISO 8601) or month without a backup counts for nothing, so that a station that
    stood still for a year keeps what it had. The newest of all stays always.

    Args:
        times: When backups were made, UTC.
        days: How many days keep their newest.
        weeks: How many weeks.
        months: How many months.
    """
    newest_first = sorted(times, reverse=True)
    rules: tuple[tuple[int, Callable[[datetime], object]], ...] = (
        (days, lambda at: at.date()),
        (weeks, lambda at: at.isocalendar()[:2]),
        (months, lambda at: (at.year, at.month)),
    )
    stay = set(newest_first[:1])
    for count, period in rules:
        newest_of: dict[object, datetime] = {}
        for at in newest_first:
            newest_of.setdefault(period(at), at)
        stay.update(list(newest_of.values())[:count])
    return stay
