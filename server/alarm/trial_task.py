"""Judges the past of one robot by one rule, in a worker."""

import heapq
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final

from autonomy.channel import Channel
from server.alarm.course import CompiledRule, Course, Look, Told
from server.alarm.rule import AlarmRule
from server.alarm.value import VALUES, Found

_ASKED_EVERY: Final = 2000
_FIRED_MAX: Final = 1000


@dataclass(frozen=True, slots=True)
class PastValue:
    """What was told of one name, in order of time."""

    times: list[datetime]
    values: list[float]


@dataclass(frozen=True, slots=True)
class Past:
    """What a robot told, and by what it is judged."""

    robot: str
    rule: AlarmRule
    channels: Mapping[str, Channel]
    told: Mapping[str, PastValue]
    end: datetime


@dataclass(slots=True)
class Fired:
    """A stretch in which the rule would have had an alarm stand."""

    robot: str
    level: str
    begin: datetime
    end: datetime | None
    """``None``: until now."""
    text: str

    def document(self) -> dict[str, Any]:
        """Return it as JSON."""
        return {
            "robot": self.robot, "level": self.level, "begin": self.begin.isoformat(),
            "end": None if self.end is None else self.end.isoformat(), "text": self.text,
        }  # fmt: skip


def replay(
    past: Past, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> list[Fired]:
    """Return when a rule would have fired, at most the last thousand times.

    A level that changes ends one stretch and begins another. Where the rule is for some modes, or
    suppressed, is not looked at: the past of that is not kept.
    """
    del report
    course, told = Course(CompiledRule(past.rule, past.channels)), dict[str, Told]()
    fired: list[Fired] = []

    def station(name: str) -> Found | None:
        kept = told.get(name)
        return None if kept is None else Found(kept.value, VALUES[name].words(kept.value))

    def judge(now: datetime) -> None:
        look = Look(past.robot, now, told, station)
        verdict = course.look(look)
        stands = fired[-1] if fired and fired[-1].end is None else None
        if stands is not None and (verdict is None or verdict.level != stands.level):
            stands.end = now
            stands = None
        if verdict is not None and stands is None:
            fired.append(Fired(past.robot, verdict.level, now, None, verdict.text))

    for number, (at, name, value) in enumerate(_merged(past.told)):
        if number % _ASKED_EVERY == 0 and is_cancelled():
            return []
        while course.due is not None and course.due < at:
            judge(course.due)
        told[name] = Told(value, at, at)
        judge(at)
    while course.due is not None and course.due <= past.end:
        judge(course.due)
    return fired[-_FIRED_MAX:]


def _merged(told: Mapping[str, PastValue]) -> Iterator[tuple[datetime, str, float]]:
    """Return all values in order of time."""
    rows = (
        zip(past.times, [name] * len(past.times), past.values, strict=True)
        for name, past in told.items()
    )
    return heapq.merge(*rows, key=lambda row: row[0])
