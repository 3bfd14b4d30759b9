"""Why missions that followed a target ended, beside what robots said of that target."""

from collections.abc import Generator, Iterable

from sqlalchemy.orm import Session

from autonomy.tracking.phase import TargetPhase
from db.query.target_end import mission_end
from robot_link.messages import OnboardPlanState, PlanReport, TargetReport

_TIME_IS_OVER = "its time is over"


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
            reason = _words(*mission_end(session, report.robot, report.measured_at))
        yield report, reason or ""


def reason_by(report: TargetReport, plan: PlanReport | None) -> str:
    """Return why the mission of a robot's newest report ended, by what it says of its plan."""
    if plan is None or report.phase is not TargetPhase.ENDED:
        return ""
    return _words(plan.state, plan.reason)


def _words(state: OnboardPlanState, reason: str) -> str:
    if state is OnboardPlanState.DONE:
        return _TIME_IS_OVER
    return reason if state is OnboardPlanState.FAILED else ""
