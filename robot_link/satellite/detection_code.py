"""Heard tags in about 12 bytes each: a block for each log and receiver.

    u8   number of detections
    u32  log
    u32  serial number of the receiver
    u40  time of the first, 1/100 s since 1970
    then of each, in the order of their numbers: number less the one before; of all but the first
    the time since the one before, s; the tag; value of its sensor and one, 0 without one; north,
    east and depth from the one before, m; position deviation, m

Numbers are in groups of seven bits as in ``sample_code``. A tag is 0 and its frequency in kHz
(u8), code space (u16) and code, or how many detections before it in the block the same tag was.
Positions are rounded to whole metres, far below the range at which tags are heard.
"""

import re
import struct
from collections.abc import Iterable, Sequence
from datetime import datetime
from itertools import groupby

from robot_link.messages import LogId, RobotId
from robot_link.report import Detection
from robot_link.satellite.frame import WireError
from robot_link.satellite.octets import OctetReader, centiseconds, moment, varint, zigzag
from robot_link.tag.check import checked_detection

_HEADER = struct.Struct(">BII")
_SPACE = struct.Struct(">BBH")
_TIME_BYTES = 5
_COUNT_MAX = 255
_HUNDREDTHS = 100
_SEQUENCE_MAX = 2**32 - 1
_TAG = re.compile(r"([A-Z])(\d{2,3})-(\d{4})-(\d+)")


def packed_detections(detections: Iterable[Detection]) -> bytes:
    """Return the blocks of all detections, and how many there are before them.

    Raises:
        ValueError: If one says what cannot be.
    """
    ordered = sorted(detections, key=lambda one: (*_block(one), one.sequence))
    blocks = [
        block[first : first + _COUNT_MAX]
        for block in (list(group) for _, group in groupby(ordered, _block))
        for first in range(0, len(block), _COUNT_MAX)
    ]
    return bytes([len(blocks)]) + b"".join(map(_packed_block, blocks))


def detections_that_fit(detections: Sequence[Detection], room: int) -> tuple[Detection, ...]:
    """Return the first of a sequence that take at most ``room`` bytes together."""
    fitting: list[Detection] = []
    for detection in detections:
        if len(packed_detections([*fitting, detection])) > room:
            break
        fitting.append(detection)
    return tuple(fitting)


def unpacked_detections(
    reader: OctetReader, robot: RobotId, received_at: datetime
) -> tuple[Detection, ...]:
    """Read blocks.

    Raises:
        WireError: If they are none.
    """
    blocks = reader.take(1)[0]
    return tuple(
        detection for _ in range(blocks) for detection in _block_of(reader, robot, received_at)
    )


def _block(detection: Detection) -> tuple[LogId, int]:
    return detection.log, detection.receiver


def _packed_block(detections: Sequence[Detection]) -> bytes:
    log, receiver = _block(detections[0])
    number, time, place = 0, centiseconds(detections[0].measured_at), (0, 0, 0)
    octets = bytearray(_HEADER.pack(len(detections), log, receiver))
    octets += time.to_bytes(_TIME_BYTES, "big")
    told: list[str] = []
    for detection in detections:
        octets += varint(detection.sequence - number)
        number = detection.sequence
        if told:
            seconds = round((centiseconds(detection.measured_at) - time) / _HUNDREDTHS)
            octets += varint(zigzag(seconds))
            time += seconds * _HUNDREDTHS
        octets += _packed_tag(detection.tag, told)
        told.append(detection.tag)
        octets += varint(0 if detection.sensor is None else detection.sensor + 1)
        north, east, depth = map(round, checked_detection(detection).position_ned)
        for now, before in zip((north, east, depth), place, strict=True):
            octets += varint(zigzag(now - before))
        place = north, east, depth
        octets += varint(round(detection.position_std_m))
    return bytes(octets)


def _packed_tag(tag: str, told: Sequence[str]) -> bytes:
    if tag in told:
        return varint(told[::-1].index(tag) + 1)
    parts = _TAG.fullmatch(tag)
    if parts is None:
        raise ValueError(f"{tag!r} is no tag")
    letter, frequency, space, code = parts.groups()
    return varint(0) + _SPACE.pack(ord(letter), int(frequency), int(space)) + varint(int(code))


def _block_of(reader: OctetReader, robot: RobotId, received_at: datetime) -> Iterable[Detection]:
    count, log, receiver = _HEADER.unpack(reader.take(_HEADER.size))
    if not count:
        raise WireError("a block of detections is empty")
    number, time = 0, int.from_bytes(reader.take(_TIME_BYTES), "big")
    place = [0, 0, 0]
    told: list[str] = []
    for index in range(count):
        number += reader.varint()
        time += reader.signed_varint() * _HUNDREDTHS if index else 0
        told.append(_tag_of(reader, told))
        sensor = reader.varint()
        place = [before + reader.signed_varint() for before in place]
        std_m = reader.varint()
        if number > _SEQUENCE_MAX:
            raise WireError("the number of a detection is impossible")
        north, east, down = map(float, place)
        try:
            yield checked_detection(
                Detection(
                    robot=robot,
                    log=LogId(log),
                    sequence=number,
                    receiver=receiver,
                    tag=told[-1],
                    sensor=sensor - 1 if sensor else None,
                    position_ned=(north, east, down),
                    position_std_m=float(std_m),
                    measured_at=moment(time),
                    received_at=received_at,
                )
            )
        except ValueError as error:
            raise WireError(str(error)) from error


def _tag_of(reader: OctetReader, told: Sequence[str]) -> str:
    back = reader.varint()
    if back:
        if back > len(told):
            raise WireError("a detection names a tag that was not told")
        return told[-back]
    letter, frequency, space = _SPACE.unpack(reader.take(_SPACE.size))
    return f"{chr(letter)}{frequency:02d}-{space:04d}-{reader.varint()}"
