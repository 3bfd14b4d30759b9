"""Compiled steps of the filter on the vehicle's model.

The covariance is kept as a lower triangular factor ``S`` with ``P = S S'``: it cannot lose symmetry
or become negative. The states that the vehicle's equations bend come first, so only the first eight
columns of the factor need probes of the model; the others move linearly, exactly.

The vehicle's coefficients are wrong by an unknown share. It is a state for drag, side force and
lift, so that its errors grow with the dynamic pressure and last from one step to the next, as those
of a wrong model do; white noise would be forgotten where they are not.

Source:
    Norgaard, Poulsen and Ravn, "New developments in state estimation for nonlinear systems",
    Automatica 36 (2000): the second-order divided-difference filter, an unscented filter whose
    weights of the covariance are all positive. Carlson's triangular square-root update,
    AIAA Journal 11 (1973).
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.estimation.kernel import LOST, REFUSED, judge
from autonomy.vehicle import kernel as body
from autonomy.vehicle.extended_kernel import advance_into

# fmt: off
(
    DEPTH, FORWARD, STARBOARD, DOWN, BIAS, DRAG, SIDE, LIFT, NORTH, EAST,
    STEADY_NORTH, STEADY_EAST, EDDY_NORTH, EDDY_EAST,
) = range(14)
# fmt: on
"""Index of each state: depth m, velocity through the water in body axes m/s, what the feedback of
the net buoyancy says too much kg, share by which the model's drag, side force and lift are too
small, position m, and the two parts of the current m/s."""

STATES = 14
BENT = 8
"""So many states come first that the vehicle's equations bend."""

# fmt: off
(
    ACCELERATION, RATE_NOISE, HEADING_STD, TILT_STD, ATTITUDE_CORRELATION,
    STEADY_STD, STEADY_CORRELATION, EDDY_STD, EDDY_CORRELATION, BIAS_STD, BIAS_CORRELATION,
    MODEL_STD, MODEL_CORRELATION,
) = range(13)
# fmt: on
"""Index of each number of the process noise."""

Scratch = tuple[FloatArray, FloatArray, FloatArray]
"""Room for a Runge-Kutta step of the 15 states, each ``(15,)``."""

_SPREAD = math.sqrt(3.0)
"""Distance of the probes in standard deviations, best for Gaussian states."""
_CURVATURE = math.sqrt(_SPREAD**2 - 1.0) / (2.0 * _SPREAD**2)


@kernel
def triangular(rows: FloatArray) -> FloatArray:
    """Return lower triangular ``S`` with ``S S' = rows' rows``, by Householder reflections.

    Args:
        rows: Columns of the covariance's factor, one a row, shape ``(m, n)``, ``m >= n``; is used
            up.
    """
    m, n = rows.shape
    S = np.zeros((n, n))
    for j in range(n):
        norm = 0.0
        for i in range(j, m):
            norm += rows[i, j] * rows[i, j]
        norm = math.sqrt(norm)
        if norm > 0.0:
            pivot = -math.copysign(norm, rows[j, j])
            head = rows[j, j] - pivot
            scale = -1.0 / (pivot * head)
            rows[j, j] = head
            for k in range(j + 1, n):
                dot = 0.0
                for i in range(j, m):
                    dot += rows[i, j] * rows[i, k]
                dot *= scale
                for i in range(j, m):
                    rows[i, k] -= dot * rows[i, j]
            rows[j, j] = pivot
        sign = -1.0 if rows[j, j] < 0.0 else 1.0
        for k in range(j, n):
            S[k, j] = sign * rows[j, k]
    return S


@inner_kernel
def swim_into(
    probe: FloatArray,
    start: FloatArray,
    command: FloatArray,
    time_s: float,
    packed: FloatArray,
    water: FloatArray,
    dt_s: float,
    steps: int,
    x: FloatArray,
    order: FloatArray,
    p: FloatArray,
    scratch: Scratch,
) -> None:
    """Write the 15 states that one probe has after a time into ``x``.

    ``start`` has what the sensors say of the 15 states; the probe has the rest. A rudder with more
    effect has less slip against it here: it is their ratio that turns the way aside. ``order`` and
    ``p`` take what command and vehicle become.
    """
    x[:] = start
    order[:] = command
    p[: packed.shape[0]] = packed
    x[2] = probe[DEPTH]
    for i in range(3):
        x[6 + i] = probe[FORWARD + i]
    x[12] -= probe[BIAS]
    order[0], order[1] = x[12], x[13]
    for i in range(body.DRAG_0, body.DRAG_DELTA + 1):
        p[i] *= 1.0 + probe[DRAG]
    p[body.SIDE_BETA] *= 1.0 - probe[SIDE]
    p[body.SIDE_DELTA] *= 1.0 + probe[SIDE]
    for i in range(body.LIFT_0, body.LIFT_ALPHA + 1):
        p[i] *= 1.0 + probe[LIFT]
    advance_into(
        x, order, p, water, time_s, dt_s / steps, steps, scratch[0], scratch[1], scratch[2]
    )


@inner_kernel
def swim(
    probe: FloatArray,
    start: FloatArray,
    command: FloatArray,
    time_s: float,
    packed: FloatArray,
    water: FloatArray,
    dt_s: float,
    steps: int,
) -> FloatArray:
    """Depth, velocity in body axes, and way made north and east of one probe, shape ``(6,)``."""
    x, order, p = np.empty(15), np.empty(5), np.empty(packed.shape[0])
    scratch = np.empty(15), np.empty(15), np.empty(15)
    swim_into(probe, start, command, time_s, packed, water, dt_s, steps, x, order, p, scratch)
    out = np.empty(6)
    out[0] = x[2]
    out[1:4] = x[6:9]
    out[4:6] = x[0:2]
    return out


@inner_kernel
def carry(column: FloatArray, dt_s: float, kept: FloatArray, out: FloatArray) -> None:
    """Carry what moves linearly on: position by current; currents, bias and shares by their memory.

    Args:
        column: State or column of its factor, shape ``(14,)``.
        dt_s: Time step.
        kept: What is left of steady current, eddies, bias and shares after it.
        out: Where to write; its first four are left as they are.
    """
    out[BIAS] = kept[2] * column[BIAS]
    for i in range(DRAG, NORTH):
        out[i] = kept[3] * column[i]
    for i in range(2):
        current = column[STEADY_NORTH + i] + column[EDDY_NORTH + i]
        out[NORTH + i] = column[NORTH + i] + dt_s * current
        out[STEADY_NORTH + i] = kept[0] * column[STEADY_NORTH + i]
        out[EDDY_NORTH + i] = kept[1] * column[EDDY_NORTH + i]


@inner_kernel
def _bend(
    x: FloatArray,
    S: FloatArray,
    start: FloatArray,
    command: FloatArray,
    time_s: float,
    packed: FloatArray,
    water: FloatArray,
    dt_s: float,
    steps: int,
    later: FloatArray,
    rows: FloatArray,
) -> None:
    """Add to ``later`` and to the factor's ``rows`` what the vehicle's equations make of both."""
    bent = (DEPTH, FORWARD, STARBOARD, DOWN, NORTH, EAST)
    centre = swim(x[:BENT], start, command, time_s, packed, water, dt_s, steps)
    for k in range(6):
        later[bent[k]] += centre[k]
    for i in range(BENT):
        reach = _SPREAD * S[:BENT, i]
        ahead = swim(x[:BENT] + reach, start, command, time_s, packed, water, dt_s, steps)
        behind = swim(x[:BENT] - reach, start, command, time_s, packed, water, dt_s, steps)
        for k in range(6):
            bend = ahead[k] + behind[k] - 2.0 * centre[k]
            later[bent[k]] += bend / (2.0 * _SPREAD**2)
            rows[i, bent[k]] += (ahead[k] - behind[k]) / (2.0 * _SPREAD)
            rows[STATES + i, bent[k]] = _CURVATURE * bend


@inner_kernel
def _disturb(
    rows: FloatArray,
    dt_s: float,
    kept: FloatArray,
    velocity: FloatArray,
    p: FloatArray,
    noise: FloatArray,
) -> None:
    """Write the factor of the process noise into ``rows``, shape ``(14, 14)``.

    The gyro's noise pushes the robot by its Coriolis acceleration, ``M^-1 (M v) x w``.
    """
    speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2)
    wander = speed * math.sqrt(2.0 * noise[ATTITUDE_CORRELATION] * dt_s)
    fresh = np.sqrt(1.0 - kept * kept)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across = p[body.MASS_1 + j] * velocity[j] / p[body.MASS_1 + i]
        over = p[body.MASS_1 + k] * velocity[k] / p[body.MASS_1 + i]
        push = noise[ACCELERATION] + (across**2 + over**2) * noise[RATE_NOISE] ** 2
        rows[FORWARD + i, FORWARD + i] = math.sqrt(push * dt_s)
        rows[DRAG + i, DRAG + i] = noise[MODEL_STD] * fresh[3]
    rows[DEPTH, DEPTH] = noise[TILT_STD] * wander
    rows[NORTH, NORTH] = noise[HEADING_STD] * wander
    rows[EAST, EAST] = noise[HEADING_STD] * wander
    for i in range(2):
        rows[STEADY_NORTH + i, STEADY_NORTH + i] = noise[STEADY_STD] * fresh[0]
        rows[EDDY_NORTH + i, EDDY_NORTH + i] = noise[EDDY_STD] * fresh[1]
    rows[BIAS, BIAS] = noise[BIAS_STD] * fresh[2]


@kernel
def predict(
    x: FloatArray,
    S: FloatArray,
    dt_s: float,
    command: FloatArray,
    time_s: float,
    attitude: FloatArray,
    rates: FloatArray,
    actuators: FloatArray,
    packed: FloatArray,
    water: FloatArray,
    noise: FloatArray,
    steps: int,
) -> None:
    """Advance estimate and factor in place by the vehicle's equations.

    Args:
        x: Estimate, shape ``(14,)``.
        S: Lower triangular factor of its covariance, shape ``(14, 14)``.
        dt_s: Time step, s.
        command: In force during it, shape ``(5,)``.
        time_s: Time at its beginning, on the clock of the tail's flap.
        attitude: Measured at its beginning, rad.
        rates: Angular velocity measured at its beginning, rad/s.
        actuators: Net mass, sliding mass and tail during it.
        packed: ``Vehicle.packed()``.
        water: ``Surroundings.packed()`` of open, still water.
        noise: Process noise, shape ``(13,)``.
        steps: Runge-Kutta steps.
    """
    memory = (STEADY_CORRELATION, EDDY_CORRELATION, BIAS_CORRELATION, MODEL_CORRELATION)
    kept = np.empty(len(memory))
    for i in range(len(memory)):
        kept[i] = math.exp(-dt_s / noise[memory[i]])
    start = np.zeros(15)
    start[3:6], start[9:12], start[12:15] = attitude, rates, actuators
    later, rows = np.zeros(STATES), np.zeros((2 * STATES + BENT, STATES))
    carry(x, dt_s, kept, later)
    for i in range(STATES):
        carry(S[:, i], dt_s, kept, rows[i])
    _bend(x, S, start, command, time_s, packed, water, dt_s, steps, later, rows)
    _disturb(rows[STATES + BENT :], dt_s, kept, x[FORWARD:BIAS], packed, noise)
    x[:] = later
    S[:, :] = triangular(rows)


@kernel
def widen(S: FloatArray, std: FloatArray) -> None:
    """Add independent errors of these standard deviations, shape ``(14,)``, to the covariance."""
    rows = np.zeros((2 * STATES, STATES))
    rows[:STATES] = S.T
    for i in range(STATES):
        rows[STATES + i, i] = std[i]
    S[:, :] = triangular(rows)


@kernel
def correct(S: FloatArray, index: int, gain: FloatArray, variance: float) -> None:
    """Let a measurement of one state correct all by a chosen gain, shape ``(14,)`` (Joseph)."""
    rows = np.empty((STATES + 1, STATES))
    for i in range(STATES):
        rows[i] = S[:, i] - gain * S[index, i]
    rows[STATES] = gain * math.sqrt(variance)
    S[:, :] = triangular(rows)


@kernel
def measure(x: FloatArray, S: FloatArray, index: int, innovation: float, variance: float) -> None:
    """Take in a measurement of one state; the factor stays triangular (Carlson's update)."""
    gain = np.zeros(STATES)
    before = variance
    for i in range(STATES - 1, -1, -1):
        f = S[index, i]
        if f == 0.0:
            continue
        after = before + f * f
        shrink, mix = math.sqrt(before / after), f / math.sqrt(before * after)
        for j in range(i, STATES):
            s = S[j, i]
            S[j, i] = shrink * s - mix * gain[j]
            gain[j] += f * s
        before = after
    for j in range(STATES):
        x[j] += gain[j] / before * innovation


@inner_kernel
def covariance_of(S: FloatArray, i: int, j: int) -> float:
    """Return one element of ``S S'``."""
    total = 0.0
    for k in range(min(i, j) + 1):
        total += S[i, k] * S[j, k]
    return total


@kernel
def measure_depth(
    x: FloatArray,
    S: FloatArray,
    depth_m: float,
    variance: float,
    limit: float,
    patience: int,
    refused: FloatArray,
) -> bool:
    """Take in a depth unless it is an outlier; tell whether it was believed."""
    innovation = depth_m - x[DEPTH]
    spread = covariance_of(S, DEPTH, DEPTH) + variance
    verdict = judge(innovation * innovation / spread, limit, patience, refused)
    if verdict == REFUSED:
        return False
    if verdict == LOST:
        std = np.zeros(STATES)
        std[DEPTH] = abs(innovation)
        widen(S, std)
    measure(x, S, DEPTH, innovation, variance)
    return True


@kernel
def take_fix(
    x: FloatArray, S: FloatArray, fix_ne: FloatArray, variance: float, tells_current: bool
) -> None:
    """Take in a horizontal fix.

    One that does not tell the steady current corrects all else, and leaves that as doubted as it is
    (Schmidt 1966, the consider filter).
    """
    for i in range(2):
        index = NORTH + i
        innovation = fix_ne[i] - x[index]
        if tells_current:
            measure(x, S, index, innovation, variance)
            continue
        gain = np.empty(STATES)
        for j in range(STATES):
            gain[j] = covariance_of(S, j, index)
        gain /= gain[index] + variance
        gain[STEADY_NORTH] = gain[STEADY_EAST] = 0.0
        x += gain * innovation
        correct(S, index, gain, variance)


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    x, S, three = np.zeros(STATES), np.eye(STATES), np.zeros(3)
    predict(
        x, S, 0.1, np.zeros(5), 0.0, three, three, three, np.ones(46), np.zeros(9), np.ones(13), 2
    )
    widen(S, np.zeros(STATES))
    correct(S, DEPTH, np.zeros(STATES), 1.0)
    measure_depth(x, S, 0.0, 1.0, 9.0, 1, np.zeros(2))
    take_fix(x, S, np.zeros(2), 1.0, tells_current=True)
