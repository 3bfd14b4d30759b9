"""The parameters of a robot: what can be read and set from outside, with types and limits."""

import math
import struct
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from enum import IntEnum

NAME_BYTES = 16
"""Longest name of a parameter, ASCII."""

_EXPONENT = 0x7F800000
_FRACTION = 0x007FFFFF
_QUIET = 0x00400000


class ParameterType(IntEnum):
    """How a parameter travels; the number is MAVLink's MAV_PARAM_TYPE."""

    UINT8 = 1
    INT8 = 2
    UINT16 = 3
    INT16 = 4
    UINT32 = 5
    INT32 = 6
    REAL32 = 9

    @property
    def is_integer(self) -> bool:
        """Whether its values are whole numbers."""
        return self is not ParameterType.REAL32

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and greatest value that the type holds."""
        if self is ParameterType.REAL32:
            return -3.4028234663852886e38, 3.4028234663852886e38
        bits = {1: 8, 2: 8, 3: 16, 4: 16, 5: 32, 6: 32}[self.value]
        is_signed = self.value % 2 == 0
        return (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if is_signed else (0, 2**bits - 1)

    def survives_bytewise(self, value: float) -> bool:
        """Tell whether a value is the same after its way through MAVLink's float field.

        The bytes of some 32-bit integers are those of a signalling NaN, which processors change.
        """
        if not self.is_integer:
            return True
        bits = int(value) & 0xFFFFFFFF
        is_nan = bits & _EXPONENT == _EXPONENT and bits & _FRACTION != 0
        return not is_nan or bool(bits & _QUIET)


class ParameterRefusal(ValueError):  # noqa: N818 - an answer, as others of this name
    """A value was not taken; the message says which and why."""


class ParameterUnkept(ParameterRefusal):
    """A value was right, but the robot's memory does not take it."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """What is declared of one parameter.

    Raises:
        ValueError: If the name does not fit the wire.
    """

    name: str
    """At most 16 ASCII characters, such as ``GOV_DEPTH_MAX``."""
    type: ParameterType
    default: float
    minimum: float
    maximum: float
    text: str = ""
    """What it means, for an operator."""

    def __post_init__(self) -> None:
        if not (self.name.isascii() and 1 <= len(self.name) <= NAME_BYTES):
            raise ValueError(f"{self.name!r}: a parameter's name has 1..{NAME_BYTES} ASCII letters")


@dataclass(frozen=True, slots=True)
class ParameterValue:
    """A parameter as it was read or written."""

    name: str
    value: float
    """Whole where the type is an integer's."""
    type: ParameterType
    index: int
    """Place in the robot's table, from 0."""

    @property
    def is_integer(self) -> bool:
        """Whether its values are whole numbers."""
        return self.type.is_integer


class ParameterTable:
    """Values that are always of their type and within their limits.

    Args:
        parameters: Declarations; their order is that of the wire.
        values: What is set apart from the defaults, such as after a restart; what is unknown or
            out of range among them is left at its default.
        on_change: Called with name and value after each change; keeps and applies it. Where it
            raises ``OSError``, as of a full disk, it is called again with the value before.

    Raises:
        ValueError: If a name is declared twice or a default breaks its own limits.
    """

    def __init__(
        self,
        parameters: Iterable[Parameter],
        *,
        values: Mapping[str, float] | None = None,
        on_change: Callable[[str, float], None] = lambda _name, _value: None,
    ) -> None:
        self._on_change = on_change
        self._parameters: dict[str, Parameter] = {}
        self._values: dict[str, float] = {}
        for parameter in parameters:
            if parameter.name in self._parameters:
                raise ValueError(f"parameter {parameter.name} is declared twice")
            self._parameters[parameter.name] = parameter
            self._values[parameter.name] = _checked(parameter, parameter.default)
        self._names = tuple(self._parameters)
        self._places = {name: place for place, name in enumerate(self._names)}
        for name, value in (values or {}).items():
            parameter = self._parameters.get(name)
            if parameter is not None and not _refusal(parameter, value):
                self._values[name] = _checked(parameter, value)

    def __len__(self) -> int:
        return len(self._parameters)

    def all(self) -> tuple[ParameterValue, ...]:
        """Return every parameter in order."""
        return tuple(self.read(name) for name in self._parameters)

    def at(self, index: int) -> ParameterValue | None:
        """Return the parameter at a place, None beyond the end."""
        return self.read(self._names[index]) if 0 <= index < len(self._names) else None

    def read(self, name: str) -> ParameterValue:
        """Return one parameter.

        Raises:
            KeyError: If there is none of this name.
        """
        parameter = self._parameters[name]
        return ParameterValue(name, self._values[name], parameter.type, self._places[name])

    def find(self, name: str) -> ParameterValue | None:
        """Return one parameter, None where there is none of this name."""
        return self.read(name) if name in self._parameters else None

    def set(self, name: str, value: float) -> ParameterValue:
        """Change one parameter; return it as it is kept.

        Raises:
            KeyError: If there is none of this name.
            ParameterRefusal: If the value is not of its type or exceeds a limit.
            ParameterUnkept: If it cannot be kept; the one before still holds.
        """
        before, checked = self._values[name], _checked(self._parameters[name], value)
        if checked != before:
            self._values[name] = checked
            try:
                self._on_change(name, checked)
            except OSError as error:
                self._values[name] = before
                with suppress(OSError):
                    self._on_change(name, before)
                raise ParameterUnkept(f"{name}: the robot's memory does not take it") from error
        return self.read(name)


def _refusal(parameter: Parameter, value: float) -> str:
    if not math.isfinite(value):
        return f"{parameter.name} must be a finite number"
    if parameter.type.is_integer and not float(value).is_integer():
        return f"{parameter.name} must be a whole number, not {value:g}"
    low = max(parameter.minimum, parameter.type.limits[0])
    high = min(parameter.maximum, parameter.type.limits[1])
    if not low <= value <= high:
        return f"{parameter.name} must be between {low:g} and {high:g}, not {value:g}"
    if not parameter.type.survives_bytewise(value):
        return f"{parameter.name} cannot be {value:g}: MAVLink cannot carry it"
    return ""


def _checked(parameter: Parameter, value: float) -> float:
    """Return the value as the wire carries it exactly."""
    if refusal := _refusal(parameter, value):
        raise ParameterRefusal(refusal)
    if parameter.type.is_integer:
        return int(value)
    single: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return single
