"""What a current report can say, whichever wire brought it."""

import math

from autonomy.estimation.config import MOST_DOUBT
from robot_link.report import CurrentReport

FASTEST_M_S = 10.0
"""No water moves faster."""
_ROUNDING = 1e-2
_DIVES_MAX = 255


def checked_current(report: CurrentReport) -> CurrentReport:
    """Return a report that is possible.

    Raises:
        ValueError: If it is not; see ``current_fault``.
    """
    if fault := current_fault(report):
        raise ValueError(f"a current report has {fault}")
    return report


def current_fault(report: CurrentReport) -> str:
    """Return what is impossible about a report, "" if nothing is."""
    numbers = (*report.current_ne_m_s, report.current_std_m_s, report.doubt)
    if not all(map(math.isfinite, numbers)):
        return "a number that is not finite"
    if max(map(abs, report.current_ne_m_s)) > FASTEST_M_S:
        return f"a current of {math.hypot(*report.current_ne_m_s):.3g} m/s"
    if not 0.0 <= report.current_std_m_s <= FASTEST_M_S:
        return f"a standard deviation of {report.current_std_m_s:.3g} m/s"
    if not 1.0 - _ROUNDING <= report.doubt <= MOST_DOUBT:
        return f"a doubt of {report.doubt:.3g}"
    if not 0 <= report.dives <= _DIVES_MAX or report.fixes_refused < 0:
        return "an impossible count"
    return ""
