"""What deserves an alarm: a table of rules, asked when a robot's status changes.

Some alarms are about time that passes: ``Watch.is_past`` notes when a rule is to be asked next.
"""

import math
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from datetime import datetime, timedelta

from autonomy.tracking.phase import TargetPhase
from robot_link.clock import Clock
from robot_link.messages import SURFACED_BY_COMMAND, LinkState, OnboardPlanState, RobotMode
from server.base.alarm_board import AlarmBoard
from server.base.wakeups import Wakeups
from server.fleet.actuator_words import slowed_text, trouble_text
from server.fleet.current_words import doubt_text
from server.fleet.fleet import Fleet
from server.fleet.status import RobotStatus
from server.fleet.target_words import search_text
from server.fleet.words import clock_time, level_of

_BATTERY_WARNING, _BATTERY_CRITICAL = 0.20, 0.10
_LOST = timedelta(seconds=15)
"""A link that is silent this long, by the wall, is lost."""
_NEAR_SHORE_M = 20.0
_WORD_STANDS = timedelta(seconds=60)
"""So long a grave sentence of a vehicle stands as an alarm."""
_SOON_ASHORE = timedelta(minutes=30)
"""A robot that the current it believes carries ashore within this time is near."""
_AFLOAT = frozenset((RobotMode.IDLE, RobotMode.SURFACED, RobotMode.HOLDING))
_OVERDUE_WATCH, _OVERDUE_CRITICAL = timedelta(minutes=10), timedelta(minutes=40)


@dataclass(frozen=True, slots=True)
class Verdict:
    """Why there is an alarm."""

    level: str
    text: str


@dataclass(slots=True)
class Watch:
    """The moment at which the rules are asked about a robot."""

    now: datetime
    since: datetime
    """When the watch began; silence before that is nobody's fault."""
    speed: float
    """Seconds of the robots' clock per second of the wall."""
    due: datetime | None = None
    """The next moment at which time alone may change an answer."""

    def is_past(self, moment: datetime) -> bool:
        """Tell whether a moment has come; if not, the rules are asked again when it does."""
        if self.now >= moment:
            return True
        self.due = moment if self.due is None else min(self.due, moment)
        return False


@dataclass(frozen=True, slots=True)
class Rule:
    """One cause of alarm."""

    cause: str
    judge: Callable[[RobotStatus, Watch], Verdict | None]
    over: Callable[[RobotStatus], str] | None = None
    """What the alarm says once it is over; None: what it said before."""
    is_of_contact: bool = False
    """Whether it is about who does not answer or drifts, which a robot in the workshop may."""


def _battery(status: RobotStatus, watch: Watch) -> Verdict | None:
    del watch
    charge = math.nan if status.state is None else status.state.battery_fraction
    if math.isnan(charge) or charge >= _BATTERY_WARNING:
        return None
    level = "critical" if charge < _BATTERY_CRITICAL else "warning"
    return Verdict(level, f"{status.record.id} has {charge:.0%} of its battery left.")


def _silence(status: RobotStatus, watch: Watch) -> Verdict | None:
    link = status.link
    if link is None or link.heard_at is None or link.state is not LinkState.STALE:
        return None
    if status.satellite is not None:
        return None  # It calls when it is due; see ``_contact``.
    if _is_early(watch, max(link.heard_at, watch.since)):
        return None
    robot = status.record.id
    return Verdict(
        "warning", f"{robot} does not answer; last heard at {_moment(link.heard_at, watch.now)}."
    )


def _port(status: RobotStatus, watch: Watch) -> Verdict | None:
    state, robot = status.radio_state, status.record.id
    if state not in (LinkState.MUTE, LinkState.PORT_CLOSED) or _is_early(watch, watch.since):
        return None
    if state is LinkState.MUTE:
        text = f"The station's radio for {robot} does not answer; its port is open."
        return Verdict("warning", f"{text} Switch it off and on, or see what serves the port.")
    return Verdict("warning", f"The radio for {robot} cannot be opened; plug it in.")


def _double(status: RobotStatus, watch: Watch) -> Verdict | None:
    del watch
    conflict = next((link.conflict for link in status.links.values() if link.conflict), "")
    if not conflict:
        return None
    return Verdict("warning", f"{status.record.id} is not alone under its system id: {conflict}.")


def _overdue(status: RobotStatus, watch: Watch) -> Verdict | None:
    due = status.next_surfacing()
    if due is None or status.link_state is not LinkState.SUBMERGED:
        return None
    if not watch.is_past(due + _OVERDUE_WATCH):
        return None
    return _late(watch, due, f"{status.record.id} was to surface at")


def _contact(status: RobotStatus, watch: Watch) -> Verdict | None:
    """Judge a robot that calls by satellite and has missed its time; one that dived has its own."""
    due = None if status.satellite is None else status.satellite.next_session_at
    if due is None or status.link_state in (LinkState.SUBMERGED, LinkState.DISABLED):
        return None
    if not watch.is_past(due + _OVERDUE_WATCH) or _is_early(watch, watch.since):
        return None
    return _late(watch, due, f"{status.record.id} was to call at")


def _late(watch: Watch, due: datetime, text: str) -> Verdict:
    """Judge what is overdue; how long it is so grows while the sentence stays."""
    level = "critical" if watch.is_past(due + _OVERDUE_CRITICAL) else "watch"
    return Verdict(level, f"{text} {_moment(due, watch.now)} and did not.")


def _moment(at: datetime, now: datetime) -> str:
    """Return a moment for a sentence that is read later, with its day where that is another."""
    return clock_time(at) if at.date() == now.date() else f"{at:%Y-%m-%d} {clock_time(at)}"


def _budget(status: RobotStatus, watch: Watch) -> Verdict | None:
    del watch
    satellite = status.satellite
    if satellite is None or not satellite.waits_for_budget:
        return None
    return Verdict(
        "warning",
        f"The satellite budget of {status.record.id} is spent "
        f"({satellite.credits_today} of {satellite.credits_per_day} credits); what is on its way "
        "waits until 00:00Z, or for a greater budget.",
    )


def _satellite(status: RobotStatus, watch: Watch) -> Verdict | None:
    del watch
    satellite = status.satellite
    if satellite is None or not satellite.fault:
        return None
    return Verdict("warning", f"Satellite to {status.record.id}: {satellite.fault}")


def _surface(status: RobotStatus, watch: Watch) -> Verdict | None:
    del watch
    fault = status.surface_fault
    return None if fault is None else Verdict("critical", fault.text)


def _clock(status: RobotStatus, watch: Watch) -> Verdict | None:
    if status.clock_fault is None:
        return None
    text = status.clock_fault.text
    if (
        status.record.kind == "simulated"
        and watch.speed > 1.0
        and status.clock_fault.ahead < timedelta()
    ):
        text += f" It may be that this machine cannot simulate {watch.speed:g} times as fast."
    return Verdict("watch", text)


def _adrift(status: RobotStatus, watch: Watch) -> Verdict | None:
    """Judge whether the water carries a robot ashore that floats and does nothing about it."""
    del watch
    state, robot = status.state, status.record.id
    if state is None or not state.has_fix or state.mode not in _AFLOAT:
        return None
    if status.record.site.kind == "tank":
        return None
    if status.plan_report is not None and status.plan_report.state is OnboardPlanState.RUNNING:
        return None
    left_m = status.record.site.clearance_m(*state.position_ned[:2])
    if left_m <= 0.0:
        return Verdict("warning", f"{robot} floats outside of its water by its own position.")
    report, site = status.current_report, status.record.site
    north_m_s, east_m_s = (0.0, 0.0) if report is None else report.current_ne_m_s
    if report is not None and math.hypot(north_m_s, east_m_s) < report.current_std_m_s:
        north_m_s = east_m_s = 0.0  # nobody knows yet whither it flows
    soon_s = _SOON_ASHORE.total_seconds()
    north_m, east_m = state.position_ned[0] + soon_s * north_m_s, state.position_ned[1]
    if left_m > _NEAR_SHORE_M and site.clearance_m(north_m, east_m + soon_s * east_m_s) > 0.0:
        return None
    return Verdict("warning", f"{robot} floats near the shore and flies no plan: it may go ashore.")


def _ended_early(status: RobotStatus, watch: Watch) -> Verdict | None:
    del watch
    report = status.plan_report
    if report is None or report.state is not OnboardPlanState.FAILED:
        return None
    if report.reason == SURFACED_BY_COMMAND:
        return None
    return Verdict(
        "watch", f"{status.record.id} ended its plan early: {report.reason or 'no reason given'}"
    )


def _target(status: RobotStatus, watch: Watch) -> Verdict | None:
    """Judge the hold on a target while a mission to follow it lasts."""
    del watch
    track, plan = status.target_report, status.plan_report
    if track is None or track.phase is not TargetPhase.LOST or status.flies_no_target:
        return None
    if plan is not None and plan.state is not OnboardPlanState.RUNNING:
        return None
    why = "it was told not to ping" if track.is_quiet else search_text(track)
    return Verdict("warning", f"{status.record.id} lost its target; {why}.")


def _target_speed(status: RobotStatus, watch: Watch) -> Verdict | None:
    """Judge whether a target that is followed can be."""
    del watch
    track, plan = status.target_report, status.plan_report
    if track is None or not track.is_too_fast or status.flies_no_target:
        return None
    if plan is not None and plan.state is not OnboardPlanState.RUNNING:
        return None
    return Verdict("warning", f"{status.record.id} follows a target that is too fast for it.")


def _target_over(status: RobotStatus) -> str:
    """Say how the loss of a target ended."""
    track, plan = status.target_report, status.plan_report
    flies = plan is None or plan.state is OnboardPlanState.RUNNING
    is_held = track is not None and track.phase in (TargetPhase.TRACKING, TargetPhase.COASTING)
    found = flies and is_held and not status.flies_no_target
    how = "found again" if found else "its pursuit ended"
    return f"{status.record.id} lost its target; {how}."


def _actuators(status: RobotStatus, watch: Watch) -> Verdict | None:
    """Judge actuators that are stuck, or make the robot swing, and a mass that slows its dives."""
    del watch
    report = status.actuator_report
    if report is None:
        return None
    robot = status.record.id
    if trouble := trouble_text(report):
        return Verdict("warning", f"{robot}: {trouble}")
    if report.is_mass_off and (slowed := slowed_text(report)):
        return Verdict("watch", f"{robot}: its sliding mass is slow or late. {slowed}")
    return None


def _is_early(watch: Watch, begin: datetime) -> bool:
    """Tell whether something that began then may still come right by itself."""
    return not watch.is_past(begin + _LOST * max(1.0, watch.speed))


def _doubt(status: RobotStatus, watch: Watch) -> Verdict | None:
    """Judge how far a robot's own fixes believe its positions."""
    del watch
    report = status.current_report
    text = "" if report is None else doubt_text(report)
    return Verdict("watch", f"{status.record.id}: {text}") if text else None


def _vehicle(status: RobotStatus, watch: Watch) -> Verdict | None:
    """Judge what a vehicle of another maker says of its own condition."""
    report, word, robot = status.vehicle_report, status.vehicle_word, status.record.id
    if report is not None and report.is_critical:
        return Verdict("critical", f"{robot} says that it is in an emergency.")
    if word is not None and not watch.is_past(word.at + _WORD_STANDS):
        return Verdict(level_of(word.severity), f"{robot} says: {word.text}")
    if report is not None and report.unhealthy:
        return Verdict("watch", f"{robot} says that its {', '.join(report.unhealthy)} is not well.")
    return None


def _channels(status: RobotStatus, watch: Watch) -> Verdict | None:
    del watch
    if not status.channel_faults:
        return None
    faults = "; ".join(status.channel_faults.values())
    text = f"{status.record.id} announces its channels otherwise: {faults}."
    return Verdict("warning", f"{text} Values of these are not used.")


RULES: tuple[Rule, ...] = (
    Rule("battery", _battery),
    Rule("silence", _silence, is_of_contact=True),
    Rule("port", _port, is_of_contact=True),
    Rule("system id", _double),
    Rule("overdue", _overdue, is_of_contact=True),
    Rule("contact", _contact, is_of_contact=True),
    Rule("satellite budget", _budget),
    Rule("satellite", _satellite),
    Rule("surface order", _surface),
    Rule("clock", _clock),
    Rule("plan ended early", _ended_early),
    Rule("adrift", _adrift, is_of_contact=True),
    Rule("doubt", _doubt),
    Rule("target", _target, _target_over),
    Rule("target speed", _target_speed),
    Rule("actuators", _actuators),
    Rule("vehicle", _vehicle),
    Rule("channels", _channels),
)
"""Every cause of alarm about a robot."""


async def watch_fleet(
    fleet: Fleet,
    alarms: AlarmBoard,
    clock: Clock,
    looks: Wakeups,
    judge_channels: Callable[[RobotStatus], Awaitable[None]],
) -> None:
    """Raise and clear alarms until cancelled.

    Args:
        fleet: The robots.
        alarms: Where alarms are raised.
        clock: The robots' clock.
        looks: Names each robot whose status changed.
        judge_channels: Judges what a robot measures by the catalogue of channels.
    """
    since = clock.now()
    for status in list(fleet.statuses):
        looks.wake(status.record.id)
    while True:
        for robot in await looks.next():
            watch = Watch(clock.now(), since, clock.speed)
            await judge_channels(fleet.status(robot))
            await _judge(fleet.status(robot), alarms, watch)
            looks.set_due(robot, watch.due)


async def _judge(status: RobotStatus, alarms: AlarmBoard, watch: Watch) -> None:
    robot = status.record.id
    for rule in RULES:
        is_asked = not (status.is_retired or (rule.is_of_contact and status.is_in_workshop))
        verdict = rule.judge(status, watch) if is_asked else None
        if verdict is None:
            over = "" if rule.over is None else rule.over(status)
            await alarms.clear(rule.cause, robot=robot, text=over)
        else:
            await alarms.raise_(rule.cause, verdict.text, level=verdict.level, robot=robot)
