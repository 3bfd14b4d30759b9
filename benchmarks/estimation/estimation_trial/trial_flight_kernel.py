"""Compiled loops over a whole trial flight: the true motion, and estimators that follow it."""

import math

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.compiled import kernel
from autonomy.estimation.kernel import (
    down_in_body,
    horizontal_velocity,
    step_attitude,
    step_observer,
    step_position,
)
from autonomy.estimation.model_kernel import (
    BIAS,
    DEPTH,
    FORWARD,
    STATES,
    correct,
    measure_depth,
    predict,
    take_fix,
)
from autonomy.estimation.tag_filter import measure_tag, step_tags
from autonomy.vehicle.extended_kernel import advance
from benchmarks.estimation.estimation_trial.dead_reckoning import fix_reckoning, reckon


@kernel
def drift(normals: FloatArray, std_m_s: float, correlation_s: float, dt_s: float) -> FloatArray:
    """Current of an Ornstein-Uhlenbeck process per axis, from its stationary distribution.

    Args:
        normals: Standard normal numbers, shape ``(n, 2)``.
        std_m_s: Of the current, m/s.
        correlation_s: Its correlation time.
        dt_s: Time between two rows.
    """
    kept = math.exp(-dt_s / correlation_s)
    fresh = std_m_s * math.sqrt(1.0 - kept * kept)
    current = np.empty_like(normals)
    for i in range(2):
        current[0, i] = std_m_s * normals[0, i]
        for k in range(1, normals.shape[0]):
            current[k, i] = kept * current[k - 1, i] + fresh * normals[k, i]
    return current


@kernel
def fly(
    state: FloatArray,
    command: FloatArray,
    current_ne: FloatArray,
    packed: FloatArray,
    water: FloatArray,
    dt_s: float,
    steps: int,
) -> FloatArray:
    """True states at the end of each period, shape ``(n, 15)``.

    Args:
        state: At the beginning, shape ``(15,)``.
        command: Of each period, shape ``(n, 5)``.
        current_ne: North and east current of each period, shape ``(n, 2)``, m/s.
        packed: ``Vehicle.packed()``.
        water: ``Surroundings.packed()`` of open water.
        dt_s: Length of a period.
        steps: Runge-Kutta steps in a period.
    """
    truth = np.empty((command.shape[0], 15))
    moving = water.copy()
    x = state
    for k in range(command.shape[0]):
        moving[0], moving[1] = current_ne[k, 0], current_ne[k, 1]
        x = advance(x, command[k], packed, moving, k * dt_s, dt_s / steps, steps)
        truth[k] = x
    return truth


@kernel
def follow_attitude(
    measured: FloatArray, gyro: FloatArray, dt_s: float, correction: float, smoothing: float
) -> tuple[FloatArray, FloatArray]:
    """Attitudes and smoothed rates that the attitude filter makes of its sensors, ``(n, 3)``."""
    attitudes, rates = np.empty_like(measured), np.empty_like(measured)
    attitude, rate = measured[0].copy(), gyro[0].copy()
    for k in range(measured.shape[0]):
        if k > 0:
            step_attitude(attitude, rate, measured[k], gyro[k], dt_s, correction, smoothing)
        attitudes[k], rates[k] = attitude, rate
    return attitudes, rates


@kernel
def follow_observer(
    start: FloatArray,
    command: FloatArray,
    attitude: FloatArray,
    rates: FloatArray,
    actuators: FloatArray,
    depth_m: FloatArray,
    surface_depth_m: float,
    gains: FloatArray,
    packed: FloatArray,
    water: FloatArray,
    dt_s: float,
    steps: int,
) -> tuple[FloatArray, FloatArray]:
    """Velocities in body axes and in NED that the observer reports, both ``(n, 3)``.

    The observer begins with the states ``start``, shape ``(15,)``. As on board, the net buoyancy
    that would lift a floating robot out of the water counts as none.
    """
    n = command.shape[0]
    body, ned = np.empty((n, 3)), np.empty((n, 3))
    state = start
    for k in range(n):
        inside, order = actuators[k].copy(), command[k].copy()
        if depth_m[k] < surface_depth_m:
            inside[0] = max(inside[0], 0.0)
        order[0] = inside[0]
        state = step_observer(
            state, dt_s, order, k * dt_s, attitude[k], rates[k], inside, depth_m[k],
            gains, packed, water, steps,
        )  # fmt: skip
        body[k] = state[6:9]
        ned[k, 0], ned[k, 1] = horizontal_velocity(attitude[k], state[6], state[7], state[8])
        st, ct = math.sin(attitude[k, 1]), math.cos(attitude[k, 1])
        sf, cf = math.sin(attitude[k, 0]), math.cos(attitude[k, 0])
        ned[k, 2] = -st * state[6] + ct * sf * state[7] + ct * cf * state[8]
    return body, ned


@kernel
def follow_doubt(
    S: FloatArray,
    body: FloatArray,
    command: FloatArray,
    attitude: FloatArray,
    rates: FloatArray,
    actuators: FloatArray,
    depth_m: FloatArray,
    surface_depth_m: float,
    depth_variance: float,
    gains: FloatArray,
    packed: FloatArray,
    water: FloatArray,
    noise: FloatArray,
    dt_s: float,
    steps: int,
) -> FloatArray:
    """Covariance of the observer's velocity in body axes, shape ``(n, 3, 3)``.

    The model filter's covariance along the velocities ``body`` that the observer reported, under
    the observer's gains: it learns no ballast error and no share, but suffers both.
    """
    n = command.shape[0]
    covariances = np.empty((n, 3, 3))
    x, gain = np.zeros(STATES), np.zeros(STATES)
    gain[DEPTH] = dt_s * gains[1]
    for k in range(n):
        before = max(k - 1, 0)
        x[DEPTH], x[FORWARD:BIAS], x[BIAS:] = depth_m[before], body[before], 0.0
        inside = actuators[before].copy()
        if depth_m[before] < surface_depth_m:
            inside[0] = max(inside[0], 0.0)
        predict(
            x, S, dt_s, command[k], k * dt_s, attitude[before], rates[before], inside,
            packed, water, noise, steps,
        )  # fmt: skip
        down = down_in_body(attitude[k])
        for i in range(3):
            gain[FORWARD + i] = dt_s * gains[0] * down[i]
        correct(S, DEPTH, gain, depth_variance)
        covariances[k] = S[FORWARD:BIAS] @ S[FORWARD:BIAS].T
    return covariances


@kernel
def follow_position(
    axes: FloatArray,
    velocity_ned: FloatArray,
    depth_m: FloatArray,
    fix_ne: FloatArray,
    has_fix: BoolArray,
    noise: FloatArray,
    dt_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Horizontal positions, shape ``(n, 2)``, and their variance per axis, from thesis 5.4.2."""
    n = depth_m.shape[0]
    position, variance = np.empty((n, 2)), np.empty((n, 2))
    for k in range(n):
        step_position(axes, dt_s, velocity_ned[k], depth_m[k], fix_ne[k], has_fix[k], noise)
        position[k], variance[k] = axes[:2, 0], axes[:2, 2]
    return position, variance


@kernel
def follow_reckoning(
    axes: FloatArray,
    velocity_ned: FloatArray,
    fix_ne: FloatArray,
    has_fix: BoolArray,
    fix_variance: float,
    errors: FloatArray,
    dt_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Horizontal positions and their variance per axis, both ``(n, 2)``, by dead reckoning."""
    n = has_fix.shape[0]
    position, variance = np.empty((n, 2)), np.empty((n, 2))
    for k in range(n):
        for i in range(2):
            reckon(axes[i], dt_s, velocity_ned[k, i], errors, 0.0)
            if has_fix[k]:
                fix_reckoning(axes[i], fix_ne[k, i], fix_variance)
        position[k], variance[k] = axes[:, 0], axes[:, 1]
    return position, variance


@kernel
def follow_model(
    x: FloatArray,
    S: FloatArray,
    command: FloatArray,
    attitude: FloatArray,
    gyro: FloatArray,
    actuators: FloatArray,
    depth_m: FloatArray,
    fix_ne: FloatArray,
    has_fix: BoolArray,
    variance: FloatArray,
    limit: float,
    patience: int,
    packed: FloatArray,
    water: FloatArray,
    noise: FloatArray,
    dt_s: float,
    steps: int,
    dive_s: float,
    telling_stay_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Estimates ``(n, 14)`` and their covariances ``(n, 14, 14)`` of the model filter.

    ``variance`` is of a depth and of a fix, ``dive_s`` the shortest dive; the rest is as in
    ``model_kernel`` and ``model_filter``.
    """
    n = command.shape[0]
    states, covariances = np.empty((n, STATES)), np.empty((n, STATES, STATES))
    depths = np.zeros(2)
    since_s = stay_s = 0.0
    for k in range(n):
        before = max(k - 1, 0)
        during = actuators[before].copy()
        during[0] = 0.5 * (actuators[before, 0] + actuators[k, 0])
        since_s, stay_s = since_s + dt_s, stay_s + dt_s
        predict(
            x, S, dt_s, command[k], k * dt_s, attitude[before], gyro[before], during,
            packed, water, noise, steps,
        )  # fmt: skip
        measure_depth(x, S, depth_m[k], variance[0], limit, patience, depths)
        if has_fix[k]:
            if since_s >= dive_s:
                stay_s = 0.0
            tells = since_s >= dive_s or stay_s >= telling_stay_s
            take_fix(x, S, fix_ne[k], variance[1], tells)
            since_s = 0.0
        states[k] = x
        covariances[k] = S @ S.T
    return states, covariances


@kernel
def follow_tags(
    axes: FloatArray,
    depth_m: FloatArray,
    attitude: FloatArray,
    gyro: FloatArray,
    poses: FloatArray,
    seen: BoolArray,
    density: FloatArray,
    variance: FloatArray,
    tag_variance: FloatArray,
    limit: float,
    patience: int,
    dt_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Poses and their variances, both ``(n, 4)``, of the tag filter.

    Args:
        axes: Where it begins, shape ``(4, 5)``.
        depth_m: Measured depths, shape ``(n,)``.
        attitude: Measured angles, shape ``(n, 3)``.
        gyro: Measured body rates, shape ``(n, 3)``.
        poses: By each tag, shape ``(n, tags, 4)``.
        seen: Which tags were seen, shape ``(n, tags)``.
        density: As in ``kernel.step_tags``.
        variance: As there.
        tag_variance: As in ``kernel.measure_tag``.
        limit: As there.
        patience: As there.
        dt_s: Time between two rows.
    """
    n = depth_m.shape[0]
    position, spread = np.empty((n, 4)), np.empty((n, 4))
    refused = np.zeros(2)
    for k in range(n):
        step_tags(axes, dt_s, depth_m[k], attitude[k], gyro[k], density, variance)
        for tag in range(poses.shape[1]):
            if seen[k, tag]:
                measure_tag(axes, poses[k, tag], tag_variance, limit, patience, refused)
        position[k], spread[k] = axes[:, 0], axes[:, 2]
    return position, spread


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    three, command = np.zeros((2, 3)), np.zeros((2, 5))
    packed, water = np.ones(46), np.zeros(9)
    current = drift(np.zeros((2, 2)), 0.0, 1.0, 0.1)
    fly(np.zeros(15), command, current, packed, water, 0.1, 5)
    follow_attitude(three, three, 0.1, 0.1, 0.1)
    follow_observer(
        np.zeros(15),
        command,
        three,
        three,
        three,
        np.zeros(2),
        0.0,
        np.zeros(2),
        packed,
        water,
        0.1,
        5,
    )
    follow_position(
        np.ones((3, 5)),
        three,
        np.zeros(2),
        np.zeros((2, 2)),
        np.zeros(2, np.bool_),
        np.ones(4),
        0.1,
    )
    x, S, two, four = np.zeros(STATES), np.eye(STATES), np.ones(2), np.ones(4)
    no, fix = np.zeros(2, np.bool_), np.zeros((2, 2))
    follow_doubt(
        S, three, command, three, three, three, two, 0.0, 1.0, two, packed, water, np.ones(13),
        0.1, 2,
    )  # fmt: skip
    follow_reckoning(np.ones((2, 5)), three, fix, no, 1.0, np.ones((3, 2)), 0.1)
    follow_model(
        x, S, command, three, three, three, two, fix, no, two, 9.0, 1, packed, water, np.ones(13),
        0.1, 2, 10.0, 16.0,
    )  # fmt: skip
    tags, seen = np.zeros((2, 1, 4)), np.zeros((2, 1), np.bool_)
    follow_tags(np.ones((4, 5)), two, three, three, tags, seen, four, np.ones(3), four, 9.0, 1, 0.1)
