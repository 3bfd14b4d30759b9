"""Which backups stay."""

from datetime import UTC, datetime, timedelta

from hypothesis import given
from hypothesis import strategies as st

from server.backup.rotation import kept
from server.backup.settings import BackupSettings

BEGIN = datetime(2026, 1, 1, 2, tzinfo=UTC)
MOMENTS = st.timedeltas(timedelta(), timedelta(days=3650)).map(lambda later: BEGIN + later)
COUNTS = st.integers(0, 10)


def test_a_year_of_nights_leaves_days_weeks_and_months():
    """As a station does it: after each night's backup the others go."""
    there: set[datetime] = set()
    for night in range(365):
        there = kept({*there, BEGIN + timedelta(days=night)}, days=7, weeks=4, months=12)
    last = BEGIN + timedelta(days=364)
    days = {last - timedelta(days=back) for back in range(7)}
    sundays = {datetime(2026, 12, day, 2, tzinfo=UTC) for day in (13, 20, 27)}
    month_ends = {datetime(2026, month, 1, 2, tzinfo=UTC) - timedelta(days=1)
                  for month in range(2, 13)}  # fmt: skip
    assert there == days | sundays | month_ends | {last}
    assert len(there) == 7 + 2 + 11


def test_nights_without_a_backup_count_for_nothing():
    old = {BEGIN + timedelta(days=day) for day in range(3)}
    later = BEGIN + timedelta(days=900)
    assert kept({*old, later}, days=3, weeks=0, months=0) == {later, *sorted(old)[1:]}


def test_of_one_day_the_newest_stays():
    times = {BEGIN + timedelta(hours=hour) for hour in range(0, 20, 6)}
    assert kept(times, days=5, weeks=5, months=5) == {max(times)}


@given(times=st.sets(MOMENTS, min_size=1), days=COUNTS, weeks=COUNTS, months=COUNTS)
def test_the_newest_stays_and_no_rule_takes_from_another(times, days, weeks, months):
    stay = kept(times, days=days, weeks=weeks, months=months)
    assert max(times) in stay
    assert len(stay) <= 1 + days + weeks + months
    assert kept(times, days=days, weeks=0, months=0) <= stay
    assert kept(stay, days=days, weeks=weeks, months=months) == stay


@given(last=MOMENTS, hour=st.integers(0, 23))
def test_a_daily_backup_is_due_at_its_hour_within_a_day(last, hour):
    due = BackupSettings(hour_utc=hour).next_after(last)
    assert timedelta() < due - last <= timedelta(days=1)
    assert (due.hour, due.minute, due.second) == (hour, 0, 0)


@given(last=MOMENTS, hours=st.integers(1, 168))
def test_other_backups_are_due_so_many_hours_after_the_last(last, hours):
    settings = BackupSettings(rhythm="hours", every_hours=hours)
    assert settings.next_after(last) - last == settings.period == timedelta(hours=hours)
