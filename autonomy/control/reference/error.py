"""Tracking errors: depth, direction to the target, and the hybrid of pitch and distance."""

import math
from dataclasses import dataclass

from autonomy.arrays import FloatArray
from autonomy.control.trajectory import Reference


@dataclass(frozen=True, slots=True)
class TrackingError:
    """Errors of a vehicle against its reference, and their rates; angles rad, lengths m.

    The horizontal error is given in the heading's frame: ``along`` ahead, ``cross`` to starboard.
    """

    depth: float
    depth_rate: float
    direction: float
    """Heading minus direction to the target (psi_e)."""
    direction_rate: float
    hybrid: float
    """Pitch error less the pitch that wins back distance (xi, Eq. 3.8)."""
    hybrid_rate: float
    distance: float
    """Horizontal distance to the target (rho_e)."""
    pitch: float
    pitch_rate: float
    along: float
    along_rate: float
    traded: float
    """Distance ahead that the hybrid error wins back: ``along`` and what is added to it."""
    cross: float
    cross_rate: float


def tracking_error(
    state: FloatArray,
    reference: Reference,
    *,
    pitch_trade_rad: float,
    near_m: float,
    near_offset_m: float,
    added_along_m: float = 0.0,
) -> TrackingError:
    """Compare a state with a reference; roll is taken as 0.

    Args:
        state: The 12 states or their estimate, shape ``(12,)``.
        reference: Where the vehicle should be.
        pitch_trade_rad: ``c`` of the hybrid error.
        near_m: Below this distance the direction is averaged over two points (epsilon_0).
        near_offset_m: How far the two points lie beside the target (l).
        added_along_m: Constant that the hybrid error adds to the distance ahead.

    Source:
        Thesis section 3.2.1 and 3.3; the average is taken in the heading's frame, where it does
        not wrap.
    """
    pitch, heading = state[4], state[5]
    v1, v2, v3 = state[6:9]
    w2, w3 = state[10], state[11]
    sp, cp = math.sin(heading), math.cos(heading)
    st, ct = math.sin(pitch), math.cos(pitch)
    turn_rate = w3 / ct
    x_e = reference.position_ned[0] - state[0]
    y_e = reference.position_ned[1] - state[1]
    vx, vy, vz = reference.velocity_ned
    along = x_e * cp + y_e * sp
    cross = -x_e * sp + y_e * cp
    along_rate = vx * cp + vy * sp - (ct * v1 + st * v3) + turn_rate * cross
    cross_rate = -vx * sp + vy * cp - v2 - turn_rate * along
    distance = math.hypot(along, cross)
    offsets = (0.0,) if distance >= near_m else (near_offset_m, -near_offset_m)
    direction, direction_rate = _direction(along, along_rate, cross, cross_rate, offsets)
    pitch_error = reference.pitch_rad - pitch
    pitch_error_rate = reference.pitch_rate_rad_s - w2
    near_level, near_target = math.tanh(pitch), math.tanh(along + added_along_m)
    trade_rate = (1.0 - near_level**2) * w2 * near_target + near_level * (
        1.0 - near_target**2
    ) * along_rate
    return TrackingError(
        depth=reference.position_ned[2] - state[2],
        depth_rate=vz + st * v1 - ct * v3,
        direction=direction,
        direction_rate=direction_rate,
        hybrid=pitch_error - pitch_trade_rad * near_level * near_target,
        hybrid_rate=pitch_error_rate - pitch_trade_rad * trade_rate,
        distance=distance,
        pitch=pitch_error,
        pitch_rate=pitch_error_rate,
        along=along,
        along_rate=along_rate,
        traded=along + added_along_m,
        cross=cross,
        cross_rate=cross_rate,
    )


def _direction(
    along: float, along_rate: float, cross: float, cross_rate: float, offsets: tuple[float, ...]
) -> tuple[float, float]:
    """Average heading minus direction over points so far beside the target; rad and rad/s."""
    direction = direction_rate = 0.0
    share = 1.0 / len(offsets)
    for offset in offsets:
        b = cross + offset
        direction -= share * math.atan2(b, along)
        direction_rate -= share * (along * cross_rate - b * along_rate) / (along**2 + b**2)
    return direction, direction_rate
