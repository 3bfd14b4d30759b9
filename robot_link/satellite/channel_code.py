"""What a robot measures, and how it is itself, in few bytes of a record.

Big endian, behind one byte of flags: bit 0 version, 1 page, 2 readings.

    version   u32 of the table of channels (``robot_link.channel_table``)
    page      only with a version: u32 log, varint number of the first measurement for which the
              table holds; u40 since when it holds, 1/100 s since 1970; u8 page, u8 pages, u8 bytes,
              rows without key and unit where they are the delivered ones
    readings  u40 time as above, u8 count; of each u8 number of the channel, and the upper three
              bytes of a float32

Stations that do not know this part refuse the whole record: a robot of such a one leaves it out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

from autonomy.channel import key_on_wire, number_on_wire
from robot_link.channel_table import ChannelPage, TableVersion, rows_of, short_rows
from robot_link.messages import LogId, RobotId
from robot_link.report import Reading
from robot_link.satellite.frame import WireError
from robot_link.satellite.octets import OctetReader, centiseconds, float24, moment, varint

_VERSION, _PAGE, _READINGS = 1, 2, 4
_FLAGS_MAX = 7
_VERSION_BYTES = 4
_TIME_BYTES = 5
_READING_BYTES = 4
_READINGS_HEAD_BYTES = _TIME_BYTES + 1
_READINGS_MAX = 255


@dataclass(frozen=True, slots=True)
class ChannelPart:
    """What a record says of channels; what is not said is absent."""

    version: TableVersion | None = None
    page: ChannelPage | None = None
    """Only with its version."""
    readings: tuple[Reading, ...] = ()
    """Of one moment, those first that matter most."""


def packed_channels(part: ChannelPart, room: int) -> bytes:
    """Return what fits of a part: the version, then the page whole, then the first readings.

    Raises:
        KeyError: If a channel is not declared.
        ValueError: If a number is not finite.
    """
    flags, octets, left = 0, b"", room - 1
    if part.version is not None and left >= _VERSION_BYTES:
        flags |= _VERSION
        octets += part.version.version.to_bytes(_VERSION_BYTES, "big")
        page = b"" if part.page is None else _packed_page(part.page)
        if page and len(octets) + len(page) <= left:
            flags |= _PAGE
            octets += page
    left -= len(octets)
    count = min(_READINGS_MAX, (left - _READINGS_HEAD_BYTES) // _READING_BYTES, len(part.readings))
    if count > 0:
        flags |= _READINGS
        octets += _packed_readings(part.readings[:count])
    return bytes([flags]) + octets if flags else b""


def unpacked_channels(
    reader: OctetReader, robot: RobotId, said_at: datetime, received_at: datetime
) -> ChannelPart:
    """Read a part.

    Args:
        reader: Where it begins.
        robot: Who says it.
        said_at: When the record was said.
        received_at: When the station had it.

    Raises:
        WireError: If it is none.
    """
    flags = reader.take(1)[0]
    if not 0 < flags <= _FLAGS_MAX or (flags & _PAGE and not flags & _VERSION):
        raise WireError(f"flags {flags:#x} of a record's channels are unknown")
    version, page = None, None
    if flags & _VERSION:
        number = int.from_bytes(reader.take(_VERSION_BYTES), "big")
        version = TableVersion(robot, number, said_at, received_at)
        page = _page(reader, version) if flags & _PAGE else None
    readings = _readings(reader, robot, received_at) if flags & _READINGS else ()
    return ChannelPart(version, page, readings)


def _packed_page(page: ChannelPage) -> bytes:
    rows = short_rows(page.rows)
    return b"".join(
        (
            page.log.to_bytes(4, "big"),
            varint(page.sequence),
            centiseconds(page.measured_at).to_bytes(_TIME_BYTES, "big"),
            bytes([page.page, page.pages, len(rows)]),
            rows,
        )
    )


def _page(reader: OctetReader, version: TableVersion) -> ChannelPage:
    log, sequence = int.from_bytes(reader.take(4), "big"), reader.varint()
    since = moment(int.from_bytes(reader.take(_TIME_BYTES), "big"))
    page, pages, length = reader.take(3)
    if page >= pages or not version.version:
        raise WireError("a page of a table of channels cannot be this one")
    try:
        rows = rows_of(reader.take(length))
    except ValueError as error:
        raise WireError(str(error)) from error
    return ChannelPage(
        robot=version.robot,
        version=version.version,
        log=LogId(log),
        sequence=sequence,
        page=page,
        pages=pages,
        rows=rows,
        is_short=True,
        measured_at=since,
        received_at=version.received_at,
    )


def _packed_readings(readings: Sequence[Reading]) -> bytes:
    time = centiseconds(readings[0].measured_at).to_bytes(_TIME_BYTES, "big")
    told = (bytes([number_on_wire(one.channel)]) + float24(one.value) for one in readings)
    return time + bytes([len(readings)]) + b"".join(told)


def _readings(reader: OctetReader, robot: RobotId, received_at: datetime) -> tuple[Reading, ...]:
    at = moment(int.from_bytes(reader.take(_TIME_BYTES), "big"))
    readings: list[Reading] = []
    for _ in range(reader.take(1)[0]):
        number = reader.take(1)[0]
        key, value = key_on_wire(number), reader.float24()
        if key is None:
            raise WireError(f"channel {number} cannot be")
        readings.append(Reading(robot, key, value, at, received_at))
    return tuple(readings)
