"""Hours on duty and quiet hours, by the wall clock of where a person is."""

from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from server.notice.wish import AlarmWish, Hours, Wishes, gate

BERLIN = ZoneInfo("Europe/Berlin")
NIGHT = Hours(begin="22:00", end="07:00")
MINUTES = st.integers(0, 24 * 60 - 1).map(lambda minute: f"{minute // 60:02}:{minute % 60:02}")
NEAR_A_CHANGE = st.sampled_from(
    [datetime(2026, 3, 29, 1, tzinfo=UTC), datetime(2026, 10, 25, 1, tzinfo=UTC)]
).flatmap(
    lambda change: st.integers(-2 * 86400, 2 * 86400).map(
        lambda seconds: change + timedelta(seconds=seconds)
    )
)
ZONES = st.sampled_from(["Europe/Berlin", "America/Detroit", "Australia/Lord_Howe", "UTC"])


def test_quiet_hours_hold_a_warning_until_their_end_and_let_a_critical_one_through():
    wishes = Wishes(quiet=NIGHT, time_zone="Europe/Berlin")
    at = datetime(2026, 7, 1, 23, 30, tzinfo=BERLIN)
    held = gate(wishes, "warning", at)
    assert not held.is_open
    assert held.until == datetime(2026, 7, 2, 7, 0, tzinfo=BERLIN)
    assert gate(wishes, "critical", at).is_open
    assert gate(wishes, "warning", datetime(2026, 7, 2, 7, 0, tzinfo=BERLIN)).is_open


def test_the_night_in_which_clocks_go_back_is_an_hour_longer():
    wishes = Wishes(quiet=Hours(begin="22:00", end="07:00"), time_zone="Europe/Berlin")
    at = datetime(2026, 10, 24, 22, 0, tzinfo=BERLIN)
    until = gate(wishes, "warning", at).until
    assert until is not None
    assert until.astimezone(UTC) - at.astimezone(UTC) == timedelta(hours=10)


def test_quiet_hours_that_end_where_clocks_jump_ahead_end_at_the_jump():
    wishes = Wishes(quiet=Hours(begin="00:00", end="02:01"), time_zone="Europe/Berlin")
    until = gate(wishes, "warning", datetime(2026, 3, 29, 0, 30, tzinfo=UTC)).until
    assert until == datetime(2026, 3, 29, 1, 0, tzinfo=UTC)


def test_nothing_breaks_through_where_the_person_wants_that():
    wishes = Wishes(quiet=NIGHT, quiet_breaks="none")
    assert not gate(wishes, "critical", datetime(2026, 7, 1, 23, tzinfo=UTC)).is_open


def test_who_is_off_duty_is_not_told_and_not_held():
    wishes = Wishes(duty=[Hours(days=[0, 1, 2, 3, 4], begin="08:00", end="16:00")])
    assert gate(wishes, "warning", datetime(2026, 7, 1, 9, tzinfo=UTC)).is_open
    off = gate(wishes, "critical", datetime(2026, 7, 4, 9, tzinfo=UTC))
    assert (off.is_open, off.until) == (False, None)


def test_a_watch_that_begins_on_friday_lasts_into_saturday():
    watch = Hours(days=[4], begin="20:00", end="04:00")
    assert watch.hold(datetime(2026, 7, 4, 3, 59, tzinfo=UTC))
    assert not watch.hold(datetime(2026, 7, 4, 4, 0, tzinfo=UTC))
    assert not watch.hold(datetime(2026, 7, 4, 20, 0, tzinfo=UTC))


def free_between(begin: str, end: str) -> timedelta:
    """Return how long nobody is quiet between the end of a night and the begin of the next."""
    first, last = (datetime.fromisoformat(f"2026-01-01T{one}Z") for one in (end, begin))
    return (last - first) % timedelta(days=1)


@given(begin=MINUTES, end=MINUTES, now=NEAR_A_CHANGE, zone=ZONES)
@example(
    begin="02:05", end="02:04", now=datetime(2026, 3, 28, 22, 4, tzinfo=UTC), zone="Europe/Berlin"
)
def test_what_is_held_is_told_at_the_end_of_quiet_hours_whatever_clocks_do(
    begin: str, end: str, now: datetime, zone: str
):
    wishes = Wishes(quiet=Hours(begin=begin, end=end), time_zone=zone)
    told = gate(wishes, "warning", now)
    if told.is_open:
        return
    if told.until is None:
        assert begin == end  # a night without end: the person said so
        return
    # Where clocks may jump over all the time between two nights, these are one.
    nights = 2 if free_between(begin, end) <= timedelta(hours=1) else 1
    assert now < told.until <= now + timedelta(hours=24 * nights + 2)
    assert gate(wishes, "warning", told.until).is_open
    quiet = wishes.quiet
    assert quiet is not None
    # Never longer than the night: a minute before, it is still quiet or the clocks just changed.
    before = told.until - timedelta(seconds=1)
    local = before.astimezone(ZoneInfo(zone))
    shift = told.until.astimezone(ZoneInfo(zone)).utcoffset() != local.utcoffset()
    assert shift or quiet.hold(local)


def test_topics_have_a_level_each():
    wishes = Wishes(alarms=AlarmWish(alarm="critical", contact="none"), surfaced=True)
    assert wishes.wants("alarm", "critical")
    assert not wishes.wants("alarm", "warning")
    assert not wishes.wants("contact", "critical")
    assert wishes.wants("surfaced", "info")
    assert not wishes.wants("plan", "warning")


@pytest.mark.parametrize(
    "wrong",
    [
        {"time_zone": "Mars/Olympus"},
        {"time_zone": "../../etc/passwd"},
        {"quiet": {"begin": "25:00", "end": "07:00"}},
        {"duty": [{"days": [7], "begin": "08:00", "end": "09:00"}]},
        {"alarms": {"alarm": "loud"}},
        {"loud": True},
    ],
)
def test_wishes_that_mean_nothing_are_refused(wrong: dict[str, object]):
    with pytest.raises(ValueError, match=r"field|zone|level|match|less|Extra"):
        Wishes.model_validate(wrong)
