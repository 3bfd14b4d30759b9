"""Compiled laws of the thesis: backstepping and PID.

Gains are packed as the configurations of ``autonomy.control.config`` pack them, references as
``Reference.packed``; vehicles as ``Vehicle.packed``.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, inner_kernel, kernel
from autonomy.vehicle import kernel as vehicle_kernel

K_Z, K_1, K_PSI, K_2, K_XI, K_3, PITCH_TRADE, TAIL_EFFECT_MIN, NEAR, NEAR_OFFSET = range(10)
TAIL_CLIPPED_FIRST = 10
"""Index of each number in packed backstepping gains."""
PID_NEAR, PID_NEAR_OFFSET, PID_ANTI_WINDUP, PID_WINDUP_RECOVERY = range(9, 13)
"""Index in packed PID gains; before them stand P, I, D of depth, pitch and direction."""
HOLD, BACK_CALCULATION = 1, 2
"""Packed choices of anti-windup; 0 is none."""

derivative_into = vehicle_kernel.derivative_into

(
    ERROR_DEPTH,
    ERROR_DEPTH_RATE,
    ERROR_DIRECTION,
    ERROR_DIRECTION_RATE,
    ERROR_HYBRID,
    ERROR_HYBRID_RATE,
    ERROR_DISTANCE,
    ERROR_PITCH,
    ERROR_PITCH_RATE,
    ERROR_ALONG,
    ERROR_ALONG_RATE,
    ERROR_CROSS,
    ERROR_CROSS_RATE,
    ERROR_TRADED,
    MASS_EFFECT,
    SLIDE_EFFECT,
) = range(16)
"""Index of each error, as ``TrackingError`` names them, and of two effects as ``Solution``."""


@inner_kernel
def error_into(
    x: FloatArray,
    r: FloatArray,
    c: float,
    near: float,
    offset: float,
    added_along: float,
    out: FloatArray,
) -> None:
    """Write the tracking errors of a state against a reference into ``out``, shape ``(16,)``."""
    pitch, heading = x[4], x[5]
    w2, w3 = x[10], x[11]
    sp, cp = math.sin(heading), math.cos(heading)
    st, ct = math.sin(pitch), math.cos(pitch)
    turn_rate = w3 / ct
    x_e, y_e = r[0] - x[0], r[1] - x[1]
    along = x_e * cp + y_e * sp
    cross = -x_e * sp + y_e * cp
    along_rate = r[4] * cp + r[5] * sp - (ct * x[6] + st * x[8]) + turn_rate * cross
    cross_rate = -r[4] * sp + r[5] * cp - x[7] - turn_rate * along
    distance = math.sqrt(along * along + cross * cross)
    if distance >= near:
        direction = -math.atan2(cross, along)
        direction_rate = -(along * cross_rate - cross * along_rate) / (distance * distance)
    else:
        right, left = cross + offset, cross - offset
        direction = -0.5 * (math.atan2(right, along) + math.atan2(left, along))
        direction_rate = -0.5 * (
            (along * cross_rate - right * along_rate) / (along * along + right * right)
            + (along * cross_rate - left * along_rate) / (along * along + left * left)
        )
    pitch_error, pitch_error_rate = r[3] - pitch, r[7] - w2
    tanh_pitch, tanh_along = math.tanh(pitch), math.tanh(along + added_along)
    trade_rate = (1.0 - tanh_pitch * tanh_pitch) * w2 * tanh_along
    trade_rate += tanh_pitch * (1.0 - tanh_along * tanh_along) * along_rate
    out[ERROR_DEPTH] = r[2] - x[2]
    out[ERROR_DEPTH_RATE] = r[6] + st * x[6] - ct * x[8]
    out[ERROR_DIRECTION] = direction
    out[ERROR_DIRECTION_RATE] = direction_rate
    out[ERROR_HYBRID] = pitch_error - c * tanh_pitch * tanh_along
    out[ERROR_HYBRID_RATE] = pitch_error_rate - c * trade_rate
    out[ERROR_DISTANCE] = distance
    out[ERROR_PITCH] = pitch_error
    out[ERROR_PITCH_RATE] = pitch_error_rate
    out[ERROR_ALONG] = along
    out[ERROR_ALONG_RATE] = along_rate
    out[ERROR_CROSS] = cross
    out[ERROR_CROSS_RATE] = cross_rate
    out[ERROR_TRADED] = along + added_along


@inner_kernel
def _trade_acceleration(
    x: FloatArray, r: FloatArray, e: FloatArray, drift: FloatArray, turn_drift: float
) -> float:
    """Second derivative of ``tanh(theta) tanh(along)`` without inputs and without ``theta''``."""
    sp, cp = math.sin(x[5]), math.cos(x[5])
    st, ct = math.sin(x[4]), math.cos(x[4])
    w2, turn_rate = x[10], x[11] / ct
    along_acceleration = (
        r[8] * cp
        + r[9] * sp
        + turn_rate * (-r[4] * sp + r[5] * cp)
        - (ct * drift[6] + st * drift[8] + w2 * (ct * x[8] - st * x[6]))
        + turn_drift * e[ERROR_CROSS]
        + turn_rate * e[ERROR_CROSS_RATE]
    )
    along_rate = e[ERROR_ALONG_RATE]
    tanh_pitch, tanh_along = math.tanh(x[4]), math.tanh(e[ERROR_TRADED])
    sech2_pitch = 1.0 - tanh_pitch * tanh_pitch
    sech2_along = 1.0 - tanh_along * tanh_along
    curve = sech2_along * along_acceleration
    curve -= 2.0 * sech2_along * tanh_along * along_rate * along_rate
    return (
        -2.0 * sech2_pitch * tanh_pitch * w2 * w2 * tanh_along
        + 2.0 * sech2_pitch * sech2_along * w2 * along_rate
        + tanh_pitch * curve
    )


@inner_kernel
def _tail_effect(x: FloatArray, p: FloatArray) -> tuple[float, float, float, float, float]:
    """Linear and square effect of the tail along and below, and its yaw acceleration.

    Returns:
        Acceleration along 1 and 3 by tail angle, by its square, and yaw acceleration by angle.
    """
    v1, v2, v3 = x[6], x[7], x[8]
    across = math.sqrt(v1 * v1 + v3 * v3)
    speed = math.sqrt(v1 * v1 + v2 * v2 + v3 * v3)
    if speed == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    ca, sa = (v1 / across, v3 / across) if across > 0.0 else (1.0, 0.0)
    cb, sb = across / speed, v2 / speed
    q = 0.5 * p[vehicle_kernel.WATER_DENSITY] * speed * speed * p[vehicle_kernel.AREA]
    side, drag = q * p[vehicle_kernel.SIDE_DELTA], q * p[vehicle_kernel.DRAG_DELTA]
    m1, m3 = p[vehicle_kernel.MASS_1], p[vehicle_kernel.MASS_3]
    yaw = ca * q * p[vehicle_kernel.YAW_DELTA] / p[vehicle_kernel.INERTIA_3]
    return (
        -ca * sb * side / m1,
        -sa * sb * side / m3,
        -ca * cb * drag / m1,
        -sa * cb * drag / m3,
        yaw,
    )


@inner_kernel
def backstepping_into(
    x: FloatArray,
    r: FloatArray,
    gains: FloatArray,
    p: FloatArray,
    added_along: float,
    e: FloatArray,
    level: FloatArray,
    drift: FloatArray,
    out: FloatArray,
) -> None:
    """Write net mass, sliding mass and tail angle of Eq. 3.19, not yet limited, into ``out``.

    Errors and effects are left in ``e``, shape ``(16,)``; ``level`` and ``drift`` are scratch,
    ``(12,)``.
    """
    c = gains[PITCH_TRADE]
    error_into(x, r, c, gains[NEAR], gains[NEAR_OFFSET], added_along, e)
    for i in range(12):
        level[i] = x[i]
    level[3] = 0.0
    derivative_into(level, 0.0, 0.0, 0.0, p, drift)
    b1, b3, c1, c3, yaw_by_tail = _tail_effect(x, p)
    st, ct = math.sin(x[4]), math.cos(x[4])
    w1, w2, w3 = x[9], x[10], x[11]

    f25 = drift[11] / ct + w3 * w2 * st / (ct * ct)
    f23 = math.copysign(
        max(abs(yaw_by_tail / ct), gains[TAIL_EFFECT_MIN]), p[vehicle_kernel.YAW_DELTA]
    )
    wanted = -f25 - gains[K_2] * e[ERROR_DIRECTION_RATE] - gains[K_PSI] * e[ERROR_DIRECTION]
    tail = wanted / f23 if f23 != 0.0 else 0.0
    stop = p[vehicle_kernel.DELTA_MAX]
    reachable = min(max(tail, -stop), stop) if gains[TAIL_CLIPPED_FIRST] != 0.0 else tail

    g = p[vehicle_kernel.GRAVITY]
    f15 = r[10] + st * (drift[6] + w2 * x[8] - w3 * x[7]) - ct * (drift[8] + w1 * x[7] - w2 * x[6])
    f11 = -g * (st * st / p[vehicle_kernel.MASS_1] + ct * ct / p[vehicle_kernel.MASS_3])
    by_tail = (st * b1 - ct * b3) * reachable + (st * c1 - ct * c3) * reachable * reachable
    wanted = -f15 - gains[K_1] * e[ERROR_DEPTH_RATE] - gains[K_Z] * e[ERROR_DEPTH]
    out[0] = (wanted - by_tail) / f11

    tanh_pitch = math.tanh(x[4])
    slope = 1.0 + c * (1.0 - tanh_pitch * tanh_pitch) * math.tanh(e[ERROR_TRADED])
    f32 = p[vehicle_kernel.SLIDING_MASS] * g / p[vehicle_kernel.INERTIA_2] * ct * slope
    f35 = r[11] - slope * drift[10] - c * _trade_acceleration(x, r, e, drift, f25)
    out[1] = (-f35 - gains[K_3] * e[ERROR_HYBRID_RATE] - gains[K_XI] * e[ERROR_HYBRID]) / f32
    out[2] = tail
    e[MASS_EFFECT] = f11
    e[SLIDE_EFFECT] = f32


@inlined_kernel
def end_stops(i: int, p: FloatArray) -> tuple[float, float]:
    """Lowest and highest set point of net mass (0), sliding mass (1) or tail (2)."""
    if i == 0:
        return p[vehicle_kernel.M0_MIN], p[vehicle_kernel.M0_MAX]
    if i == 1:
        return p[vehicle_kernel.RP1_MIN], p[vehicle_kernel.RP1_MAX]
    return -p[vehicle_kernel.DELTA_MAX], p[vehicle_kernel.DELTA_MAX]


@inner_kernel
def pid_into(
    x: FloatArray,
    r: FloatArray,
    gains: FloatArray,
    p: FloatArray,
    dt_s: float,
    integrals: FloatArray,
    errors: FloatArray,
    out: FloatArray,
) -> None:
    """Write the inputs of the three loops, not yet limited, into ``out``; add to ``integrals``."""
    error_into(x, r, 0.0, gains[PID_NEAR], gains[PID_NEAR_OFFSET], 0.0, errors)
    now = (errors[ERROR_DEPTH], errors[ERROR_PITCH], errors[ERROR_DIRECTION])
    rate = (errors[ERROR_DEPTH_RATE], errors[ERROR_PITCH_RATE], errors[ERROR_DIRECTION_RATE])
    for i in range(3):
        sign = -1.0 if i == 1 else 1.0
        k = 3 * i
        by_integral = sign * gains[k + 1]
        grown = integrals[i] + now[i] * dt_s
        wanted = sign * (gains[k] * now[i] + gains[k + 2] * rate[i]) + by_integral * grown
        low, high = end_stops(i, p)
        cut = wanted - min(max(wanted, low), high)
        if gains[PID_ANTI_WINDUP] == HOLD and cut * by_integral * now[i] > 0.0:
            grown = integrals[i]
            wanted -= by_integral * now[i] * dt_s
        elif gains[PID_ANTI_WINDUP] == BACK_CALCULATION and by_integral != 0.0:
            grown -= min(dt_s / gains[PID_WINDUP_RECOVERY], 1.0) * cut / by_integral
        if not math.isnan(grown):
            integrals[i] = grown
        out[i] = wanted


@kernel
def backstepping(
    state: FloatArray, reference: FloatArray, gains: FloatArray, packed: FloatArray
) -> FloatArray:
    """Return net mass kg, sliding mass m, tail angle rad, not yet limited, shape ``(3,)``."""
    out = np.empty(3)
    e, level, drift = np.empty(16), np.empty(12), np.empty(12)
    backstepping_into(state, reference, gains, packed, 0.0, e, level, drift, out)
    return out


@kernel
def pid(
    state: FloatArray,
    reference: FloatArray,
    gains: FloatArray,
    packed: FloatArray,
    integrals: FloatArray,
    dt_s: float,
) -> FloatArray:
    """Return net mass kg, sliding mass m, tail angle rad, and add to ``integrals`` in place."""
    out = np.empty(3)
    pid_into(state, reference, gains, packed, dt_s, integrals, np.empty(16), out)
    return out


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    state, reference, packed = np.zeros(12), np.zeros(12), np.ones(vehicle_kernel.DELTA_RATE + 1)
    state[6] = 0.1
    backstepping(state, reference, np.ones(11), packed)
    pid(state, reference, np.ones(13), packed, np.zeros(3), 0.1)
