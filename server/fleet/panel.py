"""A robot as REST and the live stream say it."""

import math
from collections import defaultdict
from collections.abc import Callable
from datetime import datetime
from typing import Any

from autonomy.channel import key_at_station
from autonomy.frames import LocalGeodetic
from autonomy.tracking.phase import TargetPhase
from db.record import same
from robot_link.messages import STATE, LinkState, StateReport
from robot_link.report import VehicleReport
from server.base.channels import Channels
from server.fleet.actuator_words import actuators_view
from server.fleet.capability import capabilities, drive_refusal
from server.fleet.current_words import current_view
from server.fleet.fleet import Fleet
from server.fleet.link_panel import link_views
from server.fleet.status import RobotStatus
from server.fleet.target_view import TargetReportView, target_view
from server.fleet.target_words import reason_by
from server.fleet.view import (
    ActuatorsView,
    ChannelView,
    ContactView,
    CurrentView,
    DeploymentBriefView,
    ForeignVehicleView,
    LinkView,
    LiveRobotView,
    OnboardPlanView,
    PositionView,
    RobotView,
    StateView,
    SuggestionView,
    WaitingPlanView,
)
from server.fleet.words import (
    IN_WORKSHOP,
    OWN_CAMERA_FIX,
    activity,
    camera_fix_text,
    clock_time,
    onboard_plan_state,
    surface_forecast,
    vehicle_activity,
    waiting_plan_text,
)
from server.vehicle.vehicles import Vehicles

FIELD_LIMIT_S = 120.0
"""Age from which a measurement of a field must look old, at the clock's normal speed."""


class FleetViews:
    """Makes views of the fleet; it changes nothing. Belongs to one event loop."""

    def __init__(
        self,
        fleet: Fleet,
        vehicles: Vehicles,
        channels: Channels,
        alarm_level: Callable[[str], str | None],
    ) -> None:
        self._fleet = fleet
        self._catalogue = channels
        self._vehicles = vehicles
        self._alarm_level = alarm_level
        self._geodetic: defaultdict[str, LocalGeodetic] = defaultdict(LocalGeodetic)

    def robot_view(self, robot: str) -> RobotView:
        """Return a robot as the fleet's list shows it."""
        status = self._fleet.status(robot)
        record = status.record
        vehicle = self._vehicles.find(record.model)
        return same(
            RobotView,
            record,
            deployment=_brief(status),
            suggestion=_suggestion(status),
            is_in_workshop=status.is_in_workshop,
            model=record.model if vehicle is None else vehicle.title,
            model_key=record.model,
            model_note="" if vehicle is None else vehicle.note,
            model_origin=self._vehicles.origin(record.model),
            capabilities=capabilities(status),
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
        return StateView(**self._state(self._fleet.status(robot)))

    def _state(self, status: RobotStatus) -> dict[str, Any]:
        """Return the fields of ``StateView``."""
        return {
            "robot": status.record.id,
            "channels": self._channels(status),
            "position": self._position(status),
            "mode": None if status.state is None else status.state.mode.name.lower(),
            "activity": self._activity(status),
            "plan": self._onboard_plan(status),
            "waiting_plan": self._waiting_plan(status),
            "link": self._link_view(status),
            "links": link_views(status),
            "clock_fault": None if status.clock_fault is None else status.clock_fault.text,
            "current": self._current(status),
            "actuators": self._actuators(status),
            "vehicle": self._vehicle(status),
            "tracking": self._tracking(status),
        }

    def live_view(self, robot: str) -> LiveRobotView:
        """Return a robot as the live stream carries it."""
        status = self._fleet.status(robot)
        return LiveRobotView(
            **self._state(status),
            suggestion=_suggestion(status),
            mission_id=status.mission_id,
            plan_id=None if status.plan is None else status.plan.plan_id,
            next_contact=self._next_contact(status),
            surface_forecast=self._forecast(status),
            driver=status.driver,
            drive_refusal=drive_refusal(status, self._fleet.speed),
            alarm_level=self._alarm_level(robot),
        )

    def _activity(self, status: RobotStatus) -> str:
        if status.record.kind == "recorded":
            return "Recording"
        if status.is_retired:
            return "Retired"
        if status.record.is_foreign:
            report = status.vehicle_report
            is_old = report is None or self._fleet.is_past(report.measured_at)
            told = vehicle_activity(report, is_old=is_old)
            return f"{IN_WORKSHOP}; {told[0].lower()}{told[1:]}" if status.is_in_workshop else told
        plan = status.plan
        flying = plan is not None and plan.state == "running"
        track = self._fleet.target_shown(status)
        return activity(
            status.state,
            plan.round_text if plan and flying else "",
            self._fleet.is_old(status),
            is_in_workshop=status.is_in_workshop,
            is_teaching=track is not None
            and not track.is_barrier_on
            and track.phase is not TargetPhase.ENDED,
        )

    def _next_contact(self, status: RobotStatus) -> ContactView | None:
        is_far = _speaks_by_satellite(status)
        call_at = self._next_call(status) if is_far else None
        if call_at is not None:
            return ContactView(call_at, f"Next session about {clock_time(call_at)}")
        # One that fell silent at the surface goes on with the plan that it flies, and so does one
        # whose call by satellite is overdue.
        if not is_far and status.link_state not in (LinkState.SUBMERGED, LinkState.STALE):
            return None
        at = status.next_surfacing()
        if at is None:
            return None
        return ContactView(at, f"Next surfacing about {clock_time(at)}")

    def _forecast(self, status: RobotStatus) -> str:
        if status.record.kind == "recorded":
            return "A recording cannot be told anything"
        is_far = _speaks_by_satellite(status)
        link = status.satellite_link if is_far else status.link
        return surface_forecast(
            status.record.id,
            LinkState.NEVER_HEARD if link is None else link.state,
            "" if link is None else link.carrier,
            self._next_call(status) if is_far else status.next_surfacing(),
        )

    def _next_call(self, status: RobotStatus) -> datetime | None:
        """Return when a robot calls next by satellite; an overdue call says nothing of the next."""
        due = None if status.satellite is None else status.satellite.next_session_at
        return None if due is None or self._fleet.age_s(due) > 0.0 else due

    def _link_view(self, status: RobotStatus) -> LinkView:
        link = status.link
        if link is None:
            return LinkView("", LinkState.NEVER_HEARD.value, None, None, None, 0, 0)
        return same(
            LinkView,
            link,
            state=link.state.value,
            age_s=None if link.heard_at is None else self._fleet.age_s(link.heard_at),
        )

    def _vehicle(self, status: RobotStatus) -> ForeignVehicleView | None:
        report, word = status.vehicle_report, status.vehicle_word
        if report is None or not status.record.is_foreign:
            return None
        return same(
            ForeignVehicleView,
            report,
            mode_name=report.mode,
            text=vehicle_activity(report, is_old=False),
            unhealthy=list(report.unhealthy),
            word="" if word is None else word.text,
            word_age_s=None if word is None else self._fleet.age_s(word.at),
            age_s=self._fleet.age_s(report.measured_at),
        )

    def _told(self, report: VehicleReport) -> dict[str, ChannelView]:
        """Return what a vehicle of another maker told and can be true, each with its own age."""
        channels: dict[str, ChannelView] = {}
        known = self._catalogue.catalogue
        for name, told in report.values.items():
            gauge = STATE.gauges.get(name)
            key = name if gauge is not None else key_at_station(name, known)
            if key is None or (gauge is None and known[key].fault(told.value) is not None):
                continue
            channels[key] = ChannelView(
                value=told.value,
                unit=known[key].unit if gauge is None else STATE[key].unit,
                display_unit=None if gauge is None else STATE[key].display_unit,
                measured_at=told.at,
                received_at=told.at,
                age_s=self._fleet.age_s(told.at),
                limit_s=self._fleet.limit_s(FIELD_LIMIT_S if gauge is None else gauge.limit_s),
            )
        return channels

    def _channels(self, status: RobotStatus) -> dict[str, ChannelView]:
        channels: dict[str, ChannelView] = {}
        if status.record.is_foreign and status.vehicle_report is not None:
            return self._told(status.vehicle_report)
        if status.state is not None:
            age_s = self._fleet.age_s(status.state.measured_at)
            values = STATE.shown(status.state)
            for key, gauge in STATE.gauges.items():
                if not math.isfinite(values[key]):
                    continue
                channels[key] = ChannelView(
                    value=values[key],
                    unit=STATE[key].unit,
                    display_unit=STATE[key].display_unit,
                    measured_at=status.state.measured_at,
                    received_at=status.state.received_at,
                    age_s=age_s,
                    limit_s=self._fleet.limit_s(gauge.limit_s),
                )
        known = self._catalogue.catalogue
        measured = {**status.samples, **status.readings}
        for key, sample in {**status.derived, **measured}.items():
            if key not in known:
                continue
            channels[key] = ChannelView(
                value=sample.value,
                unit=known[key].unit,
                display_unit=None,
                measured_at=sample.measured_at,
                received_at=sample.received_at,
                age_s=self._fleet.age_s(sample.measured_at),
                limit_s=self._fleet.limit_s(FIELD_LIMIT_S),
                is_derived=key not in measured,
                impossible=status.impossible.get(key, 0),
            )
        return channels

    def _position(self, status: RobotStatus) -> PositionView | None:
        state = status.state
        if state is None:
            return None
        site = status.record.site
        latitude_deg, longitude_deg = self._geodetic[status.record.id].at(
            *state.position_ned[:2], site.origin_latitude_deg, site.origin_longitude_deg
        )
        fix_text, fix_age_s = self._fix_by_cameras(status, state)
        return PositionView(
            ned_m=state.position_ned,
            std_m=state.position_std_m if math.isfinite(state.position_std_m) else None,
            latitude_deg=latitude_deg,
            longitude_deg=longitude_deg,
            has_fix=state.has_fix,
            measured_at=state.measured_at,
            received_at=state.received_at,
            age_s=self._fleet.age_s(state.measured_at),
            fix_text=fix_text,
            fix_age_s=fix_age_s,
        )

    def _fix_by_cameras(self, status: RobotStatus, state: StateReport) -> tuple[str, float | None]:
        """Return who fixed a position, where cameras did, and how old that fix of theirs is."""
        if not (state.has_fix and state.is_by_cameras):
            return "", None
        if state.is_by_own_camera:
            return OWN_CAMERA_FIX, None
        sent = status.fix_behind(state)
        if sent is None:
            return camera_fix_text(None), None
        return camera_fix_text(sent.cameras), self._fleet.age_s(sent.measured_at)

    def _tracking(self, status: RobotStatus) -> TargetReportView | None:
        report = self._fleet.target_shown(status)
        if report is None:
            return None
        return target_view(report, reason_by(report, status.plan_report))

    def _actuators(self, status: RobotStatus) -> ActuatorsView | None:
        report = status.actuator_report
        if report is None:
            return None
        vehicle = self._vehicles.find(status.record.model)
        return actuators_view(report, vehicle, self._fleet.age_s(report.measured_at))

    def _current(self, status: RobotStatus) -> CurrentView | None:
        report = status.current_report
        return (
            None if report is None else current_view(report, self._fleet.age_s(report.measured_at))
        )

    def _waiting_plan(self, status: RobotStatus) -> WaitingPlanView | None:
        queue, known, hand = status.plan_queue, status.next_plan, status.plan
        if queue is None or queue.next_sha256 is None:
            return None
        plan = known.id if known is not None and known.sha256 == queue.next_sha256 else None
        flown = None
        if hand is not None and hand.state == "running" and hand.record.sha256 == queue.sha256:
            flown = hand.plan_id
        at = None if flown is None else status.next_surfacing()
        return WaitingPlanView(
            plan_id=plan,
            sha256=queue.next_sha256,
            starts=queue.next_starts,
            flown_plan_id=flown,
            flown_sha256=queue.sha256,
            at=at,
            measured_at=queue.measured_at,
            age_s=self._fleet.age_s(queue.measured_at),
            text=waiting_plan_text(plan or "another plan", flown, at, starts=queue.next_starts),
        )

    def _onboard_plan(self, status: RobotStatus) -> OnboardPlanView | None:
        report = status.plan_report
        if report is None:
            return None
        plan = status.plan
        return same(
            OnboardPlanView,
            report,
            plan_id=plan.plan_id
            if plan is not None and plan.record.sha256 == report.sha256
            else None,
            state=onboard_plan_state(report.state),
            age_s=self._fleet.age_s(report.measured_at),
        )


def _brief(status: RobotStatus) -> DeploymentBriefView | None:
    deployment = status.deployment
    if deployment is None:
        return None
    return DeploymentBriefView(deployment.id, deployment.title, deployment.begun_at)


def _suggestion(status: RobotStatus) -> SuggestionView | None:
    return None if status.suggestion is None else same(SuggestionView, status.suggestion)


def _speaks_by_satellite(status: RobotStatus) -> bool:
    """Tell whether a robot is reached by satellite, and not by a radio that is nearer."""
    known = status.known_links
    return known.has_satellite and not known.radio_reaches
