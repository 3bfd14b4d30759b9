"""Commands to robots as COMMAND_LONG messages, and back."""

from dataclasses import dataclass
from datetime import datetime

from robot_link.mavlink.wire import grace
from robot_link.messages import CommandKind, CommandNumber, PlanHash, SystemId
from robot_link.robot_program import CommandOutcome

PLAN_DIGITS = 12
"""Leading digits of a plan's hash that START carries."""

_CODES = {
    CommandKind.SURFACE: grace.MAV_CMD_GRACE_SURFACE,
    CommandKind.HOLD: grace.MAV_CMD_GRACE_HOLD,
    CommandKind.RESUME: grace.MAV_CMD_GRACE_RESUME,
    CommandKind.START: grace.MAV_CMD_GRACE_START,
    CommandKind.QUIET: grace.MAV_CMD_GRACE_QUIET,
    CommandKind.PING: grace.MAV_CMD_GRACE_PING,
    CommandKind.ZERO_DEPTH: grace.MAV_CMD_GRACE_ZERO_DEPTH,
}
_KINDS = {code: kind for kind, code in _CODES.items()}
_RESULTS = {
    CommandOutcome.DONE: grace.MAV_RESULT_ACCEPTED,
    CommandOutcome.NOT_NOW: grace.MAV_RESULT_TEMPORARILY_REJECTED,
    CommandOutcome.WRONG_PLAN: grace.MAV_RESULT_DENIED,
    CommandOutcome.UNSUPPORTED: grace.MAV_RESULT_UNSUPPORTED,
    CommandOutcome.IMPLAUSIBLE: grace.MAV_RESULT_FAILED,
}
_EXACT = 2**24
_HALF_DIGITS = PLAN_DIGITS // 2


@dataclass(frozen=True, slots=True)
class ReceivedCommand:
    """A command as the robot understands it."""

    kind: CommandKind
    number: CommandNumber
    expiry_s: int
    """Second since 1970 at which it expires; with ``number`` the command's name."""
    plan_digits: str
    """First digits of the hash of START's plan, else empty."""


def command_message(
    system: SystemId,
    kind: CommandKind,
    number: CommandNumber,
    expires: datetime,
    plan: PlanHash | None,
    *,
    confirmation: int = 0,
) -> grace.MAVLink_command_long_message:
    """Encode a command; ``confirmation`` counts its repetitions."""
    expiry_high, expiry_low = divmod(int(expires.timestamp()), _EXACT)
    digits = "0" * PLAN_DIGITS if plan is None else plan[:PLAN_DIGITS]
    return grace.MAVLink_command_long_message(
        target_system=system,
        target_component=grace.MAV_COMP_ID_AUTOPILOT1,
        command=_CODES[kind],
        confirmation=confirmation,
        param1=number,
        param2=expiry_high,
        param3=expiry_low,
        param4=int(digits[:_HALF_DIGITS], 16),
        param5=int(digits[_HALF_DIGITS:], 16),
        param6=0,
        param7=0,
    )


def result_of(outcome: CommandOutcome) -> int:
    """Return the MAV_RESULT that acknowledges what came of a command."""
    return _RESULTS[outcome]


def acknowledged_kind(message: grace.MAVLink_command_ack_message) -> CommandKind | None:
    """Return which of this dialect's commands an answer is about; None for any other."""
    return _KINDS.get(message.command)


def received_command(message: grace.MAVLink_command_long_message) -> ReceivedCommand | None:
    """Decode a command; None for one that is not of this dialect.

    Raises:
        ValueError: If a parameter is not a whole number that the dialect allows.
    """
    kind = _KINDS.get(message.command)
    if kind is None:
        return None
    parameters = (message.param1, message.param2, message.param3, message.param4, message.param5)
    if not all(float(number).is_integer() and 0 <= number < _EXACT for number in parameters):
        raise ValueError(f"a parameter of the {kind} command is not a whole number in range")
    number, high, low, first, second = (int(number) for number in parameters)
    is_start = kind is CommandKind.START
    return ReceivedCommand(
        kind=kind,
        number=CommandNumber(number),
        expiry_s=high * _EXACT + low,
        plan_digits=f"{first:0{_HALF_DIGITS}x}{second:0{_HALF_DIGITS}x}" if is_start else "",
    )
