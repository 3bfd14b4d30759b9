"""The fleet as it is now: what robots said last, and how old that is."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

from autonomy.tracking.phase import TargetPhase
from autonomy.vehicle.config import Vehicle
from db.query.fleet.deployments import DeploymentRecord
from db.query.fleet.robots import RobotRecord
from db.query.measured.telemetry import TrackPoint
from db.query.mission.plans import PlanRecord
from robot_link.channel_table import Announcement
from robot_link.clock import Clock
from robot_link.messages import (
    LinkReport,
    LinkState,
    OnboardPlanState,
    PlanQueue,
    PlanReport,
    Sample,
    StateReport,
)
from robot_link.report import (
    ActuatorReport,
    CurrentReport,
    Reading,
    RobotReport,
    TargetReport,
    VehicleReport,
    VehicleWord,
)
from server.base.event_bus import EventBus
from server.base.problem import not_found
from server.fleet.clock_fault import ClockFault
from server.fleet.event import FixTaken, RobotReported, TrackGrew
from server.fleet.status import (
    DeploymentSuggestion,
    PlanInHand,
    RobotStatus,
    SatelliteStatus,
    SentFix,
    SurfaceFault,
    remembered_link,
)
from server.fleet.trail import Track
from server.fleet.water import Water
from server.vehicle.vehicles import Vehicles

_POSITION_LIMIT_S = 5.0
"""Age from which a position must look old, at the clock's normal speed."""
_ENDED_LIMIT_S = 600.0
"""Age from which the last word of a mission that followed a target concerns nobody."""
_TRACK_STEPS = 500
"""Track points are at least the site's longest side divided by this apart."""


@dataclass(frozen=True, slots=True)
class Memory:
    """What the database knows of a robot."""

    state: StateReport | None
    plan_report: PlanReport | None
    samples: Sequence[Sample]
    readings: Sequence[Reading]
    target_report: TargetReport | None
    current_report: CurrentReport | None = None
    actuator_report: ActuatorReport | None = None
    plan_queue: PlanQueue | None = None


class Fleet:
    """Status of all robots: the one place where what is known of a robot changes.

    Belongs to one event loop. ``RobotReported`` says that a status changed.
    """

    def __init__(self, clock: Clock, bus: EventBus, vehicles: Vehicles) -> None:
        self._clock = clock
        self._bus = bus
        self._vehicles = vehicles
        self._statuses: dict[str, RobotStatus] = {}
        self._disabled_links: frozenset[str] = frozenset()

    def add(self, record: RobotRecord, thresholds_m: tuple[float, ...]) -> RobotStatus:
        """Take up a robot; a robot that is known already gets the new record."""
        status = self._statuses.get(record.id)
        if status is None:
            water = record.site.water
            side_m = max(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m)
            status = RobotStatus(record, Track(side_m / _TRACK_STEPS, thresholds_m))
            status.disabled_links = self._disabled_links
            self._statuses[record.id] = status
        else:
            if Water.of(status.record) != Water.of(record):
                status.current_report = None
            status.record = record
            for uri in [one for one, link in status.links.items() if link.uri]:
                if uri not in record.links:
                    del status.links[uri]
            status.track.set_thresholds(thresholds_m)
        self.touch(record.id)
        return status

    def remember(self, robot: str, memory: Memory) -> None:
        """Take what the database knew of a robot; what was heard while it was read is newer."""
        status = self._statuses[robot]
        status.plan_report = status.plan_report or memory.plan_report
        status.plan_queue = status.plan_queue or memory.plan_queue
        status.target_report = status.target_report or memory.target_report
        status.current_report = status.current_report or memory.current_report
        status.actuator_report = status.actuator_report or memory.actuator_report
        status.samples = {one.variable: one for one in memory.samples} | status.samples
        status.readings = {one.channel: one for one in memory.readings} | status.readings
        if status.state is None and memory.state is not None:
            status.state, water = memory.state, status.record.site
            under_water = water.radio_under_water
            status.remembered = remembered_link(memory.state, radio_under_water=under_water)

    def set_deployment(
        self, robot: str, deployment: DeploymentRecord | None, ashore_since: datetime
    ) -> bool:
        """Say which deployment a robot is in; tell whether that is another stretch of time.

        Args:
            robot: Which robot.
            deployment: ``None`` for one in the workshop.
            ashore_since: End of its last deployment, or when it was added.
        """
        status = self._statuses[robot]
        before = status.deployment and (status.deployment.id, status.deployment.started_at)
        now = deployment and (deployment.id, deployment.started_at)
        is_other = before != now or status.ashore_since != ashore_since
        status.deployment, status.ashore_since = deployment, ashore_since
        if is_other:
            status.suggestion = None
            self.touch(robot)
        return is_other

    def set_driver(self, robot: str, driver: str) -> None:
        """Say who drives a robot by hand; "" for nobody."""
        self._statuses[robot].driver = driver
        self.touch(robot)

    def set_suggestion(self, robot: str, suggestion: DeploymentSuggestion | None) -> None:
        """Say what a person is asked to confirm of a robot's deployment."""
        status = self._statuses[robot]
        if status.suggestion != suggestion:
            status.suggestion = suggestion
            self.touch(robot)

    def draw_track(self, robot: str, points: Iterable[TrackPoint]) -> None:
        """Draw the track of a robot anew."""
        self._statuses[robot].track.replace(
            (point.position_ned, point.position_std_m, point.mode) for point in points
        )
        self._bus.publish(TrackGrew(robot))

    def draw_earlier_track(self, robot: str, points: Iterable[TrackPoint]) -> None:
        """Draw what lies before the points that came since the station started."""
        self._statuses[robot].track.begin_with(
            (point.position_ned, point.position_std_m, point.mode) for point in points
        )
        self._bus.publish(TrackGrew(robot))

    def set_disabled_links(self, ports: frozenset[str]) -> None:
        """Say which ports the operator has disabled, of robots there are and others."""
        self._disabled_links = ports
        for robot, status in self._statuses.items():
            status.disabled_links = ports
            self.touch(robot)

    def set_satellite(self, robot: str, satellite: SatelliteStatus) -> None:
        """Say where the satellite link of a robot stands."""
        status = self._statuses[robot]
        if status.satellite != satellite:
            status.satellite = satellite
            self.touch(robot)

    def set_clock_fault(self, robot: str, fault: ClockFault | None) -> None:
        """Say what is wrong with a robot's clock."""
        status = self._statuses[robot]
        if status.clock_fault != fault:
            status.clock_fault = fault
            self.touch(robot)

    def set_surface_fault(self, robot: str, fault: SurfaceFault | None) -> None:
        """Say why the newest order to surface was not obeyed, unless the robot is up since."""
        status = self._statuses[robot]
        if fault is not None and status.is_up_since(fault.ordered_at):
            fault = None
        if status.surface_fault != fault:
            status.surface_fault = fault
            self.touch(robot)

    def set_announced(self, robot: str, announced: Announcement, faults: Mapping[int, str]) -> None:
        """Say which channels a robot announced last, and what of that contradicts the catalogue.

        Args:
            robot: Which robot.
            announced: Its table.
            faults: A sentence for each number that the catalogue has otherwise.
        """
        status = self._statuses[robot]
        status.announced, status.channel_faults = announced, dict(faults)
        self.touch(robot)

    def count_refused(self, robot: str) -> None:
        """Count a value that was not believed."""
        self._statuses[robot].refused += 1

    def set_derived(self, robot: str, values: dict[str, Sample]) -> None:
        """Say what follows of the newest measurements of a robot."""
        self._statuses[robot].derived = values
        self.touch(robot)

    def count_impossible(self, robot: str, channel: str) -> None:
        """Count a value outside of what its channel believes; it is kept and not used."""
        counts = self._statuses[robot].impossible
        counts[channel] = counts.get(channel, 0) + 1
        self.touch(robot)

    def status(self, robot: str) -> RobotStatus:
        """Return what is known of a robot, also of a retired one.

        Raises:
            Problem: 404 if there is no such robot.
        """
        status = self._statuses.get(robot)
        if status is None:
            raise not_found(f"There is no robot {robot!r}.")
        return status

    def vehicle(self, robot: str) -> Vehicle | None:
        """Return a robot's model, ``None`` for a recording of something unknown."""
        return self._vehicles.find(self.status(robot).record.model)

    def knows(self, robot: str | None) -> bool:
        """Tell whether a robot belongs to the fleet, and is not retired."""
        status = self._statuses.get(robot or "")
        return status is not None and not status.is_retired

    @property
    def statuses(self) -> Iterable[RobotStatus]:
        """Every robot that is not retired, in the order in which they were added."""
        return [status for status in self._statuses.values() if not status.is_retired]

    @property
    def retired(self) -> Iterable[RobotStatus]:
        """Every retired robot, in the order in which they were added."""
        return [status for status in self._statuses.values() if status.is_retired]

    def take_state(self, report: StateReport) -> None:
        """Take a state report; one that is older than the newest changes no gauge."""
        status = self._statuses[report.robot]
        if status.state is None or report.measured_at >= status.state.measured_at:
            status.state = report
            if status.surface_fault is not None:
                self.set_surface_fault(report.robot, status.surface_fault)
            if status.track.add(report.position_ned, report.position_std_m, report.mode):
                self._bus.publish(TrackGrew(report.robot))
            self.touch(report.robot)
            if report.has_fix and not status.record.is_foreign:
                self._bus.publish(FixTaken(report.robot, report.measured_at))

    def note_fix_sent(self, robot: str, fix: SentFix) -> None:
        """Note that a radio took a fix by cameras for a robot."""
        self._statuses[robot].fixes_sent.append(fix)
        self.touch(robot)

    def take_sample(self, sample: Sample) -> None:
        """Take a sample as the newest value of its variable, if it is."""
        newest = self._statuses[sample.robot].samples
        known = newest.get(sample.variable)
        if known is None or sample.measured_at >= known.measured_at:
            newest[sample.variable] = sample
            self.touch(sample.robot)

    def take_reading(self, reading: Reading) -> None:
        """Take a reading as the newest value of its channel, if it is."""
        newest = self._statuses[reading.robot].readings
        known = newest.get(reading.channel)
        if known is None or reading.measured_at >= known.measured_at:
            newest[reading.channel] = reading
            self.touch(reading.robot)

    def take_plan_report(self, report: PlanReport) -> None:
        """Take what a robot says of the plan on board."""
        status = self._statuses[report.robot]
        status.plan_report = report
        if report.state is OnboardPlanState.RUNNING and status.flies_no_target:
            status.target_report = None
        self.touch(report.robot)

    def take_plan_queue(self, queue: PlanQueue) -> None:
        """Take what a robot says of the plan that waits behind the one on board."""
        self._statuses[queue.robot].plan_queue = queue
        self.touch(queue.robot)

    def take_vehicle(self, report: VehicleReport) -> None:
        """Take what a vehicle of another maker says of itself."""
        self._statuses[report.robot].vehicle_report = report
        self.touch(report.robot)

    def take_word(self, word: VehicleWord) -> None:
        """Take a grave sentence of such a vehicle."""
        self._statuses[word.robot].vehicle_word = word
        self.touch(word.robot)

    def take_target(self, report: TargetReport) -> None:
        """Take a report on a target; one that is older than the newest changes nothing."""
        self._take_newest("target_report", report)

    def take_actuators(self, report: ActuatorReport) -> None:
        """Take a report on the actuators; one that is older than the newest changes nothing."""
        self._take_newest("actuator_report", report)

    def take_current(self, report: CurrentReport) -> None:
        """Take a report on the current; one that is older than the newest changes nothing."""
        self._take_newest("current_report", report)

    def _take_newest(self, name: str, report: RobotReport) -> None:
        """Keep a report in the robot's status unless that has a newer one of the kind."""
        status = self._statuses[report.robot]
        newest = getattr(status, name)
        if newest is None or report.measured_at >= newest.measured_at:
            setattr(status, name, report)
            self.touch(report.robot)

    def take_link(self, report: LinkReport) -> None:
        """Take the health of one link to a robot; the link does not know how deep it swims."""
        status = self._statuses[report.robot]
        if report.state is LinkState.STALE and status.follows_under_water:
            report = replace(report, state=LinkState.SUBMERGED)
        status.links[report.uri or report.carrier] = report
        self.touch(report.robot)

    def set_plan(self, robot: str, plan: PlanInHand | None) -> None:
        """Say which plan of a robot concerns the operator now."""
        status = self._statuses[robot]
        status.plan = plan
        if status.surface_fault is not None:
            self.set_surface_fault(robot, status.surface_fault)
        self.touch(robot)

    def set_next_plan(self, robot: str, plan: PlanRecord | None) -> None:
        """Say which plan the robot is known to keep waiting."""
        status = self._statuses[robot]
        if status.next_plan != plan:
            status.next_plan = plan
            self.touch(robot)

    def set_mission(self, robot: str, mission_id: str | None) -> None:
        """Say which mission of a robot concerns the operator now."""
        self._statuses[robot].mission_id = mission_id
        self.touch(robot)

    def touch(self, robot: str) -> None:
        """Say that something about a robot changed."""
        self._bus.publish(RobotReported(robot))

    @property
    def speed(self) -> float:
        """Seconds of the robots' clock per second of the wall."""
        return self._clock.speed

    def limit_s(self, limit_s: float) -> float:
        """Return a limit of age by the station's clock, which a demo may run faster."""
        return limit_s * max(1.0, self._clock.speed)

    def is_old(self, status: RobotStatus) -> bool:
        """Tell whether the newest state of a robot must look old."""
        return status.state is None or self.is_past(status.state.measured_at)

    def is_past(self, moment: datetime) -> bool:
        """Tell whether what was told then must look old."""
        return self.age_s(moment) > self.limit_s(_POSITION_LIMIT_S)

    def target_shown(self, status: RobotStatus) -> TargetReport | None:
        """Return a robot's newest report on its target, ``None`` once that concerns nobody."""
        report = status.target_report
        if report is None or status.flies_no_target:
            return None
        plan = status.plan_report
        has_ended = plan is not None and plan.state is not OnboardPlanState.RUNNING
        is_over = has_ended or report.phase is TargetPhase.ENDED
        if is_over and self.age_s(report.measured_at) > self.limit_s(_ENDED_LIMIT_S):
            return None
        return report

    def is_target_old(self, report: TargetReport) -> bool:
        """Tell whether a report on a target must look old."""
        is_over = report.phase is TargetPhase.ENDED
        return is_over or self.age_s(report.measured_at) > self.limit_s(_POSITION_LIMIT_S)

    def now(self) -> datetime:
        """Return the time of the station's clock."""
        return self._clock.now()

    def age_s(self, moment: datetime) -> float:
        """Return how old something is by the station's clock."""
        return max(0.0, (self._clock.now() - moment).total_seconds())
