"""Compiled cost of a predictive controller and its gradient, forwards and backwards.

The readable cost is ``predictive.predictive.cost``. What a pass forwards leaves on the
tape is read by the pass backwards, which differentiates it by hand; no pass allocates.
"""

import math
from typing import TypeAlias

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, kernel
from autonomy.tracking.filter.filter_kernel import CLOSEST_M

NONE, TRACE, DETERMINANT, CONDITION = range(4)
"""Number of each objective in the packed settings: O0 .. O3 of thesis section 4.4.2."""

OBJECTIVE, WEIGHT, STEP, STEPS, ITERATIONS = range(5)
TURN_MIDDLE, TURN_HALF, ACCELERATION_MIDDLE, ACCELERATION_HALF = range(5, 9)
POSITION_DENSITY, HEADING_DENSITY, SPEED_DENSITY = range(9, 12)
RANGE_VARIANCE, HEADING_VARIANCE, SPEED_VARIANCE, SPEED_MIN, SPEED_MAX = range(12, 17)
SETTINGS_SIZE = 17
"""Length and places of the packed settings."""

SMOOTHING = 1e-6
"""Added to the squared determinant under O3, which would be infinite at zero (m4/s2)."""

Tape: TypeAlias = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""States ``(steps + 1, 4)``; mid-step values and gains ``(steps, 17)``; covariances before each
prediction and before each range ``(steps + 1, 2, 4, 4)``; a covariance's slope ``(4, 4)``."""

_SINE, _COSINE, _MIDDLE_SPEED, _RANGE, _IS_NEAR = range(5)
_HEADING_GAIN, _SPEED_GAIN, _RANGE_GAIN, _MIDDLE_SIZE = 5, 9, 13, 17


def empty_tape(steps: int) -> Tape:
    """Return the room that a pass over so many steps needs."""
    return (
        np.zeros((steps + 1, 4)),
        np.zeros((steps, _MIDDLE_SIZE)),
        np.zeros((steps + 1, 2, 4, 4)),
        np.zeros((4, 4)),
    )


@kernel
def cost_forward(plan: FloatArray, vt_x: float, vt_y: float, p: FloatArray, tape: Tape) -> float:
    """Return the cost of a plan from the state and covariance that begin the tape.

    Args:
        plan: Turn rate and acceleration of each step in turn, scaled to -1 .. 1, ``(2 steps,)``.
        vt_x: Target's velocity north, m/s; it counts in O2 and O3 only.
        vt_y: Its velocity east, m/s.
        p: Packed settings, ``(SETTINGS_SIZE,)``.
        tape: Its first state and first covariance are read, everything else is written.

    Returns:
        The cost of Eq. (4.23) as a sum over the steps.
    """
    states, middles, covariances, _ = tape
    objective, dt = int(p[OBJECTIVE]), p[STEP]
    near, far = p[WEIGHT] * dt, (1.0 - p[WEIGHT]) * dt
    total = 0.0
    for k in range(int(p[STEPS])):
        u1 = p[TURN_MIDDLE] + p[TURN_HALF] * plan[2 * k]
        u2 = p[ACCELERATION_MIDDLE] + p[ACCELERATION_HALF] * plan[2 * k + 1]
        before, after, middle = states[k], states[k + 1], middles[k]
        psi_m, v_m = before[2] + 0.5 * dt * u1, before[3] + 0.5 * dt * u2
        sine, cosine = math.sin(psi_m), math.cos(psi_m)
        middle[_SINE], middle[_COSINE], middle[_MIDDLE_SPEED] = sine, cosine, v_m
        x, y = before[0] + v_m * cosine * dt, before[1] + v_m * sine * dt
        after[0], after[1] = x, y
        after[2], after[3] = before[2] + u1 * dt, before[3] + u2 * dt
        total += near * (x * x + y * y)
        if objective == TRACE:
            _predict_covariance(covariances[k, 0], covariances[k, 1], middle, p)
            _hear(covariances[k, 1], covariances[k + 1, 0], x, y, middle, p)
            posterior = covariances[k + 1, 0]
            total += far * (posterior[0, 0] + posterior[1, 1] + posterior[2, 2] + posterior[3, 3])
        elif objective != NONE:
            vr_x = after[3] * math.cos(after[2]) - vt_x
            vr_y = after[3] * math.sin(after[2]) - vt_y
            determinant = x * vr_y - y * vr_x
            if objective == DETERMINANT:
                total -= far * determinant * determinant
            else:
                total += far * _condition(x, y, vr_x, vr_y, determinant)
    return total


@kernel
def gradient_backward(
    vt_x: float, vt_y: float, p: FloatArray, tape: Tape, gradient: FloatArray
) -> None:
    """Write the gradient of the plan that ``cost_forward`` left on the tape.

    Args:
        vt_x: Target's velocity north, m/s.
        vt_y: Its velocity east, m/s.
        p: Packed settings.
        tape: As ``cost_forward`` left it; only the slope is written.
        gradient: By the scaled inputs, ``(2 steps,)``; written.
    """
    states, middles, covariances, slope = tape
    objective, dt = int(p[OBJECTIVE]), p[STEP]
    near, far = p[WEIGHT] * dt, (1.0 - p[WEIGHT]) * dt
    to_x, to_y, to_psi, to_v = 0.0, 0.0, 0.0, 0.0
    slope[:] = 0.0
    for k in range(int(p[STEPS]) - 1, -1, -1):
        middle = middles[k]
        x, y, psi, v = states[k + 1, 0], states[k + 1, 1], states[k + 1, 2], states[k + 1, 3]
        to_x += 2.0 * near * x
        to_y += 2.0 * near * y
        sine, cosine, v_m = middle[_SINE], middle[_COSINE], middle[_MIDDLE_SPEED]
        by_02, by_03, by_12, by_13 = 0.0, 0.0, 0.0, 0.0
        if objective == TRACE:
            for i in range(4):
                slope[i, i] += far
            of_x, of_y = _unhear(covariances[k, 1], slope, x, y, middle)
            to_x, to_y = to_x + of_x, to_y + of_y
            by_02, by_03, by_12, by_13 = _unpredict(covariances[k, 0], slope, middle, dt)
        elif objective != NONE:
            of_x, of_y, of_psi, of_v = _observability_slope(
                x, y, psi, v, vt_x, vt_y, objective == CONDITION
            )
            to_x, to_y = to_x + far * of_x, to_y + far * of_y
            to_psi, to_v = to_psi + far * of_psi, to_v + far * of_v
        by_speed = dt * (to_x * cosine + to_y * sine - sine * by_02 + cosine * by_12)
        by_heading = dt * (
            v_m * (to_y * cosine - to_x * sine - cosine * by_02 - sine * by_12)
            - sine * by_03
            + cosine * by_13
        )
        gradient[2 * k] = p[TURN_HALF] * dt * (to_psi + 0.5 * by_heading)
        gradient[2 * k + 1] = p[ACCELERATION_HALF] * dt * (to_v + 0.5 * by_speed)
        to_psi += by_heading
        to_v += by_speed


@inlined_kernel
def _condition(x: float, y: float, vr_x: float, vr_y: float, determinant: float) -> float:
    """Return the condition number of O_p; a determinant of 0 gives a large number."""
    placed, moved = x * x + y * y, vr_x * vr_x + vr_y * vr_y
    # s^2 - 4 D^2, written so that it cannot round below zero.
    root = math.hypot(placed - moved, 2.0 * (x * vr_x + y * vr_y))
    return (placed + moved + root) / (2.0 * math.sqrt(determinant * determinant + SMOOTHING))


@inlined_kernel
def _observability_slope(
    x: float, y: float, psi: float, v: float, vt_x: float, vt_y: float, is_condition: bool
) -> tuple[float, float, float, float]:
    """Return the slope of O2 or O3 by the four states."""
    sine, cosine = math.sin(psi), math.cos(psi)
    vr_x, vr_y = v * cosine - vt_x, v * sine - vt_y
    determinant = x * vr_y - y * vr_x
    if not is_condition:
        factor = -2.0 * determinant
        by_x, by_y, by_vx, by_vy = factor * vr_y, -factor * vr_x, -factor * y, factor * x
    else:
        difference = x * x + y * y - vr_x * vr_x - vr_y * vr_y
        along = 2.0 * (x * vr_x + y * vr_y)
        root = max(math.hypot(difference, along), 1e-150)
        sum_ = x * x + y * y + vr_x * vr_x + vr_y * vr_y
        square = determinant * determinant + SMOOTHING
        over = 1.0 / math.sqrt(square)
        a, b = difference / root, along / root
        c = 0.5 * (sum_ + root) * over * determinant / square
        by_x = over * (x + a * x + b * vr_x) - c * vr_y
        by_y = over * (y + a * y + b * vr_y) + c * vr_x
        by_vx = over * (vr_x - a * vr_x + b * x) + c * y
        by_vy = over * (vr_y - a * vr_y + b * y) - c * x
    return by_x, by_y, v * (by_vy * cosine - by_vx * sine), by_vx * cosine + by_vy * sine


@inlined_kernel
def _predict_covariance(
    before: FloatArray, after: FloatArray, middle: FloatArray, p: FloatArray
) -> None:
    """Write ``F P F^T + Q dt`` of the filter's mid-step prediction."""
    dt = p[STEP]
    sine, cosine, v_m = middle[_SINE], middle[_COSINE], middle[_MIDDLE_SPEED]
    f02, f03, f12, f13 = -v_m * sine * dt, cosine * dt, v_m * cosine * dt, sine * dt
    for j in range(4):
        after[0, j] = before[0, j] + f02 * before[2, j] + f03 * before[3, j]
        after[1, j] = before[1, j] + f12 * before[2, j] + f13 * before[3, j]
        after[2, j] = before[2, j]
        after[3, j] = before[3, j]
    for i in range(4):
        after[i, 0] += f02 * after[i, 2] + f03 * after[i, 3]
        after[i, 1] += f12 * after[i, 2] + f13 * after[i, 3]
    after[0, 0] += p[POSITION_DENSITY] * dt
    after[1, 1] += p[POSITION_DENSITY] * dt
    after[2, 2] += p[HEADING_DENSITY] * dt
    after[3, 3] += p[SPEED_DENSITY] * dt


@inlined_kernel
def _unpredict(
    before: FloatArray, slope: FloatArray, middle: FloatArray, dt: float
) -> tuple[float, float, float, float]:
    """Take a covariance's slope back through the prediction; return the slope by F's entries."""
    sine, cosine, v_m = middle[_SINE], middle[_COSINE], middle[_MIDDLE_SPEED]
    f02, f03, f12, f13 = -v_m * sine * dt, cosine * dt, v_m * cosine * dt, sine * dt
    # Columns 2 and 3 of F P.
    a0 = before[0, 2] + f02 * before[2, 2] + f03 * before[3, 2]
    a1 = before[1, 2] + f12 * before[2, 2] + f13 * before[3, 2]
    b0 = before[0, 3] + f02 * before[2, 3] + f03 * before[3, 3]
    b1 = before[1, 3] + f12 * before[2, 3] + f13 * before[3, 3]
    a2, a3, b2, b3 = before[2, 2], before[3, 2], before[2, 3], before[3, 3]
    g0, g1 = slope[0], slope[1]
    by_02 = 2.0 * (g0[0] * a0 + g0[1] * a1 + g0[2] * a2 + g0[3] * a3)
    by_03 = 2.0 * (g0[0] * b0 + g0[1] * b1 + g0[2] * b2 + g0[3] * b3)
    by_12 = 2.0 * (g1[0] * a0 + g1[1] * a1 + g1[2] * a2 + g1[3] * a3)
    by_13 = 2.0 * (g1[0] * b0 + g1[1] * b1 + g1[2] * b2 + g1[3] * b3)
    for i in range(4):
        slope[i, 2] += f02 * slope[i, 0] + f12 * slope[i, 1]
        slope[i, 3] += f03 * slope[i, 0] + f13 * slope[i, 1]
    for j in range(4):
        slope[2, j] += f02 * slope[0, j] + f12 * slope[1, j]
        slope[3, j] += f03 * slope[0, j] + f13 * slope[1, j]
    return by_02, by_03, by_12, by_13


@inlined_kernel
def _hear(
    prior: FloatArray, posterior: FloatArray, x: float, y: float, middle: FloatArray, p: FloatArray
) -> None:
    """Update a covariance by heading, speed and range; ``prior`` ends as before the range."""
    _hear_state(prior, 2, p[HEADING_VARIANCE], middle[_HEADING_GAIN : _HEADING_GAIN + 4])
    _hear_state(prior, 3, p[SPEED_VARIANCE], middle[_SPEED_GAIN : _SPEED_GAIN + 4])
    distance = math.sqrt(x * x + y * y)
    gain = middle[_RANGE_GAIN : _RANGE_GAIN + 4]
    middle[_RANGE] = distance
    middle[_IS_NEAR] = 1.0 if distance < CLOSEST_M else 0.0
    if distance < CLOSEST_M:
        posterior[:] = prior
        return
    h_x, h_y = x / distance, y / distance
    for i in range(4):
        gain[i] = prior[i, 0] * h_x + prior[i, 1] * h_y
    innovation = max(h_x * gain[0] + h_y * gain[1], 0.0) + p[RANGE_VARIANCE]
    for i in range(4):
        for j in range(4):
            posterior[i, j] = prior[i, j] - gain[i] * gain[j] / innovation
    for i in range(4):
        gain[i] /= innovation


@inlined_kernel
def _hear_state(covariance: FloatArray, i: int, variance: float, gain: FloatArray) -> None:
    """Update a covariance in place by a measurement of one state."""
    innovation = max(covariance[i, i], 0.0) + variance
    for j in range(4):
        gain[j] = covariance[j, i] / innovation
    row_0, row_1, row_2, row_3 = (
        covariance[i, 0],
        covariance[i, 1],
        covariance[i, 2],
        covariance[i, 3],
    )
    for j in range(4):
        covariance[j, 0] -= gain[j] * row_0
        covariance[j, 1] -= gain[j] * row_1
        covariance[j, 2] -= gain[j] * row_2
        covariance[j, 3] -= gain[j] * row_3


@inlined_kernel
def _unhear(
    prior: FloatArray, slope: FloatArray, x: float, y: float, middle: FloatArray
) -> tuple[float, float]:
    """Take a covariance's slope back through the three updates; return the slope by x and y.

    With the gain K and the row h of a measurement, the slope G becomes
    ``(I - K h)^T G (I - K h)``; the range's h depends on the position, and its slope is
    ``2 (K^T G K) w - 2 P G K`` with ``w = P h``.
    """
    by_x, by_y = 0.0, 0.0
    if middle[_IS_NEAR] == 0.0:
        distance = middle[_RANGE]
        h_x, h_y = x / distance, y / distance
        gain = middle[_RANGE_GAIN : _RANGE_GAIN + 4]
        k0, k1, k2, k3 = gain[0], gain[1], gain[2], gain[3]
        q0 = slope[0, 0] * k0 + slope[0, 1] * k1 + slope[0, 2] * k2 + slope[0, 3] * k3
        q1 = slope[1, 0] * k0 + slope[1, 1] * k1 + slope[1, 2] * k2 + slope[1, 3] * k3
        q2 = slope[2, 0] * k0 + slope[2, 1] * k1 + slope[2, 2] * k2 + slope[2, 3] * k3
        q3 = slope[3, 0] * k0 + slope[3, 1] * k1 + slope[3, 2] * k2 + slope[3, 3] * k3
        both = k0 * q0 + k1 * q1 + k2 * q2 + k3 * q3
        a, b = prior[0], prior[1]
        by_hx = 2.0 * (both * (a[0] * h_x + a[1] * h_y))
        by_hx -= 2.0 * (a[0] * q0 + a[1] * q1 + a[2] * q2 + a[3] * q3)
        by_hy = 2.0 * (both * (b[0] * h_x + b[1] * h_y))
        by_hy -= 2.0 * (b[0] * q0 + b[1] * q1 + b[2] * q2 + b[3] * q3)
        across = (by_hx * h_y - by_hy * h_x) / distance
        by_x, by_y = across * h_y, -across * h_x
        slope[0, 0] += both * h_x * h_x - 2.0 * q0 * h_x
        slope[1, 1] += both * h_y * h_y - 2.0 * q1 * h_y
        between = both * h_x * h_y - q0 * h_y - q1 * h_x
        slope[0, 1] += between
        slope[1, 0] += between
        slope[0, 2], slope[0, 3] = slope[0, 2] - h_x * q2, slope[0, 3] - h_x * q3
        slope[1, 2], slope[1, 3] = slope[1, 2] - h_y * q2, slope[1, 3] - h_y * q3
        for j in range(2):
            slope[2, j] = slope[j, 2]
            slope[3, j] = slope[j, 3]
    _unhear_state(slope, 3, middle[_SPEED_GAIN : _SPEED_GAIN + 4])
    _unhear_state(slope, 2, middle[_HEADING_GAIN : _HEADING_GAIN + 4])
    return by_x, by_y


@inlined_kernel
def _unhear_state(slope: FloatArray, i: int, gain: FloatArray) -> None:
    """Take a covariance's slope back through the measurement of one state."""
    k0, k1, k2, k3 = gain[0], gain[1], gain[2], gain[3]
    q0 = slope[0, 0] * k0 + slope[0, 1] * k1 + slope[0, 2] * k2 + slope[0, 3] * k3
    q1 = slope[1, 0] * k0 + slope[1, 1] * k1 + slope[1, 2] * k2 + slope[1, 3] * k3
    q2 = slope[2, 0] * k0 + slope[2, 1] * k1 + slope[2, 2] * k2 + slope[2, 3] * k3
    q3 = slope[3, 0] * k0 + slope[3, 1] * k1 + slope[3, 2] * k2 + slope[3, 3] * k3
    both = k0 * q0 + k1 * q1 + k2 * q2 + k3 * q3
    own = slope[i, i]
    slope[i, 0] -= q0
    slope[i, 1] -= q1
    slope[i, 2] -= q2
    slope[i, 3] -= q3
    slope[i, i] = own + both - 2.0 * (own - slope[i, i])
    for j in range(4):
        slope[j, i] = slope[i, j]


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    tape = empty_tape(1)
    tape[0][0, 0] = 1.0
    p, plan = np.ones(SETTINGS_SIZE), np.zeros(2)
    for objective in (NONE, TRACE):
        p[OBJECTIVE] = objective
        cost_forward(plan, 0.0, 0.0, p, tape)
        gradient_backward(0.0, 0.0, p, tape, np.zeros(2))
