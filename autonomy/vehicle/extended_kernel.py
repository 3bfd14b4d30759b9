"""Compiled runs of the extended model: a robot with its actuators in its surroundings.

``autonomy.vehicle.reference.dynamics`` is the readable reference; arrays are packed as in
``autonomy.vehicle.kernel``.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.vehicle import extended_rates as rates
from autonomy.vehicle import kernel as body
from autonomy.vehicle import steep_kernel as steep

extended_derivative_into = rates.extended_derivative_into
extended_state_derivative = rates.extended_state_derivative
steep_derivative_into = steep.steep_derivative_into
attitude_quaternion = steep.attitude_quaternion
turn_attitude = steep.turn_attitude
"""Names that numba resolves once, when it compiles."""

STEEP_COS_PITCH = 0.2
"""Steeper than this, 78 degrees, a step does without Euler angles."""


@kernel
def tail_reference(command: FloatArray, time_s: float, p: FloatArray) -> tuple[float, float]:
    """Reference of the tail, cut at the end stops, and acceleration of its flap rad/s2.

    The acceleration is that of the servo's settled answer to the flap, as far as its rate allows.
    """
    bias, amplitude, w = command[2], command[3], 2.0 * math.pi * command[4]
    if amplitude == 0.0:
        return min(max(bias, -p[body.DELTA_MAX]), p[body.DELTA_MAX]), 0.0
    s, c = math.sin(w * time_s), math.cos(w * time_s)
    target = bias + amplitude * s
    if abs(target) >= p[body.DELTA_MAX]:
        return math.copysign(p[body.DELTA_MAX], target), 0.0
    k = p[body.TAIL_RESPONSE]
    gain = k / math.sqrt(k * k + w * w)
    fastest = gain * abs(amplitude * w)
    if fastest > p[body.DELTA_RATE]:
        amplitude *= p[body.DELTA_RATE] / fastest
    return target, -w * w * amplitude * gain * gain * (s - w / k * c)


@inner_kernel
def _ramp(value: float, target: float, low: float, high: float, rate: float, dt_s: float) -> float:
    """Rate with which an actuator nears its target, inside end stops and greatest rate."""
    wanted = (min(max(target, low), high) - value) / dt_s
    return min(max(wanted, -rate), rate)


@inner_kernel
def wrap_angle(angle: float) -> float:
    """Return the same direction in ``[-pi, pi)``."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@inner_kernel
def _name_attitude(x: FloatArray) -> None:
    """Rewrite the Euler angles of the same attitude so that pitch stays within 90 degrees."""
    x[4] = wrap_angle(x[4])
    if abs(x[4]) > 0.5 * math.pi:
        x[4] = math.copysign(math.pi, x[4]) - x[4]
        x[3] += math.pi
        x[5] += math.pi
    x[3] = wrap_angle(x[3])
    x[5] = wrap_angle(x[5])


@inner_kernel
def _is_in_contact(x: FloatArray, surroundings: FloatArray) -> bool:
    """Tell whether still surface, floor or a wall may push a robot."""
    if x[2] < 0.0 or x[2] > surroundings[7]:
        return True
    return surroundings[8] > 0.0 and (
        x[0] < surroundings[3]
        or x[0] > surroundings[4]
        or x[1] < surroundings[5]
        or x[1] > surroundings[6]
    )


@inner_kernel
def _damping_per_s(v1: float, v2: float, v3: float, delta: float, p: FloatArray) -> float:
    """Fastest rate at which the water damps a motion, 1/s: pitching, or drifting sideways.

    Drag grows with the angle of attack squared, which is half a turn for a robot that is driven
    backwards: the water stops that one twenty times as fast as one that glides.
    """
    speed = math.sqrt(v1 * v1 + v2 * v2 + v3 * v3)
    wet = 0.5 * p[body.WATER_DENSITY] * p[body.AREA] * speed
    alpha = math.atan2(v3, v1)
    drag = p[body.DRAG_0] + p[body.DRAG_ALPHA] * alpha * alpha + p[body.DRAG_DELTA] * delta * delta
    pitching = wet * speed * abs(p[body.PITCH_DAMPING]) / p[body.INERTIA_2]
    return max(pitching, 2.0 * wet * drag / p[body.MASS_2])


@inner_kernel
def _stable_parts(
    x: FloatArray,
    p: FloatArray,
    surroundings: FloatArray,
    time_s: float,
    dt_s: float,
    slope: FloatArray,
) -> int:
    """Into how many parts a step must be cut so that what the water damps stays stable.

    A wall may push a robot to several times its speed within a step, or backwards: in contact, the
    end of a whole step of Euler's method counts too. ``slope`` is scratch.
    """
    damping = _damping_per_s(x[6], x[7], x[8], x[14], p)
    if _is_in_contact(x, surroundings):
        extended_derivative_into(x, 0.0, 0.0, x[14], 0.0, p, surroundings, slope, time_s)
        v1, v2, v3 = x[6] + dt_s * slope[6], x[7] + dt_s * slope[7], x[8] + dt_s * slope[8]
        damping = max(damping, _damping_per_s(v1, v2, v3, x[14], p))
    return 1 + int(min(damping * dt_s / 1.5, 1000.0))


@inner_kernel
def _extended_step(
    x: FloatArray,
    command: FloatArray,
    p: FloatArray,
    surroundings: FloatArray,
    t: float,
    dt_s: float,
    slope: FloatArray,
    total: FloatArray,
    probe: FloatArray,
) -> tuple[float, float, float]:
    """Advance 15 states in place by one Runge-Kutta step; the last three are scratch.

    Returns:
        Squared rates of net mass, sliding mass and tail, their mean over the step.
    """
    u1 = _ramp(x[12], command[0], p[body.M0_MIN], p[body.M0_MAX], p[body.M0_RATE], dt_s)
    u2 = _ramp(x[13], command[1], p[body.RP1_MIN], p[body.RP1_MAX], p[body.RP1_RATE], dt_s)
    r0, a0 = tail_reference(command, t, p)
    r1, a1 = tail_reference(command, t + 0.5 * dt_s, p)
    r2, a2 = tail_reference(command, t + dt_s, p)
    half = t + 0.5 * dt_s
    extended_derivative_into(x, u1, u2, r0, a0, p, surroundings, total, t)
    tail = total[14] * total[14]
    for i in range(15):
        probe[i] = x[i] + 0.5 * dt_s * total[i]
    extended_derivative_into(probe, u1, u2, r1, a1, p, surroundings, slope, half)
    tail += 2.0 * slope[14] * slope[14]
    for i in range(15):
        total[i] += 2.0 * slope[i]
        probe[i] = x[i] + 0.5 * dt_s * slope[i]
    extended_derivative_into(probe, u1, u2, r1, a1, p, surroundings, slope, half)
    tail += 2.0 * slope[14] * slope[14]
    for i in range(15):
        total[i] += 2.0 * slope[i]
        probe[i] = x[i] + dt_s * slope[i]
    extended_derivative_into(probe, u1, u2, r2, a2, p, surroundings, slope, t + dt_s)
    tail += slope[14] * slope[14]
    for i in range(15):
        x[i] += dt_s / 6.0 * (total[i] + slope[i])
    _name_attitude(x)
    return u1 * u1, u2 * u2, tail / 6.0


@inner_kernel
def _steep_step(
    x: FloatArray,
    command: FloatArray,
    p: FloatArray,
    surroundings: FloatArray,
    t: float,
    dt_s: float,
) -> tuple[float, float, float]:
    """Advance a nose-up or nose-down robot in place by one step; returns as ``_extended_step``.

    Where Euler angles are singular the attitude is a turn from that at the start of the step.
    """
    u1 = _ramp(x[12], command[0], p[body.M0_MIN], p[body.M0_MAX], p[body.M0_RATE], dt_s)
    u2 = _ramp(x[13], command[1], p[body.RP1_MIN], p[body.RP1_MAX], p[body.RP1_RATE], dt_s)
    start = attitude_quaternion(x[3], x[4], x[5])
    total, slope, probe = np.zeros(15), np.zeros(15), x[:15].copy()
    probe[3:6] = 0.0
    origin = probe.copy()
    tail = 0.0
    for stage in range(4):
        ahead = 0.0 if stage == 0 else (0.5 if stage < 3 else 1.0)
        weight = 1.0 if stage in (0, 3) else 2.0
        for i in range(15):
            probe[i] = origin[i] + ahead * dt_s * slope[i]
        at = t + ahead * dt_s
        target, flap = tail_reference(command, at, p)
        steep_derivative_into(start, probe, u1, u2, target, flap, p, surroundings, slope, at)
        tail += weight * slope[14] * slope[14]
        for i in range(15):
            total[i] += weight * slope[i]
    for i in range(15):
        x[i] = origin[i] + dt_s / 6.0 * total[i]
    x[3], x[4], x[5] = turn_attitude(start, x[3], x[4], x[5])
    return u1 * u1, u2 * u2, tail / 6.0


@kernel
def electrical_power(
    m0_squared: float, rp1_squared: float, tail_squared: float, p: FloatArray
) -> float:
    """Electrical power, W, at squared rates of the actuators (thesis Eq. 5.20)."""
    return (
        p[body.ENERGY_0]
        + p[body.ENERGY_M0] * m0_squared
        + p[body.ENERGY_RP1] * rp1_squared
        + p[body.ENERGY_DELTA] * tail_squared
    )


@inner_kernel
def advance_into(
    x: FloatArray,
    command: FloatArray,
    packed: FloatArray,
    surroundings: FloatArray,
    time_s: float,
    dt_s: float,
    steps: int,
    slope: FloatArray,
    total: FloatArray,
    probe: FloatArray,
) -> None:
    """Advance a state in place as ``advance`` does; the last three are scratch, ``(15,)``."""
    is_metered = x.shape[0] > 15
    for step in range(steps):
        began_s = time_s + step * dt_s
        parts = _stable_parts(x, packed, surroundings, began_s, dt_s, slope)
        h = dt_s / parts
        for part in range(parts):
            t = began_s + part * h
            if abs(math.cos(x[4])) < STEEP_COS_PITCH:
                squared = _steep_step(x, command, packed, surroundings, t, h)
            else:
                squared = _extended_step(
                    x, command, packed, surroundings, t, h, slope, total, probe
                )
            if is_metered:
                x[15] += h * electrical_power(squared[0], squared[1], squared[2], packed)


@kernel
def advance(
    state: FloatArray,
    command: FloatArray,
    packed: FloatArray,
    surroundings: FloatArray,
    time_s: float,
    dt_s: float,
    steps: int,
) -> FloatArray:
    """Return the robot's 15 states after ``steps`` Runge-Kutta steps under one command.

    A buoyant robot comes to rest at depth 0; floor and walls hold it back; the tail's thrust
    lets it swim, and a bias of the tail turns it.

    Args:
        state: Shape ``(15,)``: position NED m, Euler angles rad, velocity through the water in
            body axes m/s, angular velocity rad/s, net mass kg, sliding mass m, tail angle rad.
            A sixteenth number, if given, is the electrical energy used so far, J; it needs all of
            ``Vehicle.packed()``.
        command: Shape ``(5,)``: net mass kg, sliding mass m, tail bias rad, tail amplitude rad,
            tail frequency Hz.
        packed: ``Vehicle.packed()``.
        surroundings: ``Surroundings.packed()``, at least current NED m/s, x_min, x_max, y_min,
            y_max m, floor m, and whether there are walls (0 or 1).
        time_s: Time at the start, for the phases of flap and waves.
        dt_s: Length of one step, at most 0.1 so that contact stays stable; a step that is too
            long for the damping of fast motion is cut into parts.
        steps: Number of steps.

    Raises:
        ValueError: If energy is to be counted for a vehicle without prices.
    """
    if state.shape[0] > 15 and packed.shape[0] <= body.ENERGY_DELTA:
        raise ValueError("a state with energy needs a vehicle packed with its prices")
    x = state.copy()
    slope, total, probe = np.empty(15), np.empty(15), np.empty(15)
    advance_into(x, command, packed, surroundings, time_s, dt_s, steps, slope, total, probe)
    return x


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    packed, plain = np.ones(body.ENERGY_DELTA + 1), np.zeros(9)
    rates.warm_up()
    advance(np.zeros(15), np.zeros(5), packed, plain, 0.0, 0.01, 1)
    electrical_power(0.0, 0.0, 0.0, packed)
