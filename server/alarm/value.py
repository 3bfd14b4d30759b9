"""What rules can watch beside channels: values of the station's own about robots and itself.

Each is a row of ``VALUES``: what it is called, its unit, and how it is read of a robot's status. A
value of ``None`` is normal or does not apply. What needs more than a number in words brings the
words as its detail.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final, Literal

from autonomy.tracking.phase import TargetPhase
from robot_link.messages import SURFACED_BY_COMMAND, LinkState, OnboardPlanState, RobotMode
from server.alarm.station_condition import StationCondition
from server.alarm.whereabouts import nearest_robot_m, off_plan_m, to_keep_out_m
from server.fleet.actuator_words import slowed_text, trouble_text
from server.fleet.current_words import doubt_text
from server.fleet.status import RobotStatus
from server.fleet.target_words import search_text
from server.fleet.words import clock_time, level_of

_LOST = timedelta(seconds=15)
"""Just after the start nobody has had the time to be heard."""
_NEAR_SHORE_M = 20.0
_WORD_STANDS = timedelta(seconds=60)
"""So long a grave sentence of a vehicle stands as an alarm."""
_SOON_ASHORE = timedelta(minutes=30)
"""A robot that the current it believes carries ashore within this time is near."""
_AFLOAT = frozenset((RobotMode.IDLE, RobotMode.SURFACED, RobotMode.HOLDING))
_GRAVITY: Final = {"watch": 1.0, "warning": 2.0, "critical": 3.0}
"""Steps of what a vehicle says of itself."""


@dataclass(frozen=True, slots=True)
class Found:
    """What was read."""

    value: float = 1.0
    detail: str = ""
    since: datetime | None = None
    """Where the value is a time that passes: when that began; ``value`` is not read then."""
    unit_s: float = 1.0
    """Of a time: so many seconds of the robots' clock are one of its unit."""


@dataclass(slots=True)
class Watch:
    """The moment at which rules are asked about a robot, and what else is known then."""

    now: datetime
    since: datetime
    """When the watch began; silence before that is nobody's fault."""
    speed: float = 1.0
    """Seconds of the robots' clock per second of the wall."""
    fleet: Sequence[RobotStatus] = ()
    """Every robot."""
    misses: Mapping[str, Found] = field(default_factory=dict[str, Found])
    """What the newest judged prediction of each robot was worth."""
    condition: StationCondition | None = None
    """Of the station's own machine."""
    due: datetime | None = None
    """The next moment at which time alone may change an answer."""

    def is_past(self, moment: datetime) -> bool:
        """Tell whether a moment has come; if not, the rules are asked again when it does."""
        if self.now >= moment:
            return True
        self.wait_for(moment)
        return False

    def wait_for(self, moment: datetime | None) -> None:
        """Have the rules asked again at a moment."""
        if moment is not None:
            self.due = moment if self.due is None else min(self.due, moment)


Read = Callable[[RobotStatus, Watch], Found | None]


@dataclass(frozen=True, slots=True)
class StationValue:
    """Something that a rule can watch."""

    key: str
    title: str
    unit: str
    """"" of a state, which is 0 or 1 or one of a few steps."""
    read: Read | None = None
    """How it is read of a robot; ``None`` of a value of the station itself."""
    help: str = ""
    decimals: int = 0
    condition: str = ""
    """Of a value of the station itself: the field of ``StationCondition`` that holds it."""
    is_time: bool = False
    """Whether it grows by itself."""
    over: Callable[[RobotStatus], str] | None = None
    """What the alarm says once it is over; None: what it said before."""
    history: tuple[str, float] | None = None
    """The channel of state reports that keeps its past, and what that is multiplied by."""

    @property
    def about(self) -> Literal["robot", "station"]:
        """What it is a value of."""
        return "station" if self.read is None else "robot"

    @property
    def absent(self) -> float:
        """What an expression reads where it is normal or does not apply; NaN of a quantity.

        A state is 0 then and no time has passed, but a robot that knows no other is not 0 m away.
        """
        return 0.0 if self.is_time or not self.unit else math.nan

    def found(self, status: RobotStatus | None, watch: Watch) -> Found | None:
        """Return what is to be read of a robot, or of the station."""
        if self.read is not None:
            return None if status is None else self.read(status, watch)
        value = None if watch.condition is None else getattr(watch.condition, self.condition)
        return None if value is None else Found(value)

    def words(self, value: float) -> str:
        """Return a value as a sentence has it."""
        gap = "" if self.unit in ("", "%") else " "
        return f"{value:.{self.decimals}f}{gap}{self.unit}"


def _battery(status: RobotStatus, watch: Watch) -> Found | None:
    del watch
    charge = math.nan if status.state is None else status.state.battery_fraction
    return None if math.isnan(charge) else Found(100.0 * charge, f"{charge:.0%}")


def _report_age(status: RobotStatus, watch: Watch) -> Found | None:
    state = status.state
    if state is None:
        return None
    since = max(state.received_at, watch.since)
    return Found(detail=_moment(state.received_at, watch.now), since=since, unit_s=60.0)


def _silence(status: RobotStatus, watch: Watch) -> Found | None:
    link = status.link
    if link is None or link.heard_at is None or link.state is not LinkState.STALE:
        return None
    if status.satellite is not None:
        return None  # It calls when it is due; see ``_contact``.
    return Found(
        detail=_moment(link.heard_at, watch.now),
        since=max(link.heard_at, watch.since),
        unit_s=max(1.0, watch.speed),
    )


def _port(status: RobotStatus, watch: Watch) -> Found | None:
    state, robot = status.radio_state, status.record.id
    if state not in (LinkState.MUTE, LinkState.PORT_CLOSED):
        return None
    text = f"The radio for {robot} cannot be opened; plug it in."
    if state is LinkState.MUTE:
        text = (
            f"The station's radio for {robot} does not answer; its port is open. "
            "Switch it off and on, or see what serves the port."
        )
    return Found(detail=text, since=watch.since, unit_s=max(1.0, watch.speed))


def _double(status: RobotStatus, watch: Watch) -> Found | None:
    del watch
    conflict = next((link.conflict for link in status.links.values() if link.conflict), "")
    return Found(detail=conflict) if conflict else None


def _overdue(status: RobotStatus, watch: Watch) -> Found | None:
    due = status.next_surfacing()
    if due is None or status.link_state is not LinkState.SUBMERGED:
        return None
    return Found(detail=_moment(due, watch.now), since=due, unit_s=60.0)


def _contact(status: RobotStatus, watch: Watch) -> Found | None:
    """Read by how much a robot missed its call by satellite; one that dived has its own."""
    due = None if status.satellite is None else status.satellite.next_session_at
    if due is None or status.link_state in (LinkState.SUBMERGED, LinkState.DISABLED):
        return None
    if not watch.is_past(watch.since + _LOST * max(1.0, watch.speed)):
        return None
    return Found(detail=_moment(due, watch.now), since=due, unit_s=60.0)


def _moment(at: datetime, now: datetime) -> str:
    """Return a moment for a sentence that is read later, with its day where that is another."""
    return clock_time(at) if at.date() == now.date() else f"{at:%Y-%m-%d} {clock_time(at)}"


def _budget(status: RobotStatus, watch: Watch) -> Found | None:
    del watch
    satellite = status.satellite
    if satellite is None or not satellite.waits_for_budget:
        return None
    return Found(detail=f"{satellite.credits_today} of {satellite.credits_per_day}")


def _credits(status: RobotStatus, watch: Watch) -> Found | None:
    del watch
    satellite = status.satellite
    return None if satellite is None else Found(float(satellite.credits_left))


def _satellite(status: RobotStatus, watch: Watch) -> Found | None:
    del watch
    satellite = status.satellite
    return None if satellite is None or not satellite.fault else Found(detail=satellite.fault)


def _surface(status: RobotStatus, watch: Watch) -> Found | None:
    del watch
    fault = status.surface_fault
    return None if fault is None else Found(detail=fault.text)


def _clock(status: RobotStatus, watch: Watch) -> Found | None:
    fault = status.clock_fault
    if fault is None:
        return None
    text = fault.text
    if status.record.kind == "simulated" and watch.speed > 1.0 and fault.ahead < timedelta():
        text += f" It may be that this machine cannot simulate {watch.speed:g} times as fast."
    return Found(detail=text)


def _adrift(status: RobotStatus, watch: Watch) -> Found | None:
    """Judge whether the water carries a robot ashore that floats and does nothing about it."""
    del watch
    state, robot, site = status.state, status.record.id, status.record.site
    if state is None or not state.has_fix or state.mode not in _AFLOAT or site.kind == "tank":
        return None
    if _flies(status):
        return None
    left_m = site.clearance_m(*state.position_ned[:2])
    if left_m <= 0.0:
        return Found(detail=f"{robot} floats outside of its water by its own position.")
    report = status.current_report
    north_m_s, east_m_s = (0.0, 0.0) if report is None else report.current_ne_m_s
    if report is not None and math.hypot(north_m_s, east_m_s) < report.current_std_m_s:
        north_m_s = east_m_s = 0.0  # nobody knows yet whither it flows
    soon_s = _SOON_ASHORE.total_seconds()
    north_m, east_m = state.position_ned[0] + soon_s * north_m_s, state.position_ned[1]
    if left_m > _NEAR_SHORE_M and site.clearance_m(north_m, east_m + soon_s * east_m_s) > 0.0:
        return None
    return Found(detail=f"{robot} floats near the shore and flies no plan: it may go ashore.")


def _flies(status: RobotStatus) -> bool:
    return status.plan_report is not None and status.plan_report.state is OnboardPlanState.RUNNING


def _ended_early(status: RobotStatus, watch: Watch) -> Found | None:
    del watch
    report = status.plan_report
    if report is None or report.state is not OnboardPlanState.FAILED:
        return None
    if report.reason == SURFACED_BY_COMMAND:
        return None
    return Found(detail=report.reason or "no reason given")


def _target(status: RobotStatus, watch: Watch) -> Found | None:
    """Judge the hold on a target while a mission to follow it lasts."""
    del watch
    track, plan = status.target_report, status.plan_report
    if track is None or track.phase is not TargetPhase.LOST or status.flies_no_target:
        return None
    if plan is not None and plan.state is not OnboardPlanState.RUNNING:
        return None
    return Found(detail="it was told not to ping" if track.is_quiet else search_text(track))


def _target_speed(status: RobotStatus, watch: Watch) -> Found | None:
    """Judge whether a target that is followed can be."""
    del watch
    track, plan = status.target_report, status.plan_report
    if track is None or not track.is_too_fast or status.flies_no_target:
        return None
    return Found() if plan is None or plan.state is OnboardPlanState.RUNNING else None


def _target_over(status: RobotStatus) -> str:
    """Say how the loss of a target ended."""
    track, plan = status.target_report, status.plan_report
    flies = plan is None or plan.state is OnboardPlanState.RUNNING
    is_held = track is not None and track.phase in (TargetPhase.TRACKING, TargetPhase.COASTING)
    found = flies and is_held and not status.flies_no_target
    how = "found again" if found else "its pursuit ended"
    return f"{status.record.id} lost its target; {how}."


def _actuators(status: RobotStatus, watch: Watch) -> Found | None:
    """Judge actuators that are stuck, or make the robot swing, and a mass that slows its dives."""
    del watch
    report = status.actuator_report
    if report is None:
        return None
    if trouble := trouble_text(report):
        return Found(2.0, trouble)
    if report.is_mass_off and (slowed := slowed_text(report)):
        return Found(1.0, f"its sliding mass is slow or late. {slowed}")
    return None


def _doubt(status: RobotStatus, watch: Watch) -> Found | None:
    """Read how far a robot's own fixes believe its positions."""
    del watch
    report = status.current_report
    if report is None:
        return None
    text = doubt_text(report) or f"It doubts its positions {report.doubt:.1f} times."
    return Found(report.doubt, text)


def _vehicle(status: RobotStatus, watch: Watch) -> Found | None:
    """Judge what a vehicle of another maker says of its own condition."""
    report, word = status.vehicle_report, status.vehicle_word
    if report is not None and report.is_critical:
        return Found(_GRAVITY["critical"], "says that it is in an emergency.")
    if word is not None and not watch.is_past(word.at + _WORD_STANDS):
        gravity = _GRAVITY.get(level_of(word.severity), 0.0)
        return Found(gravity, f"says: {word.text}")
    if report is not None and report.unhealthy:
        unwell = ", ".join(report.unhealthy)
        return Found(_GRAVITY["watch"], f"says that its {unwell} is not well.")
    return None


def _channels(status: RobotStatus, watch: Watch) -> Found | None:
    del watch
    faults = status.channel_faults
    return Found(detail="; ".join(faults.values())) if faults else None


def _miss(status: RobotStatus, watch: Watch) -> Found | None:
    return watch.misses.get(status.record.id)


def _off_plan(status: RobotStatus, watch: Watch) -> Found | None:
    del watch
    off_m = off_plan_m(status) if _flies(status) else None
    return None if off_m is None else Found(off_m)


def _keep_out(status: RobotStatus, watch: Watch) -> Found | None:
    del watch
    left_m = to_keep_out_m(status)
    return None if left_m is None else Found(left_m)


def _near(status: RobotStatus, watch: Watch) -> Found | None:
    found = nearest_robot_m(status, watch.fleet, watch.now)
    return None if found is None else Found(found[1], found[0])


_ROBOT_VALUES = (
    StationValue("battery", "Battery", "%", _battery, history=("battery_fraction", 100.0)),
    StationValue(
        "report_age", "Age of its last report", "min", _report_age, is_time=True,
        help="Since its newest state report came, by the station's clock.",
    ),
    StationValue(
        "silence", "Silence of its link", "s", _silence, is_time=True,
        help="Since a radio that should hear it went silent; none while it said that it dives.",
    ),
    StationValue("port", "Radio out of order", "s", _port, is_time=True),
    StationValue("system_id", "Another under its system id", "", _double),
    StationValue(
        "overdue", "Overdue at the surface", "min", _overdue, is_time=True,
        help="Since the surfacing that its plan lets expect.",
    ),
    StationValue(
        "contact", "Overdue call by satellite", "min", _contact, is_time=True,
        help="Since the session at which it was to call.",
    ),
    StationValue("credits_left", "Satellite credits left today", "credits", _credits),
    StationValue("satellite_budget", "Waits for satellite budget", "", _budget),
    StationValue("satellite_fault", "Satellite fault", "", _satellite),
    StationValue("surface_order", "Order to surface not obeyed", "", _surface),
    StationValue("clock", "Its clock is wrong", "", _clock),
    StationValue("plan_ended_early", "Plan ended early", "", _ended_early),
    StationValue("adrift", "Adrift near the shore", "", _adrift),
    StationValue(
        "doubt", "Doubt of its own positions", "times", _doubt, decimals=1,
        help="How much farther off its fixes lie than its estimator states.",
    ),
    StationValue("target_lost", "Target lost", "", _target, over=_target_over),
    StationValue("target_too_fast", "Target too fast", "", _target_speed),
    StationValue(
        "actuators", "Actuators", "", _actuators, help="1: slow or late; 2: stuck or swinging.",
    ),
    StationValue(
        "vehicle", "What the vehicle says of itself", "", _vehicle,
        help="1: not well; 2: an error; 3: an emergency.",
    ),
    StationValue("channel_table", "Channels announced otherwise", "", _channels),
    StationValue(
        "prediction_miss", "Prediction missed", "ellipse units", _miss, decimals=1,
        help="How far the newest fix after a silence lay off; 1 is the edge of the 90 % ellipse.",
    ),
    StationValue(
        "plan_deviation", "Off its plan", "m", _off_plan,
        help="Distance from the nearest planned leg that its position uncertainty (2 standard "
        "deviations) does not explain. Not in tanks.",
    ),
    StationValue(
        "keep_out_distance", "Distance to a keep-out", "m", _keep_out,
        help="To the nearest keep-out, less 2 standard deviations of its position; negative "
        "inside.",
    ),
    StationValue(
        "nearest_robot", "Distance to the nearest robot", "m", _near,
        help="Less 2 standard deviations of both positions; of robots that were heard within "
        "5 min in the same water. Not in tanks.",
    ),
)  # fmt: skip
_STATION_VALUES = (
    StationValue(
        "disk_free", "Free disk of the station", "MB", condition="disk_free_mb"
    ),
    StationValue(
        "load", "Processor load of the station", "%", condition="load_percent",
        help="Of all processors, over one minute.",
    ),
    StationValue(
        "clock_step", "Step of the station's clock", "s", condition="clock_step_s", decimals=1,
        help="By how much the wall clock jumped within the last ten minutes, a second at least.",
    ),
    StationValue(
        "rows_waiting", "Measurements that wait for the database", "rows",
        condition="rows_waiting",
    ),
)  # fmt: skip
VALUES: Final[Mapping[str, StationValue]] = {
    value.key: value for value in (*_ROBOT_VALUES, *_STATION_VALUES)
}
"""Everything that a rule can watch beside channels."""
