"""Compiled steps of the filter on the vehicle's model.

The covariance is kept as a lower triangular factor ``S`` with ``P = S S'``: it cannot lose symmetry
or become negative. The states that the vehicle's equations bend come first, so only the first five
columns of the factor need probes of the model; the others move linearly, exactly.

Source:
    Norgaard, Poulsen and Ravn, "New developments in state estimation for nonlinear systems",
    Automatica 36 (2000): the second-order divided-difference filter, an unscented filter whose
    weights of the covariance are all positive. Carlson's triangular square-root update,
    AIAA Journal 11 (1973).
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.estimation.kernel import LOST, REFUSED, judge
from autonomy.vehicle.extended_kernel import advance
from autonomy.vehicle.kernel import MASS_1

# fmt: off
(
    DEPTH, FORWARD, STARBOARD, DOWN, BIAS, NORTH, EAST,
    STEADY_NORTH, STEADY_EAST, EDDY_NORTH, EDDY_EAST,
) = range(11)
# fmt: on
"""Index of each state: depth m, velocity through the water in body axes m/s, what the feedback of
the net buoyancy says too much kg, position m, and the two parts of the current m/s."""

STATES = 11
BENT = 5
"""So many states come first that the vehicle's equations bend."""

# fmt: off
(
    ACCELERATION, RATE_NOISE, HEADING_STD, TILT_STD, ATTITUDE_CORRELATION,
    STEADY_STD, STEADY_CORRELATION, EDDY_STD, EDDY_CORRELATION, BIAS_STD, BIAS_CORRELATION,
) = range(11)
# fmt: on
"""Index of each number of the process noise."""

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


@kernel
def _swim(
    probe: FloatArray,
    dt_s: float,
    command: FloatArray,
    time_s: float,
    attitude: FloatArray,
    rates: FloatArray,
    actuators: FloatArray,
    packed: FloatArray,
    water: FloatArray,
    steps: int,
) -> FloatArray:
    """Depth, velocity in body axes, and way made north and east of one probe, shape ``(6,)``."""
    x, order = np.zeros(15), command.copy()
    x[2] = probe[DEPTH]
    for i in range(3):
        x[3 + i] = attitude[i]
        x[6 + i] = probe[FORWARD + i]
        x[9 + i] = rates[i]
    x[12] = actuators[0] - probe[BIAS]
    x[13], x[14] = actuators[1], actuators[2]
    order[0], order[1] = x[12], x[13]
    y = advance(x, order, packed, water, time_s, dt_s / steps, steps)
    out = np.empty(6)
    out[0] = y[2]
    out[1:4] = y[6:9]
    out[4:6] = y[0:2]
    return out


@kernel
def _carry(column: FloatArray, dt_s: float, kept: FloatArray, out: FloatArray) -> None:
    """Carry what moves linearly on: position by current, currents and bias by their memory.

    Args:
        column: State or column of its factor, shape ``(11,)``.
        dt_s: Time step.
        kept: What is left of steady current, eddies and bias after it.
        out: Where to write; its first four are left as they are.
    """
    out[BIAS] = kept[2] * column[BIAS]
    for i in range(2):
        current = column[STEADY_NORTH + i] + column[EDDY_NORTH + i]
        out[NORTH + i] = column[NORTH + i] + dt_s * current
        out[STEADY_NORTH + i] = kept[0] * column[STEADY_NORTH + i]
        out[EDDY_NORTH + i] = kept[1] * column[EDDY_NORTH + i]


@kernel
def _disturb(
    rows: FloatArray,
    first: int,
    dt_s: float,
    kept: FloatArray,
    velocity: FloatArray,
    p: FloatArray,
    noise: FloatArray,
) -> None:
    """Write the factor of the process noise into the rows from ``first`` on.

    The gyro's noise pushes the robot by its Coriolis acceleration, ``M^-1 (M v) x w``.
    """
    speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2)
    wander = speed * math.sqrt(2.0 * noise[ATTITUDE_CORRELATION] * dt_s)
    steady = noise[STEADY_STD] * math.sqrt(1.0 - kept[0] * kept[0])
    eddy = noise[EDDY_STD] * math.sqrt(1.0 - kept[1] * kept[1])
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across = p[MASS_1 + j] * velocity[j] / p[MASS_1 + i]
        over = p[MASS_1 + k] * velocity[k] / p[MASS_1 + i]
        push = noise[ACCELERATION] + (across**2 + over**2) * noise[RATE_NOISE] ** 2
        rows[first + FORWARD + i, FORWARD + i] = math.sqrt(push * dt_s)
    rows[first + DEPTH, DEPTH] = noise[TILT_STD] * wander
    rows[first + NORTH, NORTH] = noise[HEADING_STD] * wander
    rows[first + EAST, EAST] = noise[HEADING_STD] * wander
    for i in range(2):
        rows[first + STEADY_NORTH + i, STEADY_NORTH + i] = steady
        rows[first + EDDY_NORTH + i, EDDY_NORTH + i] = eddy
    rows[first + BIAS, BIAS] = noise[BIAS_STD] * math.sqrt(1.0 - kept[2] * kept[2])


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
        x: Estimate, shape ``(11,)``.
        S: Lower triangular factor of its covariance, shape ``(11, 11)``.
        dt_s: Time step, s.
        command: In force during it, shape ``(5,)``.
        time_s: Time at its beginning, on the clock of the tail's flap.
        attitude: Measured at its beginning, rad.
        rates: Angular velocity measured at its beginning, rad/s.
        actuators: Net mass, sliding mass and tail during it.
        packed: ``Vehicle.packed()``.
        water: ``Surroundings.packed()`` of open, still water.
        noise: Process noise, shape ``(11,)``.
        steps: Runge-Kutta steps.
    """
    kept = np.array(
        [
            math.exp(-dt_s / noise[STEADY_CORRELATION]),
            math.exp(-dt_s / noise[EDDY_CORRELATION]),
            math.exp(-dt_s / noise[BIAS_CORRELATION]),
        ]
    )
    bent = (DEPTH, FORWARD, STARBOARD, DOWN, NORTH, EAST)
    rows = np.zeros((2 * STATES + BENT, STATES))
    centre = _swim(
        x[:BENT], dt_s, command, time_s, attitude, rates, actuators, packed, water, steps
    )
    velocity = x[FORWARD:BIAS].copy()
    mean = centre.copy()
    for i in range(STATES):
        _carry(S[:, i], dt_s, kept, rows[i])
        if i >= BENT:
            continue
        reach = _SPREAD * S[:BENT, i]
        ahead = _swim(
            x[:BENT] + reach,
            dt_s,
            command,
            time_s,
            attitude,
            rates,
            actuators,
            packed,
            water,
            steps,
        )
        behind = _swim(
            x[:BENT] - reach,
            dt_s,
            command,
            time_s,
            attitude,
            rates,
            actuators,
            packed,
            water,
            steps,
        )
        for k in range(6):
            bend = ahead[k] + behind[k] - 2.0 * centre[k]
            mean[k] += bend / (2.0 * _SPREAD**2)
            rows[i, bent[k]] += (ahead[k] - behind[k]) / (2.0 * _SPREAD)
            rows[STATES + i, bent[k]] = _CURVATURE * bend
    _disturb(rows, STATES + BENT, dt_s, kept, velocity, packed, noise)
    later = np.zeros(STATES)
    _carry(x, dt_s, kept, later)
    for k in range(6):
        later[bent[k]] += mean[k]
    x[:] = later
    S[:, :] = triangular(rows)


@kernel
def widen(S: FloatArray, std: FloatArray) -> None:
    """Add independent errors of these standard deviations, shape ``(11,)``, to the covariance."""
    rows = np.zeros((2 * STATES, STATES))
    rows[:STATES] = S.T
    for i in range(STATES):
        rows[STATES + i, i] = std[i]
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


@kernel
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
def measure_fix(
    x: FloatArray,
    S: FloatArray,
    fix_ne: FloatArray,
    variance: float,
    limit: float,
    patience: int,
    refused: FloatArray,
) -> bool:
    """Take in a horizontal fix unless it is an outlier; tell whether it was believed."""
    dn, de = fix_ne[0] - x[NORTH], fix_ne[1] - x[EAST]
    a = covariance_of(S, NORTH, NORTH) + variance
    b = covariance_of(S, NORTH, EAST)
    d = covariance_of(S, EAST, EAST) + variance
    distance = (d * dn * dn - 2.0 * b * dn * de + a * de * de) / (a * d - b * b)
    verdict = judge(distance, limit, patience, refused)
    if verdict == REFUSED:
        return False
    if verdict == LOST:
        std = np.zeros(STATES)
        std[NORTH] = std[EAST] = math.hypot(dn, de)
        widen(S, std)
    measure(x, S, NORTH, dn, variance)
    measure(x, S, EAST, fix_ne[1] - x[EAST], variance)
    return True


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    x, S, three = np.zeros(STATES), np.eye(STATES), np.zeros(3)
    predict(
        x, S, 0.1, np.zeros(5), 0.0, three, three, three, np.ones(46), np.zeros(9), np.ones(11), 2
    )
    widen(S, np.zeros(STATES))
    measure_depth(x, S, 0.0, 1.0, 9.0, 1, np.zeros(2))
    measure_fix(x, S, np.zeros(2), 1.0, 9.0, 1, np.zeros(2))
