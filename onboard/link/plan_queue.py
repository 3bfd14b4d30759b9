"""The plan that waits behind the one on board, and what the robot says of it by radio."""

import logging
from dataclasses import replace

from onboard.link.plan_store import PlanStore, WaitingPlan
from robot_link.clock import Clock
from robot_link.mavlink import telemetry
from robot_link.mavlink.wire import grace
from robot_link.messages import PlanHash, PlanQueue, RobotId
from robot_link.mission import Mission

_AT_ONCE = 10
"""Plan reports after a change with each of which the queue is said."""
_EVERY = 5
"""Then it is said with each fifth, while there is anything to say."""

_log = logging.getLogger(__name__)


class PlanQueueDesk:
    """Keeps the waiting plan, and what became of the plan before the one on board.

    A robot in which no plan ever waited says nothing of it, so that a station that does not know
    of waiting plans hears nothing new.
    """

    def __init__(self, plans: PlanStore, clock: Clock) -> None:
        self._plans = plans
        self._clock = clock
        self.waiting: WaitingPlan | None = plans.load_next()
        """The plan that waits."""
        self._last: tuple[PlanHash, bool] | None = None
        self._changed_at = clock.now()
        self._reports = 0

    @property
    def next_hash(self) -> PlanHash | None:
        """Hash of the plan that waits."""
        return None if self.waiting is None else self.waiting.mission.sha256()

    def keep(self, mission: Mission, *, starts: bool) -> None:
        """Let a mission wait in place of any that does.

        Raises:
            OSError: If it cannot be kept; what waited before still does.
        """
        waiting = WaitingPlan(mission, starts=starts)
        if waiting != self.waiting:
            self._plans.replace_next(waiting)
            self._set(waiting)

    def drop(self) -> None:
        """Let no plan wait any more.

        A disk that refuses must not keep a robot from obeying: it holds until that is switched
        off, and no plan begins by itself after that.
        """
        if self.waiting is not None:
            self._set(None)
            self._write()

    def hold_back(self) -> None:
        """Let the waiting plan wait for another START."""
        if self.waiting is not None and self.waiting.starts:
            self._set(replace(self.waiting, starts=False))
            self._write()

    def note_switch(self, last: PlanHash | None, *, is_done: bool) -> None:
        """Note that the waiting plan took the place of the one on board.

        Args:
            last: The plan that was on board.
            is_done: Whether that was flown to its end.
        """
        self._last = None if last is None else (last, is_done)
        self._note_change()

    def forget_last(self) -> None:
        """Note that a plan came on board in the ordinary way."""
        if self._last is not None:
            self._last = None
            self._note_change()

    def due(self, on_board: PlanHash | None) -> grace.MAVLink_grace_plan_queue_message | None:
        """Return what is to be said with this plan report, None for nothing.

        Args:
            on_board: Hash of the plan on board.
        """
        if not self._plans.has_queued:
            return None
        self._reports += 1
        is_empty = self.waiting is None and self._last is None
        if self._reports > _AT_ONCE and (is_empty or self._reports % _EVERY):
            return None
        return telemetry.plan_queue_message(self.said(on_board))

    def said(self, on_board: PlanHash | None) -> PlanQueue:
        """Return what is to be said; ``robot`` and ``received_at`` do not travel."""
        waiting = self.waiting
        last, is_done = self._last or (None, False)
        return PlanQueue(
            robot=RobotId(""),
            sha256=on_board,
            next_sha256=self.next_hash,
            next_starts=waiting is not None and waiting.starts,
            last_sha256=last,
            last_done=is_done,
            measured_at=self._changed_at,
            received_at=self._changed_at,
        )

    def _set(self, waiting: WaitingPlan | None) -> None:
        self.waiting = waiting
        self._note_change()

    def _write(self) -> None:
        try:
            self._plans.replace_next(self.waiting)
        except OSError as error:
            _log.error("what becomes of the waiting plan was not kept: %s", error)

    def _note_change(self) -> None:
        self._changed_at = self._clock.now()
        self._reports = 0
