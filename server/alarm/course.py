"""One rule along one robot: how it reads, judges and speaks. Live and over the past the same."""

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import NamedTuple

from autonomy.channel import Channel
from server.alarm.expression import compile_expression
from server.alarm.judging import NORMAL, Band, Standing, advance, settle
from server.alarm.rule import AlarmRule, RuleLimit, filled
from server.alarm.value import VALUES, Found

_ASKED_AGAIN = timedelta(seconds=5)
"""Of an expression over a time that passes: nobody can say when it holds."""


class Told(NamedTuple):
    """The newest value of a channel."""

    value: float
    measured_at: datetime
    received_at: datetime


@dataclass(slots=True)
class Look:
    """What a rule sees of a robot at one moment."""

    robot: str
    now: datetime
    channels: Mapping[str, Told]
    """Newest values of channels and of gauges of the state report."""
    station: Callable[[str], Found | None]
    """Reads a value of ``VALUES``; ``None`` where it is normal or does not apply."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a rule says of a robot."""

    level: str
    text: str


class CompiledRule:
    """A rule with what the catalogue says of what it reads; shared by all robots."""

    def __init__(self, rule: AlarmRule, channels: Mapping[str, Channel]) -> None:
        self.rule = rule
        self.names = rule.names
        self.value = VALUES.get(rule.reads)
        self.channel = channels.get(rule.reads)
        limits = rule.limits
        if rule.kind == "catalogue" and self.channel is not None:
            limits = tuple(
                RuleLimit(level=one.level, low=one.low, high=one.high)
                for one in self.channel.alarms
            )
        self.band = Band.of(rule, limits)
        is_expression = rule.kind == "expression"
        self._evaluate = compile_expression(rule.expression).value if is_expression else None
        self.is_timed = rule.kind == "absence" or (self.value is not None and self.value.is_time)
        """Whether its value grows while nothing is told."""
        self.reads_station = any(name in VALUES for name in self.names)
        self.reads_time = any(name in VALUES and VALUES[name].is_time for name in self.names)
        self.is_of_station = bool(self.names) and all(
            name in VALUES and VALUES[name].about == "station" for name in self.names
        )
        """Whether it is about the station, and about no robot."""

    def evaluated(self, look: Look) -> float:
        """Return the value of its expression, NaN where nobody knows."""

        def lookup(name: str) -> float:
            told = look.channels.get(name)
            if told is not None:
                return told.value
            if name not in VALUES:
                return math.nan
            found = look.station(name)
            return VALUES[name].absent if found is None else _number(found, look.now)

        evaluate = self._evaluate
        value = math.nan if evaluate is None else evaluate(lookup)
        return value if math.isfinite(value) else math.nan

    def words(self, value: float) -> str:
        """Return a value as its sentence has it."""
        if self.rule.kind == "absence":
            return f"{value:.0f} s"
        if self.rule.kind == "rate":
            unit = "" if self.channel is None else self.channel.unit
            return f"{value:.3g} {unit}/min"
        if self.channel is not None:
            return self.channel.words(value)
        return f"{value:g}" if self.value is None else self.value.words(value)

    @property
    def is_conditional(self) -> bool:
        """Whether what a robot does decides if what it finds is an alarm."""
        return bool(self.rule.modes or self.rule.suppressed)

    @property
    def title(self) -> str:
        """What its sentence calls what it watches."""
        if self.channel is not None:
            return self.channel.title
        return self.rule.title if self.value is None else self.value.title


def _number(found: Found, now: datetime) -> float:
    if found.since is None:
        return found.value
    return (now - found.since).total_seconds() / found.unit_s


@dataclass(slots=True)
class Course:
    """Where one rule stands for one robot, and what it remembers."""

    compiled: CompiledRule
    standing: Standing = field(default_factory=Standing)
    verdict: Verdict | None = None
    """What it says now."""
    due: datetime | None = None
    """When time alone may change that."""
    _before: deque[Told] = field(default_factory=deque[Told])
    _detail: str = ""
    """With which it said that."""

    def look(self, look: Look) -> Verdict | None:
        """Judge what is to be seen, and return what the rule says now."""
        value, detail, is_known = self._read(look)
        before = self.standing.rank
        band, timed = self.compiled.band, self.compiled.is_timed
        if value is None:
            self.standing, self.due = settle(band, self.standing, NORMAL, look.now)
        else:
            self.standing, self.due = advance(band, self.standing, value, look.now, inclusive=timed)
        if (timed or self.compiled.reads_time) and is_known and self.due is None:
            self.due = self._reached_at(look)
        rank = self.standing.rank
        if rank == NORMAL:
            self.verdict = None
        elif value is not None and (
            rank != before or self.verdict is None or (is_known and detail != self._detail)
        ):
            # A sentence follows its detail; its value stays the one that crossed the limit.
            limit, self._detail = band.limits[rank], detail
            self.verdict = Verdict(limit.level, self._text(look.robot, value, detail, limit))
        return self.verdict

    def resume(self, level: str, text: str) -> None:
        """Take up an alarm that stood when the station last ran."""
        rank = self.compiled.band.rank_of(level)
        if rank != NORMAL:
            self.standing = Standing(rank, rank)
            self.verdict = Verdict(self.compiled.band.limits[rank].level, text)

    def forget(self) -> None:
        """Begin anew: the rule was not asked for a while."""
        self.standing, self.verdict, self.due = Standing(), None, None
        self._before.clear()

    def _read(self, look: Look) -> tuple[float | None, str, bool]:
        """Return the value, its words, and whether it is known; ``None`` if it does not apply."""
        compiled, kind = self.compiled, self.compiled.rule.kind
        if kind == "expression":
            return compiled.evaluated(look), "", True
        if compiled.value is not None:
            found = look.station(compiled.rule.reads)
            if found is None:
                return None, "", False
            return _number(found, look.now), found.detail, True
        told = look.channels.get(compiled.rule.reads)
        if told is None:
            return math.nan, "", False
        if kind == "absence":
            return (look.now - told.received_at).total_seconds(), "", True
        if kind == "rate":
            return self._rate_per_min(told), "", True
        return told.value, "", True

    def _rate_per_min(self, told: Told) -> float:
        """Return the change over the window; half of it must be known."""
        before, window = self._before, timedelta(seconds=self.compiled.rule.window_s)
        if not before or told.measured_at > before[-1].measured_at:
            before.append(told)
        while before[0].measured_at < before[-1].measured_at - window:
            before.popleft()
        span_s = (before[-1].measured_at - before[0].measured_at).total_seconds()
        if span_s < window.total_seconds() / 2.0:
            return math.nan
        return 60.0 * (before[-1].value - before[0].value) / span_s

    def _reached_at(self, look: Look) -> datetime | None:
        """Return when a value that grows by itself reaches its next limit."""
        compiled = self.compiled
        if compiled.rule.kind == "expression":
            return look.now + _ASKED_AGAIN
        begin, unit_s = None, 1.0
        if compiled.rule.kind == "absence":
            told = look.channels.get(compiled.rule.reads)
            begin = None if told is None else told.received_at
        else:
            found = look.station(compiled.rule.reads)
            if found is not None:
                begin, unit_s = found.since, found.unit_s
        if begin is None:
            return None
        ends = [one.high for one in compiled.band.limits if one.high is not None]
        moments = (begin + timedelta(seconds=end * unit_s) for end in ends)
        return min((moment for moment in moments if moment > look.now), default=None)

    def _text(self, robot: str, value: float, detail: str, limit: RuleLimit) -> str:
        is_high = limit.high is not None and (limit.low is None or value >= limit.high)
        end = limit.high if is_high else limit.low
        return filled(
            self.compiled.rule.text,
            {
                "robot": robot,
                "title": self.compiled.title,
                "value": self.compiled.words(value),
                "limit": self.compiled.words(value if end is None else end),
                "side": "above" if is_high else "below",
                "detail": detail,
            },
        )
