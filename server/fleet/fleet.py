"""The fleet as it is now: what robots said last, and how old that is."""

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from datetime import datetime

from autonomy.field.variable import VARIABLES
from autonomy.frames import wgs84_from_ned
from autonomy.planner.plan import PositionNed
from autonomy.tracking.phase import TargetPhase
from autonomy.vehicle.config import Vehicle
from db.query.robots import RobotRecord
from robot_link.clock import Clock
from robot_link.messages import (
    STATE,
    LinkReport,
    LinkState,
    OnboardPlanState,
    PlanReport,
    Sample,
    StateReport,
    TargetReport,
)
from server.base.problem import not_found
from server.fleet.link_panel import link_views
from server.fleet.status import PlanInHand, RobotStatus
from server.fleet.target_end import reason_by
from server.fleet.target_report import target_view
from server.fleet.target_view import TargetReportView
from server.fleet.trail import Track
from server.fleet.view import (
    ChannelView,
    ContactView,
    LinkView,
    LiveRobotView,
    OnboardPlanView,
    PositionView,
    RobotView,
    StateView,
)
from server.fleet.words import activity, clock_time, onboard_plan_state, surface_forecast
from server.vehicle.vehicles import Vehicles

_POSITION_LIMIT_S = 5.0
"""Age from which a position must look old, at the clock's normal speed."""
_FIELD_LIMIT_S = 120.0
"""The same for a measurement of a field."""
_SAME_PLACE_M = 0.02
_ENDED_LIMIT_S = 600.0
"""Age from which the last word of a mission that followed a target concerns nobody."""
_TRACK_STEPS = 500
"""Track points are at least the site's longest side divided by this apart."""


class Fleet:
    """Status of all robots, and the views that REST and the live stream make of them.

    Belongs to one event loop. ``on_change`` is called with a robot's id whenever its status
    changed; it must be cheap.
    """

    def __init__(
        self,
        clock: Clock,
        on_change: Callable[[str], None],
        alarm_level: Callable[[str], str | None],
        vehicles: Vehicles,
    ) -> None:
        self._clock = clock
        self._on_change = on_change
        self._alarm_level = alarm_level
        self._vehicles = vehicles
        self._statuses: dict[str, RobotStatus] = {}

    def add(self, record: RobotRecord, thresholds_m: tuple[float, ...]) -> RobotStatus:
        """Take up a robot; a robot that is known already gets the new record."""
        status = self._statuses.get(record.id)
        if status is None:
            water = record.site.water
            side_m = max(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m)
            status = RobotStatus(record, Track(side_m / _TRACK_STEPS, thresholds_m))
            self._statuses[record.id] = status
        else:
            status.record = record
            status.geodetic = None
            for uri in [one for one, link in status.links.items() if link.uri]:
                if uri not in record.links:
                    del status.links[uri]
            status.track.set_thresholds(thresholds_m)
        self.touch(record.id)
        return status

    def status(self, robot: str) -> RobotStatus:
        """Return what is known of a robot.

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
        """Tell whether a robot belongs to the fleet."""
        return robot in self._statuses

    @property
    def statuses(self) -> Iterable[RobotStatus]:
        """Every robot, in the order in which they were added."""
        return self._statuses.values()

    def take_state(self, report: StateReport) -> None:
        """Take a state report; one that is older than the newest changes no gauge."""
        status = self._statuses[report.robot]
        if status.state is None or report.measured_at >= status.state.measured_at:
            status.state = report
            status.track.add(report.position_ned, report.position_std_m, report.mode)
            self.touch(report.robot)

    def take_sample(self, sample: Sample) -> None:
        """Take a sample as the newest value of its variable, if it is."""
        newest = self._statuses[sample.robot].samples
        known = newest.get(sample.variable)
        if known is None or sample.measured_at >= known.measured_at:
            newest[sample.variable] = sample
            self.touch(sample.robot)

    def take_plan_report(self, report: PlanReport) -> None:
        """Take what a robot says of the plan on board."""
        status = self._statuses[report.robot]
        status.plan_report = report
        if report.state is OnboardPlanState.RUNNING and status.flies_no_target:
            status.target_report = None
        self.touch(report.robot)

    def take_target(self, report: TargetReport) -> None:
        """Take a report on a target; one that is older than the newest changes nothing."""
        status = self._statuses[report.robot]
        newest = status.target_report
        if newest is None or report.measured_at >= newest.measured_at:
            status.target_report = report
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
        self._statuses[robot].plan = plan
        self.touch(robot)

    def set_mission(self, robot: str, mission_id: str | None) -> None:
        """Say which mission of a robot concerns the operator now."""
        self._statuses[robot].mission_id = mission_id
        self.touch(robot)

    def touch(self, robot: str) -> None:
        """Say that something about a robot changed."""
        self._on_change(robot)

    def limit_s(self, limit_s: float) -> float:
        """Return a limit of age by the station's clock, which a demo may run faster."""
        return limit_s * max(1.0, self._clock.speed)

    def is_old(self, status: RobotStatus) -> bool:
        """Tell whether the newest state of a robot must look old."""
        state = status.state
        return state is None or self._age_s(state.measured_at) > self.limit_s(_POSITION_LIMIT_S)

    def target_shown(self, status: RobotStatus) -> TargetReport | None:
        """Return a robot's newest report on its target, ``None`` once that concerns nobody."""
        report = status.target_report
        if report is None or status.flies_no_target:
            return None
        plan = status.plan_report
        has_ended = plan is not None and plan.state is not OnboardPlanState.RUNNING
        is_over = has_ended or report.phase is TargetPhase.ENDED
        if is_over and self._age_s(report.measured_at) > self.limit_s(_ENDED_LIMIT_S):
            return None
        return report

    def is_target_old(self, report: TargetReport) -> bool:
        """Tell whether a report on a target must look old."""
        is_over = report.phase is TargetPhase.ENDED
        return is_over or self._age_s(report.measured_at) > self.limit_s(_POSITION_LIMIT_S)

    def robot_view(self, robot: str) -> RobotView:
        """Return a robot as the fleet's list shows it."""
        status = self.status(robot)
        record = status.record
        vehicle = self._vehicles.find(record.model)
        return RobotView(
            id=record.id,
            name=record.name,
            model=record.model if vehicle is None else vehicle.title,
            model_key=record.model,
            model_note="" if vehicle is None else vehicle.note,
            model_origin=self._vehicles.origin(record.model),
            kind=record.kind,
            system_id=record.system_id,
            simulated=record.simulated,
            site=record.site,
            link=self._link_view(status),
            mode=None if status.state is None else status.state.mode.name.lower(),
            activity=self._activity(status),
            mission_id=status.mission_id,
            plan_id=None if status.plan is None else status.plan.plan_id,
            next_contact=self._next_contact(status),
            surface_forecast=self._forecast(status),
            alarm_level=self._alarm_level(robot),
        )

    def state_view(self, robot: str) -> StateView:
        """Return the newest value of everything that a robot reports."""
        status = self.status(robot)
        return StateView(
            robot=robot,
            channels=self._channels(status),
            position=self._position(status),
            mode=None if status.state is None else status.state.mode.name.lower(),
            activity=self._activity(status),
            plan=self._onboard_plan(status),
            link=self._link_view(status),
            links=link_views(status),
            clock_fault=None if status.clock_fault is None else status.clock_fault.text,
            tracking=self._tracking(status),
        )

    def live_view(self, robot: str) -> LiveRobotView:
        """Return a robot as the live stream carries it."""
        status = self.status(robot)
        state = self.state_view(robot)
        return LiveRobotView(
            robot=state.robot,
            channels=state.channels,
            position=state.position,
            mode=state.mode,
            activity=state.activity,
            plan=state.plan,
            link=state.link,
            links=state.links,
            clock_fault=state.clock_fault,
            tracking=state.tracking,
            mission_id=status.mission_id,
            plan_id=None if status.plan is None else status.plan.plan_id,
            next_contact=self._next_contact(status),
            surface_forecast=self._forecast(status),
            alarm_level=self._alarm_level(robot),
        )

    def _age_s(self, moment: datetime) -> float:
        return max(0.0, (self._clock.now() - moment).total_seconds())

    def _activity(self, status: RobotStatus) -> str:
        if status.record.kind == "recorded":
            return "Recording"
        plan = status.plan
        flying = plan is not None and plan.state == "running"
        track = self.target_shown(status)
        return activity(
            status.state,
            plan.round_text if plan and flying else "",
            self.is_old(status),
            is_teaching=track is not None
            and not track.is_barrier_on
            and track.phase is not TargetPhase.ENDED,
        )

    def _next_contact(self, status: RobotStatus) -> ContactView | None:
        if status.link_state is not LinkState.SUBMERGED:
            return None
        at = status.next_surfacing()
        if at is None:
            return None
        return ContactView(at, f"Next surfacing about {clock_time(at)}")

    def _forecast(self, status: RobotStatus) -> str:
        if status.record.kind == "recorded":
            return "A recording cannot be told anything"
        link = status.link
        return surface_forecast(
            status.record.id,
            status.link_state,
            "" if link is None else link.carrier,
            status.next_surfacing(),
        )

    def _link_view(self, status: RobotStatus) -> LinkView:
        link = status.link
        if link is None:
            return LinkView("", LinkState.NEVER_HEARD.value, None, None, None, 0, 0)
        return LinkView(
            carrier=link.carrier,
            state=link.state.value,
            heard_at=link.heard_at,
            age_s=None if link.heard_at is None else self._age_s(link.heard_at),
            rssi_dbm=link.rssi_dbm,
            frames_received=link.frames_received,
            frames_bad=link.frames_bad,
        )

    def _channels(self, status: RobotStatus) -> dict[str, ChannelView]:
        channels: dict[str, ChannelView] = {}
        if status.state is not None:
            age_s = self._age_s(status.state.measured_at)
            values = STATE.shown(status.state)
            for key, gauge in STATE.gauges.items():
                channels[key] = ChannelView(
                    value=values[key],
                    unit=STATE[key].unit,
                    display_unit=STATE[key].display_unit,
                    measured_at=status.state.measured_at,
                    received_at=status.state.received_at,
                    age_s=age_s,
                    limit_s=self.limit_s(gauge.limit_s),
                )
        for key, sample in status.samples.items():
            channels[key] = ChannelView(
                value=sample.value,
                unit=VARIABLES[key].unit,
                display_unit=None,
                measured_at=sample.measured_at,
                received_at=sample.received_at,
                age_s=self._age_s(sample.measured_at),
                limit_s=self.limit_s(_FIELD_LIMIT_S),
            )
        return channels

    def _position(self, status: RobotStatus) -> PositionView | None:
        state = status.state
        if state is None:
            return None
        latitude_deg, longitude_deg = self._geodetic(status, state.position_ned)
        return PositionView(
            ned_m=state.position_ned,
            std_m=state.position_std_m,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            has_fix=state.has_fix,
            measured_at=state.measured_at,
            received_at=state.received_at,
            age_s=self._age_s(state.measured_at),
        )

    def _geodetic(self, status: RobotStatus, position_ned: PositionNed) -> tuple[float, float]:
        """Return latitude and longitude, converted anew after ``_SAME_PLACE_M`` of way.

        The conversion costs more than all the rest of a view that is made ten times a second.
        """
        known = status.geodetic
        if known is None or math.dist(known[0][:2], position_ned[:2]) > _SAME_PLACE_M:
            site = status.record.site
            latitude_deg, longitude_deg = wgs84_from_ned(
                position_ned[:2], site.origin_latitude_deg, site.origin_longitude_deg
            )
            known = (position_ned, (float(latitude_deg), float(longitude_deg)))
            status.geodetic = known
        return known[1]

    def _tracking(self, status: RobotStatus) -> TargetReportView | None:
        report = self.target_shown(status)
        if report is None:
            return None
        return target_view(report, reason_by(report, status.plan_report))

    def _onboard_plan(self, status: RobotStatus) -> OnboardPlanView | None:
        report = status.plan_report
        if report is None:
            return None
        plan = status.plan
        return OnboardPlanView(
            plan_id=plan.plan_id
            if plan is not None and plan.record.sha256 == report.sha256
            else None,
            sha256=report.sha256,
            state=onboard_plan_state(report.state),
            leg=report.leg,
            legs=report.legs,
            energy_used=report.energy_used,
            age_s=self._age_s(report.measured_at),
        )
