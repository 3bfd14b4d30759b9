"""What follows from a fix: it is sent to its robot, and held against what that says."""

import asyncio
from collections.abc import Callable
from datetime import datetime, timedelta
from functools import partial
from typing import Final

from robot_link.camera.config import CameraConfig
from robot_link.camera.fix import CameraFix
from robot_link.messages import RobotId, StateReport
from robot_link.report import Reading
from server.base.foundation import Foundation
from server.fix.comparison import Apart, Disagreement, compared
from server.fix.event import FixFound
from server.fix.fusion import Fusion
from server.fix.gathering import Pace
from server.fix.records import FixRecords
from server.fleet.fleet import Fleet
from server.fleet.status import SentFix
from server.link.event import StateReported
from server.link.radios import Radios

OFF_CAMERAS: Final = "off_cameras"
"""Channel of the distance between a robot's own estimate and a fix."""
_ERROR_PERIOD: Final = timedelta(seconds=1)
CAUSE: Final = "fix:disagreement"
UNSEEN: Final = timedelta(seconds=10)
"""After so long without a fix nobody knows any more whether robot and cameras disagree."""
_PERIOD_S: Final = 1.0


class FixFollowing:
    """Sends fixes, and watches that robots agree with them. Belongs to one event loop."""

    def __init__(
        self,
        foundation: Foundation,
        fleet: Fleet,
        fusion: Fusion,
        records: FixRecords,
        radios: Radios,
        config: Callable[[], CameraConfig],
    ) -> None:
        self._alarms, self._background = foundation.alarms, foundation.background
        self._clock, self._config = foundation.clock, config
        self._fleet, self._fusion, self._records, self._radios = fleet, fusion, records, radios
        self._newest: dict[RobotId, CameraFix] = {}
        self._disagreements: dict[RobotId, Disagreement] = {}
        self._paces: dict[RobotId, Pace] = {}
        self._sendings: dict[RobotId, Pace] = {}

    def take_fix(self, event: FixFound) -> None:
        """Send a fix that was taken, and compare it with what the robot said."""
        fix = event.fix
        if fix.quality == "refused":
            return
        self._newest[fix.robot] = fix
        if self._is_due(fix):
            unsent = self._radios.send_fix(fix, partial(self._sent, fix))
            sight = self._fusion.sight(fix.robot)
            if sight is not None:
                sight.unsent = unsent
        state = self._fleet.status(fix.robot).state
        if state is not None:
            self._compare(state, fix)

    def take_state(self, event: StateReported) -> None:
        """Compare what a robot says with the newest fix."""
        fix = self._newest.get(event.report.robot)
        if fix is not None:
            self._compare(event.report, fix)

    async def run(self) -> None:
        """End disagreements of robots that are not seen any more, until cancelled.

        What stood when the station last ran is told again where it still is so.
        """
        for alarm in self._alarms.open:
            if alarm.cause == CAUSE:
                await self._alarms.clear(CAUSE, robot=alarm.robot)
        while True:
            await asyncio.sleep(_PERIOD_S)
            told = [robot for robot, watch in self._disagreements.items() if watch.is_told]
            for robot in told:
                if not self._is_seen(robot):
                    del self._disagreements[robot]
                    await self._end(robot)

    def _is_due(self, fix: CameraFix) -> bool:
        """Tell whether a fix is one of so many a second that are sent."""
        period = timedelta(seconds=self._clock.speed / self._config().fix_rate_hz)
        pace = self._sendings.setdefault(fix.robot, Pace(period))
        pace.period = period
        return pace.lets(fix.measured_at)

    def _is_seen(self, robot: RobotId) -> bool:
        if self._fusion.sight(robot) is None or self._fusion.uri(robot) is None:
            return False
        return self._clock.now() - self._newest[robot].measured_at <= UNSEEN

    def _sent(self, fix: CameraFix, at: datetime) -> None:
        self._records.note_sent(fix, at)
        self._fleet.note_fix_sent(fix.robot, SentFix(len(fix.cameras), fix.measured_at))

    def _compare(self, state: StateReport, fix: CameraFix) -> None:
        said_at = self._fleet.status(fix.robot).at_station(state.measured_at)
        apart = compared(state, said_at, fix)
        if apart is None:
            return
        if self._paces.setdefault(fix.robot, Pace(_ERROR_PERIOD)).lets(apart.at):
            self._records.take_error(
                Reading(fix.robot, OFF_CAMERAS, apart.distance_m, apart.at, self._clock.now())
            )
        watch = self._disagreements.setdefault(fix.robot, Disagreement())
        raises = watch.take(apart, has_fix=state.has_fix)
        if raises is not None:
            told = self._tell(fix.robot, apart) if raises else self._end(fix.robot)
            self._background.start(f"disagreement of {fix.robot} and cameras", told)

    async def _tell(self, robot: RobotId, apart: Apart) -> None:
        text = (
            f"{robot} says that it has a fix, and is {apart.distance_m:.1f} m from where cameras"
            " see it."
        )
        action = "Check its tags: are plates swapped or registered otherwise? Then the cameras."
        await self._alarms.raise_(CAUSE, text, robot=robot, action=action)

    async def _end(self, robot: RobotId) -> None:
        await self._alarms.clear(CAUSE, robot=robot)
