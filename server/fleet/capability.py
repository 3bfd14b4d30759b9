"""What each robot can do, and in one sentence why it cannot do the rest.

The app offers what is offered here, and says the sentence where something is not.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Final

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
    record = status.record
    text = ""
    if key in _NEEDS_VEHICLE and not record.model:
        text = _NO_VEHICLE
    elif record.system_id is None:
        text = "" if key in _OF_A_RECORDING else _RECORDING
    else:
        text = (_FOREIGN if record.is_foreign else _OWN).get(key, "")
    return text.format(robot=record.id)


def capabilities(status: RobotStatus) -> list[RobotCapabilityView]:
    """Return everything that robots may be able to do, as it stands with this one."""
    reasons = ((key, reason_against(status, key)) for key in KEYS)
    return [RobotCapabilityView(key, not reason, reason) for key, reason in reasons]


def refuse_unless_able(status: RobotStatus, key: str) -> None:
    """Refuse what a robot cannot do.

    Raises:
        Problem: 409 with the sentence.
    """
    if reason := reason_against(status, key):
        raise conflict(reason)
