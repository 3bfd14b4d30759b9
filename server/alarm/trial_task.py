"""Judges the past of one robot by one rule, in a worker."""

import heapq
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from itertools import groupby
from operator import itemgetter
from typing import Any, Final

from autonomy.channel import Channel
from robot_link.messages import RobotMode
from server.alarm.course import CompiledRule, Course, Look, Told
from server.alarm.rule import AlarmRule
from server.alarm.value import VALUES, Found

_ASKED_EVERY: Final = 2000
_FIRED_MAX: Final = 1000
_MODE: Final = ""
"""Stands among the names of values for what the robot was doing."""


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
    modes: PastValue
    """Numbers of ``RobotMode``; empty where the rule is for any."""
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

    What was measured at one moment is judged together, as a report is. A level that changes ends
    one stretch and begins another, and a mode that the rule is not for ends one. When the rule is
    suppressed by design is not looked at: the past of that is not kept.
    """
    del report
    course, told = Course(CompiledRule(past.rule, past.channels)), dict[str, Told]()
    fired: list[Fired] = []
    mode = ""

    def station(name: str) -> Found | None:
        kept = told.get(name)
        if kept is None or math.isnan(kept.value):
            return None
        return Found(kept.value, VALUES[name].words(kept.value))

    def judge(now: datetime) -> None:
        look = Look(past.robot, now, told, station)
        verdict = course.look(look)
        if past.rule.modes and mode not in past.rule.modes:
            verdict = None
        stands = fired[-1] if fired and fired[-1].end is None else None
        if stands is not None and (verdict is None or verdict.level != stands.level):
            stands.end = now
            stands = None
        if verdict is not None and stands is None:
            fired.append(Fired(past.robot, verdict.level, now, None, verdict.text))

    for number, (at, rows) in enumerate(groupby(_merged(past), itemgetter(0))):
        if number % _ASKED_EVERY == 0 and is_cancelled():
            return []
        while course.due is not None and course.due < at:
            judge(course.due)
        for _, name, value in rows:
            if name == _MODE:
                mode = RobotMode(int(value)).name.lower()
            else:
                told[name] = Told(value, at, at)
        judge(at)
    while course.due is not None and course.due <= past.end:
        judge(course.due)
    return fired[-_FIRED_MAX:]


def _merged(past: Past) -> Iterator[tuple[datetime, str, float]]:
    """Return all values and modes in order of time."""
    series = {**past.told, _MODE: past.modes}
    rows = (
        zip(one.times, [name] * len(one.times), one.values, strict=True)
        for name, one in series.items()
    )
    return heapq.merge(*rows, key=lambda row: row[0])
