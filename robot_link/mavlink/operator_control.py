"""Which ground station is in control of a robot: MAVLink's operator control protocol.

The robot manages its control. It tells who is in control (CONTROL_STATUS), and passes what another
ground station asks (MAV_CMD_REQUEST_OPERATOR_CONTROL) on to its own station, which decides. So that
nobody else profits from what was granted, its own station names who is to be in control, in the
parameter in which others name themselves.
"""

from dataclasses import dataclass
from datetime import datetime
from typing import Final

from robot_link.mavlink.codec import ROBOT_COMPONENT, STATION_COMPONENT, STATION_SYSTEM, WireMessage
from robot_link.mavlink.wire import grace
from robot_link.messages import RobotId, SystemId
from robot_link.report import ControlAsked, ControlReport

REQUEST: Final = grace.MAV_CMD_REQUEST_OPERATOR_CONTROL
NOBODY: Final = SystemId(0)
STANDS_S: Final = (3.0, 60.0)
"""Shortest and longest time for which a request stands."""
_STANDS_S: Final = 10.0
"""Of a request that does not say."""
_MANAGER: Final = grace.GCS_CONTROL_STATUS_FLAGS_SYSTEM_MANAGER
_ALLOWED: Final = grace.GCS_CONTROL_STATUS_FLAGS_TAKEOVER_ALLOWED
_SYSTEM_MAX: Final = 255


@dataclass(frozen=True, slots=True)
class ControlWish:
    """What a ground station wants of a robot's control."""

    is_request: bool
    """Else it gives control back, or asks no more."""
    allows_takeover: bool
    stands_s: float
    """How long a request stands, s of the wall."""
    system: SystemId
    """Who is to be in control; 0 where the sender means itself."""


def status_message(
    controller: SystemId, *, allows_takeover: bool
) -> grace.MAVLink_control_status_message:
    """Return what a robot says of who controls it."""
    flags = _MANAGER | (_ALLOWED if allows_takeover else 0)
    return grace.MAVLink_control_status_message(flags, controller, [0] * 10)


def wish_message(
    target: SystemId, component: int, wish: ControlWish
) -> grace.MAVLink_command_long_message:
    """Return the command that carries a wish."""
    parameters = (wish.is_request, wish.allows_takeover, wish.stands_s, wish.system, 0, 0, 0)
    return grace.MAVLink_command_long_message(target, component, REQUEST, 0, *parameters)


def passed_on(wish: ControlWish) -> grace.MAVLink_command_long_message:
    """Return a wish as a robot passes it on to its own station."""
    return wish_message(STATION_SYSTEM, STATION_COMPONENT, wish)


def decision(robot: SystemId, wish: ControlWish) -> grace.MAVLink_command_long_message:
    """Return who is to be in control, as a station tells its robot."""
    return wish_message(robot, ROBOT_COMPONENT, wish)


def answer(
    result: int, target: SystemId, component: int, about: SystemId = NOBODY
) -> grace.MAVLink_command_ack_message:
    """Return the answer to a wish; ``about`` names whose it was, where another passed it on."""
    return grace.MAVLink_command_ack_message(
        command=REQUEST,
        result=result,
        result_param2=about,
        target_system=target,
        target_component=component,
    )


def wish_of(message: grace.MAVLink_command_long_message) -> ControlWish:
    """Decode a wish.

    Raises:
        ValueError: If a parameter is not what the command allows.
    """
    if message.param1 not in (0, 1) or message.param2 not in (0, 1):
        raise ValueError("a request for control neither asks for it nor gives it back")
    system = message.param4
    if not float(system).is_integer() or not 0 <= system <= _SYSTEM_MAX:
        raise ValueError("a request for control names no system")
    least_s, most_s = STANDS_S
    asked_s = message.param3 if 0 < message.param3 < float("inf") else _STANDS_S
    return ControlWish(
        bool(message.param1),
        bool(message.param2),
        min(max(asked_s, least_s), most_s),
        SystemId(int(system)),
    )


def told(
    message: WireMessage, robot: RobotId, received_at: datetime
) -> ControlReport | ControlAsked | None:
    """Decode what a robot says of its control; None for anything else.

    Raises:
        ValueError: If it passes on what is no wish.
    """
    match message:
        case grace.MAVLink_control_status_message() if message.flags & _MANAGER:
            is_allowed = bool(message.flags & _ALLOWED)
            return ControlReport(robot, SystemId(message.gcs_main), is_allowed, received_at)
        case grace.MAVLink_command_long_message(command=grace.MAV_CMD_REQUEST_OPERATOR_CONTROL):
            wish = wish_of(message)
            if wish.system in (NOBODY, STATION_SYSTEM):
                raise ValueError("a request for control was passed on that names nobody")
            return ControlAsked(robot, wish.system, wish.is_request, wish.stands_s, received_at)
        case _:
            return None
