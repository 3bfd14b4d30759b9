"""The filter of a coarse flight: the same estimate, its covariance by linear steps.

The robot's filter (``autonomy.estimation.model_kernel``) probes its model seventeen times a step
and keeps a square root. Hundreds of flights ahead cannot afford that. Here one probe carries the
estimate, and the covariance is carried every ``belief_every`` periods by the model's slopes, taken
by differences at the middle of that time; its corrections are the Kalman filter's.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel
from autonomy.estimation import kernel as estimators
from autonomy.estimation import model_kernel as model
from autonomy.vehicle import extended_rates
from autonomy.vehicle import kernel as body
from simulator.ahead.state import Robot, Setup, State

swim_into, carry = model.swim_into, model.carry
extended_derivative_into = extended_rates.extended_derivative_into
judge, REFUSED, LOST = estimators.judge, estimators.REFUSED, estimators.LOST
(
    DEPTH, FORWARD, STARBOARD, DOWN, BIAS, DRAG, SIDE, LIFT, NORTH, EAST,
    STEADY_NORTH, STEADY_EAST, EDDY_NORTH, EDDY_EAST,
) = range(14)  # fmt: skip
STATES = model.STATES
"""Names that numba resolves once, when it compiles."""

_INPUTS = 7
"""Velocity along three axes, ballast error, and the shares of drag, side force and lift."""
_TRIED = (1e-3, 1e-3, 1e-3, 1e-5, 1e-3, 1e-3, 1e-3)
"""Differences by which the slopes are taken: m/s, kg and shares."""
CLEAR_M = 1.0
"""Depth from which on the surface pushes nobody."""
_QUICK, _PARTS = 0.4, 60
"""Longest part of a step, times the fastest of the model's rates, and how many parts do at most."""
_STABLE = 1.5
"""Longest part, times that rate, however many they are: at the surface contact is fast."""
_GROWN = 4.0
"""So many times a doubt of the velocity may grow within one step; farther the slopes do not hold.
A robot that hardly moves with its nose up can be unstable by its slopes at one place, with 27 a
second, and is not a tenth of a second later: over three seconds that would be a factor of 1e35."""


@inner_kernel
def step(
    s: State,
    setup: Setup,
    robot: Robot,
    command: FloatArray,
    time_s: float,
    during: FloatArray,
) -> None:
    """Carry the estimate on by one period, and now and then its covariance.

    Args:
        s: The flight.
        setup: What stays the same.
        robot: Its vehicle as it believes.
        command: Set points that were in force.
        time_s: When the period began.
        during: Mean of what the actuators say at its begin and end.
    """
    dt, start, x = setup.period_s, s.sensed, s.swum
    start[:] = 0.0
    for i in range(3):
        start[3 + i], start[9 + i] = s.before_attitude[i], s.before_gyro[i]
        start[12 + i] = during[i]
    if command[3] == 0.0 and s.belief[DEPTH] > CLEAR_M:
        _glide(s, robot, start, dt)
    else:
        swim_into(
            s.belief, start, command, time_s, robot.believed, robot.still, dt, setup.model_steps,
            x, s.order, s.altered, (s.slope, s.total, s.probe),
        )  # fmt: skip
    later = s.later
    carry(s.belief, dt, setup.kept, later)
    later[DEPTH] = x[2]
    for i in range(3):
        later[FORWARD + i] = x[6 + i]
    later[NORTH] += x[0]
    later[EAST] += x[1]
    s.belief[:] = later
    s.since_belief += 1
    if s.since_belief >= setup.belief_every:
        _carry_covariance(s, setup, robot, start, s.since_belief * dt)
        s.since_belief = 0


@inner_kernel
def _glide(s: State, robot: Robot, start: FloatArray, dt_s: float) -> None:
    """Carry the 15 states of the model on by a midpoint step into ``s.swum``, the tail still.

    Turning goes on as the gyro says and actuators stay: at the next step the sensors tell anew. So
    nothing is left that a longer step could not follow.
    """
    x, middle, rate = s.swum, s.middle, s.slope
    _accelerations(s, start, robot, -1, s.altered, rate)
    middle[:] = x
    for i in range(9):
        middle[i] += 0.5 * dt_s * rate[i]
    extended_derivative_into(middle, 0.0, 0.0, middle[14], 0.0, s.altered, robot.still, rate, 0.0)
    x[0] = x[1] = 0.0
    for i in range(9):
        x[i] += dt_s * rate[i]


@inner_kernel
def kept_over(setup: Setup, time_s: float) -> FloatArray:
    """Return what is left of steady current, eddies, bias and shares after a time."""
    kept = np.empty(4)
    kept[0] = math.exp(-time_s / setup.noise[model.STEADY_CORRELATION])
    kept[1] = math.exp(-time_s / setup.noise[model.EDDY_CORRELATION])
    kept[2] = math.exp(-time_s / setup.noise[model.BIAS_CORRELATION])
    kept[3] = math.exp(-time_s / setup.noise[model.MODEL_CORRELATION])
    return kept


@inner_kernel
def _accelerations(
    s: State, start: FloatArray, robot: Robot, which: int, p: FloatArray, out: FloatArray
) -> None:
    """Write the model's rates where one of the inputs is a little larger; -1 for none."""
    x = s.swum
    x[:] = start
    x[2] = s.belief[DEPTH]
    for i in range(3):
        x[6 + i] = s.belief[FORWARD + i]
    x[12] -= s.belief[BIAS]
    drag, side, lift = s.belief[DRAG], s.belief[SIDE], s.belief[LIFT]
    if 0 <= which < 3:
        x[6 + which] += _TRIED[which]
    elif which == 3:
        x[12] -= _TRIED[3]
    elif which == 4:
        drag += _TRIED[4]
    elif which == 5:
        side += _TRIED[5]
    elif which == 6:
        lift += _TRIED[6]
    believed = robot.believed
    p[: believed.shape[0]] = believed
    for i in range(body.DRAG_0, body.DRAG_DELTA + 1):
        p[i] = believed[i] * (1.0 + drag)
    p[body.SIDE_BETA] = believed[body.SIDE_BETA] * (1.0 - side)
    p[body.SIDE_DELTA] = believed[body.SIDE_DELTA] * (1.0 + side)
    for i in range(body.LIFT_0, body.LIFT_ALPHA + 1):
        p[i] = believed[i] * (1.0 + lift)
    extended_derivative_into(x, 0.0, 0.0, x[14], 0.0, p, robot.still, out, 0.0)


@inner_kernel
def _slopes(s: State, robot: Robot, start: FloatArray, drift: FloatArray, turn: FloatArray) -> None:
    """Write the slopes of acceleration ``(3, 7)`` and of velocity in NED by that in body axes."""
    p, base, tried = s.altered, s.slope, s.total
    _accelerations(s, start, robot, -1, p, base)
    for k in range(_INPUTS):
        _accelerations(s, start, robot, k, p, tried)
        for i in range(3):
            drift[i, k] = (tried[6 + i] - base[6 + i]) / _TRIED[k]
            if k < 3:
                turn[i, k] = (tried[i] - base[i]) / _TRIED[k]


@inner_kernel
def _response(
    s: State,
    drift: FloatArray,
    turn: FloatArray,
    time_s: float,
    push: FloatArray,
    answer: FloatArray,
    shaken: FloatArray,
) -> None:
    """Write how velocity and place answer to the inputs after a time, and to shakes during it.

    Args:
        s: The flight, which has room to work in.
        drift: Slopes of acceleration.
        turn: Slopes of the velocity in NED.
        time_s: How long.
        push: Density of the white acceleration along each axis, m2/s3.
        answer: Velocity, then way in NED, by the inputs, shape ``(6, 7)``.
        shaken: Covariance that the acceleration brings, shape ``(6, 6)``.
    """
    fastest = 1e-9
    for i in range(3):
        row = 0.0
        for k in range(3):
            row += abs(drift[i, k])
        fastest = max(fastest, row)
    parts = min(1 + int(time_s * fastest / _QUICK), _PARTS)
    parts = max(parts, 1 + int(time_s * fastest / _STABLE))
    h = time_s / parts
    rate, probe = s.answer_rate, s.answer_probe
    answer[:, :] = 0.0
    shaken[:, :] = 0.0
    for i in range(3):
        answer[i, i] = 1.0
    grown = 0.0
    for _ in range(parts):
        for stage in range(2):
            now = answer if stage == 0 else probe
            for i in range(3):
                for k in range(_INPUTS):
                    slope = drift[i, k] if k >= 3 else 0.0
                    for j in range(3):
                        slope += drift[i, j] * now[j, k]
                    rate[i, k] = slope if grown < _GROWN else 0.0
            for i in range(3):
                for k in range(_INPUTS):
                    if stage == 0:
                        probe[i, k] = answer[i, k] + 0.5 * h * rate[i, k]
        for i in range(3):
            for k in range(_INPUTS):
                for j in range(3):
                    answer[3 + i, k] += h * turn[i, j] * probe[j, k]
        for i in range(3):
            for k in range(_INPUTS):
                answer[i, k] += h * rate[i, k]
                if k < 3:
                    grown = max(grown, abs(answer[i, k]))
        for i in range(6):
            for k in range(i + 1):
                total = 0.0
                for j in range(3):
                    total += answer[i, j] * push[j] * answer[k, j]
                shaken[i, k] += h * total
                shaken[k, i] = shaken[i, k]


@inner_kernel
def _carry_covariance(
    s: State, setup: Setup, robot: Robot, start: FloatArray, time_s: float
) -> None:
    """Carry the covariance on by the model's slopes."""
    noise, believed = setup.noise, robot.believed
    drift, turn, push, answer, shaken = s.drift, s.turn, s.push, s.answer, s.shaken
    _slopes(s, robot, start, drift, turn)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        mass = believed[body.MASS_1 + i]
        across = believed[body.MASS_1 + j] * s.belief[FORWARD + j] / mass
        over = believed[body.MASS_1 + k] * s.belief[FORWARD + k] / mass
        push[i] = noise[model.ACCELERATION] + (across**2 + over**2) * noise[model.RATE_NOISE] ** 2
    _response(s, drift, turn, time_s, push, answer, shaken)
    kept = kept_over(setup, time_s)
    F = s.carrying
    F[:, :] = 0.0
    eddy_s = noise[model.EDDY_CORRELATION]
    for i in range(3):
        place = DEPTH if i == 2 else NORTH + i
        F[place, place] = 1.0
        for k in range(_INPUTS):
            F[FORWARD + i, FORWARD + k] = answer[i, k]
            F[place, FORWARD + k] = answer[3 + i, k]
        F[DRAG + i, DRAG + i] = kept[3]
    F[BIAS, BIAS] = kept[2]
    for i in range(2):
        F[NORTH + i, STEADY_NORTH + i] = time_s
        F[NORTH + i, EDDY_NORTH + i] = eddy_s * (1.0 - kept[1])
        F[STEADY_NORTH + i, STEADY_NORTH + i] = kept[0]
        F[EDDY_NORTH + i, EDDY_NORTH + i] = kept[1]
    _congruence(F, s.covariance, s.carried)
    _disturb(s, setup, shaken, kept, time_s)


@inner_kernel
def _congruence(F: FloatArray, P: FloatArray, W: FloatArray) -> None:
    """Replace ``P`` by ``F P F'``, with room for ``F P``; zeros of ``F`` cost nothing."""
    W[:, :] = 0.0
    for i in range(STATES):
        for j in range(STATES):
            if F[i, j] != 0.0:
                for k in range(STATES):
                    W[i, k] += F[i, j] * P[j, k]
    P[:, :] = 0.0
    for i in range(STATES):
        for j in range(STATES):
            if F[i, j] != 0.0:
                for k in range(STATES):
                    P[k, i] += F[i, j] * W[k, j]


@inner_kernel
def _disturb(s: State, setup: Setup, shaken: FloatArray, kept: FloatArray, time_s: float) -> None:
    """Add to the covariance what a time brings that nobody can know."""
    P, noise = s.covariance, setup.noise
    speed_2 = s.belief[FORWARD] ** 2 + s.belief[STARBOARD] ** 2 + s.belief[DOWN] ** 2
    wander = speed_2 * 2.0 * noise[model.ATTITUDE_CORRELATION] * time_s
    for i in range(6):
        row = FORWARD + i if i < 3 else (DEPTH if i == 5 else NORTH + i - 3)
        for k in range(6):
            column = FORWARD + k if k < 3 else (DEPTH if k == 5 else NORTH + k - 3)
            P[row, column] += shaken[i, k]
    P[DEPTH, DEPTH] += noise[model.TILT_STD] ** 2 * wander
    P[BIAS, BIAS] += noise[model.BIAS_STD] ** 2 * (1.0 - kept[2] * kept[2])
    eddy_s, variance = noise[model.EDDY_CORRELATION], noise[model.EDDY_STD] ** 2
    e = kept[1]
    for i in range(2):
        P[NORTH + i, NORTH + i] += noise[model.HEADING_STD] ** 2 * wander
        P[STEADY_NORTH + i, STEADY_NORTH + i] += noise[model.STEADY_STD] ** 2 * (
            1.0 - kept[0] * kept[0]
        )
        # displacement of an Ornstein-Uhlenbeck process that begins at rest
        P[EDDY_NORTH + i, EDDY_NORTH + i] += variance * (1.0 - e * e)
        shared = variance * eddy_s * (1.0 - e) ** 2
        P[NORTH + i, EDDY_NORTH + i] += shared
        P[EDDY_NORTH + i, NORTH + i] += shared
        P[NORTH + i, NORTH + i] += (
            variance * eddy_s**2 * (2.0 * time_s / eddy_s - 3.0 + 4.0 * e - e * e)
        )
    for i in range(3):
        P[DRAG + i, DRAG + i] += noise[model.MODEL_STD] ** 2 * (1.0 - kept[3] * kept[3])


@inner_kernel
def hear(s: State, index: int, innovation: float, variance: float) -> None:
    """Take in a measurement of one state."""
    P, column = s.covariance, s.column
    total = P[index, index] + variance
    column[:] = P[:, index]
    for i in range(STATES):
        gain = column[i] / total
        s.belief[i] += gain * innovation
        for j in range(STATES):
            P[i, j] -= gain * column[j]


@inner_kernel
def measure_depth(s: State, setup: Setup) -> None:
    """Take in a depth unless it is an outlier."""
    innovation = s.depth_m - s.belief[DEPTH]
    spread = s.covariance[DEPTH, DEPTH] + setup.depth_variance
    squared = innovation * innovation / spread
    verdict = judge(squared, setup.outlier_limit, setup.patience, s.refused_depths)
    if verdict == REFUSED:
        return
    if verdict == LOST:
        s.covariance[DEPTH, DEPTH] += innovation * innovation
    hear(s, DEPTH, innovation, setup.depth_variance)


@inner_kernel
def take_fix(s: State, variance: float, tells_current: bool) -> None:
    """Take in a fix; one that does not tell the steady current leaves it as doubted as it is."""
    P = s.covariance
    for axis in range(2):
        index = NORTH + axis
        innovation = s.fix_ne_m[axis] - s.belief[index]
        if tells_current:
            hear(s, index, innovation, variance)
            continue
        column = s.column
        column[:] = P[:, index]
        total = column[index] + variance
        for i in range(STATES):
            is_considered = i in (STEADY_NORTH, STEADY_EAST)
            gain = 0.0 if is_considered else column[i] / total
            s.belief[i] += gain * innovation
            for j in range(STATES):
                if not (is_considered and j in (STEADY_NORTH, STEADY_EAST)):
                    P[i, j] -= column[i] * column[j] / total


@inner_kernel
def widen(s: State, std: FloatArray) -> None:
    """Add independent errors of these standard deviations to the covariance."""
    for i in range(STATES):
        s.covariance[i, i] += std[i] * std[i]
