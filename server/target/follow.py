"""Events of a target that is lost and found, from what robots say of it, each told once."""

from collections.abc import Awaitable, Callable
from datetime import datetime, timedelta
from typing import Final

from sqlalchemy.orm import Session

from autonomy.tracking.phase import TargetPhase
from db.query.mission.target_reports import has_ended_within, lost_since, newest_event_of
from db.query.station.events import add_event
from db.store import Store
from robot_link.report import TargetReport
from server.base.retry_queue import RetryQueue

LOST: Final = "track.lost"
FOUND: Final = "track.found"
ENDED: Final = "track.ended"
_SAYS: Final = {
    TargetPhase.WAITING: ENDED,
    TargetPhase.TRACKING: FOUND,
    TargetPhase.LOST: LOST,
    TargetPhase.ENDED: ENDED,
}
"""Coasting is in between: neither a loss nor the end of one. Who waits for a first range has begun
another mission, or goes on with one that was held."""


class TargetFollower:
    """Tells what becomes of targets. Belongs to one event loop.

    What was told last is asked of the database in the transaction that tells more, so a station
    that was killed in between tells it once, and a robot that repeats itself is not heard twice.

    Args:
        store: Where events go.
        settle: Waits until what robots said before is committed: whether a mission has ended
            decides what the next report means.
    """

    def __init__(self, store: Store, settle: Callable[[], Awaitable[None]]) -> None:
        self._store = store
        self._settle = settle
        self._queue = RetryQueue("reports on targets")
        self._heard: dict[str, TargetReport] = {}
        """The newest report of each robot that led to a word."""

    async def run(self) -> None:
        """Follow until cancelled."""
        await self._queue.run()

    def take(self, report: TargetReport) -> None:
        """Take a report; only news is worked on."""
        said, before = _SAYS.get(report.phase), self._heard.get(report.robot)
        if said is None or (before is not None and before.measured_at > report.measured_at):
            return
        if before is None or _SAYS[before.phase] != said:
            self._queue.add(lambda: self._follow(report))
        self._heard[report.robot] = report

    async def _follow(self, report: TargetReport) -> None:
        await self._settle()
        await self._store.write(lambda session: self._tell(session, report))

    def _tell(self, session: Session, report: TargetReport) -> None:
        robot, said = report.robot, _SAYS[report.phase]
        last = newest_event_of(session, robot, (LOST, FOUND, ENDED))
        if said == last or (said != LOST and last != LOST):
            return
        since = None if said == LOST else lost_since(session, robot, report.measured_at)
        if said == FOUND and since is not None:
            is_another = has_ended_within(session, robot, since, report.measured_at)
            said = ENDED if is_another else FOUND  # the end of the first may not have been heard
        add_event(
            session,
            report.measured_at,
            said,
            _text(report, said, since),
            level="watch" if said == LOST else "info",
            robot=robot,
            data={
                "phase": report.phase.name.lower(),
                "lost_s": None if since is None else (report.measured_at - since) / _SECOND,
            },
        )


_SECOND: Final = timedelta(seconds=1)


def _text(report: TargetReport, said: str, since: datetime | None) -> str:
    robot = report.robot
    if said == LOST:
        why = "; it was told not to ping" if report.is_quiet else ""
        return f"{robot} lost its target{why}."
    if said == ENDED and report.phase is TargetPhase.WAITING:
        return f"{robot} begins to listen for its target anew; it had not found it again."
    if said == ENDED:
        return f"{robot} ended without finding its target again."
    after = "" if since is None else f" after {(report.measured_at - since) / _SECOND:.0f} s"
    return f"{robot} found its target again{after}."
