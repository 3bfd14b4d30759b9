"""When a robot calls by satellite, and for how long it stays up for it; pure, by its own time."""

import math
from dataclasses import dataclass, replace

_FIRST_RETRY_S = 30.0
_LONGEST_RETRY_S = 480.0
SESSIONS_MAX = 8
"""Sessions of one call."""
_DAY_S = 86_400.0
_SPENT_PAUSE_S = 3600.0
"""Between two calls of a robot that has had all sessions of a day."""


@dataclass(frozen=True, slots=True)
class CallLimits:
    """What the operator allows, in seconds of the robot."""

    radio_silence_s: float
    """A robot at the surface calls when it has not heard its station by radio for so long."""
    session_period_s: float
    """Time between two calls of a robot that stays at the surface."""
    sessions_per_day: int
    """After so many sessions within a day it calls once an hour only, one session each."""


@dataclass(frozen=True, slots=True)
class Situation:
    """What the robot knows of itself at one moment."""

    time_s: float
    """Its program's time."""
    surfaced_s: float
    """How long it has been at the surface; 0 under water."""
    silent_s: float
    """How long its station was not heard by radio; infinite before the first time."""
    has_rung: bool
    """Whether a ring was heard since the last call."""
    has_news: bool
    """Whether there is something that the station asked for and has not been told by satellite."""


@dataclass(frozen=True, slots=True)
class CallPolicy:
    """Decides on calls. Every change returns a new value.

    A robot that comes up gives the radio ``radio_silence_s`` to be heard. If it stays silent the
    robot calls, and again after each ``session_period_s`` at the surface. A ring, or an answer
    that belongs to a message from the satellite, makes it call at once even where radio is live.
    A call that fails is repeated after 30 s, twice as long each time. Whatever happens, a day has
    no more sessions than the operator allows, and one an hour on top.
    """

    limits: CallLimits
    called_s: float = -math.inf
    """When the last call succeeded."""
    failed_s: float = -math.inf
    failures: int = 0
    """Calls that failed since the last one that did not, or since the robot came up then."""
    sessions_s: tuple[float, ...] = ()
    """When the sessions of the last day were; those that failed cost nothing and do not count."""

    def is_due(self, now: Situation) -> bool:
        """Tell whether to call now."""
        if now.surfaced_s <= 0.0 or now.time_s < self._retry_s(now) or self._must_pause(now):
            return False
        if now.has_rung or now.has_news:
            return True
        return self._is_silent(now) and self._is_owed(now)

    def is_awaited(self, now: Situation) -> bool:
        """Tell whether a robot that wants to dive should stay up for a call."""
        if now.surfaced_s <= 0.0 or self._failures(now) > 1 or self._must_pause(now):
            return False
        is_alone = now.silent_s >= min(now.surfaced_s, self.limits.radio_silence_s)
        return now.has_rung or now.has_news or (is_alone and not self._has_called(now))

    def called(self, now: Situation, *, is_sent: bool) -> "CallPolicy":
        """Note how a call ended, now."""
        if is_sent:
            return replace(self, called_s=now.time_s, failures=0)
        return replace(self, failed_s=now.time_s, failures=self._failures(now) + 1)

    def held(self, time_s: float) -> "CallPolicy":
        """Note that a session came about then."""
        recent = (at for at in self.sessions_s if time_s - at < _DAY_S)
        return replace(self, sessions_s=(*recent, time_s))

    def is_spent(self, time_s: float) -> bool:
        """Tell whether the sessions of a day have been held."""
        recent = sum(time_s - at < _DAY_S for at in self.sessions_s)
        return recent >= self.limits.sessions_per_day

    def _must_pause(self, now: Situation) -> bool:
        is_early = bool(self.sessions_s) and now.time_s - self.sessions_s[-1] < _SPENT_PAUSE_S
        return is_early and self.is_spent(now.time_s)

    def _failures(self, now: Situation) -> int:
        """Return the calls that failed since the robot came up."""
        return self.failures if self.failed_s > now.time_s - now.surfaced_s else 0

    def _is_silent(self, now: Situation) -> bool:
        return min(now.surfaced_s, now.silent_s) >= self.limits.radio_silence_s

    def _is_owed(self, now: Situation) -> bool:
        is_late = now.time_s - self.called_s >= self.limits.session_period_s
        return is_late or not self._has_called(now)

    def _has_called(self, now: Situation) -> bool:
        """Tell whether a call succeeded since the robot came up."""
        return self.called_s > now.time_s - now.surfaced_s

    def _retry_s(self, now: Situation) -> float:
        """Return when a call may be tried again; at once after coming up."""
        failures = self._failures(now)
        if failures == 0:
            return -math.inf
        wait_s = _FIRST_RETRY_S * 2.0 ** (failures - 1)
        return self.failed_s + min(wait_s, _LONGEST_RETRY_S)
