"""A robot whose clock is wrong: it is shown as such, and what it says now counts as of its arrival.

What it kept under water was dated by the same clock, so it is put as long before as that clock
says. Its bytes are in the journal with the time that the robot gave them.
"""

from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Final, TypeVar

from robot_link.messages import PlanReport, Sample, StateReport, TrackReport

Told = TypeVar("Told", bound=StateReport | Sample | PlanReport | TrackReport)

_WRONG: Final = timedelta(days=1)
"""A state report tells of now, so it can only be this old if the clock that dated it is wrong; a
gateway delivers for half a day."""
_YEAR_DAYS: Final = 365.25


@dataclass(frozen=True, slots=True)
class ClockFault:
    """How wrong a robot's clock is."""

    ahead: timedelta
    """Of the station's clock; negative if it is behind."""
    text: str
    """One sentence for the operator."""


def clock_fault(report: StateReport, speed: float) -> ClockFault | None:
    """Return what is wrong with the clock that dated a state report, ``None`` if it is right.

    Args:
        report: What a robot says of now.
        speed: Seconds of the station's clock per second of the wall.
    """
    ahead = report.measured_at - report.received_at
    if abs(ahead) <= _WRONG * max(1.0, speed):
        return None
    days = abs(ahead) / timedelta(days=1)
    much = f"{days / _YEAR_DAYS:.1f} years" if days > _YEAR_DAYS else f"{days:.0f} days"
    side = "ahead" if ahead > timedelta(0) else "behind"
    return ClockFault(
        ahead,
        f"The clock of {report.robot} is {much} {side} ({report.measured_at:%Y-%m-%d %H:%MZ}); "
        "what it says is shown by the time of its arrival.",
    )


def by_arrival(value: Told, fault: ClockFault | None) -> Told:
    """Return a value with its time by the station's clock, at the latest that of its arrival."""
    if fault is None:
        return value
    at = min(value.measured_at - fault.ahead, value.received_at)
    return replace(value, measured_at=at)
