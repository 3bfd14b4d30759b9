"""A robot whose clock is wrong: it is shown as such, and what it says now counts as of its arrival.

What it kept under water was dated by the same clock, so it is put as long before as that clock
says. Its bytes are in the journal with the time that the robot gave them.
"""

from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Final, TypeVar

from robot_link.channel_table import ChannelPage
from robot_link.messages import StateReport
from robot_link.report import RobotReport

Told = TypeVar("Told", bound=RobotReport | ChannelPage)

AHEAD_MAX: Final = timedelta(seconds=60)
"""Nothing is told before it happens: a clock that is farther ahead is wrong."""
_BEHIND_MAX: Final = timedelta(seconds=60)
"""States by radio tell of now; those that are all this late were dated by a clock that is behind,
unless they waited on the way."""
_STEADY: Final = timedelta(seconds=5)
"""What waited on the way is late by less and less, or more and more; a clock is always late by the
same, and not for less long than this."""
_STEADY_REPORTS: Final = 5
_WAY_MAX: Final = timedelta(days=1)
"""A gateway delivers for half a day; a state that is older was dated by a wrong clock."""
_SAID_AGAIN: Final = timedelta(seconds=60)
"""So long after a state of now, one of long ago accuses no clock unless others follow."""
_NEVER_SET: Final = timedelta(days=365)
_YEAR_DAYS: Final = 365.25


@dataclass(frozen=True, slots=True)
class ClockFault:
    """How wrong a robot's clock is."""

    ahead: timedelta
    """Of the station's clock; negative if it is behind."""
    text: str
    """One sentence for the operator."""


class ClockJudge:
    """Judges one robot's clock by when its states arrive, and dates what it tells.

    Limits of time are wall time; both clocks may run faster than the wall.

    Args:
        speed: Seconds of the station's clock per second of the wall.
    """

    def __init__(self, speed: float) -> None:
        self._speed = max(1.0, speed)
        self._late_since: datetime | None = None
        self._late_by = timedelta()
        self._right_at: datetime | None = None
        """When a state of now came last."""
        self._late_reports = 0
        self._told_ahead = timedelta()
        self.fault: ClockFault | None = None
        """What is wrong with the clock that dated the newest state; ``None`` if it is right."""

    def hear(self, report: StateReport, *, is_prompt: bool) -> None:
        """Take what a robot says of now.

        Args:
            report: Its state.
            is_prompt: Whether it came as soon as it was said; not so by satellite.
        """
        ahead = report.measured_at - report.received_at
        if not is_prompt and self._may_be_on_its_way(ahead):
            return
        is_wrong = ahead > AHEAD_MAX * self._speed or (
            -ahead > _WAY_MAX * self._speed
            and not self._may_be_said_again(report.received_at, -ahead)
        )
        is_behind = is_prompt and self._is_behind(report.received_at, -ahead)
        self.fault = self._fault(report.robot, ahead) if is_wrong or is_behind else None

    def dated(self, value: Told) -> Told:
        """Return a value with its time by the station's clock, at the latest that of its arrival.

        A clock that is right by a little more or less keeps its word.
        """
        ahead = value.measured_at - value.received_at
        if self.fault is not None:
            at = min(value.measured_at - self.fault.ahead, value.received_at)
            return replace(value, measured_at=at)
        is_future = ahead > AHEAD_MAX * self._speed
        return replace(value, measured_at=value.received_at) if is_future else value

    def _may_be_on_its_way(self, ahead: timedelta) -> bool:
        """Tell whether a late state is as late as one of a clock that is known to be behind."""
        if self.fault is None or ahead >= timedelta():
            return False
        return -_WAY_MAX * self._speed < self.fault.ahead < timedelta()

    def _may_be_said_again(self, received_at: datetime, late_by: timedelta) -> bool:
        """Tell whether states of now came until a moment ago, and a robot may have said this one.

        A clock that was never set is years behind.
        """
        if self._right_at is None or late_by > _NEVER_SET:
            return False
        return received_at - self._right_at < _SAID_AGAIN * self._speed

    def _is_behind(self, received_at: datetime, late_by: timedelta) -> bool:
        """Tell whether states arrive so late, and for so long, that nothing but a clock does it."""
        if late_by <= _BEHIND_MAX * self._speed:
            self._late_since = None
            self._right_at = received_at
            return False
        if self._late_since is None or abs(late_by - self._late_by) > _STEADY * self._speed:
            self._late_since, self._late_by, self._late_reports = received_at, late_by, 0
        self._late_reports += 1
        is_steady = received_at - self._late_since >= _STEADY * self._speed
        was_behind = self.fault is not None and self.fault.ahead < timedelta()
        return was_behind or (is_steady and self._late_reports >= _STEADY_REPORTS)

    def _fault(self, robot: str, ahead: timedelta) -> ClockFault:
        """Return what is wrong; the sentence stays as it is while the clock is off by the same."""
        is_same = abs(ahead - self._told_ahead) <= AHEAD_MAX * self._speed
        if self.fault is not None and is_same:
            return replace(self.fault, ahead=ahead)
        self._told_ahead = ahead
        side = "ahead of" if ahead > timedelta() else "behind"
        return ClockFault(
            ahead,
            f"The clock of {robot} is {_much(abs(ahead))} {side} the station's; "
            "what it says is shown by the time of its arrival.",
        )


def _much(span: timedelta) -> str:
    days = span / timedelta(days=1)
    if days > _YEAR_DAYS:
        return f"{days / _YEAR_DAYS:.1f} years"
    for unit, length in (("days", timedelta(days=1)), ("hours", timedelta(hours=1))):
        if span >= 2 * length:
            return f"{span / length:.0f} {unit}"
    return f"{max(1.0, span / timedelta(minutes=1)):.0f} min"
