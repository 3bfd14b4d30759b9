"""Compiled steps of the extended Kalman filter and of the target-velocity filter.

``filter`` and ``velocity_filter`` are the readable forms. The covariance of the four states is its
upper triangle by rows, ten numbers; nothing here allocates.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_entry, inlined_kernel, kernel
from autonomy.tracking.config import TrackingConfig

STATES = 4
"""Relative position (north, east), heading, speed."""
TRIANGLE = 10
"""Entries of the packed covariance: 00, 01, 02, 03, 11, 12, 13, 22, 23, 33."""
VELOCITY_SIZE = 8
"""Packed target-velocity filter: north, east, their rates, variance of a place, its covariance with
the rate, variance of a rate (the same for both axes), and 1 once it has begun."""
(
    Q_POSITION,
    Q_HEADING,
    Q_SPEED,
    R_RANGE,
    R_HEADING,
    R_SPEED,
    Q_TARGET,
    R_TARGET,
    START_VELOCITY,
) = range(9)
"""Index of each number in what ``pack_filter`` returns."""
FILTER_SIZE = 9
CLOSEST_M = 1e-6
"""A target estimated nearer than this has no bearing, so a range says nothing of the direction."""
LOG_2PI = math.log(2.0 * math.pi)


def pack_filter(config: TrackingConfig) -> FloatArray:
    """Return densities and variances of the filters, shape ``(FILTER_SIZE,)``."""
    noise = config.filter
    return np.array(
        [
            noise.position_density_m2_s,
            noise.heading_density_rad2_s,
            noise.speed_density_m2_s3,
            config.ranging.variance_m2,
            noise.heading_variance_rad2,
            noise.speed_variance_m2_s2,
            noise.target_acceleration_density,
            noise.target_position_variance_m2,
            noise.target_speed_std_m_s**2,
        ]
    )


@inlined_kernel
def wrapped(angle: float) -> float:
    """Return the same direction in ``[-pi, pi)``."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@inlined_entry
def predict_into(
    x: FloatArray,
    P: FloatArray,
    u1: float,
    u2: float,
    dt: float,
    vt_x: float,
    vt_y: float,
    q: FloatArray,
) -> tuple[float, float]:
    """Let ``dt`` pass under one command, in place, by the midpoint rule (specification 1).

    Args:
        x: Relative position north and east, m, heading, rad, and speed, m/s; shape ``(4,)``.
        P: Its packed covariance, shape ``(10,)``.
        u1: Turn rate, rad/s.
        u2: Acceleration, m/s2.
        dt: Time, s.
        vt_x: Velocity of the target north, m/s.
        vt_y: Velocity of the target east, m/s.
        q: From ``pack_filter``.

    Returns:
        How far the robot itself went through the water, north and east, m.
    """
    psi = x[2] + 0.5 * u1 * dt
    v = x[3] + 0.5 * u2 * dt
    c, s = math.cos(psi), math.sin(psi)
    own_x, own_y = v * c * dt, v * s * dt
    x[0] += own_x - vt_x * dt
    x[1] += own_y - vt_y * dt
    x[2] += u1 * dt
    x[3] += u2 * dt
    f02, f03, f12, f13 = -v * s * dt, c * dt, v * c * dt, s * dt
    # rows 0 and 1 of F P, in the columns of heading and speed
    a2 = P[2] + f02 * P[7] + f03 * P[8]
    a3 = P[3] + f02 * P[8] + f03 * P[9]
    b2 = P[5] + f12 * P[7] + f13 * P[8]
    b3 = P[6] + f12 * P[8] + f13 * P[9]
    P[0] += f02 * (P[2] + a2) + f03 * (P[3] + a3) + q[Q_POSITION] * dt
    P[1] += f02 * P[5] + f03 * P[6] + f12 * a2 + f13 * a3
    P[4] += f12 * (P[5] + b2) + f13 * (P[6] + b3) + q[Q_POSITION] * dt
    P[2], P[3], P[5], P[6] = a2, a3, b2, b3
    P[7] += q[Q_HEADING] * dt
    P[9] += q[Q_SPEED] * dt
    return own_x, own_y


@inlined_kernel
def correct_into(
    x: FloatArray,
    P: FloatArray,
    k0: float,
    k1: float,
    k2: float,
    k3: float,
    s: float,
    innovation: float,
) -> float:
    """Take in one scalar: ``P H'`` is given as ``k0`` to ``k3``, its variance as ``s``."""
    i = 1.0 / s
    x[0] += k0 * i * innovation
    x[1] += k1 * i * innovation
    x[2] += k2 * i * innovation
    x[3] += k3 * i * innovation
    # A first guess that is vague beyond all digits of a range could round a variance below zero.
    P[0] = max(P[0] - k0 * k0 * i, 0.0)
    P[1] -= k0 * k1 * i
    P[2] -= k0 * k2 * i
    P[3] -= k0 * k3 * i
    P[4] = max(P[4] - k1 * k1 * i, 0.0)
    P[5] -= k1 * k2 * i
    P[6] -= k1 * k3 * i
    P[7] = max(P[7] - k2 * k2 * i, 0.0)
    P[8] -= k2 * k3 * i
    P[9] = max(P[9] - k3 * k3 * i, 0.0)
    return -0.5 * (innovation * innovation * i + math.log(s) + LOG_2PI)


@inlined_entry
def own_into(x: FloatArray, P: FloatArray, psi: float, v: float, q: FloatArray) -> float:
    """Take in measured heading and speed, in place; return the log likelihood."""
    likelihood = correct_into(
        x, P, P[2], P[5], P[7], P[8], P[7] + q[R_HEADING], wrapped(psi - x[2])
    )
    return likelihood + correct_into(x, P, P[3], P[6], P[8], P[9], P[9] + q[R_SPEED], v - x[3])


@inlined_entry
def expected_range(x: FloatArray, P: FloatArray, q: FloatArray) -> tuple[float, float]:
    """Return the range that the estimate expects, m, and the variance of a measured one, m2."""
    r = math.sqrt(x[0] * x[0] + x[1] * x[1])
    if r < CLOSEST_M:
        return r, 0.5 * (P[0] + P[4]) + q[R_RANGE]
    hx, hy = x[0] / r, x[1] / r
    along = hx * hx * P[0] + 2.0 * hx * hy * P[1] + hy * hy * P[4]
    return r, max(along, 0.0) + q[R_RANGE]


@inlined_entry
def range_into(x: FloatArray, P: FloatArray, range_m: float, q: FloatArray) -> float:
    """Take in a measured range, in place; return the log likelihood, 0 where it says nothing."""
    r = math.sqrt(x[0] * x[0] + x[1] * x[1])
    if r < CLOSEST_M:
        return 0.0
    hx, hy = x[0] / r, x[1] / r
    k0 = P[0] * hx + P[1] * hy
    k1 = P[1] * hx + P[4] * hy
    k2 = P[2] * hx + P[5] * hy
    k3 = P[3] * hx + P[6] * hy
    s = max(hx * k0 + hy * k1, 0.0) + q[R_RANGE]
    return correct_into(x, P, k0, k1, k2, k3, s, range_m - r)


@inlined_entry
def update_into(
    x: FloatArray,
    P: FloatArray,
    psi: float,
    v: float,
    range_m: float,
    has_range: bool,
    q: FloatArray,
) -> float:
    """Take in heading, speed and then the range if there is one, in place.

    Args:
        x: Estimate, shape ``(4,)``.
        P: Its packed covariance, shape ``(10,)``.
        psi: Measured heading, rad.
        v: Measured speed, m/s.
        range_m: Measured horizontal range; looked at only with ``has_range``.
        has_range: Whether the range is one.
        q: From ``pack_filter``.

    Returns:
        Log likelihood of all that was taken in.
    """
    likelihood = own_into(x, P, psi, v, q)
    if has_range:
        likelihood += range_into(x, P, range_m, q)
    return likelihood


@inlined_entry
def velocity_into(
    k: FloatArray, north_m: float, east_m: float, dt: float, variance_m2: float, q: FloatArray
) -> None:
    """Let ``dt`` pass, then take in where the target seems to be, in place (ETV).

    Args:
        k: Shape ``(VELOCITY_SIZE,)``; zeros before the first call.
        north_m: Dead-reckoned robot minus relative position, north; the origin is arbitrary.
        east_m: The same, east.
        dt: Time since the last call, s.
        variance_m2: Variance of that place, per axis.
        q: From ``pack_filter``.
    """
    if k[7] == 0.0:
        k[0], k[1], k[2], k[3] = north_m, east_m, 0.0, 0.0
        k[4], k[5], k[6], k[7] = variance_m2, 0.0, q[START_VELOCITY], 1.0
        return
    velocity_passes(k, dt, q)
    i = 1.0 / (k[4] + variance_m2)
    north, east = (north_m - k[0]) * i, (east_m - k[1]) * i
    k[0] += k[4] * north
    k[1] += k[4] * east
    k[2] += k[5] * north
    k[3] += k[5] * east
    k[6] -= k[5] * k[5] * i
    k[5] *= variance_m2 * i
    k[4] *= variance_m2 * i


@inlined_kernel
def velocity_passes(k: FloatArray, dt: float, q: FloatArray) -> None:
    """Let ``dt`` pass in the target-velocity filter, in place."""
    k[0] += k[2] * dt
    k[1] += k[3] * dt
    k[4] += dt * (2.0 * k[5] + dt * k[6]) + q[Q_TARGET] * dt * dt * dt / 3.0
    k[5] += dt * k[6] + 0.5 * q[Q_TARGET] * dt * dt
    k[6] += q[Q_TARGET] * dt


@kernel
def predict(
    x: FloatArray,
    P: FloatArray,
    u1: float,
    u2: float,
    dt: float,
    vt_x: float,
    vt_y: float,
    q: FloatArray,
) -> tuple[float, float]:
    """As ``predict_into``, to be called from Python."""
    return predict_into(x, P, u1, u2, dt, vt_x, vt_y, q)


@kernel
def update(
    x: FloatArray,
    P: FloatArray,
    psi: float,
    v: float,
    range_m: float,
    has_range: bool,
    q: FloatArray,
) -> float:
    """As ``update_into``, to be called from Python."""
    return update_into(x, P, psi, v, range_m, has_range, q)


@kernel
def velocity_step(k: FloatArray, north_m: float, east_m: float, dt: float, q: FloatArray) -> None:
    """As ``velocity_into`` with the variance of ``q``, to be called from Python."""
    velocity_into(k, north_m, east_m, dt, q[R_TARGET], q)


def start_covariance(position_variance_m2: float, q: FloatArray) -> FloatArray:
    """Return the packed covariance of a first guess, shape ``(10,)``.

    Heading and speed are as uncertain as one measurement of them (specification 1).
    """
    P = np.zeros(TRIANGLE)
    P[0] = P[4] = position_variance_m2
    P[7], P[9] = q[R_HEADING], q[R_SPEED]
    return P


def full_covariance(P: FloatArray) -> FloatArray:
    """Unpack a covariance, shape ``(4, 4)``."""
    full = np.empty((STATES, STATES))
    full[np.triu_indices(STATES)] = P
    return np.triu(full) + np.triu(full, 1).T


def packed_covariance(full: FloatArray) -> FloatArray:
    """Pack a covariance of shape ``(4, 4)``."""
    return np.ascontiguousarray(full[np.triu_indices(STATES)], dtype=np.float64)


def warm_up() -> None:
    """Compile every kernel of this module."""
    q = pack_filter(TrackingConfig())
    x, P = np.array([1.0, 0.0, 0.0, 0.1]), start_covariance(0.1, q)
    update(x, P, 0.0, 0.1, 1.0, True, q)
    velocity_step(np.zeros(VELOCITY_SIZE), 0.0, 0.0, 0.1, q)
    predict(x, P, 0.0, 0.0, 0.1, 0.0, 0.0, q)
