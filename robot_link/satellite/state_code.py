"""The robot's state in 33 bytes, and its word on the plan in 15.

State, big endian: u40 time, 1/100 s since 1970; the channels of a state with their octets, such as
i32 north, i32 east, i24 depth, mm; u8 mode, and 128 with a fix. What exceeds its octets is shown as
their end.

Plan: 8 bytes of the hash, zero without a plan; u8 state << 5 | reason; u12 leg, u12 legs; u24
energy used, 1/1000 units. The state's energy is that of the plan, else 0.
"""

import struct
from datetime import datetime
from itertools import accumulate, pairwise

from robot_link.messages import STATE, OnboardPlanState, RobotId, RobotMode, StateReport
from robot_link.satellite.content import Reason, ShortPlanReport
from robot_link.satellite.frame import WireError
from robot_link.satellite.octets import OctetReader, centiseconds, moment, signed, unsigned

_TIME_BYTES = 5
_OCTETS = tuple(
    sorted(
        (
            (index, channel.octets)
            for index, channel in enumerate(STATE.channels)
            if channel.octets is not None
        ),
        key=lambda pair: pair[1].place,
    )
)
"""Index in ``STATE.channels`` and form, in the order of the record."""
_STARTS = tuple(accumulate((octets.count for _, octets in _OCTETS), initial=_TIME_BYTES))
_WRITTEN = {
    index: f"int.from_bytes(data[{start}:{end}], 'big', signed={octets.signed}) / {octets.scale}"
    for (index, octets), (start, end) in zip(_OCTETS, pairwise(_STARTS), strict=True)
}
_read_state = STATE.reader(
    "data, energy_used", (_WRITTEN.get(i, "energy_used") for i in range(len(STATE.channels)))
)
STATE_BYTES = _STARTS[-1] + 1
_PLAN = struct.Struct(">8sB3s3s")
PLAN_BYTES = _PLAN.size
DIGITS = 16
"""Leading digits of a plan's hash that a record carries."""
_HAS_FIX = 128
_LEGS_MAX = 2**12 - 1
_REASON_BITS = 5


def packed_state(state: StateReport) -> bytes:
    """Return a state's bytes.

    Raises:
        ValueError: If a number is not finite.
    """
    parts = [centiseconds(state.measured_at).to_bytes(_TIME_BYTES, "big")]
    numbers = STATE.numbers(state)
    for index, octets in _OCTETS:
        whole = (signed if octets.signed else unsigned)(numbers[index] * octets.scale, octets.count)
        parts.append(whole.to_bytes(octets.count, "big", signed=octets.signed))
    parts.append(bytes([state.mode | (_HAS_FIX if state.has_fix else 0)]))
    return b"".join(parts)


def unpacked_state(
    data: bytes, robot: RobotId, received_at: datetime, energy_used: float
) -> StateReport:
    """Read a state.

    Raises:
        WireError: If its mode is unknown.
    """
    data = OctetReader(data).take(STATE_BYTES)
    mode = data[-1]
    try:
        known_mode = RobotMode(mode & ~_HAS_FIX)
    except ValueError as error:
        raise WireError("the mode of a state is unknown") from error
    return StateReport(
        robot=robot,
        measured_at=moment(int.from_bytes(data[:_TIME_BYTES], "big")),
        received_at=received_at,
        mode=known_mode,
        has_fix=bool(mode & _HAS_FIX),
        **_read_state(data, energy_used),
    )


def packed_plan(plan: ShortPlanReport) -> bytes:
    """Return the bytes of the robot's word on its plan.

    Raises:
        ValueError: If the digits are none, or the energy is not finite.
    """
    if len(plan.digits) not in (0, DIGITS):
        raise ValueError(f"a plan is named by {DIGITS} digits, not {len(plan.digits)}")
    legs = min(plan.leg, _LEGS_MAX) << 12 | min(plan.legs, _LEGS_MAX)
    return _PLAN.pack(
        bytes.fromhex(plan.digits or "0" * DIGITS),
        plan.state << _REASON_BITS | plan.reason,
        legs.to_bytes(3, "big"),
        unsigned(plan.energy_used * 1e3, 3).to_bytes(3, "big"),
    )


def unpacked_plan(data: bytes) -> ShortPlanReport:
    """Read the robot's word on its plan.

    Raises:
        WireError: If state or reason is unknown.
    """
    digits, word, legs, energy = _PLAN.unpack(data)
    try:
        state = OnboardPlanState(word >> _REASON_BITS)
    except ValueError as error:
        raise WireError("the state of a plan is unknown") from error
    leg, count = divmod(int.from_bytes(legs, "big"), 1 << 12)
    return ShortPlanReport(
        digits=digits.hex() if any(digits) else "",
        state=state,
        leg=leg,
        legs=count,
        energy_used=int.from_bytes(energy, "big") / 1e3,
        reason=reason_of(word),
    )


def reason_of(word: int) -> Reason:
    """Return the reason in the low five bits; one that is not known here is OTHER."""
    code = word & (1 << _REASON_BITS) - 1
    return Reason(code) if code in tuple(Reason) else Reason.OTHER
