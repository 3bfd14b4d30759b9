"""What the station says of a robot, in words: plain, short, and never more than is known."""

from collections.abc import Sequence
from datetime import datetime

from robot_link.messages import CommandKind, LinkState, OnboardPlanState, RobotMode, StateReport
from robot_link.report import VehicleReport

_CARRIERS = {
    "xbee": "XBee",
    "serial": "Serial line",
    "udp": "UDP",
    "tcp": "TCP",
    "rockblock": "RockBLOCK",
    "directip": "Iridium DirectIP",
    "cloudloop": "Cloudloop",
    "micromodem": "Acoustic modem",
    "cameras": "Cameras",
}
_BY_SATELLITE = ("rockblock", "directip", "cloudloop")
_SLOW_M_S = 0.003
IN_WORKSHOP = "In the workshop"
"""What a robot does between two deployments."""
TEACHING = "teaching: barrier off"
"""Mark of a robot, or of its plan, that does nothing to keep its target observable."""


def activity(
    state: StateReport | None,
    round_text: str,
    is_old: bool,
    *,
    is_teaching: bool = False,
    is_in_workshop: bool = False,
) -> str:
    """Say what a robot does, such as "Gliding down, round 2 of 4".

    Args:
        state: Its newest report.
        round_text: Where its mission stands, such as "round 2 of 4"; "" without one.
        is_old: Whether the report is older than its limit.
        is_teaching: Whether nothing keeps the target that it follows observable.
        is_in_workshop: Whether it is between two deployments.
    """
    if is_in_workshop:
        if state is None or is_old or state.mode is RobotMode.IDLE:
            return IN_WORKSHOP
        return f"{IN_WORKSHOP}; {_motion(state).lower()}"
    if state is None:
        return "Not heard yet"
    text = _motion(state)
    if is_teaching and state.mode in {RobotMode.TRACKING, RobotMode.SEARCHING}:
        text = f"{text}, {TEACHING}"
    if round_text and state.mode not in {RobotMode.IDLE, RobotMode.ABORTING}:
        text = f"{text}, {round_text}"
    return f"Last heard: {text[0].lower()}{text[1:]}" if is_old else text


OWN_CAMERA_FIX = "fixed by its own camera"


def camera_fix_text(cameras: int | None) -> str:
    """Say who fixed a position, such as "fixed by 3 cameras".

    Args:
        cameras: How many saw the robot in the newest fix that was sent to it; None where nobody
            knows, as of fixes that another sent.
    """
    if not cameras:
        return "fixed by cameras"
    return f"fixed by {cameras} camera{'' if cameras == 1 else 's'}"


def _motion(state: StateReport) -> str:
    down_m_s = state.velocity_ned[2]
    way = "" if abs(down_m_s) < _SLOW_M_S else " down" if down_m_s > 0 else " up"
    match state.mode:
        case RobotMode.IDLE:
            return "Idle at the surface"
        case RobotMode.DIVING:
            return "Rising" if down_m_s < -_SLOW_M_S else "Diving"
        case RobotMode.GLIDING:
            return f"Gliding{way}"
        case RobotMode.SPIRALLING:
            return f"Spiralling{way}"
        case RobotMode.SWIMMING:
            return "Swimming"
        case RobotMode.TURNING:
            return "Turning to the next leg"
        case RobotMode.SURFACED:
            return "At the surface between legs"
        case RobotMode.ABORTING:
            return "Coming up"
        case RobotMode.HOLDING:
            return "Holding at the surface"
        case RobotMode.TRACKING:
            return "Following its target"
        case RobotMode.SEARCHING:
            return "Searching for its target"
        case RobotMode.DRIVEN:
            return "Driven by hand"


_LEVELS = ("critical", "critical", "critical", "warning", "watch")
"""Of MAV_SEVERITY, from emergency to warning; what is less grave is information."""


def level_of(severity: int) -> str:
    """Return the level of an event for a sentence that a vehicle said with a MAV_SEVERITY."""
    return _LEVELS[severity] if severity < len(_LEVELS) else "info"


def mode_text(report: VehicleReport) -> str:
    """Say mode and arming of a vehicle of another maker, such as "armed, in ALT_HOLD: ..."."""
    armed = {None: "", True: "armed, ", False: "disarmed, "}[report.is_armed]
    words = f" ({report.mode_words})" if report.mode_words else ""
    return f"{armed}in {report.mode}{words}"


def vehicle_activity(report: VehicleReport | None, *, is_old: bool) -> str:
    """Say what a vehicle of another maker does, such as "Armed, in ALT_HOLD (holds its depth)"."""
    if report is None:
        return "Not heard yet"
    if not report.mode:
        return "Speaks, but has not said its mode"
    text = mode_text(report)
    if report.mode == "AUTO" and report.mission_item is not None:
        of = "" if report.mission_items is None else f" of {report.mission_items}"
        text = f"{text}, item {report.mission_item}{of}"
    return f"Last heard: {text}" if is_old else f"{text[0].upper()}{text[1:]}"


def carrier_title(carrier: str) -> str:
    """Return a carrier's name for people."""
    return _CARRIERS.get(carrier, carrier)


def surface_forecast(
    robot: str, link: LinkState, carrier: str, next_contact: datetime | None
) -> str:
    """Say what "surface now" would do at this moment."""
    if carrier in _BY_SATELLITE and link is not LinkState.DISABLED:
        when = "" if next_contact is None else f", expected about {clock_time(next_contact)}"
        return f"Reaches {robot} at its next session by {carrier_title(carrier)}{when}"
    match link:
        case LinkState.LIVE:
            return f"Reaches {robot} now by {carrier_title(carrier)}"
        case LinkState.SUBMERGED if next_contact is not None:
            return f"Reaches {robot} at its next surfacing, about {clock_time(next_contact)}"
        case LinkState.SUBMERGED:
            return f"Reaches {robot} at its next surfacing"
        case LinkState.STALE:
            return f"{robot} does not answer; the order is repeated until it does"
        case LinkState.NEVER_HEARD:
            return f"{robot} was never heard; the order is repeated until it answers"
        case LinkState.MUTE:
            return f"The station's radio does not answer; the order for {robot} waits for it"
        case LinkState.PORT_CLOSED:
            return f"The radio's port is closed; the order for {robot} waits for it"
        case LinkState.DISABLED:
            return f"The link is unplugged; the order for {robot} waits until it is plugged in"


def clock_time(moment: datetime) -> str:
    """Return a time of day for a sentence, such as 14:32Z."""
    return moment.strftime("%H:%MZ")


def command_text(
    robot: str, kind: CommandKind, level: str, reason: str, carriers: Sequence[str] = ()
) -> str:
    """Say how far a command is proved to have come.

    Args:
        robot: Who is told.
        kind: What it is told.
        level: The highest level that was proved.
        reason: Why it was refused or expired.
        carriers: The links that proved that level.
    """
    order = _ORDERS[kind]
    match level:
        case "queued":
            gateways = [carrier_title(one) for one in carriers if one in _BY_SATELLITE]
            takers = " and ".join(gateways) or "the radio"
            return f"{order} for {robot}: {takers} took it; {robot} has not answered yet."
        case "radio":
            return f"{order} delivered to {robot}'s radio; {robot} has not answered yet."
        case "applied":
            return _APPLIED[kind].format(robot=robot)
        case "refused":
            return f"{robot} refused: {reason or 'it gave no reason.'}"
        case "expired":
            return f"{order} for {robot} expired: {reason or 'it was not answered in time.'}"
        case _:
            return f"{order} for {robot} is written down; no link has taken it yet."


_TOLD = {
    CommandKind.QUIET: "to stop pinging its target",
    CommandKind.PING: "to ping its target again",
    CommandKind.ARM: "to let its motors turn",
    CommandKind.DISARM: "to stop its motors",
    CommandKind.ZERO_DEPTH: "to take its depth as zero",
}
_ORDERS = {
    CommandKind.SURFACE: "Surface order",
    CommandKind.HOLD: "Hold order",
    CommandKind.RESUME: "Resume order",
    CommandKind.START: "Start order",
    CommandKind.QUIET: "Order to stop pinging",
    CommandKind.PING: "Order to ping again",
    CommandKind.ARM: "Order to arm",
    CommandKind.DISARM: "Order to disarm",
    CommandKind.ZERO_DEPTH: "Order to zero the depth",
}
_APPLIED = {
    CommandKind.SURFACE: "{robot} obeys: it is coming up.",
    CommandKind.HOLD: "{robot} obeys the order to hold.",
    CommandKind.RESUME: "{robot} obeys: it continues its mission.",
    CommandKind.START: "{robot} obeys: it flies the plan on board.",
    CommandKind.QUIET: "{robot} obeys: it does not ping its target.",
    CommandKind.PING: "{robot} obeys: it pings its target again.",
    CommandKind.ARM: "{robot} obeys: it is armed, its motors may turn.",
    CommandKind.DISARM: "{robot} obeys: it is disarmed, its motors stand.",
    CommandKind.ZERO_DEPTH: "{robot} obeys: what its depth sensor reads now is the surface.",
}


def told_to(kind: CommandKind) -> str:
    """Return what somebody told a robot, such as "to surface"."""
    return _TOLD.get(kind, f"to {kind.value}")


def waiting_plan_text(plan: str, flown: str | None, at: datetime | None, *, starts: bool) -> str:
    """Say what becomes of a plan that waits on board.

    Args:
        plan: Its name.
        flown: The plan that is flown until then, where that is known.
        at: When the robot is expected to surface next.
        starts: Whether the plan begins then.
    """
    name = f"{plan[0].upper()}{plan[1:]}"
    if not starts:
        until = f"; {flown} is flown on" if flown is not None else ""
        return f"{name} waits on board until it is started{until}."
    when = "" if at is None else f", about {clock_time(at)}"
    until = f"; {flown} is flown until then" if flown is not None else ""
    return f"{name} waits on board for the next surfacing{when}{until}."


def onboard_plan_state(state: OnboardPlanState) -> str:
    """Return the name of a plan's state on board, as REST says it."""
    return state.name.lower()


def sentence(error: Exception) -> str:
    """Return what an error says, as a sentence."""
    text = str(error) or "The robot did not answer"
    return f"{text[0].upper()}{text[1:]}".rstrip(".") + "."
