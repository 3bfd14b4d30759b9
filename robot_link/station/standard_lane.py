"""Our orders to a vehicle of another maker: told in its words, proved by what it reports."""

from collections.abc import Callable
from typing import Final

from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.standard_vehicle import StandardVehicle
from robot_link.mavlink.wire import grace
from robot_link.messages import CommandKind, CommandLevel, CommandReport
from robot_link.standard_config import StandardCommandConfig
from robot_link.station.command_client import StandardCommand
from robot_link.station.command_lane import Command, CommandLane
from robot_link.station.peer import Peer

_CUSTOM: Final = grace.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
_COMPONENT: Final = grace.MAV_COMP_ID_AUTOPILOT1
_PLAIN_MODE_MAX: Final = 2**16 - 1
_RISEN_M: Final = 0.3
"""A depth that is less by so much proves that the vehicle comes up."""
_AT_SURFACE_M: Final = 0.5
_PAUSE, _CONTINUE = 0.0, 1.0
_ARMING: Final = (CommandKind.ARM, CommandKind.DISARM)
_REFUSALS: Final = {
    grace.MAV_RESULT_TEMPORARILY_REJECTED: "the vehicle cannot do this now",
    grace.MAV_RESULT_DENIED: "the vehicle refuses to do this",
    grace.MAV_RESULT_UNSUPPORTED: "the vehicle does not know this command",
    grace.MAV_RESULT_FAILED: "the vehicle failed to do this",
}


class StandardCommandLane(CommandLane):
    """A lane whose vehicle does not know our commands' numbers.

    Its answer proves that it heard (RADIO); APPLIED waits for its mode, its arming, its item or its
    depth. A mode that leads up proves nothing while the motors are disarmed: then its depth must.
    """

    def __init__(
        self,
        peer: Peer,
        on_report: Callable[[CommandReport], None],
        vehicle: StandardVehicle,
        config: StandardCommandConfig,
    ) -> None:
        super().__init__(peer, on_report)
        self._vehicle = vehicle
        self._config = config
        self._depths_m: dict[int, float] = {}
        """How deep the vehicle was when each order was sent first, by the order's number."""

    def answered(self, message: grace.MAVLink_command_ack_message) -> None:
        """Take the vehicle's answer to the order under way."""
        for command in self._open:
            if message.command != self._code(command.kind) or not self._is_sent(command):
                continue
            if message.result in (grace.MAV_RESULT_ACCEPTED, grace.MAV_RESULT_IN_PROGRESS):
                command.is_confirmed = True
                self._tell_once(command, CommandLevel.RADIO, self._peer.heard_by)
            else:
                reason = _REFUSALS.get(message.result, f"it answers with result {message.result}")
                self._settle(command, CommandLevel.REFUSED, self._with_word(reason))
            return

    def contact(self) -> None:
        """Look whether what the vehicle has just reported proves an order."""
        for command in list(self._open):
            if self._is_sent(command) and self._is_proved(command):
                self._tell_once(command, CommandLevel.RADIO, self._peer.heard_by)
                self._settle(command, CommandLevel.APPLIED)
        super().contact()

    def _message(self, command: Command, attempt: int) -> WireMessage:
        depth_m = self._vehicle.depth_m
        if depth_m is not None:
            self._depths_m.setdefault(command.number, depth_m)
        standard = StandardCommand(self._code(command.kind), self._parameters(command.kind))
        return standard.message(self._peer.system, _COMPONENT, min(attempt, 255))

    def _has_answered(self, command: Command) -> bool:
        return CommandLevel.RADIO in command.told

    def _code(self, kind: CommandKind) -> int:
        config = self._config
        if kind in _ARMING:
            return grace.MAV_CMD_COMPONENT_ARM_DISARM
        if kind is CommandKind.SURFACE and config.surface_by == "command":
            return config.surface_number
        if kind is CommandKind.SURFACE and config.surface_by == "mission_item":
            return grace.MAV_CMD_DO_SET_MISSION_CURRENT
        if kind is not CommandKind.SURFACE and config.hold_by == "command":
            return grace.MAV_CMD_DO_PAUSE_CONTINUE
        return grace.MAV_CMD_DO_SET_MODE

    def _parameters(self, kind: CommandKind) -> tuple[float, ...]:
        match self._code(kind):
            case grace.MAV_CMD_COMPONENT_ARM_DISARM:
                return (float(kind is CommandKind.ARM),)
            case grace.MAV_CMD_DO_SET_MODE:
                return float(_CUSTOM), *_mode_parameters(self._mode(kind))
            case grace.MAV_CMD_DO_SET_MISSION_CURRENT:
                return (float(self._config.surface_number),)
            case grace.MAV_CMD_DO_PAUSE_CONTINUE:
                return (_PAUSE if kind is CommandKind.HOLD else _CONTINUE,)
            case _:
                return ()

    def _mode(self, kind: CommandKind) -> int:
        match kind:
            case CommandKind.SURFACE:
                return self._config.surface_number
            case CommandKind.HOLD:
                return self._config.hold_mode
            case _:
                return self._config.resume_mode

    def _is_sent(self, command: Command) -> bool:
        return CommandLevel.QUEUED in command.told

    def _is_proved(self, command: Command) -> bool:
        match self._code(command.kind):
            case grace.MAV_CMD_COMPONENT_ARM_DISARM if command.kind in _ARMING:
                return self._vehicle.is_armed is (command.kind is CommandKind.ARM)
            case grace.MAV_CMD_DO_SET_MODE:
                is_in_mode = self._vehicle.mode_number == self._mode(command.kind)
                if command.kind is CommandKind.SURFACE and self._vehicle.is_armed is False:
                    return is_in_mode and self._has_risen(command)
                return is_in_mode
            case grace.MAV_CMD_DO_SET_MISSION_CURRENT:
                at_item = self._vehicle.mission_item == self._config.surface_number
                return at_item and self._has_risen(command)
            case grace.MAV_CMD_DO_PAUSE_CONTINUE:
                return command.is_confirmed
            case _:
                return command.is_confirmed and self._has_risen(command)

    def _has_risen(self, command: Command) -> bool:
        depth_m = self._vehicle.depth_m
        began_m = self._depths_m.get(command.number)
        if depth_m is None:
            return False
        risen_m = 0.0 if began_m is None else began_m - depth_m
        return depth_m <= _AT_SURFACE_M or risen_m >= _RISEN_M

    def _with_word(self, reason: str) -> str:
        """Return a reason with what the vehicle said of late, which often says more."""
        word = self._vehicle.last_word
        return f"{reason} ({word})" if word else reason


def _mode_parameters(mode: int) -> tuple[float, ...]:
    """Return a custom mode as DO_SET_MODE carries it.

    PX4 packs its modes into the upper half of the number that its heartbeat says; the command
    names main mode and sub mode apart.
    """
    if mode <= _PLAIN_MODE_MAX:
        return (float(mode),)
    return float(mode >> 16 & 0xFF), float(mode >> 24 & 0xFF)
