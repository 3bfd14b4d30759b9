"""A robot's answers to those who read and set its parameters."""

from collections import deque
from collections.abc import Callable, Iterator

from onboard.link.status_text import status_texts
from robot_link.mavlink.codec import WireMessage
from robot_link.mavlink.wire import grace
from robot_link.service.parameter_table import ParameterTable, ParameterUnkept, ParameterValue
from robot_link.service.parameter_wire import (
    IntegerEncoding,
    from_wire,
    name_octets,
    to_wire,
)

ENCODING = IntegerEncoding.BYTEWISE
"""How this project's robots put integers into the float field; their capability bits say so."""

_BY_NAME = -1


class ParameterServer:
    """Answers one asker; a list is given piece by piece so that it never crowds out the rest.

    Args:
        table: The parameters.
        may_write: Returns why the asker may not set parameters now, a sentence, or "".
        encoding: How integers travel in the float field.
    """

    def __init__(
        self,
        table: ParameterTable,
        may_write: Callable[[], str] = lambda: "",
        *,
        encoding: IntegerEncoding = ENCODING,
    ) -> None:
        self._table = table
        self._encoding = encoding
        self._may_write = may_write
        self._owed: deque[int] = deque()

    def hear(self, message: WireMessage) -> list[WireMessage]:
        """Return what to answer at once; nothing to what is not of parameters."""
        match message:
            case grace.MAVLink_param_request_list_message():
                self._owed = deque(range(len(self._table)))
                return []
            case grace.MAVLink_param_request_read_message():
                return [self._read(message)]
            case grace.MAVLink_param_set_message():
                return self._set(message)
            case _:
                return []

    def owed(self) -> Iterator[WireMessage]:
        """Yield what remains of a list that was asked for; a new request begins it again."""
        while self._owed:
            value = self._table.at(self._owed.popleft())
            if value is not None:
                yield self._message(value)

    def _read(self, request: grace.MAVLink_param_request_read_message) -> WireMessage:
        index, name = request.param_index, request.param_id
        value = self._table.find(name) if index == _BY_NAME else self._table.at(index)
        if value is None:
            return _error(name, index, grace.MAV_PARAM_ERROR_DOES_NOT_EXIST)
        return self._message(value)

    def _set(self, message: grace.MAVLink_param_set_message) -> list[WireMessage]:
        name = message.param_id
        kept = self._table.find(name)
        if kept is None:
            return [_error(name, _BY_NAME, grace.MAV_PARAM_ERROR_DOES_NOT_EXIST)]
        if reason := self._may_write():
            return self._refusal(kept, grace.MAV_PARAM_ERROR_PERMISSION_DENIED, reason)
        if message.param_type != kept.type:
            reason = f"{name} is of type {kept.type.name}"
            return self._refusal(kept, grace.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE, reason)
        try:
            return [self._message(self._table.set(name, from_wire(message, self._encoding)))]
        except ParameterUnkept as error:
            return self._refusal(kept, grace.MAV_PARAM_ERROR_PERMISSION_DENIED, str(error))
        except ValueError as error:
            return self._refusal(kept, grace.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE, str(error))

    def _refusal(self, kept: ParameterValue, code: int, reason: str) -> list[WireMessage]:
        """Say in three ways that nothing changed: for new askers, for old ones, for people."""
        return [_error(kept.name, _BY_NAME, code), self._message(kept), *status_texts(reason)]

    def _message(self, value: ParameterValue) -> WireMessage:
        return grace.MAVLink_param_value_message(
            param_id=name_octets(value.name),
            param_value=to_wire(value.value, value.type, self._encoding),
            param_type=int(value.type),
            param_count=len(self._table),
            param_index=value.index,
        )


def _error(name: str, index: int, code: int) -> WireMessage:
    return grace.MAVLink_param_error_message(
        target_system=0,
        target_component=0,
        param_id=name_octets(name),
        param_index=index,
        error=code,
    )
