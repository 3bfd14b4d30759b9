"""Standard commands to a vehicle: sent, acknowledged, and repeated only where that is harmless."""

from dataclasses import dataclass

from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.station.error import NoAnswerError, ServiceRefusedError
from robot_link.station.exchange import Correspondent, Exchange, Patience

_LONGEST_WORK_S = 60.0
"""A command that has been in progress without a word for so long counts as not answered."""

IDEMPOTENT = frozenset(
    (
        grace.MAV_CMD_REQUEST_MESSAGE,
        grace.MAV_CMD_SET_MESSAGE_INTERVAL,
        grace.MAV_CMD_GET_MESSAGE_INTERVAL,
        grace.MAV_CMD_DO_PAUSE_CONTINUE,
        grace.MAV_CMD_GRACE_SURFACE,
        grace.MAV_CMD_GRACE_HOLD,
        grace.MAV_CMD_GRACE_RESUME,
        grace.MAV_CMD_GRACE_START,
    )
)
"""Commands that mean the same if they are heard twice."""

_REFUSALS = {
    grace.MAV_RESULT_TEMPORARILY_REJECTED: "the robot cannot do this now",
    grace.MAV_RESULT_DENIED: "the robot refuses to do this",
    grace.MAV_RESULT_UNSUPPORTED: "the robot does not know this command",
    grace.MAV_RESULT_FAILED: "the robot failed to do this",
}


@dataclass(frozen=True, slots=True)
class StandardCommand:
    """A command of the MAVLink standard with its seven parameters."""

    code: int
    parameters: tuple[float, ...] = ()

    def message(
        self, system: int, component: int, confirmation: int
    ) -> grace.MAVLink_command_long_message:
        """Return the message that carries it; ``confirmation`` counts repetitions."""
        one, two, three, four, five, six, seven = (*self.parameters, *[0.0] * 7)[:7]
        return grace.MAVLink_command_long_message(
            system, component, self.code, confirmation, one, two, three, four, five, six, seven
        )


class CommandClient:
    """Sends one command at a time to each vehicle."""

    def __init__(
        self,
        peer: Correspondent,
        *,
        component: int = grace.MAV_COMP_ID_AUTOPILOT1,
        patience: Patience | None = None,
    ) -> None:
        self._exchange = Exchange(peer, patience)
        self._component = component

    def hear(self, message: WireMessage) -> None:
        """Take what the vehicle says."""
        self._exchange.hear(message)

    async def send(self, command: StandardCommand) -> None:
        """Tell a vehicle to do something, and wait until it says that this is done.

        A command that does not mean the same when it is heard twice is sent once: after a silence
        nobody knows whether it was heard. The others are repeated with a growing confirmation.

        Raises:
            NoAnswerError: If the vehicle does not answer, or does not come to an end.
            ServiceRefusedError: If it refuses or fails.
        """
        attempts = self._exchange.patience.attempts if command.code in IDEMPOTENT else 1
        with self._exchange.listen() as inbox:
            for attempt in range(attempts):
                message = command.message(self._exchange.system, self._component, attempt)
                await self._exchange.say((message,))
                ends_s = monotonic_s() + self._exchange.wait_s
                while True:
                    try:
                        result = await inbox.first(
                            lambda heard: _result_of(heard, command.code), ends_s - monotonic_s()
                        )
                    except TimeoutError:
                        break
                    if result == grace.MAV_RESULT_IN_PROGRESS:
                        ends_s = monotonic_s() + _LONGEST_WORK_S
                        continue
                    if result != grace.MAV_RESULT_ACCEPTED:
                        reason = _REFUSALS.get(result, f"the robot answers with result {result}")
                        raise ServiceRefusedError(reason)
                    return
        raise NoAnswerError("the robot did not answer the command")


def _result_of(message: WireMessage, code: int) -> int | None:
    is_ack = isinstance(message, grace.MAVLink_command_ack_message)
    return message.result if is_ack and message.command == code else None
