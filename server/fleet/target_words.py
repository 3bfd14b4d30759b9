"""What the station says of a robot that follows a target, in words."""

import math
from collections.abc import Generator, Iterable

from sqlalchemy.orm import Session

from autonomy.estimation.position import STD_95
from autonomy.tracking.phase import TargetPhase
from db.query.mission.target_end import mission_end
from robot_link.messages import OnboardPlanState, PlanReport
from robot_link.report import TargetEstimate, TargetReport

_TEACHING = "Nothing keeps the target observable: the mission is for teaching."
_SMALL = 0.005
"""A mirrored estimate less probable than this is not worth a word."""
_LONG_M, _LONG_S = 10.0, 10.0
"""Beyond these a sentence needs no decimals."""
_LATE_S = 0.5
"""A delay of ranges shorter than this is not worth a word."""
TOO_FAST = "The target seems too fast to follow and will be lost."
_TIME_IS_OVER = "its time is over"
_QUIET = "it was told not to ping"


def target_text(report: TargetReport, reason: str = "") -> str:
    """Say in one sentence what a report on a target means; in others what must be known beside.

    Args:
        report: What the robot says.
        reason: Why the mission ended, "" while it goes on or where nobody knows.
    """
    text = _phase_text(report, reason)
    if report.is_too_fast and report.phase is not TargetPhase.ENDED:
        text = f"{text} {TOO_FAST}"
    if (report.delay_s or 0.0) >= _LATE_S and report.phase is TargetPhase.TRACKING:
        text = f"{text} Its ranges seem {report.delay_s:.1f} s older than they are told."
    if report.is_barrier_on or report.phase is TargetPhase.ENDED:
        return text
    return f"{text} {_TEACHING}"


def _phase_text(report: TargetReport, reason: str) -> str:
    robot = report.robot
    match report.phase:
        case TargetPhase.WAITING:
            why = f"; {_QUIET}" if report.is_quiet else ""
            return f"{robot} has heard no range of its target yet{why}."
        case TargetPhase.TRACKING:
            return f"{robot} follows its target, {_distance(report)}{_known(report)}."
        case TargetPhase.COASTING:
            # a range that was heard may not have been believed
            return (
                f"{robot} goes on by dead reckoning{_reason(report)}; the newest range is "
                f"{_seconds(report.range_age_s)} old{_known(report)}."
            )
        case TargetPhase.LOST:
            return f"{robot} lost its target{_lost_reason(report)}; {search_text(report)}."
        case TargetPhase.ENDED:
            why = f": {reason}" if reason else ""
            return f"{robot} follows its target no longer{why}."


def search_text(report: TargetReport) -> str:
    """Say what a robot that lost its target does about it."""
    return "it circles to find it" if report.is_barrier_on else "it does not search for it"


def _distance(report: TargetReport) -> str:
    if not report.hypotheses:
        return "where it is not known"
    away_m = math.dist(report.hypotheses[0].position_ne_m, report.position_ne_m)
    return f"{_metres(away_m)} away"


def _known(report: TargetReport) -> str:
    if not report.hypotheses:
        return ""
    known = f", known within {_metres(within_95_m(report.hypotheses[0]))}"
    mirrored = 1.0 - report.hypotheses[0].weight  # the other does not arrive by satellite
    return known if mirrored < _SMALL else f"{known} if it is not mirrored ({mirrored:.0%})"


def _metres(length_m: float) -> str:
    return f"{length_m:.2f} m" if length_m < _LONG_M else f"{length_m:.0f} m"


def _reason(report: TargetReport) -> str:
    return f" ({_QUIET})" if report.is_quiet else ""


def _lost_reason(report: TargetReport) -> str:
    if report.is_quiet:
        return f", for {_QUIET}"
    if report.range_m is None:
        return ""
    return f"; the newest range is {_seconds(report.range_age_s)} old"


def _seconds(age_s: float) -> str:
    return f"{age_s:.1f} s" if age_s < _LONG_S else f"{age_s:.0f} s"


def within_95_m(estimate: TargetEstimate) -> float:
    """Return the larger semi-axis of an estimate's 95 % ellipse, m."""
    nn, ne, ee = estimate.covariance_m2
    largest = 0.5 * (nn + ee) + math.hypot(0.5 * (nn - ee), ne)
    return STD_95 * math.sqrt(max(largest, 0.0))


def with_reasons(
    session: Session, reports: Iterable[TargetReport]
) -> Generator[tuple[TargetReport, str]]:
    """Yield reports of one robot, in order of time, each with why the mission ended.

    That is "" as long as the mission has not ended, or nobody knows why. Reports in a row that say
    that it is over are of one mission, so the first tells for all.
    """
    reason: str | None = None
    for report in reports:
        if report.phase is not TargetPhase.ENDED:
            reason = None
        elif reason is None:
            reason = _end_text(*mission_end(session, report.robot, report.measured_at))
        yield report, reason or ""


def reason_by(report: TargetReport, plan: PlanReport | None) -> str:
    """Return why the mission of a robot's newest report ended, by what it says of its plan."""
    if plan is None or report.phase is not TargetPhase.ENDED:
        return ""
    return _end_text(plan.state, plan.reason)


def _end_text(state: OnboardPlanState, reason: str) -> str:
    if state is OnboardPlanState.DONE:
        return _TIME_IS_OVER
    return reason if state is OnboardPlanState.FAILED else ""
