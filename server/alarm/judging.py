"""When a rule fires: limits with hysteresis and delays along the time that is given.

Pure: the same function judges what robots say now and what they said last week.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta

from autonomy.channel import ALARM_LEVELS
from server.alarm.rule import AlarmRule, RuleLimit

NORMAL = -1


@dataclass(frozen=True, slots=True)
class Band:
    """How a rule judges a number."""

    limits: tuple[RuleLimit, ...]
    """The least grave first; their places are the ranks below."""
    hysteresis: float = 0.0
    delay: timedelta = timedelta()
    clear_after: timedelta = timedelta()

    @classmethod
    def of(cls, rule: AlarmRule, limits: Sequence[RuleLimit]) -> "Band":
        """Return how a rule judges by some limits, its own or those of the catalogue."""
        ascending = sorted(limits, key=lambda limit: ALARM_LEVELS.index(limit.level))
        return cls(
            tuple(ascending),
            rule.hysteresis,
            timedelta(seconds=rule.delay_s),
            timedelta(seconds=rule.clear_after_s),
        )

    def rank_of(self, level: str) -> int:
        """Return the rank of the gravest limit that is no graver than a level."""
        least = ALARM_LEVELS.index(level)
        ranks = (n for n, one in enumerate(self.limits) if ALARM_LEVELS.index(one.level) <= least)
        return max(ranks, default=0 if self.limits else NORMAL)


@dataclass(frozen=True, slots=True)
class Standing:
    """Where a rule stands for one robot."""

    rank: int = NORMAL
    """Of the limit by which its alarm stands; -1 while all is normal."""
    wished: int = NORMAL
    """Rank that the value asks for, while a delay still keeps it from that."""
    since: datetime | None = None
    """When it began to; ``None`` where no delay runs."""


def rank_of(band: Band, value: float, at: int, *, inclusive: bool = False) -> int:
    """Return the rank of the gravest limit beyond which a value is.

    Args:
        band: How the rule judges.
        value: The value.
        at: The rank at which it stands: to fall below that takes the hysteresis as well.
        inclusive: Whether a high limit is reached where the value is equal to it, as of a time.
    """
    for rank in range(len(band.limits) - 1, -1, -1):
        limit, slack = band.limits[rank], band.hysteresis if rank <= at else 0.0
        if limit.low is not None and value < limit.low + slack:
            return rank
        if limit.high is not None:
            end = limit.high - slack
            if value > end or (inclusive and value == end):
                return rank
    return NORMAL


def advance(
    band: Band, standing: Standing, value: float, now: datetime, *, inclusive: bool = False
) -> tuple[Standing, datetime | None]:
    """Return where a rule stands after a value, and when time alone may move it further.

    Args:
        band: How it judges.
        standing: Where it stood.
        value: The value; NaN, of which nobody knows, changes nothing and ends a running delay.
        now: When that is, never earlier than before.
        inclusive: As of ``rank_of``.
    """
    if math.isnan(value):
        return replace(standing, wished=standing.rank, since=None), None
    return settle(band, standing, rank_of(band, value, standing.rank, inclusive=inclusive), now)


def settle(
    band: Band, standing: Standing, rank: int, now: datetime
) -> tuple[Standing, datetime | None]:
    """Return where a rule stands once it is asked to go to a rank, and when it gets there.

    Args:
        band: How it judges.
        standing: Where it stood.
        rank: Where it is to go; ``NORMAL`` also for what does not apply.
        now: When that is, never earlier than before.
    """
    if rank == standing.rank:
        return Standing(rank, rank), None
    is_worse = rank > standing.rank
    waits = standing.since is not None and (standing.wished > standing.rank) is is_worse
    since = standing.since if waits and standing.since is not None else now
    due = since + (band.delay if is_worse else band.clear_after)
    if now >= due:
        return Standing(rank, rank), None
    return Standing(standing.rank, rank, since), due
