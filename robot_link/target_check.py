"""What a report on a target can say, whichever wire brought it."""

import math

from autonomy.tracking.phase import TargetPhase
from robot_link.report import TargetEstimate, TargetReport

MOST_HYPOTHESES = 2
_ROUNDING = 1e-2
"""What the roundings of a wire may add to a probability, a condition number or a correlation."""


def target_phase(number: int) -> TargetPhase:
    """Return the phase of a wire's number.

    Raises:
        ValueError: If there is none.
    """
    try:
        return TargetPhase(number)
    except ValueError as error:
        raise ValueError(f"phase {number} of a track is unknown") from error


def checked_target(report: TargetReport) -> TargetReport:
    """Return a report that is possible.

    Raises:
        ValueError: If it is not; see ``target_fault``.
    """
    if fault := target_fault(report):
        raise ValueError(f"a track has {fault}")
    return report


def target_fault(report: TargetReport) -> str:
    """Return what is impossible about a report, "" if nothing is.

    A number that is not finite, negative where it cannot be, or more than 1 where it is a
    probability or an inverse condition number; or a covariance that is none.
    """
    if not all(math.isfinite(number) for number in _numbers(report)):
        return "a number that is not finite"
    if report.range_m is not None and report.range_m < 0.0:
        return f"a range of {report.range_m:.3g} m"
    if report.range_m is not None and report.range_age_s < 0.0:
        return f"a range that is {report.range_age_s:.3g} s old"
    if report.delay_s is not None and report.delay_s < 0.0:
        return f"ranges that are {report.delay_s:.3g} s late"
    if not 0 <= report.ranges_rejected <= report.ranges_heard:
        return "more ranges that were not believed than were heard"
    if not -_ROUNDING <= report.inverse_condition <= 1.0 + _ROUNDING:
        return f"an inverse condition number of {report.inverse_condition:.3g}"
    faults = map(_hypothesis_fault, report.hypotheses)
    return next((fault for fault in faults if fault), "")


def _hypothesis_fault(one: TargetEstimate) -> str:
    if not 0.0 <= one.weight <= 1.0 + _ROUNDING:
        return f"a hypothesis with a probability of {one.weight:.3g}"
    north, both, east = one.covariance_m2
    if min(north, east) < 0.0 or abs(both) > math.sqrt(north) * math.sqrt(east) * (1.0 + _ROUNDING):
        return "a covariance that is none"
    return ""


def _numbers(report: TargetReport) -> tuple[float, ...]:
    numbers = (
        *report.position_ne_m,
        *(() if report.range_m is None else (report.range_m, report.range_age_s)),
        report.determinant_m2_s,
        report.barrier,
        report.inverse_condition,
        *report.nominal,
        *report.command,
        *(report.true_ne_m or ()),
        *(() if report.delay_s is None else (report.delay_s,)),
    )
    estimates = (
        number
        for one in report.hypotheses
        for number in (*one.position_ne_m, *one.velocity_ne_m_s, *one.covariance_m2, one.weight)
    )
    return (*numbers, *estimates)
