"""Numbers and times in bytes, and reading them with every failure a ``WireError``."""

import math
import struct
from datetime import UTC, datetime, timedelta

from robot_link.satellite.frame import WireError

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_CENTISECOND = timedelta(milliseconds=10)
_CENTISECONDS_MAX = 2**40 - 1
"""In the year 2318."""
_VARINT_BYTES = 5
_FLOAT_BYTES = 3


def centiseconds(at: datetime) -> int:
    """Return hundredths of a second since 1970, held within 1970..2318: a clock may be wrong."""
    return max(0, min(_CENTISECONDS_MAX, (at - _EPOCH) // _CENTISECOND))


def moment(time: int) -> datetime:
    """Return the moment that ``centiseconds`` says.

    Raises:
        WireError: If there is no such moment.
    """
    try:
        return _EPOCH + time * _CENTISECOND
    except OverflowError as error:
        raise WireError("a time is impossible") from error


def zigzag(number: int) -> int:
    """Fold the sign of a number into its lowest bit."""
    return 2 * number if number >= 0 else -2 * number - 1


def varint(number: int) -> bytes:
    """Return a number that is not negative in groups of seven bits, the lowest first.

    Raises:
        ValueError: If it needs more than five bytes.
    """
    if not 0 <= number < 1 << 7 * _VARINT_BYTES:
        raise ValueError(f"{number} cannot travel")
    octets = bytearray()
    while number > 0x7F:
        octets.append(number & 0x7F | 0x80)
        number >>= 7
    octets.append(number)
    return bytes(octets)


def float24(value: float) -> bytes:
    """Return the upper three bytes of the float32, rounded: exact to 2^-16 of the value.

    Raises:
        ValueError: If the value is not finite, or more than a float32 can say.
    """
    if not math.isfinite(value):
        raise ValueError("a value is not finite")
    try:
        bits = int.from_bytes(struct.pack(">f", value), "big")
        rounded = struct.pack(">I", min((bits & 0x7FFFFFFF) + 0x80, 0x7F7FFFFF) & ~0xFF)
    except OverflowError as error:
        raise ValueError(f"the value {value:g} cannot travel") from error
    return bytes([rounded[0] | (0x80 if bits >> 31 else 0)]) + rounded[1:_FLOAT_BYTES]


def signed(value: float, octets: int) -> int:
    """Return the whole number nearest to a value, within what so many bytes with a sign say.

    Raises:
        ValueError: If the value is not finite.
    """
    most = 2 ** (8 * octets - 1) - 1
    return max(-most, min(most, _whole(value)))


def unsigned(value: float, octets: int) -> int:
    """Return the whole number nearest to a value, within what so many bytes say.

    Raises:
        ValueError: If the value is not finite.
    """
    return max(0, min(2 ** (8 * octets) - 1, _whole(value)))


def _whole(value: float) -> int:
    if not math.isfinite(value):
        raise ValueError("a value is not finite")
    return round(value)


class OctetReader:
    """Takes bytes from the front, never more than there are."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._next = 0

    @property
    def is_at_end(self) -> bool:
        """Whether nothing is left."""
        return self._next == len(self._data)

    def take(self, count: int) -> bytes:
        """Return the next bytes."""
        end = self._next + count
        if end > len(self._data):
            raise WireError("the message ends too early")
        taken = self._data[self._next : end]
        self._next = end
        return taken

    def varint(self) -> int:
        """Return a number of at most five groups of seven bits."""
        number = 0
        for place in range(_VARINT_BYTES):
            octet = self.take(1)[0]
            number |= (octet & 0x7F) << 7 * place
            if octet < 0x80:
                return number
        raise WireError("a number is longer than five bytes")

    def float24(self) -> float:
        """Return a number of ``float24``."""
        (value,) = struct.unpack(">f", self.take(_FLOAT_BYTES) + b"\0")
        if not math.isfinite(value):
            raise WireError("a value is impossible")
        return value

    def signed_varint(self) -> int:
        """Return a number whose sign was folded by ``zigzag``."""
        folded = self.varint()
        return -((folded + 1) // 2) if folded & 1 else folded // 2
