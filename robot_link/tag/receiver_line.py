r"""Real-time lines of a VR2C receiver, ASCII at 9600 baud, each ended by CR LF.

::

    450052,005,2026-07-01 09:30:17,A69-1601,179,#6F
    450052,006,2026-07-01 09:31:02,A69-9002,4711,87,#35
    450052,007,2026-07-01 10:00:00,STS,DC=39,PC=326,LV=12.0,T=8.6,#FE

Serial number, number of the line, the receiver's clock (UTC), what it says, and the 8-bit sum of
all before ``,#`` in hexadecimal. A detection names the code space, the tag within it and, for a tag
with a sensor, its raw value; ``STS`` is the receiver's own condition.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from types import MappingProxyType

BAUD = 9600
LINE_BYTES_MAX = 200
"""A longer line is none."""
_LINE = re.compile(r"(\d{1,9}),(\d{1,4}),([^,]*),(.*)", re.DOTALL)
_CODE = re.compile(r"([A-Z]\d{2,3}-\d{4}),(\d{1,7})(?:,(\d{1,5}))?")
_CLOCK = "%Y-%m-%d %H:%M:%S"
_STATUS = "STS"


class LineFault(StrEnum):
    """Why a line is not believed."""

    SUM = "wrong sum"
    DATE = "wrong date"
    CODE = "unknown code"


class ReceiverLineError(ValueError):
    """A line that is not believed; ``fault`` says why."""

    def __init__(self, fault: LineFault) -> None:
        super().__init__(fault.value)
        self.fault = fault


@dataclass(frozen=True, slots=True)
class HeardLine:
    """A transmission that the receiver understood."""

    receiver: int
    """Serial number."""
    sequence: int
    at: datetime
    """By the receiver's clock."""
    tag: str
    """As the makers of tags write it, such as ``A69-1601-179``."""
    sensor: int | None
    """Raw value of the tag's sensor."""


@dataclass(frozen=True, slots=True)
class StatusLine:
    """What the receiver says of itself."""

    receiver: int
    sequence: int
    at: datetime
    """By the receiver's clock."""
    values: Mapping[str, str]
    """Such as DC, detections; PC, pings; LV, line voltage."""


def read_line(line: bytes) -> HeardLine | StatusLine:
    """Read one line, with or without its end.

    Raises:
        ReceiverLineError: If it is not to be believed.
    """
    body, mark, told = line.strip(b"\r\n").rpartition(b",#")
    if not mark or told.upper() != _sum(body):
        raise ReceiverLineError(LineFault.SUM)
    parts = _LINE.fullmatch(body.decode("ascii", errors="replace"))
    if parts is None:
        raise ReceiverLineError(LineFault.CODE)
    serial, sequence, clock, info = parts.groups()
    try:
        at = datetime.strptime(clock, _CLOCK).replace(tzinfo=UTC)
    except ValueError as error:
        raise ReceiverLineError(LineFault.DATE) from error
    receiver, number = int(serial), int(sequence)
    if info == _STATUS or info.startswith(f"{_STATUS},"):
        pairs = (pair.partition("=") for pair in info.split(",")[1:])
        values = {name: value for name, _, value in pairs}
        return StatusLine(receiver, number, at, MappingProxyType(values))
    code = _CODE.fullmatch(info)
    if code is None:
        raise ReceiverLineError(LineFault.CODE)
    space, tag, sensor = code.groups()
    name = f"{space}-{int(tag)}"
    return HeardLine(receiver, number, at, name, None if sensor is None else int(sensor))


def written_line(line: HeardLine | StatusLine) -> bytes:
    """Return a line as the receiver writes it."""
    if isinstance(line, HeardLine):
        space, _, tag = line.tag.rpartition("-")
        info = f"{space},{tag}" + ("" if line.sensor is None else f",{line.sensor}")
    else:
        info = ",".join((_STATUS, *(f"{name}={value}" for name, value in line.values.items())))
    clock = line.at.strftime(_CLOCK)
    body = f"{line.receiver},{line.sequence:03d},{clock},{info}".encode("ascii")
    return body + b",#" + _sum(body) + b"\r\n"


def _sum(body: bytes) -> bytes:
    return b"%02X" % (sum(body) & 0xFF)
