"""What was kept of robots that followed targets."""

from datetime import datetime

from sqlalchemy.orm import Session

from db.query.mission.plans import get_plan, newest_begun
from db.query.mission.target_reports import target_reports
from db.query.mission.target_span import EVERYTHING, TargetSpan, range_of_plan
from db.store import Store
from server.base.problem import not_found
from server.fleet.status import FOLLOW_TARGET
from server.fleet.target_view import TargetReportsView, TargetReportView, target_view
from server.fleet.target_words import with_reasons


class TargetHistory:
    """Reads reports on targets; may be used from any event loop."""

    def __init__(self, store: Store) -> None:
        self._store = store

    async def reports(
        self, robot: str, plan: str | None, after: datetime | None, limit: int
    ) -> TargetReportsView:
        """Return reports of a robot in order of time.

        Args:
            robot: Id of the robot.
            plan: Only those of this plan.
            after: The first that follow this moment; ``None`` for the newest.
            limit: Most reports that are returned.

        Raises:
            Problem: 404 if the plan is none of this robot that follows a target.
            UnknownIdError: If there is no such robot or plan.
        """

        def read(session: Session) -> tuple[str | None, list[TargetReportView]]:
            named = newest_begun(session, robot, FOLLOW_TARGET) if plan is None else plan
            wanted = _range(session, robot, plan)
            if wanted is None:
                return named, []
            begin = max((one for one in (wanted.after, after) if one is not None), default=None)
            within = TargetSpan(begin, wanted.until)
            found = target_reports(session, robot, within, limit, newest=after is None)
            return named, [target_view(*told) for told in with_reasons(session, found)]

        named, reports = await self._store.query(read)
        return TargetReportsView(robot, named, reports)

    async def range_of(self, robot: str, plan: str | None) -> TargetSpan | None:
        """Return the time of a plan, of everything for no plan, ``None`` if it never began.

        Raises:
            Problem: 404 if the plan is none of this robot that follows a target.
            UnknownIdError: If there is no such robot or plan.
        """
        return await self._store.query(lambda session: _range(session, robot, plan))


def _range(session: Session, robot: str, plan: str | None) -> TargetSpan | None:
    if plan is None:
        return EVERYTHING
    record = get_plan(session, plan)
    if record.robot != robot or record.kind != FOLLOW_TARGET:
        raise not_found(f"{plan} is no plan of {robot} that follows a target.")
    return None if record.sha256 is None else range_of_plan(session, robot, record.sha256)
