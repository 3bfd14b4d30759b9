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
    LinkReport,
    LinkState,
    OnboardPlanState,
    PlanReport,
    Sample,
    StateReport,
    TargetReport,
)
from server.base.problem import not_found
from server.fleet.channel import CHANNELS, FIELD_LIMIT_S, POSITION_LIMIT_S, Channel
from server.fleet.link_panel import link_views
from server.fleet.picture import Picture, PlanInHand
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

_SAME_PLACE_M = 0.02
_ENDED_LIMIT_S = 600.0
"""Age from which the last word of a mission that followed a target concerns nobody."""
_TRACK_STEPS = 500
"""Track points are at least the site's longest side divided by this apart."""


class Fleet:
    """Pictures of all robots, and the views that REST and the live stream make of them.

    Belongs to one event loop. ``on_change`` is called with a robot's id whenever its picture
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
        self._pictures: dict[str, Picture] = {}

    def add(self, record: RobotRecord, thresholds_m: tuple[float, ...]) -> Picture:
        """Take up a robot; a robot that is known already gets the new record."""
        picture = self._pictures.get(record.id)
        if picture is None:
            water = record.site.water
            side_m = max(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m)
            picture = Picture(record, Track(side_m / _TRACK_STEPS, thresholds_m))
            self._pictures[record.id] = picture
        else:
            picture.record = record
            picture.geodetic = None
            for uri in [one for one, link in picture.links.items() if link.uri]:
                if uri not in record.links:
                    del picture.links[uri]
            picture.track.set_thresholds(thresholds_m)
        self.touch(record.id)
        return picture

    def picture(self, robot: str) -> Picture:
        """Return what is known of a robot.

        Raises:
            Problem: 404 if there is no such robot.
        """
        picture = self._pictures.get(robot)
        if picture is None:
            raise not_found(f"There is no robot {robot!r}.")
        return picture

    def vehicle(self, robot: str) -> Vehicle | None:
        """Return a robot's model, ``None`` for a recording of something unknown."""
        return self._vehicles.find(self.picture(robot).record.model)

    def knows(self, robot: str | None) -> bool:
        """Tell whether a robot belongs to the fleet."""
        return robot in self._pictures

    @property
    def pictures(self) -> Iterable[Picture]:
        """Every robot, in the order in which they were added."""
        return self._pictures.values()

    def take_state(self, report: StateReport) -> None:
        """Take a state report; one that is older than the newest changes no gauge."""
        picture = self._pictures[report.robot]
        if picture.state is None or report.measured_at >= picture.state.measured_at:
            picture.state = report
            picture.track.add(report.position_ned, report.position_std_m, report.mode)
            self.touch(report.robot)

    def take_sample(self, sample: Sample) -> None:
        """Take a sample as the newest value of its variable, if it is."""
        newest = self._pictures[sample.robot].samples
        known = newest.get(sample.variable)
        if known is None or sample.measured_at >= known.measured_at:
            newest[sample.variable] = sample
            self.touch(sample.robot)

    def take_plan_report(self, report: PlanReport) -> None:
        """Take what a robot says of the plan on board."""
        picture = self._pictures[report.robot]
        picture.plan_report = report
        if report.state is OnboardPlanState.RUNNING and picture.flies_no_target:
            picture.target_report = None
        self.touch(report.robot)

    def take_target(self, report: TargetReport) -> None:
        """Take a report on a target; one that is older than the newest changes nothing."""
        picture = self._pictures[report.robot]
        newest = picture.target_report
        if newest is None or report.measured_at >= newest.measured_at:
            picture.target_report = report
            self.touch(report.robot)

    def take_link(self, report: LinkReport) -> None:
        """Take the health of one link to a robot; the link does not know how deep it swims."""
        picture = self._pictures[report.robot]
        if report.state is LinkState.STALE and picture.follows_under_water:
            report = replace(report, state=LinkState.SUBMERGED)
        picture.links[report.uri or report.carrier] = report
        self.touch(report.robot)

    def set_plan(self, robot: str, plan: PlanInHand | None) -> None:
        """Say which plan of a robot concerns the operator now."""
        self._pictures[robot].plan = plan
        self.touch(robot)

    def set_mission(self, robot: str, mission_id: str | None) -> None:
        """Say which mission of a robot concerns the operator now."""
        self._pictures[robot].mission_id = mission_id
        self.touch(robot)

    def touch(self, robot: str) -> None:
        """Say that something about a robot changed."""
        self._on_change(robot)

    def limit_s(self, limit_s: float) -> float:
        """Return a limit of age by the station's clock, which a demo may run faster."""
        return limit_s * max(1.0, self._clock.speed)

    def is_old(self, picture: Picture) -> bool:
        """Tell whether the newest state of a robot must look old."""
        state = picture.state
        return state is None or self._age_s(state.measured_at) > self.limit_s(POSITION_LIMIT_S)

    def target_shown(self, picture: Picture) -> TargetReport | None:
        """Return a robot's newest report on its target, ``None`` once that concerns nobody."""
        report = picture.target_report
        if report is None or picture.flies_no_target:
            return None
        plan = picture.plan_report
        has_ended = plan is not None and plan.state is not OnboardPlanState.RUNNING
        is_over = has_ended or report.phase is TargetPhase.ENDED
        if is_over and self._age_s(report.measured_at) > self.limit_s(_ENDED_LIMIT_S):
            return None
        return report

    def is_target_old(self, report: TargetReport) -> bool:
        """Tell whether a report on a target must look old."""
        is_over = report.phase is TargetPhase.ENDED
        return is_over or self._age_s(report.measured_at) > self.limit_s(POSITION_LIMIT_S)

    def robot_view(self, robot: str) -> RobotView:
        """Return a robot as the fleet's list shows it."""
        picture = self.picture(robot)
        record = picture.record
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
            link=self._link_view(picture),
            mode=None if picture.state is None else picture.state.mode.name.lower(),
            activity=self._activity(picture),
            mission_id=picture.mission_id,
            plan_id=None if picture.plan is None else picture.plan.plan_id,
            next_contact=self._next_contact(picture),
            surface_forecast=self._forecast(picture),
            alarm_level=self._alarm_level(robot),
        )

    def state_view(self, robot: str) -> StateView:
        """Return the newest value of everything that a robot reports."""
        picture = self.picture(robot)
        return StateView(
            robot=robot,
            channels=self._channels(picture),
            position=self._position(picture),
            mode=None if picture.state is None else picture.state.mode.name.lower(),
            activity=self._activity(picture),
            plan=self._onboard_plan(picture),
            link=self._link_view(picture),
            links=link_views(picture),
            clock_fault=None if picture.clock_fault is None else picture.clock_fault.text,
            tracking=self._tracking(picture),
        )

    def live_view(self, robot: str) -> LiveRobotView:
        """Return a robot as the live stream carries it."""
        picture = self.picture(robot)
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
            mission_id=picture.mission_id,
            plan_id=None if picture.plan is None else picture.plan.plan_id,
            next_contact=self._next_contact(picture),
            surface_forecast=self._forecast(picture),
            alarm_level=self._alarm_level(robot),
        )

    def _age_s(self, moment: datetime) -> float:
        return max(0.0, (self._clock.now() - moment).total_seconds())

    def _activity(self, picture: Picture) -> str:
        if picture.record.kind == "recorded":
            return "Recording"
        plan = picture.plan
        flying = plan is not None and plan.state == "running"
        track = self.target_shown(picture)
        return activity(
            picture.state,
            plan.round_text if plan and flying else "",
            self.is_old(picture),
            is_teaching=track is not None
            and not track.is_barrier_on
            and track.phase is not TargetPhase.ENDED,
        )

    def _next_contact(self, picture: Picture) -> ContactView | None:
        if picture.link_state is not LinkState.SUBMERGED:
            return None
        at = picture.next_surfacing()
        if at is None:
            return None
        return ContactView(at, f"Next surfacing about {clock_time(at)}")

    def _forecast(self, picture: Picture) -> str:
        if picture.record.kind == "recorded":
            return "A recording cannot be told anything"
        link = picture.link
        return surface_forecast(
            picture.record.id,
            picture.link_state,
            "" if link is None else link.carrier,
            picture.next_surfacing(),
        )

    def _link_view(self, picture: Picture) -> LinkView:
        link = picture.link
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

    def _channels(self, picture: Picture) -> dict[str, ChannelView]:
        channels: dict[str, ChannelView] = {}
        if picture.state is not None:
            age_s = self._age_s(picture.state.measured_at)
            for channel in CHANNELS:
                channels[channel.key] = self._channel(channel, picture.state, age_s)
        for key, sample in picture.samples.items():
            channels[key] = ChannelView(
                value=sample.value,
                unit=VARIABLES[key].unit,
                display_unit=None,
                measured_at=sample.measured_at,
                received_at=sample.received_at,
                age_s=self._age_s(sample.measured_at),
                limit_s=self.limit_s(FIELD_LIMIT_S),
            )
        return channels

    def _channel(self, channel: Channel, state: StateReport, age_s: float) -> ChannelView:
        return ChannelView(
            value=channel.value(state),
            unit=channel.unit,
            display_unit=channel.display_unit,
            measured_at=state.measured_at,
            received_at=state.received_at,
            age_s=age_s,
            limit_s=self.limit_s(channel.limit_s),
        )

    def _position(self, picture: Picture) -> PositionView | None:
        state = picture.state
        if state is None:
            return None
        latitude_deg, longitude_deg = self._geodetic(picture, state.position_ned)
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

    def _geodetic(self, picture: Picture, position_ned: PositionNed) -> tuple[float, float]:
        """Return latitude and longitude, converted anew after ``_SAME_PLACE_M`` of way.

        The conversion costs more than all the rest of a view that is made ten times a second.
        """
        known = picture.geodetic
        if known is None or math.dist(known[0][:2], position_ned[:2]) > _SAME_PLACE_M:
            site = picture.record.site
            latitude_deg, longitude_deg = wgs84_from_ned(
                position_ned[:2], site.origin_latitude_deg, site.origin_longitude_deg
            )
            known = (position_ned, (float(latitude_deg), float(longitude_deg)))
            picture.geodetic = known
        return known[1]

    def _tracking(self, picture: Picture) -> TargetReportView | None:
        report = self.target_shown(picture)
        if report is None:
            return None
        return target_view(report, reason_by(report, picture.plan_report))

    def _onboard_plan(self, picture: Picture) -> OnboardPlanView | None:
        report = picture.plan_report
        if report is None:
            return None
        plan = picture.plan
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
