"""A robot's parameters, read and written from the station."""

from collections.abc import Sequence

from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.messages import SystemId
from robot_link.service.parameter_table import NAME_BYTES, ParameterType, ParameterValue
from robot_link.service.parameter_wire import (
    IntegerEncoding,
    encoding_of,
    guessed_encoding,
    name_octets,
    parameter_value,
    to_wire,
)
from robot_link.station.error import NoAnswerError, OutOfContactError, ServiceRefusedError
from robot_link.station.exchange import Correspondent, Exchange, Patience

_ASKED_AT_ONCE = 8
"""Missing parameters that are asked for together."""
_BY_NAME = -1
_READINGS = 3
"""How often a value is read that is not the one that was set: an answer may be an old one, late."""

_ValueMessage = grace.MAVLink_param_value_message

_ERRORS = {
    grace.MAV_PARAM_ERROR_DOES_NOT_EXIST: "the robot has no parameter of this name",
    grace.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE: "the value is outside the robot's limits",
    grace.MAV_PARAM_ERROR_PERMISSION_DENIED: "the robot does not let this parameter be set now",
    grace.MAV_PARAM_ERROR_READ_ONLY: "the robot does not let this parameter be set",
}


class ParameterClient:
    """Reads all parameters with the gaps refilled, and writes with proof; one use at a time.

    Integers are decoded by the vehicle's capability bits; where it keeps them to itself, by its
    autopilot, and else by what its values look like.

    Args:
        peer: The vehicle.
        component: Its component that keeps the parameters; 0 is ignored by some vehicles.
        patience: How long and how often to ask.
    """

    def __init__(
        self,
        peer: Correspondent,
        *,
        component: int = grace.MAV_COMP_ID_AUTOPILOT1,
        patience: Patience | None = None,
    ) -> None:
        self._exchange = Exchange(peer, patience)
        self._component = component
        self._encoding: IntegerEncoding | None = None
        self._is_told = False
        self._types: dict[str, ParameterType] = {}

    def hear(self, message: WireMessage) -> None:
        """Take what the vehicle says."""
        match message:
            case grace.MAVLink_heartbeat_message(autopilot=grace.MAV_AUTOPILOT_ARDUPILOTMEGA):
                self._encoding = self._encoding or IntegerEncoding.C_CAST
            case grace.MAVLink_heartbeat_message(autopilot=grace.MAV_AUTOPILOT_PX4):
                self._encoding = self._encoding or IntegerEncoding.BYTEWISE
            case grace.MAVLink_autopilot_version_message():
                if (encoding := encoding_of(message.capabilities)) is not None:
                    self._encoding, self._is_told = encoding, True
            case _:
                pass
        self._exchange.hear(message)

    async def read_all(self) -> tuple[ParameterValue, ...]:
        """Return every parameter in the vehicle's order.

        Raises:
            NoAnswerError: If some of them stay away.
            ServiceRefusedError: If what it says makes no sense.
        """
        await self._learn_encoding()
        found, count = await self._collect()
        messages = [found[index] for index in range(count)]
        encoding = self._encoding or guessed_encoding(messages)
        if any(message.param_value for message in messages if message.param_type != _REAL):
            self._encoding = encoding
        return tuple(self._decoded(message, encoding) for message in messages)

    async def read(self, name: str) -> ParameterValue:
        """Return one parameter.

        Raises:
            NoAnswerError: If the vehicle does not answer, as many do that have none of this name.
            ServiceRefusedError: If it has none of this name.
        """
        await self._learn_encoding()
        message = await self._ask(name, (self._request(name),), f"for {name}")
        return self._decoded(message, self._encoding or guessed_encoding((message,)))

    async def write(self, name: str, value: float) -> ParameterValue:
        """Set one parameter, and read it back.

        Returns:
            The parameter as the vehicle says that it is now: of the value that was asked for.

        Raises:
            ValueError: If the value is not of the parameter's type.
            OutOfContactError: If the vehicle fell silent before anything was set.
            NoAnswerError: If the vehicle does not answer; what it holds is not known then.
            ServiceRefusedError: If it holds another value afterwards.
        """
        kind = self._types.get(name) or await self._type_of(name)
        encoding = self._encoding or IntegerEncoding.BYTEWISE
        setting = grace.MAVLink_param_set_message(
            target_system=self._exchange.system,
            target_component=self._component,
            param_id=name_octets(name),
            param_value=to_wire(value, kind, encoding),
            param_type=int(kind),
        )
        kept = self._decoded(
            await self._ask(name, (setting,), f"to the setting of {name}"), encoding
        )
        for _ in range(_READINGS):
            kept = await self.read(name)
            if kept.value == setting_value(value, kind):
                return kept
        raise ServiceRefusedError(f"{name} was not taken: the robot still holds {kept.value:g}")

    async def _type_of(self, name: str) -> ParameterType:
        try:
            return (await self.read(name)).type
        except NoAnswerError as error:
            raise OutOfContactError(f"{error}, and nothing was set") from error

    async def _learn_encoding(self) -> None:
        """Ask once for the capability bits; a vehicle may keep silent of them."""
        if self._is_told:
            return
        self._is_told = True
        ask = grace.MAVLink_command_long_message(
            target_system=self._exchange.system,
            target_component=self._component,
            command=grace.MAV_CMD_REQUEST_MESSAGE,
            confirmation=0,
            param1=grace.MAVLINK_MSG_ID_AUTOPILOT_VERSION,
            param2=0,
            param3=0,
            param4=0,
            param5=0,
            param6=0,
            param7=0,
        )
        try:
            await self._exchange.ask(lambda _: (ask,), _version_or_refusal, attempts=2)
        except NoAnswerError:
            self._is_told = self._encoding is not None

    async def _collect(self) -> tuple[dict[int, _ValueMessage], int]:
        """Return the messages by place, and how many there are."""
        found: dict[int, _ValueMessage] = {}
        count = -1
        fruitless = 0
        await_all: Sequence[WireMessage] = (
            grace.MAVLink_param_request_list_message(
                target_system=self._exchange.system, target_component=self._component
            ),
        )
        with self._exchange.listen() as inbox:
            await self._exchange.say(await_all)
            while len(found) != count:
                try:
                    message = await inbox.first(_value_message, self._exchange.wait_s)
                except TimeoutError:
                    fruitless += 1
                    if fruitless >= self._exchange.patience.attempts:
                        how_many = f" ({len(found)} of {count} parameters came)" if found else ""
                        raise NoAnswerError(f"the robot did not answer{how_many}") from None
                    missing = [index for index in range(max(0, count)) if index not in found]
                    asked = [self._request_at(index) for index in missing[:_ASKED_AT_ONCE]]
                    await self._exchange.say(asked or await_all)
                    continue
                if message.param_count != count:
                    count = message.param_count
                    found = {index: kept for index, kept in found.items() if index < count}
                if message.param_index < count and message.param_index not in found:
                    found[message.param_index] = message
                    fruitless = 0
        return found, count

    async def _ask(self, name: str, question: Sequence[WireMessage], about: str) -> _ValueMessage:
        answer = await self._exchange.ask(
            lambda _: question, lambda message: _answer_about(message, name), about=about
        )
        if isinstance(answer, grace.MAVLink_param_error_message):
            reason = _ERRORS.get(answer.error, "the robot refused")
            raise ServiceRefusedError(f"{name}: {reason}")
        return answer

    def _decoded(self, message: _ValueMessage, encoding: IntegerEncoding) -> ParameterValue:
        try:
            value = parameter_value(message, encoding)
        except ValueError as error:
            raise ServiceRefusedError(f"{message.param_id}: {error}") from error
        self._types[value.name] = value.type
        return value

    def _request(self, name: str) -> WireMessage:
        if not (name.isascii() and 1 <= len(name) <= NAME_BYTES):
            raise ServiceRefusedError(f"{name!r} is no name of a parameter")
        return _request(self._exchange.system, self._component, name, _BY_NAME)

    def _request_at(self, index: int) -> WireMessage:
        return _request(self._exchange.system, self._component, "", index)


_REAL = ParameterType.REAL32


def setting_value(value: float, kind: ParameterType) -> float:
    """Return a value as it is after its way through the wire's field."""
    if kind.is_integer:
        return int(value)
    octets = grace.MAVLink_param_set_message.unpacker.pack(value, 0, 0, b"", 0)
    rounded: float = grace.MAVLink_param_set_message.unpacker.unpack(octets)[0]
    return rounded


def _request(system: SystemId, component: int, name: str, index: int) -> WireMessage:
    return grace.MAVLink_param_request_read_message(
        target_system=system,
        target_component=component,
        param_id=name_octets(name),
        param_index=index,
    )


def _value_message(message: WireMessage) -> _ValueMessage | None:
    return message if isinstance(message, _ValueMessage) else None


def _answer_about(
    message: WireMessage, name: str
) -> _ValueMessage | grace.MAVLink_param_error_message | None:
    match message:
        case grace.MAVLink_param_value_message() | grace.MAVLink_param_error_message():
            return message if message.param_id == name else None
        case _:
            return None


def _version_or_refusal(message: WireMessage) -> bool | None:
    match message:
        case grace.MAVLink_autopilot_version_message():
            return True
        case grace.MAVLink_command_ack_message(command=grace.MAV_CMD_REQUEST_MESSAGE):
            return None if message.result == grace.MAV_RESULT_ACCEPTED else False
        case _:
            return None
