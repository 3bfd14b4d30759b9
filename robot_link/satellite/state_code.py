"""The robot's state in 33 bytes, and its word on the plan in 15.

State, big endian: u40 time, 1/100 s since 1970; i32 north, i32 east, i24 depth, mm; u24 position
deviation, mm; 3 x i8 velocity, cm/s; 4 x i8 roll, pitch, heading and tail, pi/128; i16 net
buoyancy, 0.1 g; i16 mass position, 0.1 mm; u8 battery, 1/255; u8 battery, 0.2 V; u8 mode, and 128
with a fix. What exceeds its field is shown as the field's end.

Plan: 8 bytes of the hash, zero without a plan; u8 state << 5 | reason; u12 leg, u12 legs; u24
energy used, 1/1000 units. The state's energy is that of the plan, else 0.
"""

import math
import struct
from datetime import datetime

from robot_link.messages import OnboardPlanState, RobotId, RobotMode, StateReport
from robot_link.satellite.content import Reason, ShortPlanReport
from robot_link.satellite.frame import WireError
from robot_link.satellite.octets import centiseconds, moment, signed, unsigned

_STATE = struct.Struct(">5sii3s3s7bhhBBB")
_PLAN = struct.Struct(">8sB3s3s")
STATE_BYTES = _STATE.size
PLAN_BYTES = _PLAN.size
DIGITS = 16
"""Leading digits of a plan's hash that a record carries."""
_ANGLE = 128.0 / math.pi
_HAS_FIX = 128
_BATTERY = 255
_VOLT_STEPS = 5.0
_LEGS_MAX = 2**12 - 1
_REASON_BITS = 5


def packed_state(state: StateReport) -> bytes:
    """Return a state's bytes.

    Raises:
        ValueError: If a number is not finite.
    """
    north, east, down = state.position_ned
    angles = (state.roll_rad, state.pitch_rad, state.heading_rad, state.tail_rad)
    return _STATE.pack(
        centiseconds(state.measured_at).to_bytes(5, "big"),
        signed(north * 1e3, 4),
        signed(east * 1e3, 4),
        signed(down * 1e3, 3).to_bytes(3, "big", signed=True),
        unsigned(state.position_std_m * 1e3, 3).to_bytes(3, "big"),
        *(signed(speed * 1e2, 1) for speed in state.velocity_ned),
        *(signed(angle * _ANGLE, 1) for angle in angles),
        signed(state.net_buoyancy_kg * 1e4, 2),
        signed(state.mass_position_m * 1e4, 2),
        min(_BATTERY, unsigned(state.battery_fraction * _BATTERY, 1)),
        unsigned(state.battery_v * _VOLT_STEPS, 1),
        state.mode | (_HAS_FIX if state.has_fix else 0),
    )


def unpacked_state(
    data: bytes, robot: RobotId, received_at: datetime, energy_used: float
) -> StateReport:
    """Read a state.

    Raises:
        WireError: If its mode is unknown.
    """
    time, north, east, down, std, *rest = _STATE.unpack(data)
    vx, vy, vz, roll, pitch, heading, tail, buoyancy, mass, battery, volts, mode = rest
    try:
        known_mode = RobotMode(mode & ~_HAS_FIX)
    except ValueError as error:
        raise WireError("the mode of a state is unknown") from error
    return StateReport(
        robot=robot,
        measured_at=moment(int.from_bytes(time, "big")),
        received_at=received_at,
        position_ned=(north / 1e3, east / 1e3, int.from_bytes(down, "big", signed=True) / 1e3),
        position_std_m=int.from_bytes(std, "big") / 1e3,
        velocity_ned=(vx / 1e2, vy / 1e2, vz / 1e2),
        roll_rad=roll / _ANGLE,
        pitch_rad=pitch / _ANGLE,
        heading_rad=heading / _ANGLE,
        net_buoyancy_kg=buoyancy / 1e4,
        mass_position_m=mass / 1e4,
        tail_rad=tail / _ANGLE,
        battery_fraction=battery / _BATTERY,
        battery_v=volts / _VOLT_STEPS,
        mode=known_mode,
        has_fix=bool(mode & _HAS_FIX),
        energy_used=energy_used,
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
