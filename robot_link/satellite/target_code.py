"""What a robot knows of its target, in 27 to 86 bytes; it goes with a state, whose time it has.

Big endian: u8 phase; u8 flags: bit 0 estimate, 1 range, 2 truth, 3 barrier on, 4 feasible, 5 quiet,
6 a second estimate, 7 motion; u8 inverse condition, 1/255; float24 (``octets.float24``)
determinant, barrier, turn rate and acceleration of the pursuit law, turn rate and acceleration of
the command; u24 ranges heard, u24 not believed. Then what the flags say::

    estimate  i32 north, i32 east, mm; i16 velocity north, i16 east, mm/s; float24 variance north,
              covariance, variance east; u8 probability, 1/255
    second    the same of the less likely hypothesis; only with an estimate
    range     u24 mm; u16 age, 0.1 s
    truth     i32 north, i32 east, mm
    motion    u8: bits 0 and 1 speed class, 2 too fast; u8 delay of ranges, 1/50 s

The second hypothesis takes 22 bytes, and travels only where a record has room for it. What exceeds
its field is shown as the field's end.
"""

import struct
from collections.abc import Sequence

from autonomy.tracking.phase import SpeedClass
from robot_link.messages import StateReport
from robot_link.report import TargetEstimate, TargetReport
from robot_link.satellite.frame import WireError
from robot_link.satellite.octets import OctetReader, float24, signed, unsigned
from robot_link.target_check import MOST_HYPOTHESES, checked_target, target_phase

_HEAD = struct.Struct(">BBB")
_PLACE = struct.Struct(">ii")
_VELOCITY = struct.Struct(">hh")
_ESTIMATE, _RANGE, _TRUTH, _BARRIER, _FEASIBLE, _QUIET, _SECOND, _MOTION = (
    1 << bit for bit in range(8)
)
_CLASS_BITS, _TOO_FAST = 3, 4
_DELAY_SCALE = 50.0
_SHARE = 255
_COUNT_BYTES = 3
_RANGE_BYTES = 3
_AGE_BYTES = 2


def packed_target(report: TargetReport, room: int) -> bytes:
    """Return a report's bytes, none where there is no room for it.

    Args:
        report: What to say; of two hypotheses the likeliest alone where both are too much.
        room: How many bytes it may take.

    Raises:
        ValueError: If a number is not finite.
    """
    for count in range(MOST_HYPOTHESES, 0, -1):
        octets = _packed(report, report.hypotheses[:count])
        if len(octets) <= room:
            return octets
    return b""


def _packed(report: TargetReport, hypotheses: Sequence[TargetEstimate]) -> bytes:
    flags = (
        _ESTIMATE * bool(hypotheses)
        | _SECOND * (len(hypotheses) == MOST_HYPOTHESES)
        | _RANGE * (report.range_m is not None)
        | _TRUTH * (report.true_ne_m is not None)
        | _BARRIER * report.is_barrier_on
        | _FEASIBLE * report.is_feasible
        | _QUIET * report.is_quiet
        | _MOTION * (report.speed_class is not None)
    )
    octets = _HEAD.pack(report.phase, flags, unsigned(report.inverse_condition * _SHARE, 1))
    floats = (report.determinant_m2_s, report.barrier, *report.nominal, *report.command)
    octets += b"".join(map(float24, floats))
    for count in (report.ranges_heard, report.ranges_rejected):
        octets += unsigned(count, _COUNT_BYTES).to_bytes(_COUNT_BYTES, "big")
    octets += b"".join(map(_packed_estimate, hypotheses))
    if report.range_m is not None:
        octets += unsigned(report.range_m * 1e3, _RANGE_BYTES).to_bytes(_RANGE_BYTES, "big")
        octets += unsigned(report.range_age_s * 10.0, _AGE_BYTES).to_bytes(_AGE_BYTES, "big")
    if report.true_ne_m is not None:
        octets += _packed_place(report.true_ne_m)
    if report.speed_class is not None:
        motion = report.speed_class | _TOO_FAST * report.is_too_fast
        octets += bytes([motion, unsigned((report.delay_s or 0.0) * _DELAY_SCALE, 1)])
    return octets


def unpacked_target(reader: OctetReader, state: StateReport) -> TargetReport:
    """Read a report.

    Args:
        reader: Where it begins.
        state: The state that it goes with, which has its time and the robot's place.

    Raises:
        WireError: If it is none.
    """
    phase, flags, condition = _HEAD.unpack(reader.take(_HEAD.size))
    numbers = [reader.float24() for _ in range(6)]
    heard, rejected = (int.from_bytes(reader.take(_COUNT_BYTES), "big") for _ in range(2))
    if flags & _SECOND and not flags & _ESTIMATE:
        raise WireError("a track has a second estimate and no first")
    hypotheses = tuple(_estimate(reader) for flag in (_ESTIMATE, _SECOND) if flags & flag)
    range_m, age_s = _range(reader) if flags & _RANGE else (None, 0.0)
    true_ne_m = _place(reader) if flags & _TRUTH else None
    motion, late = reader.take(2) if flags & _MOTION else (0, 0)
    if motion > (_CLASS_BITS | _TOO_FAST):
        raise WireError(f"motion {motion:#x} of a track is unknown")
    try:
        return checked_target(
            TargetReport(
                robot=state.robot,
                measured_at=state.measured_at,
                received_at=state.received_at,
                phase=target_phase(phase),
                position_ne_m=state.position_ned[:2],
                hypotheses=hypotheses,
                range_m=range_m,
                range_age_s=age_s,
                ranges_heard=heard,
                ranges_rejected=rejected,
                determinant_m2_s=numbers[0],
                barrier=numbers[1],
                inverse_condition=condition / _SHARE,
                nominal=(numbers[2], numbers[3]),
                command=(numbers[4], numbers[5]),
                is_barrier_on=bool(flags & _BARRIER),
                is_feasible=bool(flags & _FEASIBLE),
                is_quiet=bool(flags & _QUIET),
                true_ne_m=true_ne_m,
                is_too_fast=bool(motion & _TOO_FAST),
                speed_class=SpeedClass(motion & _CLASS_BITS) if flags & _MOTION else None,
                delay_s=late / _DELAY_SCALE if flags & _MOTION else None,
            )
        )
    except ValueError as error:
        raise WireError(str(error)) from error


def _packed_estimate(one: TargetEstimate) -> bytes:
    return (
        _packed_place(one.position_ne_m)
        + _VELOCITY.pack(*(signed(speed * 1e3, 2) for speed in one.velocity_ne_m_s))
        + b"".join(map(float24, one.covariance_m2))
        + bytes([unsigned(one.weight * _SHARE, 1)])
    )


def _estimate(reader: OctetReader) -> TargetEstimate:
    place = _place(reader)
    north_mm_s, east_mm_s = _VELOCITY.unpack(reader.take(_VELOCITY.size))
    covariance = (reader.float24(), reader.float24(), reader.float24())
    weight = reader.take(1)[0] / _SHARE
    return TargetEstimate(place, (north_mm_s / 1e3, east_mm_s / 1e3), covariance, weight)


def _packed_place(place_ne_m: tuple[float, float]) -> bytes:
    return _PLACE.pack(*(signed(one * 1e3, 4) for one in place_ne_m))


def _place(reader: OctetReader) -> tuple[float, float]:
    north_mm, east_mm = _PLACE.unpack(reader.take(_PLACE.size))
    return north_mm / 1e3, east_mm / 1e3


def _range(reader: OctetReader) -> tuple[float, float]:
    millimetres = int.from_bytes(reader.take(_RANGE_BYTES), "big")
    tenths = int.from_bytes(reader.take(_AGE_BYTES), "big")
    return millimetres / 1e3, tenths / 10.0
