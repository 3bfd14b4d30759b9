"""Values of several channels in one frame: GRACE_SAMPLES and GRACE_HEALTH."""

import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from typing import Protocol

from autonomy.channel import key_on_wire, number_on_wire
from robot_link.mavlink.telemetry import check_finite, microseconds, moment
from robot_link.mavlink.wire import grace
from robot_link.messages import LogId, RobotId, Sample
from robot_link.report import Reading
from robot_link.sample_log import Measurement

_VALUE = struct.Struct("<Bf")
_OCTETS = 180
AT_ONCE = _OCTETS // _VALUE.size
"""Values that one frame can carry."""
_HEAD_BYTES = 12 + grace.MAVLink_grace_samples_message.unpacker.size - _OCTETS
"""Bytes of a frame of samples beside their values."""
HEALTH_FRAME_BYTES = 12 + grace.MAVLink_grace_health_message.unpacker.size
"""Bytes of one health report's frame, at most; what is not used of it is not sent."""


def at_once(payload_bytes: int) -> int:
    """Return how many values a frame can carry that must fit into so many bytes."""
    return max(0, min(AT_ONCE, (payload_bytes - _HEAD_BYTES) // _VALUE.size))


class _Values(Protocol):
    count: int
    values: Sequence[int]


def samples_message(
    log: LogId, first: int, measurements: Sequence[Measurement]
) -> grace.MAVLink_grace_samples_message:
    """Encode measurements of one place and time whose numbers follow one another.

    Raises:
        ValueError: If a number is not finite, or they are more than a frame can carry.
        KeyError: If a channel is not declared.
    """
    north, east, down = measurements[0].position_ned
    position_std = measurements[0].position_std_m
    check_finite((north, east, down, position_std))
    return grace.MAVLink_grace_samples_message(
        time_utc_us=microseconds(measurements[0].measured_at),
        log=log,
        sequence=first,
        x=north,
        y=east,
        z=down,
        position_std=position_std,
        count=len(measurements),
        values=_packed([(one.variable, one.value) for one in measurements]),
    )


def samples(
    message: grace.MAVLink_grace_samples_message, robot: RobotId, received_at: datetime
) -> tuple[Sample, ...]:
    """Decode measurements.

    Raises:
        ValueError: If a number is not finite, the time or the count impossible, or a channel's
            number unknown.
    """
    check_finite((message.x, message.y, message.z, message.position_std))
    measured_at = moment(message.time_utc_us)
    return tuple(
        Sample(
            robot=robot,
            log=LogId(message.log),
            sequence=message.sequence + place,
            variable=key,
            value=value,
            position_ned=(message.x, message.y, message.z),
            position_std_m=message.position_std,
            measured_at=measured_at,
            received_at=received_at,
        )
        for place, (key, value) in enumerate(_unpacked(message))
    )


def health_message(
    values: Mapping[str, float], measured_at: datetime
) -> grace.MAVLink_grace_health_message:
    """Encode readings by the keys of their channels; a value that is not finite is left out.

    Raises:
        ValueError: If they are more than a frame can carry.
        KeyError: If a channel is not declared.
    """
    told = [(key, value) for key, value in values.items() if math.isfinite(value)]
    return grace.MAVLink_grace_health_message(
        time_utc_us=microseconds(measured_at), count=len(told), values=_packed(told)
    )


def readings(
    message: grace.MAVLink_grace_health_message, robot: RobotId, received_at: datetime
) -> tuple[Reading, ...]:
    """Decode readings.

    Raises:
        ValueError: As ``samples``.
    """
    measured_at = moment(message.time_utc_us)
    return tuple(
        Reading(robot, key, value, measured_at, received_at) for key, value in _unpacked(message)
    )


def _packed(values: Sequence[tuple[str, float]]) -> bytes:
    if len(values) > AT_ONCE:
        raise ValueError(f"a frame carries {AT_ONCE} values, not {len(values)}")
    check_finite(value for _, value in values)
    octets = b"".join(_VALUE.pack(number_on_wire(key), value) for key, value in values)
    return octets.ljust(_OCTETS, b"\0")


def _unpacked(message: _Values) -> Iterable[tuple[str, float]]:
    if not 0 < message.count <= AT_ONCE:
        raise ValueError(f"a frame cannot carry {message.count} values")
    octets = bytes(message.values[: message.count * _VALUE.size])
    told: list[tuple[str, float]] = []
    for number, value in _VALUE.iter_unpack(octets):
        key = key_on_wire(number)
        if key is None:
            raise ValueError(f"channel {number} is not declared")
        told.append((key, value))
    check_finite(value for _, value in told)
    return told
