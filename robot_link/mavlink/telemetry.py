"""States, samples and plan reports between the dialect's messages and the project's values."""

import math
from collections.abc import Callable, Iterable, Sequence
from datetime import UTC, datetime, timedelta
from operator import attrgetter
from typing import Any

from autonomy.channel import key_on_wire, number_on_wire
from robot_link.mavlink.wire import grace
from robot_link.messages import (
    STATE,
    LogId,
    OnboardPlanState,
    PlanHash,
    PlanQueue,
    PlanReport,
    RobotId,
    RobotMode,
    Sample,
    StateReport,
    SystemId,
)
from robot_link.report_field import ReportField
from robot_link.sample_log import Measurement

ACKNOWLEDGED_AT_ONCE = 256
"""Samples that one acknowledgement can speak of."""

SAMPLE_FRAME_BYTES = 12 + grace.MAVLink_grace_sample_message.unpacker.size
"""Bytes of one sample's frame; its last byte is never zero, so none is ever shorter."""

STATE_FRAME_BYTES = 12 + grace.MAVLink_grace_state_message.unpacker.size
"""Bytes of one state's frame, at most."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND = timedelta(microseconds=1)
_REASON_BYTES = 100
_BY_OWN_CAMERA = 4
"""GRACE_STATE_FLAGS_BY_OWN_CAMERA."""
_WHOLE = {"int16_t": (-(2**15), 2**15 - 1), "uint16_t": (0, 2**16 - 1)}


def _state_field(channel: ReportField) -> tuple[str, float, int, int]:
    """Return a channel's field, its scale and its ends; both are 0 where it is no whole number."""
    wire, dialect = channel.wire, grace.MAVLink_grace_state_message
    if wire is None:
        raise TypeError(f"{channel.key} has no field in the dialect")
    kind = dialect.fieldtypes[dialect.fieldnames.index(wire.field)]
    return wire.field, wire.scale, *_WHOLE.get(kind, (0, 0))


_STATE_FIELDS = tuple(map(_state_field, STATE.channels))
_read_floats: Callable[[object], tuple[float, ...]] = attrgetter(
    *(name for name, _, _, high in _STATE_FIELDS if not high)
)
_read_state = STATE.reader(
    "message",
    (
        f"message.{n}" if scale == 1.0 else f"message.{n} / {scale}"
        for n, scale, *_ in _STATE_FIELDS
    ),
)


def state_message(state: StateReport) -> grace.MAVLink_grace_state_message:
    """Encode a state; what exceeds its field stops at the field's border.

    Raises:
        ValueError: If a number that travels as a whole one is not finite.
    """
    fields: dict[str, Any] = {
        name: _whole(number * scale, low, high) if high else number * scale
        for (name, scale, low, high), number in zip(
            _STATE_FIELDS, STATE.numbers(state), strict=True
        )
    }
    return grace.MAVLink_grace_state_message(
        time_utc_us=microseconds(state.measured_at),
        mode=int(state.mode),
        flags=grace.GRACE_STATE_FLAGS_HAS_FIX * state.has_fix
        | grace.GRACE_STATE_FLAGS_BY_CAMERAS * state.is_by_cameras
        | _BY_OWN_CAMERA * state.is_by_own_camera,
        **fields,
    )


def state_report(
    message: grace.MAVLink_grace_state_message, robot: RobotId, received_at: datetime
) -> StateReport:
    """Decode a state.

    Raises:
        ValueError: If a number is not finite, or the mode or the time is impossible.
    """
    check_finite(_read_floats(message))
    return StateReport(
        robot=robot,
        measured_at=moment(message.time_utc_us),
        received_at=received_at,
        mode=RobotMode(message.mode),
        has_fix=bool(message.flags & grace.GRACE_STATE_FLAGS_HAS_FIX),
        is_by_cameras=bool(message.flags & grace.GRACE_STATE_FLAGS_BY_CAMERAS),
        is_by_own_camera=bool(message.flags & _BY_OWN_CAMERA),
        **_read_state(message),
    )


def _whole(value: float, low: int, high: int) -> int:
    whole = round(value)
    if low <= whole <= high:
        return whole
    return low if whole < low else high


def sample_message(
    log: LogId, sequence: int, measurement: Measurement
) -> grace.MAVLink_grace_sample_message:
    """Encode a sample.

    Raises:
        ValueError: If a number is not finite: the far side could only drop it, again and again.
        KeyError: If no such variable is declared.
    """
    north, east, down = measurement.position_ned
    check_finite((measurement.value, north, east, down, measurement.position_std_m))
    return grace.MAVLink_grace_sample_message(
        time_utc_us=microseconds(measurement.measured_at),
        log=log,
        sequence=sequence,
        x=north,
        y=east,
        z=down,
        position_std=measurement.position_std_m,
        value=measurement.value,
        variable=number_on_wire(measurement.variable),
    )


def sample(
    message: grace.MAVLink_grace_sample_message, robot: RobotId, received_at: datetime
) -> Sample:
    """Decode a sample.

    Raises:
        ValueError: If a number is not finite, the time impossible, or the variable unknown.
    """
    check_finite((message.value, message.x, message.y, message.z, message.position_std))
    key = key_on_wire(message.variable)
    if key is None:
        raise ValueError(f"variable {message.variable} of a sample is not declared")
    return Sample(
        robot=robot,
        log=LogId(message.log),
        sequence=message.sequence,
        variable=key,
        value=message.value,
        position_ned=(message.x, message.y, message.z),
        position_std_m=message.position_std,
        measured_at=moment(message.time_utc_us),
        received_at=received_at,
    )


def acknowledgements(
    system: SystemId, log: LogId, sequences: Iterable[int]
) -> list[grace.MAVLink_grace_sample_ack_message]:
    """Say that these samples are stored, in as few messages as their spread allows."""
    bitmaps: list[tuple[int, bytearray]] = []
    for sequence in sorted(sequences):
        if not bitmaps or sequence - bitmaps[-1][0] >= ACKNOWLEDGED_AT_ONCE:
            bitmaps.append((sequence, bytearray(ACKNOWLEDGED_AT_ONCE // 8)))
        base, bitmap = bitmaps[-1]
        byte, bit = divmod(sequence - base, 8)
        bitmap[byte] |= 1 << bit
    return [
        grace.MAVLink_grace_sample_ack_message(
            log=log, base=base, target_system=system, stored=bitmap
        )
        for base, bitmap in bitmaps
    ]


def acknowledged_sequences(message: grace.MAVLink_grace_sample_ack_message) -> list[int]:
    """Return the samples that an acknowledgement speaks of, ascending."""
    return [
        message.base + 8 * byte + bit
        for byte, octet in enumerate(message.stored)
        for bit in range(8)
        if octet >> bit & 1
    ]


def plan_report_message(
    *,
    measured_at: datetime,
    sha256: PlanHash | None,
    state: OnboardPlanState,
    leg: int = 0,
    legs: int = 0,
    energy_used: float = 0.0,
    reason: str = "",
) -> grace.MAVLink_grace_plan_report_message:
    """Encode what the robot says of a plan; a reason is ASCII on the wire, and cut where long."""
    return grace.MAVLink_grace_plan_report_message(
        time_utc_us=microseconds(measured_at),
        energy_used=energy_used,
        leg=leg,
        legs=legs,
        sha256=hash_octets(sha256),
        state=int(state),
        reason=reason.encode("ascii", errors="replace")[:_REASON_BYTES],
    )


def plan_report(
    message: grace.MAVLink_grace_plan_report_message, robot: RobotId, received_at: datetime
) -> PlanReport:
    """Decode a plan report.

    Raises:
        ValueError: If the energy is not finite, or the state or the time is impossible.
    """
    check_finite((message.energy_used,))
    return PlanReport(
        robot=robot,
        sha256=plan_hash(message.sha256),
        state=OnboardPlanState(message.state),
        leg=message.leg,
        legs=message.legs,
        energy_used=message.energy_used,
        reason=message.reason,
        measured_at=moment(message.time_utc_us),
        received_at=received_at,
    )


def plan_queue_message(queue: PlanQueue) -> grace.MAVLink_grace_plan_queue_message:
    """Encode what the robot says of the plans beside the one on board."""
    return grace.MAVLink_grace_plan_queue_message(
        time_utc_us=microseconds(queue.measured_at),
        sha256=hash_octets(queue.sha256),
        next_sha256=hash_octets(queue.next_sha256),
        last_sha256=hash_octets(queue.last_sha256),
        next_starts=int(queue.next_starts),
        last_done=int(queue.last_done),
    )


def plan_queue(
    message: grace.MAVLink_grace_plan_queue_message, robot: RobotId, received_at: datetime
) -> PlanQueue:
    """Decode what a robot says of the plans beside the one on board.

    Raises:
        ValueError: If a flag or the time is impossible, or one plan has two places.
    """
    if max(message.next_starts, message.last_done) > 1:
        raise ValueError("a flag of a plan queue is 0 or 1")
    sha256, following = plan_hash(message.sha256), plan_hash(message.next_sha256)
    if following is not None and following == sha256:
        raise ValueError("a plan cannot wait behind itself")
    return PlanQueue(
        robot=robot,
        sha256=sha256,
        next_sha256=following,
        next_starts=bool(message.next_starts),
        last_sha256=plan_hash(message.last_sha256),
        last_done=bool(message.last_done),
        measured_at=moment(message.time_utc_us),
        received_at=received_at,
    )


def hash_octets(sha256: PlanHash | None) -> Sequence[int]:
    """Return the 32 octets of a hash; all zero stands for none."""
    return bytes(32) if sha256 is None else bytes.fromhex(sha256)


def plan_hash(octets: Sequence[int]) -> PlanHash | None:
    """Return the hash that 32 octets spell, or None where all are zero."""
    return PlanHash(bytes(octets).hex()) if any(octets) else None


def check_finite(numbers: Iterable[float]) -> None:
    """Refuse what no decoded number may be.

    Raises:
        ValueError: If a number is not finite.
    """
    if not all(map(math.isfinite, numbers)):
        raise ValueError("a number is not finite")


def microseconds(moment: datetime) -> int:
    """Return the microseconds since 1970 by which a wire says a moment."""
    return (moment - _EPOCH) // _MICROSECOND


def moment(microseconds: int) -> datetime:
    """Return the moment of a wire's microseconds since 1970.

    Raises:
        ValueError: If no calendar knows it.
    """
    try:
        return _EPOCH + microseconds * _MICROSECOND
    except OverflowError as error:
        raise ValueError("the time is impossible") from error
