"""Samples in few bytes: each as its difference to the one before it.

Samples of one log and variable make a block:

    u8   number of the variable
    u32  log
    u8   bit length of the unit of positions: the unit is 2^n mm
    u8   number of samples
    u40  time of the first, 1/100 s since 1970 by the robot's clock
    then of each, in the order of their numbers: number less the one before; of all but the first
    the time since the one before, 1/10 s; north, east, depth from the one before, in units;
    position deviation, mm; value, the upper three bytes of a float32

Numbers are in groups of seven bits, lowest first, those with a sign folded (0, -1, 1, -2, ..).
The unit is fine beside the smallest deviation of the block: at most a sixteenth of it.
"""

import math
import struct
from collections.abc import Iterable, Sequence
from datetime import datetime
from itertools import groupby

from autonomy.channel import key_on_wire, number_on_wire
from robot_link.messages import LogId, RobotId, Sample
from robot_link.satellite.frame import WireError
from robot_link.satellite.octets import OctetReader, centiseconds, float24, moment, varint, zigzag

_HEADER = struct.Struct(">BIBB")
_UNIT_SHARE = 16.0
_UNIT_MAX = 12
_COUNT_MAX = 255
_TENTHS = 10
_SEQUENCE_MAX = 2**32 - 1
_STD_MAX_MM = 2**24 - 1


def packed_samples(samples: Iterable[Sample]) -> bytes:
    """Return the blocks of all samples.

    Raises:
        ValueError: If a number is not finite or out of the wire's range.
        KeyError: If no such variable is declared.
    """
    ordered = sorted(samples, key=lambda one: (*_block(one), one.sequence))
    blocks = (list(block) for _, block in groupby(ordered, _block))
    return b"".join(
        _packed_block(block[first : first + _COUNT_MAX])
        for block in blocks
        for first in range(0, len(block), _COUNT_MAX)
    )


def can_travel(sample: Sample) -> bool:
    """Tell whether a record can say a sample; a sensor that fails may say what is no number."""
    try:
        packed_samples([sample])
    except (ValueError, KeyError):
        return False
    return True


def most_that_fit(samples: Sequence[Sample], room: int) -> tuple[Sample, ...]:
    """Return the first samples of a sequence that take at most ``room`` bytes together."""
    fitting: list[Sample] = []
    for sample in samples:
        if len(packed_samples([*fitting, sample])) > room:
            break
        fitting.append(sample)
    return tuple(fitting)


def unpacked_samples(
    reader: OctetReader, robot: RobotId, received_at: datetime
) -> tuple[Sample, ...]:
    """Read blocks up to the end.

    Raises:
        WireError: If they are none.
    """
    samples: list[Sample] = []
    while not reader.is_at_end:
        samples += _unpacked_block(reader, robot, received_at)
    return tuple(samples)


def _block(sample: Sample) -> tuple[LogId, int]:
    return sample.log, number_on_wire(sample.variable)


def _packed_block(samples: Sequence[Sample]) -> bytes:
    log, variable = _block(samples[0])
    unit = _unit_of(min(sample.position_std_m for sample in samples))
    number, time = 0, centiseconds(samples[0].measured_at)
    place = (0, 0, 0)
    octets = bytearray(_HEADER.pack(variable, log, unit, len(samples)))
    octets += time.to_bytes(5, "big")
    for index, sample in enumerate(samples):
        octets += varint(sample.sequence - number)
        number = sample.sequence
        if index:
            tenths = round((centiseconds(sample.measured_at) - time) / _TENTHS)
            octets += varint(zigzag(tenths))
            time += tenths * _TENTHS
        here = _in_units(sample, unit)
        for now, before in zip(here, place, strict=True):
            octets += varint(zigzag(now - before))
        place = here
        octets += varint(_std_mm(sample)) + _value(sample)
    return bytes(octets)


def _unpacked_block(reader: OctetReader, robot: RobotId, received_at: datetime) -> list[Sample]:
    variable, log, unit, count = _HEADER.unpack(reader.take(_HEADER.size))
    key = key_on_wire(variable)
    if key is None or unit > _UNIT_MAX or not count:
        raise WireError("the head of a block of samples is none")
    number, time = 0, int.from_bytes(reader.take(5), "big")
    place = [0, 0, 0]
    samples: list[Sample] = []
    for index in range(count):
        number += reader.varint()
        time += reader.signed_varint() * _TENTHS if index else 0
        place = [before + reader.signed_varint() for before in place]
        north, east, down = ((one << unit) / 1e3 for one in place)
        std_m = reader.varint() / 1e3
        value = reader.float24()
        if number > _SEQUENCE_MAX:
            raise WireError("the number of a sample is impossible")
        samples.append(
            Sample(
                robot=robot,
                log=LogId(log),
                sequence=number,
                variable=key,
                value=value,
                position_ned=(north, east, down),
                position_std_m=std_m,
                measured_at=moment(time),
                received_at=received_at,
            )
        )
    return samples


def _unit_of(std_m: float) -> int:
    fine_mm = max(1.0, std_m * 1e3 / _UNIT_SHARE)
    return min(_UNIT_MAX, int(math.log2(fine_mm)))


def _in_units(sample: Sample, unit: int) -> tuple[int, int, int]:
    if not all(math.isfinite(one) for one in sample.position_ned):
        raise ValueError("the position of a sample is not finite")
    north, east, down = (round(one * 1e3 / (1 << unit)) for one in sample.position_ned)
    return north, east, down


def _std_mm(sample: Sample) -> int:
    if not math.isfinite(sample.position_std_m) or sample.position_std_m < 0.0:
        raise ValueError("the position deviation of a sample is no number")
    return min(_STD_MAX_MM, round(sample.position_std_m * 1e3))


def _value(sample: Sample) -> bytes:
    try:
        return float24(sample.value)
    except ValueError as error:
        raise ValueError(f"the value of a sample: {error}") from error
