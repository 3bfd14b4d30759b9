"""What an actuator report can say, whichever wire brought it."""

import math

from robot_link.report import ActuatorReport

ACTUATORS = frozenset({"sliding mass", "pump", "tail"})
"""Those that can be stuck."""
_MOST_SHARE, _MOST_DELAY_S = 10.0, 60.0


def checked_actuators(report: ActuatorReport) -> ActuatorReport:
    """Return a report that is possible.

    Raises:
        ValueError: If it is not; see ``actuator_fault``.
    """
    if fault := actuator_fault(report):
        raise ValueError(f"an actuator report has {fault}")
    return report


def actuator_fault(report: ActuatorReport) -> str:
    """Return what is impossible about a report, "" if nothing is."""
    for one in (report.mass, report.pump):
        numbers = (one.rate_share, one.rate_std_octaves, one.delay_s, one.delay_std_s)
        if not all(map(math.isfinite, (*numbers, one.learned_age_s or 0.0))):
            return "a number that is not finite"
        if not 0.0 < one.rate_share <= _MOST_SHARE:
            return f"a rate of {one.rate_share:.3g} times the nominal one"
        if not 0.0 <= one.delay_s <= _MOST_DELAY_S:
            return f"a delay of {one.delay_s:.3g} s"
        if one.rate_std_octaves < 0.0 or one.delay_std_s < 0.0 or (one.learned_age_s or 0.0) < 0.0:
            return "a negative deviation or age"
    if not 0.0 < report.speed_share <= 1.0 + 1e-6:
        return f"legs at {report.speed_share:.3g} times their speed"
    return "" if set(report.stuck) <= ACTUATORS else "an actuator that nobody has"
