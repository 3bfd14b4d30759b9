"""Parameter values in MAVLink's one float field: as they are, cast, or bit by bit.

A vehicle says by a capability bit which of the two ways its integers take. MAVSDK and PX4 put the
bytes of the integer where the float would be (4 then looks like 5.6e-45); ArduPilot casts.
"""

import struct
from collections.abc import Iterable
from enum import StrEnum

from robot_link.mavlink.wire import grace
from robot_link.service.parameter_table import ParameterType, ParameterValue

ParameterMessage = grace.MAVLink_param_value_message | grace.MAVLink_param_set_message

_PAYLOAD_START = 10
_FORMATS = {
    ParameterType.UINT8: "<B3x",
    ParameterType.INT8: "<b3x",
    ParameterType.UINT16: "<H2x",
    ParameterType.INT16: "<h2x",
    ParameterType.UINT32: "<I",
    ParameterType.INT32: "<i",
    ParameterType.REAL32: "<f",
}


class IntegerEncoding(StrEnum):
    """How a vehicle puts integers into the float field."""

    BYTEWISE = "bytewise"
    C_CAST = "c_cast"


def encoding_of(capabilities: int) -> IntegerEncoding | None:
    """Return what the capability bits of AUTOPILOT_VERSION say; None where they say nothing."""
    if capabilities & grace.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE:
        return IntegerEncoding.BYTEWISE
    if capabilities & grace.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST:
        return IntegerEncoding.C_CAST
    return None


def guessed_encoding(messages: Iterable[grace.MAVLink_param_value_message]) -> IntegerEncoding:
    """Tell the encoding from the values: a cast integer is a whole number, always.

    Where all integers are zero or there are none, it is bytewise, as the MAVLink standard prefers.
    """
    values = [m.param_value for m in messages if m.param_type != ParameterType.REAL32]
    is_cast = any(values) and all(float(value).is_integer() for value in values)
    return IntegerEncoding.C_CAST if is_cast else IntegerEncoding.BYTEWISE


def is_exact(value: float, kind: ParameterType, encoding: IntegerEncoding) -> bool:
    """Tell whether a value survives the float field on its way.

    Bytewise, 32-bit integers whose bytes are a signalling NaN do not: processors change them. Cast,
    those beyond 24 bits do not.
    """
    if kind is ParameterType.REAL32:
        return True
    if encoding is IntegerEncoding.C_CAST:
        return abs(value) <= 2**24
    return kind.survives_bytewise(value)


def to_wire(value: float, kind: ParameterType, encoding: IntegerEncoding) -> float:
    """Return the float that carries a value.

    Raises:
        ValueError: If the value is not of the type, or does not survive the float field.
    """
    low, high = kind.limits
    if not low <= value <= high or (kind.is_integer and not float(value).is_integer()):
        raise ValueError(f"{value:g} is no value of type {kind.name}")
    if not is_exact(value, kind, encoding):
        raise ValueError(f"{value:g} cannot be carried exactly as type {kind.name}")
    if kind is ParameterType.REAL32 or encoding is IntegerEncoding.C_CAST:
        return float(value)
    carried: float = struct.unpack("<f", struct.pack(_FORMATS[kind], int(value)))[0]
    return carried


def from_wire(message: ParameterMessage, encoding: IntegerEncoding) -> float:
    """Return the value that a message carries.

    Raises:
        ValueError: If its type is not known, or an integer is not whole or out of its range.
    """
    try:
        kind = ParameterType(message.param_type)
    except ValueError as error:
        raise ValueError(f"type {message.param_type} of a parameter is not known") from error
    if kind is ParameterType.REAL32:
        return message.param_value
    if encoding is IntegerEncoding.C_CAST:
        value = message.param_value
        low, high = kind.limits
        if not (low <= value <= high and float(value).is_integer()):
            raise ValueError(f"{value:g} is no value of type {kind.name}")
        return int(value)
    carried: int = struct.unpack(_FORMATS[kind], _field(message))[0]
    return carried


def parameter_value(
    message: grace.MAVLink_param_value_message, encoding: IntegerEncoding
) -> ParameterValue:
    """Decode a PARAM_VALUE.

    Raises:
        ValueError: If its content is impossible.
    """
    value = from_wire(message, encoding)
    kind = ParameterType(message.param_type)
    return ParameterValue(message.param_id, value, kind, message.param_index)


def name_octets(name: str) -> bytes:
    """Return a name as it travels."""
    return name.encode("ascii", errors="replace")


def _field(message: ParameterMessage) -> bytes:
    """Return the four bytes of the value as they came: a float in between might change them."""
    frame = message.get_msgbuf()
    if frame:
        return bytes(frame[_PAYLOAD_START : _PAYLOAD_START + 4])
    return struct.pack("<f", message.param_value)
