"""Compiled pursuit law and barrier filter; ``barrier.control`` is the readable form.

``control_step`` is inlined into the loops of other kernels and is called from Python just as well,
with floats: an integer among its arguments would be compiled for anew. Settings are packed by
``pack_control``.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_entry, inlined_kernel

(
    IS_FILTERED,
    IS_SQUARED,
    ALPHA,
    SLOPE,
    EPSILON,
    IS_BEST_EFFORT,
    HEADING_GAIN,
    DISTANCE_GAIN,
    LEAD,
    TURN_MAX,
    ACCELERATION_MIN,
    ACCELERATION_MAX,
    SPEED_MIN,
    SPEED_MAX,
) = range(14)
"""Index of each packed setting."""
SIZE = 14
LINEAR, CUBIC, NEGATIVE, ZERO, ROOT, CONSTANT = range(6)
"""Packed choices of the class-K function."""
UNCHANGED, ACTIVE, INFEASIBLE, BAD_INPUT = range(4)
"""Status of a step, as ``barrier.ControlStatus``."""
LARGEST = 1e9
"""An input beyond this, in its SI unit, is a fault and no measurement."""
SPEED_TIME_S = 1.0
"""The speed comes no closer to a limit than by its distance in this time."""


@inlined_entry
def control_step(
    x_r: float,
    y_r: float,
    psi: float,
    v: float,
    vt_x: float,
    vt_y: float,
    at_x: float,
    at_y: float,
    p: FloatArray,
) -> tuple[float, float, float, float, float, float, int]:
    """Return the command for a relative state, and why it is as it is.

    Args:
        x_r: Relative position (tracker minus target), north, m.
        y_r: East, m.
        psi: Heading, rad.
        v: Speed, m/s.
        vt_x: Target's velocity, north, m/s.
        vt_y: East, m/s.
        at_x: Target's acceleration, north, m/s2; 0 where it is not known.
        at_y: East, m/s2.
        p: Settings as packed by ``pack_control``.

    Returns:
        Turn rate rad/s, acceleration m/s2, the pursuit law's turn rate and acceleration before any
        limit, determinant m2/s, barrier, status. All are 0 but the status for bad input.
    """
    if not (
        abs(x_r) < LARGEST
        and abs(y_r) < LARGEST
        and abs(psi) < LARGEST
        and abs(v) < LARGEST
        and abs(vt_x) < LARGEST
        and abs(vt_y) < LARGEST
        and abs(at_x) < LARGEST
        and abs(at_y) < LARGEST
    ):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, BAD_INPUT
    c, s = math.cos(psi), math.sin(psi)
    n1, n2 = pursuit(x_r, y_r, c, s, p)
    turn = p[TURN_MAX]
    least, most = p[ACCELERATION_MIN], p[ACCELERATION_MAX]
    high = min(most, max(least, (p[SPEED_MAX] - v) / SPEED_TIME_S))
    low = max(least, min(most, (p[SPEED_MIN] - v) / SPEED_TIME_S))
    det = x_r * (v * s - vt_y) - y_r * (v * c - vt_x)
    b = det * det - p[EPSILON] if p[IS_SQUARED] else abs(det) - math.sqrt(p[EPSILON])
    if not p[IS_FILTERED]:
        u1, u2 = min(max(n1, -turn), turn), min(max(n2, low), high)
        return u1, u2, n1, n2, det, b, UNCHANGED
    sign = 1.0 if det >= 0.0 else -1.0
    factor = 2.0 * det if p[IS_SQUARED] else sign
    d1, d2 = v * (x_r * c + y_r * s), x_r * s - y_r * c
    g1, g2 = factor * d1, factor * d2
    least_rise = factor * (x_r * at_y - y_r * at_x) - class_k(b, p[ALPHA], p[SLOPE])
    u1, u2, status = closest(n1, n2, g1, g2, least_rise, -turn, low, turn, high)
    if status == INFEASIBLE and p[IS_BEST_EFFORT]:
        if d1 != 0.0:
            u1 = math.copysign(turn, sign * d1)
        if d2 != 0.0:
            u2 = high if sign * d2 > 0.0 else low
    return u1, u2, n1, n2, det, b, status


@inlined_kernel
def pursuit(x_r: float, y_r: float, c: float, s: float, p: FloatArray) -> tuple[float, float]:
    """Return the pursuit law's turn rate and acceleration; ``c, s`` belong to the heading.

    Heading error and its cosine come from the components along and across the heading.
    """
    x_l, y_l = -x_r - p[LEAD] * c, -y_r - p[LEAD] * s
    along = x_l * c + y_l * s
    across = (x_l * s - y_l * c) + 0.0  # no negative zero: straight behind is +pi
    return -p[HEADING_GAIN] * math.atan2(across, along), p[DISTANCE_GAIN] * along


@inlined_kernel
def class_k(b: float, alpha: float, slope: float) -> float:
    """Return how fast the barrier may fall at the value ``b``."""
    if alpha == LINEAR:
        return slope * b
    if alpha == CUBIC:
        return slope * b * b * b
    if alpha == NEGATIVE:
        return -slope * b
    if alpha == ROOT:
        return slope * math.copysign(math.sqrt(abs(b)), b)
    if alpha == CONSTANT:
        return -slope
    return 0.0


@inlined_entry
def closest(
    n1: float,
    n2: float,
    g1: float,
    g2: float,
    b: float,
    low1: float,
    low2: float,
    high1: float,
    high2: float,
) -> tuple[float, float, int]:
    """Return the point of a box closest to ``n`` with ``g . u >= b``, as ``box_qp.solve``.

    Returns:
        The two components, and UNCHANGED for ``n`` clipped to the box, ACTIVE for a point on the
        constraint, INFEASIBLE for ``n`` clipped where no point of the box meets it.
    """
    u1, u2 = min(max(n1, low1), high1), min(max(n2, low2), high2)
    if g1 * u1 + g2 * u2 >= b:
        return u1, u2, UNCHANGED
    if (g1 * high1 if g1 > 0.0 else g1 * low1) + (g2 * high2 if g2 > 0.0 else g2 * low2) < b:
        return u1, u2, INFEASIBLE
    # On the constraint's line the input with the smaller |g| is free and the other follows, so
    # that nothing is divided by a small number that matters.
    if abs(g1) >= abs(g2):
        u2, u1 = _along(n2, n1, g2, g1, b, low2, high2, low1, high1)
    else:
        u1, u2 = _along(n1, n2, g1, g2, b, low1, high1, low2, high2)
    return u1, u2, ACTIVE


@inlined_kernel
def _along(
    n_free: float,
    n_other: float,
    g_free: float,
    g_other: float,
    b: float,
    low_free: float,
    high_free: float,
    low_other: float,
    high_other: float,
) -> tuple[float, float]:
    slope = g_free / g_other  # within -1 .. 1
    level = b / g_other
    free = (n_free + slope * (level - n_other)) / (1.0 + slope * slope)
    if slope != 0.0:
        one, two = (level - low_other) / slope, (level - high_other) / slope
        free = min(max(free, min(one, two)), max(one, two))
    free = min(max(free, low_free), high_free)
    return free, min(max(level - slope * free, low_other), high_other)


@inlined_entry
def inverse_condition(
    x_r: float, y_r: float, psi: float, v: float, vt_x: float, vt_y: float
) -> float:
    """Return the inverse condition number, as ``observability.inverse_condition``."""
    v_xr, v_yr = v * math.cos(psi) - vt_x, v * math.sin(psi) - vt_y
    position, velocity = x_r * x_r + y_r * y_r, v_xr * v_xr + v_yr * v_yr
    difference, inner = position - velocity, 2.0 * (x_r * v_xr + y_r * v_yr)
    whole = position + velocity + math.sqrt(difference * difference + inner * inner)
    return 2.0 * abs(x_r * v_yr - y_r * v_xr) / whole if whole > 0.0 else 0.0


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    p = np.ones(SIZE)
    control_step(-1.0, 0.5, 0.3, 0.2, 0.0, 0.0, 0.0, 0.0, p)
    inverse_condition(-1.0, 0.5, 0.3, 0.2, 0.0, 0.0)
    closest(0.0, 0.0, 1.0, 1.0, 0.5, -1.0, -1.0, 1.0, 1.0)
