"""How a mission that followed a target ended, by what its robot said of the plan."""

from datetime import datetime

from sqlalchemy import select
from sqlalchemy.orm import Session

from autonomy.tracking.phase import TargetPhase
from db.query.fleet.robots import robot_key
from db.tables import PlanReportRow
from db.target_tables import TargetReportRow
from robot_link.messages import OnboardPlanState

_RUNNING = int(OnboardPlanState.RUNNING)
_OVER = (int(OnboardPlanState.DONE), int(OnboardPlanState.FAILED))


def mission_end(session: Session, robot: str, moment: datetime) -> tuple[OnboardPlanState, str]:
    """Return how the mission ended of which a robot said at a moment that it is over.

    It may say so of its target before it says so of its plan, while it still comes up.

    Returns:
        DONE, or FAILED with the robot's reason; RUNNING while it has not said it of its plan.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    key, at, state = robot_key(session, robot), PlanReportRow.measured_at, PlanReportRow.state
    mine = PlanReportRow.robot_key == key
    word = select(PlanReportRow).where(mine, at <= moment, state.in_((_RUNNING, *_OVER)))
    last = session.scalar(word.order_by(at.desc()).limit(1))
    if last is not None and last.state != _RUNNING and not _goes_on(session, key, last, moment):
        return OnboardPlanState(last.state), last.reason
    over = select(PlanReportRow).where(mine, at > moment, state.in_((_RUNNING, *_OVER)))
    if last is not None and last.state == _RUNNING:
        over = over.where(PlanReportRow.sha256 == last.sha256, state.in_(_OVER))
    end = session.scalar(over.order_by(at).limit(1))
    if end is None or end.state == _RUNNING:
        return OnboardPlanState.RUNNING, ""
    return OnboardPlanState(end.state), end.reason


def _goes_on(session: Session, key: int, end: PlanReportRow, moment: datetime) -> bool:
    """Tell whether a target was followed again between the end of a plan and a moment."""
    at = TargetReportRow.measured_at
    again = select(at).where(
        TargetReportRow.robot_key == key,
        TargetReportRow.phase != int(TargetPhase.ENDED),
        at > end.measured_at,
        at <= moment,
    )
    return session.scalar(again.limit(1)) is not None
