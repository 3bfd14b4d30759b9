"""What each robot can do, and in one sentence why it cannot do the rest.

The app offers what is offered here, and says the sentence where something is not.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Annotated, Final, NamedTuple

from db.query.fleet.robots import RobotRecord
from robot_link.messages import LinkState, RobotMode
from server.base.problem import conflict
from server.base.view import View, one_of
from server.fleet.status import RobotStatus

KEYS: Final[tuple[str, ...]] = (
    "adaptive_survey",
    "target_tracking",
    "what_if",
    "identification",
    "trim",
    "satellite_plan",
    "waypoints",
    "surface",
    "hold",
    "resume",
    "start",
    "ping",
    "arm",
    "zero_depth",
    "drive",
    "logs",
    "parameters",
)
CapabilityKey = Annotated[str, one_of(*KEYS)]


@dataclass(frozen=True, slots=True)
class RobotCapabilityView(View):
    """One thing that robots may be able to do."""

    key: CapabilityKey
    is_offered: bool
    reason: str
    """One sentence on why it is not offered; empty where it is."""


_FOREIGN: Final[Mapping[str, str]] = MappingProxyType(
    {
        "adaptive_survey": "{robot} speaks standard MAVLink: it takes waypoints, not the glides,"
        " spirals and swims of a survey that is planned here.",
        "target_tracking": "{robot} speaks standard MAVLink: it follows no target by ranges.",
        "trim": "{robot} speaks standard MAVLink: it has no trim that a plan could carry.",
        "satellite_plan": "{robot} speaks standard MAVLink: no plan reaches it by satellite.",
        "start": "{robot} flies no plans of this station; its own mode says when its mission runs.",
        "ping": "{robot} speaks standard MAVLink: it pings no target.",
        "zero_depth": "{robot} speaks standard MAVLink: its own ground station calibrates its"
        " pressure sensor.",
    }
)
_OWN: Final[Mapping[str, str]] = MappingProxyType(
    {
        "waypoints": "{robot} flies plans, which say more than waypoints can.",
        "arm": "{robot} needs no arming: it moves only for a plan or an order.",
    }
)
_NEEDS_VEHICLE: Final = ("what_if", "identification")
_NO_VEHICLE: Final = (
    "It is not known what vehicle of the catalogue {robot} is; without its parameters nothing can"
    " be computed with."
)
_RECORDING: Final = "{robot} is a recording; there is nobody behind it."
_OF_A_RECORDING: Final = ("what_if", "identification")


def reason_against(status: RobotStatus, key: str) -> str:
    """Return why a robot cannot do something, "" if it can."""
    return _reason(_Means.of(status.record), key)


def capabilities(status: RobotStatus) -> tuple[RobotCapabilityView, ...]:
    """Return everything that robots may be able to do, as it stands with this one."""
    return _views(_Means.of(status.record))


class _Means(NamedTuple):
    """What decides on what a robot can do."""

    robot: str
    has_model: bool
    has_system_id: bool
    is_foreign: bool

    @classmethod
    def of(cls, record: RobotRecord) -> "_Means":
        return cls(record.id, bool(record.model), record.system_id is not None, record.is_foreign)


def _reason(means: _Means, key: str) -> str:
    text = ""
    if key in _NEEDS_VEHICLE and not means.has_model:
        text = _NO_VEHICLE
    elif not means.has_system_id:
        text = "" if key in _OF_A_RECORDING else _RECORDING
    else:
        text = (_FOREIGN if means.is_foreign else _OWN).get(key, "")
    return text.format(robot=means.robot)


@lru_cache(maxsize=1000)
def _views(means: _Means) -> tuple[RobotCapabilityView, ...]:
    """Made once: every list of the fleet says it of every robot."""
    reasons = ((key, _reason(means, key)) for key in KEYS)
    return tuple(RobotCapabilityView(key, not reason, reason) for key, reason in reasons)


def refuse_unless_able(status: RobotStatus, key: str) -> None:
    """Refuse what a robot cannot do.

    Raises:
        Problem: 409 with the sentence.
    """
    if reason := reason_against(status, key):
        raise conflict(reason)


SPEED_MAX: Final = 4.0
"""How fast the clock of simulated robots may be for a person to drive one."""
_STEERED: Final = ("MANUAL", "STABILIZE", "ALT_HOLD", "ACRO", "POSHOLD", "ALTCTL", "POSCTL")
"""Modes in which other makers' vehicles act on a stick."""
_NO_CONTACT: Final[Mapping[LinkState, str]] = MappingProxyType(
    {
        LinkState.SUBMERGED: "{robot} is under water, where no radio reaches it; it can be driven"
        " once it is up.",
        LinkState.NEVER_HEARD: "{robot} was never heard by radio.",
        LinkState.STALE: "{robot} does not answer by radio.",
        LinkState.MUTE: "The station's radio does not answer.",
        LinkState.PORT_CLOSED: "The port of the radio to {robot} is closed.",
        LinkState.DISABLED: "The radio to {robot} is unplugged.",
    }
)


def drive_refusal(status: RobotStatus, speed: float) -> str:
    """Return why nobody can begin to drive a robot by hand now, "" if somebody can.

    Driving takes a dialogue ten times a second: a radio that reaches the robot now. By satellite a
    word takes minutes, so nothing of it ever goes there.

    Args:
        status: What is known of it.
        speed: Seconds of the robots' clock per second of the wall.
    """
    robot = status.record.id
    if reason := reason_against(status, "drive"):
        return reason
    if status.is_retired:
        return f"{robot} is retired; nobody drives it until it is brought back."
    if status.known_links.radio is None:
        return f"{robot} has no radio: a stick's word by satellite would be minutes old."
    if status.radio_state is not LinkState.LIVE:
        return _NO_CONTACT[status.radio_state].format(robot=robot)
    if status.driver:
        return f"{status.driver} drives {robot}; one person at a time can."
    if speed > SPEED_MAX:
        return (
            f"The robots' clock runs {speed:g} times as fast as a person's;"
            f" at most {SPEED_MAX:g} times can be driven."
        )
    return _foreign_refusal(status) if status.record.is_foreign else _busy(status)


def _busy(status: RobotStatus) -> str:
    """Return what a robot of ours does that is not to be driven over."""
    robot, state = status.record.id, status.state
    if state is None:
        return f"{robot} has not said yet what it does."
    if state.mode is RobotMode.DRIVEN:
        return f"{robot} is driven by another ground station, or comes up after that."
    if state.mode is not RobotMode.IDLE or status.leg_now is not None:
        return f"{robot} flies a mission; wait for its end, or surface it."
    if status.plan is not None and status.plan.state == "sent":
        return f"A plan is on its way to {robot}; wait until it is on board, or cancel it."
    return ""


def _foreign_refusal(status: RobotStatus) -> str:
    """Return why a vehicle of another maker would not act on a stick."""
    robot, report = status.record.id, status.vehicle_report
    if report is None or not report.mode:
        return f"{robot} has not said its mode yet."
    if report.mode not in _STEERED:
        return (
            f"{robot} is in {report.mode}, where it does not act on a stick; tell it to hold, or"
            f" choose {', '.join(_STEERED[:3])} at its own ground station."
        )
    return ""
