"""Compiled attitude of a robot that stands on its head or tail, where Euler angles are singular.

Within a step the attitude is a rotation vector in body axes, the turn since the step began; its
rate is smooth whatever the pitch. Euler angles are worked out of it for the model, which needs only
their sines and cosines.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.vehicle import extended_rates
from autonomy.vehicle import kernel as body

extended_derivative_into = extended_rates.extended_derivative_into
"""A name that numba resolves once, when it compiles."""

Quaternion = tuple[float, float, float, float]
"""Scalar part first; turns body axes into NED."""

_POLE = 1e-6
"""Cosine of pitch below which roll and heading are one angle, and roll is called 0."""


@kernel
def attitude_quaternion(roll: float, pitch: float, heading: float) -> Quaternion:
    """Return the quaternion of an attitude given by Euler angles (heading, pitch, roll)."""
    sf, cf = math.sin(0.5 * roll), math.cos(0.5 * roll)
    st, ct = math.sin(0.5 * pitch), math.cos(0.5 * pitch)
    sp, cp = math.sin(0.5 * heading), math.cos(0.5 * heading)
    return (
        cf * ct * cp + sf * st * sp,
        sf * ct * cp - cf * st * sp,
        cf * st * cp + sf * ct * sp,
        cf * ct * sp - sf * st * cp,
    )


@kernel
def turn_attitude(start: Quaternion, u1: float, u2: float, u3: float) -> tuple[float, float, float]:
    """Return roll, pitch and heading after a turn by a rotation vector in body axes, rad."""
    angle = math.sqrt(u1 * u1 + u2 * u2 + u3 * u3)
    # sin(angle / 2) / angle, and its limit
    k = math.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    dw, dx, dy, dz = math.cos(0.5 * angle), k * u1, k * u2, k * u3
    aw, ax, ay, az = start
    w = aw * dw - ax * dx - ay * dy - az * dz
    x = aw * dx + ax * dw + ay * dz - az * dy
    y = aw * dy - ax * dz + ay * dw + az * dx
    z = aw * dz + ax * dy - ay * dx + az * dw
    north_of_bow = 1.0 - 2.0 * (y * y + z * z)
    east_of_bow = 2.0 * (x * y + w * z)
    level = math.sqrt(north_of_bow * north_of_bow + east_of_bow * east_of_bow)
    pitch = math.atan2(2.0 * (w * y - x * z), level)
    if level < _POLE:
        heading = math.atan2(2.0 * (w * z - x * y), 1.0 - 2.0 * (x * x + z * z))
        return 0.0, pitch, heading
    roll = math.atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    return roll, pitch, math.atan2(east_of_bow, north_of_bow)


@kernel
def steep_derivative_into(
    start: Quaternion,
    x: FloatArray,
    m0_rate: float,
    rp1_rate: float,
    tail_target: float,
    flap_acceleration: float,
    p: FloatArray,
    surroundings: FloatArray,
    out: FloatArray,
    time_s: float,
) -> None:
    """Write the rates of the 15-state model into ``out``, with a turn in place of Euler angles.

    Args:
        start: Attitude at the start of the step.
        x: State, with the rotation vector since then in place of the three Euler angles.
        m0_rate: As the next six in ``extended_derivative_into``.
        rp1_rate: See there.
        tail_target: See there.
        flap_acceleration: See there.
        p: See there.
        surroundings: See there.
        out: See there; the rates of the rotation vector are in place of those of the angles.
        time_s: Time.
    """
    named = x.copy()
    named[3], named[4], named[5] = turn_attitude(start, x[3], x[4], x[5])
    extended_derivative_into(
        named, m0_rate, rp1_rate, tail_target, flap_acceleration, p, surroundings, out, time_s
    )
    u1, u2, u3 = x[3], x[4], x[5]
    w1, w2, w3 = x[9], x[10], x[11]
    # inverse of the exponential map's derivative to second order; the next term is of the fourth
    c1, c2, c3 = u2 * w3 - u3 * w2, u3 * w1 - u1 * w3, u1 * w2 - u2 * w1
    out[3] = w1 + 0.5 * c1 + (u2 * c3 - u3 * c2) / 12.0
    out[4] = w2 + 0.5 * c2 + (u3 * c1 - u1 * c3) / 12.0
    out[5] = w3 + 0.5 * c3 + (u1 * c2 - u2 * c1) / 12.0


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    start = attitude_quaternion(0.0, 0.0, 0.0)
    turn_attitude(start, 0.0, 0.0, 0.0)
    packed, plain = np.ones(body.ENERGY_DELTA + 1), np.zeros(9)
    x, out = np.zeros(15), np.empty(15)
    steep_derivative_into(start, x, 0.0, 0.0, 0.0, 0.0, packed, plain, out, 0.0)
