"""Compiled steps of the estimators; the classes of this package call them.

An *axis* is five numbers: value, its rate, and the covariance of both (variance of the value,
cross term, variance of the rate). ``autonomy.estimation.position.AxisCovariance`` is the readable
reference of its covariance.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.vehicle.extended_kernel import advance


@kernel
def turn(angle: float) -> float:
    """Return the same direction in ``[-pi, pi)``; the shortest way between two directions."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@inner_kernel
def predict_axis(axis: FloatArray, dt_s: float, density: float) -> None:
    """Let ``dt_s`` pass under a white acceleration of this spectral density."""
    b, d = axis[3], axis[4]
    axis[0] += dt_s * axis[1]
    axis[2] += 2.0 * dt_s * b + dt_s * dt_s * d + density * dt_s**3 / 3.0
    axis[3] += dt_s * d + density * dt_s * dt_s / 2.0
    axis[4] += density * dt_s


@inner_kernel
def measure_value(axis: FloatArray, innovation: float, variance: float) -> None:
    """Take in a measurement of the value; an angle's innovation is wrapped by the caller."""
    a, b = axis[2], axis[3]
    s = a + variance
    axis[0] += a / s * innovation
    axis[1] += b / s * innovation
    axis[2] = a * variance / s
    axis[3] = b * variance / s
    axis[4] -= b * b / s


@inner_kernel
def measure_rate(axis: FloatArray, innovation: float, variance: float) -> None:
    """Take in a measurement of the rate."""
    b, d = axis[3], axis[4]
    s = d + variance
    axis[0] += b / s * innovation
    axis[1] += d / s * innovation
    axis[2] -= b * b / s
    axis[3] = b * variance / s
    axis[4] = d * variance / s


@kernel
def step_position(
    axes: FloatArray,
    dt_s: float,
    velocity_ned: FloatArray,
    depth_m: float,
    fix_ne_m: FloatArray,
    has_fix: bool,
    noise: FloatArray,
) -> tuple[float, float]:
    """Advance the filter of thesis 5.4.2 in place; return how far the fix moved north and east.

    Args:
        axes: North, east and down, shape ``(3, 5)``.
        dt_s: Time since the last step, s.
        velocity_ned: Measured velocity, shape ``(3,)``, m/s.
        depth_m: Measured depth.
        fix_ne_m: Horizontal fix, shape ``(2,)``, m; looked at only with ``has_fix``.
        has_fix: Whether the fix is one.
        noise: Acceleration density, drift m/sqrt(s), standard deviations of fix and depth.
    """
    moved_n = moved_e = 0.0
    for i in range(3):
        axis = axes[i]
        predict_axis(axis, dt_s, noise[0])
        if i == 2:
            measure_value(axis, depth_m - axis[0], noise[3] ** 2)
        elif has_fix:
            before = axis[0]
            measure_value(axis, fix_ne_m[i] - before, noise[2] ** 2)
            if i == 0:
                moved_n = axis[0] - before
            else:
                moved_e = axis[0] - before
        measure_rate(axis, velocity_ned[i] - axis[1], noise[1] ** 2 / dt_s)
    return moved_n, moved_e


@kernel
def take_late_fix(axes: FloatArray, fix_ne_m: FloatArray, variance: float) -> None:
    """Take a late horizontal fix into north and east, which makes neither surer than itself.

    ``autonomy.estimation.position.AxisCovariance.take_late_fix`` is its readable reference.

    Args:
        axes: North and east at least, shape ``(n, 5)``.
        fix_ne_m: Where the robot is now, by the fix, shape ``(2,)``, m.
        variance: Of it per axis, what was lost since it was measured included, m^2.
    """
    for i in range(2):
        least = min(axes[i, 2], variance)
        measure_value(axes[i], fix_ne_m[i] - axes[i, 0], variance)
        axes[i, 2] = max(axes[i, 2], least)


@inner_kernel
def heading_rate(attitude: FloatArray, gyro: FloatArray) -> float:
    """Rate of the heading by the gyro; held where the nose points nearly up or down."""
    across = math.sin(attitude[0]) * gyro[1] + math.cos(attitude[0]) * gyro[2]
    return across / max(math.cos(attitude[1]), 0.1)


@kernel
def step_attitude(
    attitude: FloatArray,
    rates: FloatArray,
    measured: FloatArray,
    gyro: FloatArray,
    dt_s: float,
    correction: float,
    smoothing: float,
) -> None:
    """Advance attitude and smoothed rates in place, each of shape ``(3,)``.

    The gyro carries the attitude on; the part ``correction`` of the measured angles' difference
    pulls it back, the shortest way round.
    """
    for i in range(3):
        rates[i] += smoothing * (gyro[i] - rates[i])
    roll, pitch = attitude[0], attitude[1]
    turn_rate = heading_rate(attitude, gyro)
    attitude[0] += dt_s * (gyro[0] + math.sin(pitch) * turn_rate)
    attitude[1] += dt_s * (math.cos(roll) * gyro[1] - math.sin(roll) * gyro[2])
    attitude[2] += dt_s * turn_rate
    for i in range(3):
        attitude[i] = turn(attitude[i] + correction * turn(measured[i] - attitude[i]))


REFUSED, BELIEVED, LOST = 0, 1, 2
"""What a gate says of a measurement; ``LOST`` asks to widen the covariance before believing it."""


@inner_kernel
def judge(squared_distance: float, limit: float, patience: int, refused: FloatArray) -> int:
    """Judge a measurement by its squared normalized distance from the prediction.

    Args:
        squared_distance: In standard deviations.
        limit: Beyond it a measurement is refused.
        patience: After so many refusals in a row the filter doubts itself.
        refused: How many were refused in a row, and in all; shape ``(2,)``, changed in place.
    """
    if squared_distance <= limit:
        refused[0] = 0.0
        return BELIEVED
    if refused[0] >= patience:
        refused[0] = 0.0
        return LOST
    refused[0] += 1.0
    refused[1] += 1.0
    return REFUSED


@inner_kernel
def down_in_body(attitude: FloatArray) -> tuple[float, float, float]:
    """Components of the vertical along the body's axes: the third row of R."""
    across = math.cos(attitude[1])
    return (
        -math.sin(attitude[1]),
        across * math.sin(attitude[0]),
        across * math.cos(attitude[0]),
    )


@kernel
def horizontal_velocity(
    attitude: FloatArray, v1: float, v2: float, v3: float
) -> tuple[float, float]:
    """North and east components of a velocity in body axes."""
    sf, cf = math.sin(attitude[0]), math.cos(attitude[0])
    st, ct = math.sin(attitude[1]), math.cos(attitude[1])
    sp, cp = math.sin(attitude[2]), math.cos(attitude[2])
    ahead = ct * v1 + st * sf * v2 + st * cf * v3
    abeam = cf * v2 - sf * v3
    return cp * ahead - sp * abeam, sp * ahead + cp * abeam


@kernel
def step_observer(
    state: FloatArray,
    dt_s: float,
    command: FloatArray,
    time_s: float,
    attitude: FloatArray,
    rates: FloatArray,
    actuators: FloatArray,
    depth_m: float,
    gains: FloatArray,
    packed: FloatArray,
    water: FloatArray,
    steps: int,
) -> FloatArray:
    """Return the velocity observer's 15 states after ``dt_s`` and the measurements at its end.

    Args:
        state: Of the vehicle model, as in ``extended_kernel.advance``.
        dt_s: Time since the last step, s.
        command: In force during it, shape ``(5,)``.
        time_s: Time at its beginning.
        attitude: Measured roll, pitch, heading.
        rates: Measured angular velocity in body axes.
        actuators: Measured net mass, sliding mass, tail.
        depth_m: Measured depth.
        gains: K1 and K2.
        packed: ``Vehicle.packed()``.
        water: ``Surroundings.packed()`` of open water.
        steps: Runge-Kutta steps.
    """
    later = advance(state, command, packed, water, time_s, dt_s / steps, steps)
    error = depth_m - later[2]
    down = down_in_body(attitude)
    later[2] += dt_s * gains[1] * error
    for i in range(3):
        later[3 + i] = attitude[i]
        later[6 + i] += dt_s * gains[0] * error * down[i]
        later[9 + i] = rates[i]
        later[12 + i] = actuators[i]
    return later


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    three = np.zeros(3)
    step_position(np.ones((3, 5)), 0.1, three, 0.0, np.zeros(2), True, np.ones(4))
    take_late_fix(np.ones((3, 5)), np.zeros(2), 1.0)
    step_attitude(np.zeros(3), np.zeros(3), three, three, 0.1, 0.1, 0.1)
    horizontal_velocity(three, 0.0, 0.0, 0.0)
    step_observer(
        np.zeros(15), 0.1, np.zeros(5), 0.0, three, three, three, 0.0, np.zeros(2),
        np.ones(46), np.zeros(9), 5,
    )  # fmt: skip
