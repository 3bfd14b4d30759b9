"""Compiled steps of one hypothesis of the filter bank; ``bank`` says when to call which.

A *hypothesis* is ``SIZE`` numbers: the estimate and its packed covariance, the target-velocity
filter, and how far the robot went through the water by dead reckoning. The filters are those of
``filter_kernel``.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.filter import filter_kernel as f

COVARIANCE, VELOCITY, RECKONED = 4, 14, 22
"""Where each part begins; the estimate is first."""
NORTH_RATE, EAST_RATE, RATE_VARIANCE = VELOCITY + 2, VELOCITY + 3, VELOCITY + 6
SPEED_VARIANCE = COVARIANCE + 9
SIZE = 24
PLACE_STEP_S = 0.1
"""Interval for which the settings give the variance of the target's place."""

predict_into, own_into, range_into = f.predict_into, f.own_into, f.range_into
expected_range, velocity_into = f.expected_range, f.velocity_into
R_TARGET = f.R_TARGET
"""Names that numba resolves once, when it compiles."""


@kernel
def pass_time(
    h: FloatArray,
    u1: float,
    u2: float,
    dt: float,
    vt_x: float,
    vt_y: float,
    silence_s: float,
    q: FloatArray,
) -> None:
    """Let ``dt`` pass under one command, in place.

    Args:
        h: Hypothesis, shape ``(SIZE,)``.
        u1: Turn rate, rad/s.
        u2: Acceleration, m/s2.
        dt: Time, s.
        vt_x: Velocity of the target north, m/s, where it is known; NaN: as the filter estimates.
        vt_y: The same, east.
        silence_s: How long ranges have failed; beyond 0 the place grows uncertain as the target's
            velocity is. While ranges come, the position noise stands for that.
        q: From ``filter_kernel.pack_filter``.
    """
    is_known = vt_x == vt_x and vt_y == vt_y
    if not is_known:
        vt_x, vt_y = h[NORTH_RATE], h[EAST_RATE]
    P = h[COVARIANCE:VELOCITY]
    own_x, own_y = predict_into(h[:4], P, u1, u2, dt, vt_x, vt_y, q)
    h[RECKONED] += own_x
    h[RECKONED + 1] += own_y
    if silence_s > 0.0 and not is_known:
        grown = h[RATE_VARIANCE] * dt * (2.0 * silence_s + dt)
        P[0] += grown
        P[4] += grown


@kernel
def hear_own(h: FloatArray, psi: float, v: float, q: FloatArray) -> None:
    """Take in measured heading and speed, in place; one that is not finite is left out."""
    if not (math.isfinite(psi) and math.isfinite(v)):
        return
    own_into(h[:4], h[COVARIANCE:VELOCITY], psi, v, q)


@kernel
def expect(h: FloatArray, q: FloatArray) -> tuple[float, float]:
    """Return the range that a hypothesis expects, m, and the variance of a measured one, m2."""
    return expected_range(h[:4], h[COVARIANCE:VELOCITY], q)


@kernel
def hear_range(h: FloatArray, range_m: float, since_s: float, q: FloatArray) -> None:
    """Take in a range, and then in the velocity filter where it puts the target; in place.

    A series of ranges says the same of the velocity however densely it is taken: the variance of
    a place, set for ``PLACE_STEP_S``, falls as ranges get rarer, but not below the estimate's own:
    while the estimate still moves towards the target, the target does not move.

    Args:
        h: Hypothesis, shape ``(SIZE,)``.
        range_m: Horizontal range.
        since_s: Time since the last range that this hypothesis took in, s; 0 at the first.
        q: From ``filter_kernel.pack_filter``.
    """
    P = h[COVARIANCE:VELOCITY]
    range_into(h[:4], P, range_m, q)
    variance = q[R_TARGET] * min(1.0, PLACE_STEP_S / max(since_s, 1e-9))
    variance = max(variance, P[0] + P[4])
    north, east = h[RECKONED] - h[0], h[RECKONED + 1] - h[1]
    velocity_into(h[VELOCITY:RECKONED], north, east, since_s, variance, q)


@kernel
def apart(one: FloatArray, other: FloatArray) -> float:
    """Return the squared distance of two places over their mean covariance."""
    a = 0.5 * (one[4] + other[4])
    b = 0.5 * (one[5] + other[5])
    d = 0.5 * (one[8] + other[8])
    x, y = one[0] - other[0], one[1] - other[1]
    det = a * d - b * b
    return (d * x * x - 2.0 * b * x * y + a * y * y) / det if det > 0.0 else math.inf


@kernel
def worst_variance(h: FloatArray) -> float:
    """Return the variance of the place along its worst direction, m2."""
    half = 0.5 * (h[4] - h[8])
    return 0.5 * (h[4] + h[8]) + math.sqrt(half * half + h[5] * h[5])


def warm_up() -> None:
    """Compile every kernel of this module."""
    q = f.pack_filter(TrackingConfig())
    h = np.zeros(SIZE)
    h[0] = h[4] = h[8] = h[11] = h[13] = 1.0
    hear_own(h, 0.0, 0.1, q)
    expect(h, q)
    hear_range(h, 1.0, 0.1, q)
    pass_time(h, 0.0, 0.0, 0.1, math.nan, math.nan, 0.0, q)
    apart(h, h)
    worst_variance(h)
