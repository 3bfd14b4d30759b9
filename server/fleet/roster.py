"""Takes up robots as the database knows them: at the start, and when somebody changed one."""

import asyncio
import logging
from collections import defaultdict
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from autonomy.channel import ChannelCatalogue
from autonomy.planner.config import PlannerConfig
from db.fault import StoreError
from db.query.fleet.deployments import DeploymentRecord, deployment_in_water, newest_span
from db.query.fleet.robots import RobotRecord, get_robot, list_robots
from db.query.measured.actuator_reports import newest_actuator_report
from db.query.measured.current_reports import newest_current_report
from db.query.measured.samples import newest_readings, newest_samples
from db.query.measured.telemetry import (
    TrackPoint,
    newest_plan_queue,
    newest_plan_report,
    newest_state,
)
from db.query.measured.telemetry import track as stored_track
from db.query.mission.target_reports import newest_target_report
from server.base.event_bus import EventLogged, SettingsChanged
from server.base.foundation import Foundation
from server.fleet.event import RobotChanged
from server.fleet.fleet import Fleet, Memory
from server.water.event import WaterChanged

log = logging.getLogger(__name__)

_TRACK_POINTS = 5000
_OF_A_ROBOT = (
    "deployment.",
    "robot.added",
    "robot.changed",
    "robot.retired",
    "robot.restored",
    "robot.signing",
)
"""Beginnings of the kinds of events after which the database says something else of a robot; its
dives and contacts are none of them."""
_SETTINGS = ("planner", "field")


@dataclass(frozen=True, slots=True)
class _Undrawn:
    """The track of a robot from the begin of its deployment to where it was at the start."""

    robot: str
    since: datetime
    until: datetime


class Roster:
    """Keeps the fleet as the database has it. Belongs to one event loop."""

    def __init__(self, foundation: Foundation, fleet: Fleet) -> None:
        self._foundation = foundation
        self._fleet = fleet
        self._undrawn: list[_Undrawn] = []
        self._turns: defaultdict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        """Whoever reads a robot later takes it up later, so that the newest record stays."""

    async def load(self) -> None:
        """Take up every robot, with what it said last; ``draw_tracks`` draws where it was."""
        for robot in await self._foundation.store.query(list_robots):
            await self._take_up(robot, draws=False)

    async def draw_tracks(self) -> None:
        """Draw where each robot was before the station started, while others use the station."""
        while self._undrawn:
            one = self._undrawn[0]
            try:
                points = await self._foundation.store.query(
                    lambda session, one=one: _track(session, one.robot, one.since, one.until)
                )
            except StoreError as error:
                log.warning("the track of %s was not drawn: %s", one.robot, error)
                points = []
            if one in self._undrawn:
                self._undrawn.remove(one)
                self._fleet.draw_earlier_track(one.robot, points)

    async def refresh(self, robot: str) -> None:
        """Take up a robot that was added or changed, or whose settings were.

        Raises:
            UnknownIdError: If there is no such robot.
            StoreError: Everything stays as it was.
        """
        async with self._turns[robot]:
            record = await self._foundation.store.query(lambda session: get_robot(session, robot))
            await self._take_up(record)
        self._foundation.bus.publish(RobotChanged(record))

    def event_logged(self, logged: EventLogged) -> None:
        """Follow what others did to the fleet, such as the command line."""
        event = logged.event
        if event.kind.startswith(_OF_A_ROBOT) and event.robot is not None:
            self._follow(event.robot)

    def settings_changed(self, changed: SettingsChanged) -> None:
        """Follow the settings that a robot's track and maps are made with."""
        if changed.kind in _SETTINGS:
            everyone = [status.record.id for status in self._fleet.statuses]
            for robot in everyone if changed.robot is None else [changed.robot]:
                self._follow(robot)

    def water_changed(self, changed: WaterChanged) -> None:
        """Give robots the water that they work in as it is now."""
        for robot in changed.robots:
            self._follow(robot)

    def _follow(self, robot: str) -> None:
        self._foundation.background.start(f"refresh {robot}", self._follow_change(robot))

    async def _follow_change(self, robot: str) -> None:
        try:
            await self.refresh(robot)
        except StoreError as error:
            log.warning("%s was not taken up anew: %s", robot, error)

    async def _take_up(self, robot: RobotRecord, *, draws: bool = True) -> None:
        found = await self._foundation.configurations.current("planner", robot.id)
        status = self._fleet.add(robot, found.value_as(PlannerConfig).fidelity_thresholds_m)
        deployment, since = await self._foundation.store.query(
            lambda session: _deployment(session, robot)
        )
        is_other = self._fleet.set_deployment(robot.id, deployment, since)
        if status.state is None:
            memory = await self._foundation.store.query(
                lambda session: _memory(session, robot.id, self._foundation.channels.catalogue)
            )
            self._fleet.remember(robot.id, memory)
            if not draws and memory.state is not None:
                self._undrawn.append(_Undrawn(robot.id, since, memory.state.measured_at))
        elif not is_other:
            return
        if draws:
            self._undrawn = [one for one in self._undrawn if one.robot != robot.id]
            points = await self._foundation.store.query(
                lambda session: _track(session, robot.id, since)
            )
            self._fleet.draw_track(robot.id, points)


def _deployment(session: Session, robot: RobotRecord) -> tuple[DeploymentRecord | None, datetime]:
    """Return which deployment a robot is in, and since when it is in it or in the workshop."""
    deployment = deployment_in_water(session, robot.id)
    if deployment is not None:
        return deployment, deployment.begun_at
    span = newest_span(session, robot.id)
    return None, robot.created_at if span is None else span.ended_at or span.started_at


def _track(
    session: Session, robot: str, since: datetime, until: datetime | None = None
) -> list[TrackPoint]:
    return stored_track(session, robot, since, until, max_points=_TRACK_POINTS).points


def _memory(session: Session, robot: str, channels: ChannelCatalogue) -> Memory:
    return Memory(
        state=newest_state(session, robot),
        plan_report=newest_plan_report(session, robot),
        plan_queue=newest_plan_queue(session, robot),
        samples=[
            sample
            for sample in newest_samples(session, robot)
            if sample.variable in channels and channels[sample.variable].fault(sample.value) is None
        ],
        readings=[
            reading
            for reading in newest_readings(session, robot)
            if reading.channel in channels
            and channels[reading.channel].fault(reading.value) is None
        ],
        target_report=newest_target_report(session, robot),
        current_report=newest_current_report(session, robot),
        actuator_report=newest_actuator_report(session, robot),
    )
