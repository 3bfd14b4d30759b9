"""Takes up robots as the database knows them: at the start, and when somebody changed one."""

import logging

from sqlalchemy.orm import Session

from autonomy.planner.config import PlannerConfig
from db.fault import StoreError
from db.query.actuator_reports import newest_actuator_report
from db.query.current_reports import newest_current_report
from db.query.robots import RobotRecord, get_robot, list_robots
from db.query.samples import newest_samples
from db.query.target_reports import newest_target_report
from db.query.telemetry import newest_plan_report, newest_state
from db.query.telemetry import track as stored_track
from server.base.event_bus import EventLogged, SettingsChanged
from server.base.foundation import Foundation
from server.fleet.event import RobotChanged
from server.fleet.fleet import Fleet, Memory

log = logging.getLogger(__name__)

_TRACK_POINTS = 5000
_OF_A_ROBOT = ("deployment.imported", "deployment.mapped", "robot.added", "robot.changed")
"""Events after which the database says something else of a robot."""
_SETTINGS = ("planner", "field")


class Roster:
    """Keeps the fleet as the database has it. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._foundation = foundation
        self._fleet = fleet

    async def load(self) -> None:
        """Take up every robot, with what it said last."""
        for robot in await self._foundation.store.query(list_robots):
            await self._take_up(robot)

    async def refresh(self, robot: str) -> None:
        """Take up a robot that was added or changed, or whose settings were.

        Raises:
            UnknownIdError: If there is no such robot.
            StoreError: Everything stays as it was.
        """
        record = await self._foundation.store.query(lambda session: get_robot(session, robot))
        await self._take_up(record)
        self._foundation.bus.publish(RobotChanged(record))

    def event_logged(self, logged: EventLogged) -> None:
        """Follow what others did to the fleet, such as the command line."""
        event = logged.event
        if event.kind in _OF_A_ROBOT and event.robot is not None:
            self._follow(event.robot)

    def settings_changed(self, changed: SettingsChanged) -> None:
        """Follow the settings that a robot's track and maps are made with."""
        if changed.kind in _SETTINGS:
            everyone = [status.record.id for status in self._fleet.statuses]
            for robot in everyone if changed.robot is None else [changed.robot]:
                self._follow(robot)

    def _follow(self, robot: str) -> None:
        self._foundation.background.start(f"refresh {robot}", self._follow_change(robot))

    async def _follow_change(self, robot: str) -> None:
        try:
            await self.refresh(robot)
        except StoreError as error:
            log.warning("%s was not taken up anew: %s", robot, error)

    async def _take_up(self, robot: RobotRecord) -> None:
        found = await self._foundation.configurations.current("planner", robot.id)
        status = self._fleet.add(robot, found.value_as(PlannerConfig).fidelity_thresholds_m)
        if status.state is None:
            memory = await self._foundation.store.query(lambda session: _memory(session, robot.id))
            self._fleet.remember(robot.id, memory)


def _memory(session: Session, robot: str) -> Memory:
    return Memory(
        state=newest_state(session, robot),
        plan_report=newest_plan_report(session, robot),
        samples=newest_samples(session, robot),
        track=stored_track(session, robot, max_points=_TRACK_POINTS).points,
        target_report=newest_target_report(session, robot),
        current_report=newest_current_report(session, robot),
        actuator_report=newest_actuator_report(session, robot),
    )
