"""What a person wants to be told, and when: topics, hours on duty, quiet hours.

Hours are those of a wall clock where the person is. Where that clock is set back, an hour that
comes twice counts twice; where it is set forward, what would begin in the hour that is left out
begins with the next.
"""

from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta
from functools import cache
from typing import Annotated, Final, Literal
from zoneinfo import ZoneInfo, available_timezones

from pydantic import AfterValidator, Field

from server.base.alarm_board import LEVELS
from server.base.view import Body, one_of

Topic = Literal["alarm", "contact", "battery", "station", "surfaced", "plan", "assigned", "test"]
Level = Annotated[str, one_of(*LEVELS, "none")]
_EVERY_DAY: Final = tuple(range(7))
_CLOCK: Final = r"^([01]\d|2[0-3]):[0-5]\d$"


@cache
def _zones() -> frozenset[str]:
    return frozenset(available_timezones())


def _is_zone(name: str) -> str:
    if name not in _zones():
        raise ValueError("there is no such time zone; take one such as Europe/Berlin, or UTC")
    return name


def _is_level(level: str) -> str:
    if level not in (*LEVELS, "none"):
        raise ValueError(f"a level is one of {', '.join(LEVELS)}, or none")
    return level


LeastLevel = Annotated[Level, AfterValidator(_is_level)]


class Hours(Body):
    """Hours of some days of the week, by a wall clock."""

    days: list[Annotated[int, Field(ge=0, le=6)]] = Field(default=[*_EVERY_DAY], max_length=7)
    """Days on which they begin: 0 is Monday."""
    begin: str = Field(pattern=_CLOCK)
    """``22:00``."""
    end: str = Field(pattern=_CLOCK)
    """``07:00``; of the next day where it is not after ``begin``."""

    def hold(self, local: datetime) -> bool:
        """Tell whether a moment of the wall clock is within them."""
        begin, end = _clock(self.begin), _clock(self.end)
        now = local.time().replace(tzinfo=None)
        today = local.weekday() in self.days
        if begin < end:
            return today and begin <= now < end
        yesterday = (local.weekday() - 1) % 7 in self.days
        return (today and now >= begin) or (yesterday and now < end)


class AlarmWish(Body):
    """From which level on a person is told of each kind of alarm; ``none`` for never."""

    alarm: LeastLevel = "warning"
    """What robots measure and do."""
    contact: LeastLevel = "warning"
    """Robots that do not answer or are overdue."""
    battery: LeastLevel = "warning"
    """Low batteries."""
    station: LeastLevel = "warning"
    """The station itself: storage, links, notices that cannot be sent."""


class Wishes(Body):
    """What one person wants to be told, and when."""

    alarms: AlarmWish = AlarmWish()
    """By topic, the least level of which this person is told; ``none`` for never."""
    surfaced: bool = False
    """Told when a robot surfaces."""
    plan: bool = False
    """Told when a plan is done or failed."""
    duty: list[Hours] = Field(default=[], max_length=21)
    """Hours in which the person is told at all; empty: always."""
    quiet: Hours | None = None
    """Hours in which notices wait until the end, but for those that break through."""
    quiet_breaks: LeastLevel = "critical"
    """Level from which on notices break through quiet hours; ``none``: none does."""
    time_zone: Annotated[str, AfterValidator(_is_zone)] = Field(default="UTC", max_length=64)
    """Of the hours above, by its name in the IANA list."""
    position: Literal["degrees", "minutes", "seconds"] = "minutes"
    """How positions are written to this person."""

    def wants(self, topic: str, level: str) -> bool:
        """Tell whether the person wants to hear of something."""
        if topic in ("surfaced", "plan"):
            return bool(getattr(self, topic))
        least = getattr(self.alarms, topic)
        return least != "none" and rank(level) >= rank(least)


@dataclass(frozen=True, slots=True)
class Gate:
    """Whether a person may be told now."""

    is_open: bool
    until: datetime | None = None
    """When a closed gate opens by itself; ``None`` of a person who is off duty."""


def rank(level: str) -> int:
    """Return how much a level matters; below all alarms is what is none."""
    return LEVELS.index(level) if level in LEVELS else -1


def gate(wishes: Wishes, level: str, now: datetime) -> Gate:
    """Tell whether a person may be told of something of a level at a moment."""
    zone = ZoneInfo(wishes.time_zone)
    local = now.astimezone(zone)
    if wishes.duty and not any(hours.hold(local) for hours in wishes.duty):
        return Gate(is_open=False)
    breaks = wishes.quiet_breaks
    if breaks != "none" and rank(level) >= rank(breaks):
        return Gate(is_open=True)
    if wishes.quiet is None or not wishes.quiet.hold(local):
        return Gate(is_open=True)
    return Gate(is_open=False, until=_end_of(wishes.quiet, now, zone))


def _end_of(quiet: Hours, now: datetime, zone: ZoneInfo) -> datetime | None:
    """Return when quiet hours end that hold now; None where one night follows another for ever."""
    today = now.astimezone(zone).date()
    wall = (datetime.combine(today + timedelta(days=day), _clock(quiet.end)) for day in range(9))
    ends = sorted(end for one in wall for end in _passed(one, zone))
    return next((end for end in ends if end > now and not quiet.hold(end.astimezone(zone))), None)


def _passed(wall: datetime, zone: ZoneInfo) -> tuple[datetime, ...]:
    """Return when a clock on the wall passes a time, by UTC.

    That is twice where clocks go back, and the moment of the jump where they jump over it.
    """
    first, last = sorted(wall.replace(tzinfo=zone, fold=fold).astimezone(UTC) for fold in (0, 1))
    if last.astimezone(zone).replace(tzinfo=None) == wall:
        return (first, last)
    while first.astimezone(zone).replace(tzinfo=None) < wall:
        first += timedelta(minutes=1)
    return (first,)


def _clock(text: str) -> time:
    return time.fromisoformat(text)
