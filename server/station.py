"""The services of one station, put together."""

import asyncio
import logging
from collections.abc import Callable, Coroutine, Sequence
from typing import Any

from sqlalchemy.orm import Session

from autonomy.planner.config import PlannerConfig
from autonomy.warm_up import search_step
from db.fault import StoreError
from db.query.events import EventRecord
from db.query.robots import RobotRecord, get_robot, list_robots
from db.query.samples import newest_samples
from db.query.target_reports import newest_target_report
from db.query.telemetry import Track as StoredTrack
from db.query.telemetry import newest_plan_report, newest_state
from db.query.telemetry import track as stored_track
from robot_link.messages import (
    LinkEvent,
    PlanReport,
    RobotId,
    Sample,
    StateReport,
    TargetReport,
)
from robot_link.station.gateway.address import is_acoustic
from robot_link.station.gateway.gateway import MobileOriginated
from robot_link.transport.opening import is_radio
from server.access.foundation import Foundation
from server.alarm.rules import watch_fleet
from server.base.job_watch import watch_jobs
from server.base.live_feed import LiveFeed
from server.base.machine_code import MachineCode
from server.base.problem import not_found
from server.base.worker import WORKER_FAILURES, WorkerPool
from server.command.commands import Commands
from server.fleet.disabled_links import DisabledLinks
from server.fleet.fleet import Fleet
from server.fleet.status import remembered_link
from server.link.ingest import Ingest, Listeners
from server.link.parameters import Parameters
from server.link.radios import LinkFactory, Radios, open_link
from server.link.ranging import Ranging
from server.link.robot_logs import RobotLogs
from server.link.signing import RobotSigning
from server.map.comparison import MapComparisons
from server.map.field_maps import FieldMaps
from server.map.group import MapSettings
from server.map.learning import MapLearning
from server.plan.dry_run import DryRuns
from server.plan.follow import PlanFollower
from server.plan.ledger import PlanLedger, PlanOutdated
from server.plan.planning import Planning
from server.plan.round_problem import field_config_of
from server.plan.task import LOAD_PLANNER
from server.satellite.gateways import Gateways, KeepMessage
from server.satellite.satellite import Satellite
from server.scene.host import SceneHost
from server.scene.source import StationSceneSource
from server.study.identification import Identifications
from server.study.trim import TrimAdvices
from server.study.whatif import WhatIfs
from server.survey.fleet_survey import FleetSurveys
from server.survey.map_quality import SurveyMaps
from server.survey.mission_ledger import MissionLedger
from server.survey.plan_choice import PlanChoices
from server.survey.step import SurveySteps
from server.survey.surveys import Surveys, purge_in
from server.target.follow import TargetFollower
from server.target.planning import TargetPlanning
from server.transfer.machine import TransferServices
from server.transfer.transfers import Transfers
from server.vehicle.vehicles import Vehicles
from webui.scene.source import SceneSource

log = logging.getLogger(__name__)

_TRACK_POINTS = 5000
STUDY_NICENESS = 10
"""What-if runs and identifications give way to the planner and to the station itself."""


GatewayFactory = Callable[[Foundation, KeepMessage], Gateways]


class Station:
    """Everything that the station does for its robots; started once, stopped once.

    Belongs to one event loop. ``make_link`` and ``make_gateways`` are where tests put their own.
    """

    def __init__(
        self,
        foundation: Foundation,
        make_link: LinkFactory = open_link,
        make_gateways: GatewayFactory = Gateways,
    ) -> None:
        self._foundation = foundation
        self._tasks: list[asyncio.Task[Any]] = []
        store, clock = foundation.store, foundation.clock
        self.feed = LiveFeed(store, clock, lambda: foundation.alarms.unacknowledged)
        self.workers = WorkerPool(foundation.settings.worker_processes)
        self.study_workers = WorkerPool(
            foundation.settings.worker_processes, niceness=STUDY_NICENESS
        )
        self.vehicles = Vehicles(store, clock, self.workers)
        self.fleet = Fleet(clock, self._robot_changed, foundation.alarms.worst_level, self.vehicles)
        self.maps = FieldMaps(store, clock)
        self._opening_maps = asyncio.Lock()
        """Whoever waits reads the settings after who went before, so the newest are shown."""
        signing = RobotSigning(foundation.secrets, clock)
        self.radios = Radios(clock, self._take_event, make_link, signing)
        self.parameters = Parameters(foundation, self.fleet, self.radios)
        self.robot_logs = RobotLogs(foundation, self.fleet, self.radios)
        self.plans = PlanLedger(foundation, self.fleet, self.feed)
        self.machine_code = MachineCode(foundation.jobs)
        self.planning = Planning(
            foundation, self.fleet, self.plans, self.workers, self.machine_code
        )
        self.tracks = TargetPlanning(foundation, self.fleet, self.plans, self.planning.settings)
        self.disabled_links = DisabledLinks(store, clock)
        self.gateways = make_gateways(foundation, self._take_message)
        self.ranging = Ranging(foundation, self._take_event)
        self.satellite = Satellite(
            foundation, self.fleet, self.gateways, self.disabled_links, self._store_values
        )
        self.commands = Commands(foundation, self.fleet, self.radios, self.satellite)
        self.transfers = Transfers(
            TransferServices(
                foundation, self.fleet, self.plans, self.commands, self.radios, self.satellite
            )
        )
        self.missions = MissionLedger(store, clock, foundation.alarms, self.fleet, self.feed)
        self.choices = PlanChoices(foundation, self.fleet, self.plans, self.missions, self.planning)
        self.surveys = self._surveys()
        self.fleet_surveys = FleetSurveys(self.fleet, self.surveys)
        self.comparisons = MapComparisons(foundation, self.fleet, self.maps, self.study_workers)
        self.learning = MapLearning(foundation, self.fleet, self.maps, self.study_workers)
        self.whatifs = WhatIfs(
            foundation, self.fleet, self.vehicles, self.workers, self.study_workers
        )
        self.identifications = Identifications(
            foundation, self.fleet, self.vehicles, self.study_workers
        )
        self.trim = TrimAdvices(foundation, self.fleet, self.vehicles, self.study_workers)
        self._follower = PlanFollower(store, self.plans)
        self._target_follower = TargetFollower(store, self._settle)
        self.ingest = Ingest(store, self.fleet, clock, self._listeners())
        self.scenes = SceneHost(self._scene_source)
        self._connect()

    async def start(self) -> None:
        """Take up the fleet as the database knows it, and go on with what was under way."""
        await self.vehicles.load()
        await self.disabled_links.load()
        for robot in await self._foundation.store.query(list_robots):
            await self._take_up(robot)
        await self.satellite.load()
        await self.plans.load()
        await self.missions.load()
        await self.whatifs.load()
        await self.identifications.load()
        self._run("live stream", self.feed.run())
        self._run("waiting plans", self.plans.watch_drafts())
        self._run("command reports", self.commands.run())
        self._run("plan reports", self._follower.run())
        self._run("reports on targets", self._target_follower.run())
        self._run("field maps", self.maps.run())
        self._run("alarm rules", self._watch())
        self._run("job progress", watch_jobs(self._foundation.jobs, self.feed))
        self._run("scenes", self.scenes.run())
        await self.planning.resume()
        robots = [status.record for status in self.fleet.statuses]
        self.radios.set_robots(robots)
        for uri in self.disabled_links.disabled:
            self.radios.set_enabled(uri, is_enabled=False)
            self.ranging.set_enabled(uri, is_enabled=False)
        await self.ranging.set_robots(robots)
        self._run("radio", self.radios.run())
        self._run("satellite", self.satellite.run())
        await self.gateways.start()
        await self.commands.resume()
        await self.transfers.resume()
        self._run("transfers", self.transfers.run())
        await self.surveys.resume()
        self._run("surveys", self.surveys.run())
        self._run("planner's machine code", self._warm_up())
        for status in list(self.fleet.statuses):
            self._run(f"maps of {status.record.id}", self._open_maps(status.record))

    async def stop(self) -> None:
        """Stop in the reverse order; everything under way goes on at the next start."""
        self.feed.close()
        self.workers.hurry()
        self.study_workers.hurry()
        await self.whatifs.stop()
        await self.identifications.stop()
        await self.surveys.stop_all()
        await self.transfers.stop()
        await self.gateways.stop()
        await self.ranging.stop()
        await self.planning.stop()
        await self.vehicles.stop()
        for task in reversed(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self.ingest.flush()
        await self.scenes.stop()
        await self.workers.stop()
        await self.study_workers.stop()

    async def refresh(self, robot: str) -> None:
        """Take up a robot that was added or changed, its settings and its maps."""
        record = await self._foundation.store.query(lambda session: get_robot(session, robot))
        await self._take_up(record)
        await self._open_maps(record)
        robots = [status.record for status in self.fleet.statuses]
        await self.ranging.set_robots(robots)
        if self.radios.set_robots(robots):
            await self.commands.resume()

    async def set_enabled(self, robot: str, uri: str, *, is_enabled: bool, by: str) -> None:
        """Enable or disable a link for every robot that shares it.

        Raises:
            Problem: 404 if the robot has no such link.
            StoreUnavailableError: Nothing was changed.
        """
        if uri not in self.fleet.status(robot).record.links:
            raise not_found(f"{robot} has no link {uri!r}.")
        await self.disabled_links.set(uri, is_enabled=is_enabled, robot=robot, by=by)
        for status in self.fleet.statuses:
            status.disabled_links = self.disabled_links.disabled
            self.fleet.touch(status.record.id)
        if is_radio(uri):
            self.radios.set_enabled(uri, is_enabled=is_enabled)
        if is_acoustic(uri):
            self.ranging.set_enabled(uri, is_enabled=is_enabled)
        await self.satellite.refresh()
        self.satellite.stir()

    def _surveys(self) -> Surveys:
        foundation, fleet, missions = self._foundation, self.fleet, self.missions
        problems = self.planning.problems
        quality = SurveyMaps(foundation, fleet, missions, problems, self.maps, self.workers)
        steps = SurveySteps(
            foundation, fleet, missions, self.plans, self.planning, self.transfers, quality
        )
        return Surveys(foundation, missions, self.planning, self.transfers, steps)

    async def _settle(self) -> None:
        """Wait until what was taken in before is committed."""
        await self.ingest.settle()

    def _listeners(self) -> Listeners:
        """Return who is told what robots say."""
        return Listeners(
            acknowledge=self.radios.acknowledge_samples,
            samples=self.maps.feed,
            plan=self._take_plan_report,
            upload=self.transfers.take_upload,
            command=self.commands.take,
            track=self._target_follower.take,
        )

    def _connect(self) -> None:
        """Let the services follow each other."""
        self._foundation.bus.subscribe(
            PlanOutdated, lambda event: self.missions.robot_said_more(event.robot)
        )
        self.commands.purges.append(purge_in)
        self.commands.on_surface.append(self._show_missions)
        self.feed.listeners.append(self._event_happened)

    def _run(self, name: str, work: Coroutine[Any, Any, None]) -> None:
        self._tasks.append(self._foundation.background.start(name, work))

    async def _watch(self) -> None:
        await watch_fleet(self.fleet, self._foundation.alarms, self._foundation.clock)

    async def _warm_up(self) -> None:
        """Compile what is not, and let a worker load the planner, so that nobody waits later."""
        await self.machine_code.prepare()
        await self.machine_code.wait_for(search_step("information_gain"), lambda _: None)
        try:
            await self.workers.run(LOAD_PLANNER, None)
            await DryRuns(self.fleet, self.workers).warm_up()
        except WORKER_FAILURES as error:
            log.warning("the planner could not be loaded ahead: %s", error)

    async def _take_up(self, robot: RobotRecord) -> None:
        status = self.fleet.add(robot, (await self._planner(robot.id)).fidelity_thresholds_m)
        status.disabled_links = self.disabled_links.disabled
        if status.state is not None:
            return
        memory = await self._foundation.store.query(lambda session: _memory(session, robot.id))
        status.state, status.plan_report, samples, track, status.target_report = memory
        if status.target_report is not None:
            self._target_follower.take(status.target_report)
        status.samples = {sample.variable: sample for sample in samples}
        if status.state is not None:
            status.remembered = remembered_link(
                status.state, radio_under_water=robot.site.radio_under_water
            )
        status.track.replace(
            (point.position_ned, point.position_std_m, point.mode) for point in track.points
        )

    async def _open_maps(self, robot: RobotRecord) -> None:
        if robot.kind == "recorded":
            await self.maps.show_saved(robot.id)
            return
        async with self._opening_maps:
            planner = await self._planner(robot.id)
            found = await self._foundation.configurations.current("field", robot.id)
            settings = MapSettings(
                config=field_config_of(found, planner),
                domain=planner.domain,
                version=found.id or "preset",
            )
            await self.maps.open(robot, settings)

    async def _planner(self, robot: str) -> PlannerConfig:
        found = await self._foundation.configurations.current("planner", robot)
        return found.value_as(PlannerConfig)

    async def _take_message(self, message: MobileOriginated) -> bool:
        return await self.satellite.take(message)

    async def _store_values(self, values: Sequence[LinkEvent]) -> None:
        await self.ingest.store(values)

    def _take_event(self, event: LinkEvent) -> None:
        self.ingest.take(event)

    def _take_plan_report(self, report: PlanReport) -> None:
        self._follower.take(report)
        self.missions.robot_said_more(report.robot)
        self.surveys.robot_said_more(report.robot)

    def _robot_changed(self, robot: str) -> None:
        state = self.fleet.status(robot).state
        if state is not None and state.has_fix:
            self.maps.take_fix(robot, state.measured_at)
        self.transfers.robot_changed(robot)
        self.feed.put("robots", robot, lambda: self.fleet.live_view(robot), robot)

    def _event_happened(self, event: EventRecord) -> None:
        """Follow changes that others made: of settings, or of the fleet by the command line."""
        if event.kind in {
            "deployment.imported",
            "deployment.mapped",
            "robot.added",
            "robot.changed",
        }:
            robots = [event.robot] if event.robot is not None else []
        elif event.kind == "config.changed" and event.data.get("kind") in {"planner", "field"}:
            everyone = [status.record.id for status in self.fleet.statuses]
            robots = everyone if event.robot is None else [event.robot]
        else:
            return
        for robot in robots:
            self._foundation.background.start(f"refresh {robot}", self._follow_change(robot))

    async def _follow_change(self, robot: str) -> None:
        try:
            await self.refresh(robot)
        except StoreError as error:
            log.warning("%s was not taken up anew: %s", robot, error)

    async def _show_missions(self, robot: str) -> None:
        mission = self.fleet.status(robot).mission_id
        if mission is not None:
            await self.missions.show(mission)

    def _scene_source(self, robot: RobotId) -> SceneSource | None:
        if not self.fleet.knows(robot):
            return None
        return StationSceneSource(robot, self.fleet, self.maps, self.vehicles, self.whatifs.shown)


def _memory(
    session: Session, robot: str
) -> tuple[
    StateReport | None, PlanReport | None, Sequence[Sample], StoredTrack, TargetReport | None
]:
    return (
        newest_state(session, robot),
        newest_plan_report(session, robot),
        newest_samples(session, robot),
        stored_track(session, robot, max_points=_TRACK_POINTS),
        newest_target_report(session, robot),
    )
