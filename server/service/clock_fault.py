"""A robot whose clock is wrong: it is shown as such, and its values are ordered by their arrival.

Their bytes are in the journal with the time that the robot gave them.
"""

from dataclasses import replace
from datetime import timedelta
from typing import Final, TypeVar

from robot_link.messages import PlanReport, Sample, StateReport

Told = TypeVar("Told", StateReport, Sample, PlanReport)

_WRONG: Final = timedelta(days=1)
"""A state report tells of now, so it can only be this old if the clock that dated it is wrong; a
gateway delivers for half a day."""
_YEAR_DAYS: Final = 365.25


def clock_fault(report: StateReport, speed: float) -> str | None:
    """Return what is wrong with the clock that dated a state report, ``None`` if it is right.

    Args:
        report: What a robot says of now.
        speed: Seconds of the station's clock per second of the wall.
    """
    off = report.measured_at - report.received_at
    if abs(off) <= _WRONG * max(1.0, speed):
        return None
    days = abs(off) / timedelta(days=1)
    much = f"{days / _YEAR_DAYS:.1f} years" if days > _YEAR_DAYS else f"{days:.0f} days"
    side = "ahead" if off > timedelta(0) else "behind"
    return (
        f"The clock of {report.robot} is {much} {side} ({report.measured_at:%Y-%m-%d %H:%MZ}); "
        "what it says is shown by the time of its arrival."
    )


def by_arrival(value: Told, fault: str | None) -> Told:
    """Return a value with the time of its arrival in the place of a wrong one."""
    return value if fault is None else replace(value, measured_at=value.received_at)
