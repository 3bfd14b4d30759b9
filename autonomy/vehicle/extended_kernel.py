"""Compiled extended model: actuators, flapping tail, contact and current around the rigid body.

``autonomy.vehicle.dynamics`` is the readable reference; arrays are packed as in
``autonomy.vehicle.kernel``.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import kernel
from autonomy.vehicle import kernel as body

hydrodynamic_wrench = body.hydrodynamic_wrench
rigid_body = body.rigid_body
"""Names that numba resolves once, when it compiles."""


@kernel
def contact_force(
    x: FloatArray, rate: FloatArray, surroundings: FloatArray, p: FloatArray
) -> tuple[float, float, float]:
    """Force N of surface, floor and walls on the robot in NED; they push and never pull.

    Args:
        x: State; its first three are the position.
        rate: Velocity over ground in NED in the first three, m/s.
        surroundings: As in ``advance``.
        p: Packed vehicle.
    """
    k, c = p[body.CONTACT_STIFFNESS], p[body.CONTACT_DAMPING]
    north, east, down = 0.0, 0.0, 0.0
    if x[2] < 0.0:
        down = max(0.0, -k * x[2] - c * rate[2])
    elif x[2] > surroundings[7]:
        down = -max(0.0, k * (x[2] - surroundings[7]) + c * rate[2])
    if surroundings[8] > 0.0:
        if x[0] < surroundings[3]:
            north = max(0.0, k * (surroundings[3] - x[0]) - c * rate[0])
        elif x[0] > surroundings[4]:
            north = -max(0.0, k * (x[0] - surroundings[4]) + c * rate[0])
        if x[1] < surroundings[5]:
            east = max(0.0, k * (surroundings[5] - x[1]) - c * rate[1])
        elif x[1] > surroundings[6]:
            east = -max(0.0, k * (x[1] - surroundings[6]) + c * rate[1])
    return north, east, down


@kernel
def _apply_contact(x: FloatArray, surroundings: FloatArray, p: FloatArray, out: FloatArray) -> None:
    """Add what surface, floor and walls do to the rates in ``out``."""
    north, east, down = contact_force(x, out, surroundings, p)
    if north != 0.0 or east != 0.0 or down != 0.0:
        sf, cf = math.sin(x[3]), math.cos(x[3])
        st, ct = math.sin(x[4]), math.cos(x[4])
        sp, cp = math.sin(x[5]), math.cos(x[5])
        out[6] += (ct * cp * north + ct * sp * east - st * down) / p[body.MASS_1]
        out[7] += (
            (cp * st * sf - cf * sp) * north + (cf * cp + st * sf * sp) * east + ct * sf * down
        ) / p[body.MASS_2]
        out[8] += (
            (sf * sp + cf * cp * st) * north + (cf * st * sp - cp * sf) * east + ct * cf * down
        ) / p[body.MASS_3]
    if x[2] < 0.0:
        out[9] -= p[body.SURFACE_DAMPING] * x[9]
        out[10] -= p[body.SURFACE_DAMPING] * x[10]


@kernel
def extended_derivative_into(
    x: FloatArray,
    m0_rate: float,
    rp1_rate: float,
    tail_target: float,
    flap_acceleration: float,
    p: FloatArray,
    surroundings: FloatArray,
    out: FloatArray,
) -> None:
    """Write the rates of the 15-state model of thesis Eq. 5.17 into ``out``, shape ``(15,)``."""
    delta = x[14]
    f1, f2, f3, t1, t2, t3 = hydrodynamic_wrench(
        x[6], x[7], x[8], x[9], x[10], x[11], delta, p, True
    )
    out[12] = m0_rate
    out[13] = rp1_rate
    wanted = p[body.TAIL_RESPONSE] * (tail_target - delta)
    out[14] = min(max(wanted, -p[body.DELTA_RATE]), p[body.DELTA_RATE])
    water_kg = p[body.WATER_DENSITY] * p[body.TAIL_AREA] * p[body.TAIL_WATER_LENGTH]
    thrust = -water_kg * p[body.TAIL_CENTRE] * flap_acceleration
    f1 += thrust * math.sin(delta)
    t1 -= p[body.CROSSFLOW_1] * abs(x[9]) * x[9]
    t2 -= p[body.CROSSFLOW_2] * abs(x[10]) * x[10]
    t3 += p[body.TAIL_ARM] * thrust * math.cos(delta) - p[body.CROSSFLOW_3] * abs(x[11]) * x[11]
    rigid_body(x, x[12], x[13], (f1, f2, f3, t1, t2, t3), p, out)
    out[0] += surroundings[0]
    out[1] += surroundings[1]
    out[2] += surroundings[2]
    _apply_contact(x, surroundings, p, out)


@kernel
def extended_state_derivative(
    state: FloatArray,
    actuator: FloatArray,
    packed: FloatArray,
    surroundings: FloatArray,
) -> FloatArray:
    """Rates of the 15-state model, shape ``(15,)``.

    Args:
        state: Shape ``(15,)``: the 12 states, net mass kg, sliding mass m, tail rad.
        actuator: Rate of the net mass kg/s, of the sliding mass m/s, reference of the tail rad,
            acceleration of the tail's flap rad/s2.
        packed: ``Vehicle.packed()``.
        surroundings: As in ``advance``.
    """
    out = np.empty(15)
    extended_derivative_into(
        state, actuator[0], actuator[1], actuator[2], actuator[3], packed, surroundings, out
    )
    return out


@kernel
def tail_reference(command: FloatArray, time_s: float, p: FloatArray) -> tuple[float, float]:
    """Reference of the tail, cut at the end stops, and acceleration of its flap rad/s2.

    The acceleration is that of the servo's settled answer to the flap, as far as its rate allows.
    """
    bias, amplitude, w = command[2], command[3], 2.0 * math.pi * command[4]
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


@kernel
def _ramp(value: float, target: float, low: float, high: float, rate: float, dt_s: float) -> float:
    """Rate with which an actuator nears its target, inside end stops and greatest rate."""
    wanted = (min(max(target, low), high) - value) / dt_s
    return min(max(wanted, -rate), rate)


@kernel
def wrap_angle(angle: float) -> float:
    """Return the same direction in ``[-pi, pi)``."""
    return angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))


@kernel
def _name_attitude(x: FloatArray) -> None:
    """Rewrite the Euler angles of the same attitude so that pitch stays within 90 degrees."""
    x[4] = wrap_angle(x[4])
    if abs(x[4]) > 0.5 * math.pi:
        x[4] = math.copysign(math.pi, x[4]) - x[4]
        x[3] += math.pi
        x[5] += math.pi
    x[3] = wrap_angle(x[3])
    x[5] = wrap_angle(x[5])


@kernel
def _stable_parts(x: FloatArray, p: FloatArray, dt_s: float) -> int:
    """Into how many parts a step must be cut so that the water's pitch damping stays stable."""
    squared = x[6] * x[6] + x[7] * x[7] + x[8] * x[8]
    damping = (
        0.5
        * p[body.WATER_DENSITY]
        * p[body.AREA]
        * squared
        * abs(p[body.PITCH_DAMPING])
        / p[body.INERTIA_2]
    )
    return 1 + int(min(damping * dt_s / 1.5, 1000.0))


@kernel
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
) -> None:
    """Advance 15 states in place by one Runge-Kutta step; the last three are scratch."""
    u1 = _ramp(x[12], command[0], p[body.M0_MIN], p[body.M0_MAX], p[body.M0_RATE], dt_s)
    u2 = _ramp(x[13], command[1], p[body.RP1_MIN], p[body.RP1_MAX], p[body.RP1_RATE], dt_s)
    r0, a0 = tail_reference(command, t, p)
    r1, a1 = tail_reference(command, t + 0.5 * dt_s, p)
    r2, a2 = tail_reference(command, t + dt_s, p)
    extended_derivative_into(x, u1, u2, r0, a0, p, surroundings, total)
    for i in range(15):
        probe[i] = x[i] + 0.5 * dt_s * total[i]
    extended_derivative_into(probe, u1, u2, r1, a1, p, surroundings, slope)
    for i in range(15):
        total[i] += 2.0 * slope[i]
        probe[i] = x[i] + 0.5 * dt_s * slope[i]
    extended_derivative_into(probe, u1, u2, r1, a1, p, surroundings, slope)
    for i in range(15):
        total[i] += 2.0 * slope[i]
        probe[i] = x[i] + dt_s * slope[i]
    extended_derivative_into(probe, u1, u2, r2, a2, p, surroundings, slope)
    for i in range(15):
        x[i] += dt_s / 6.0 * (total[i] + slope[i])
    _name_attitude(x)


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
        command: Shape ``(5,)``: net mass kg, sliding mass m, tail bias rad, tail amplitude rad,
            tail frequency Hz.
        packed: ``Vehicle.packed()``.
        surroundings: Shape ``(9,)``: current NED m/s, x_min, x_max, y_min, y_max m, floor m,
            and whether there are walls (0 or 1).
        time_s: Time at the start, for the phase of the flap.
        dt_s: Length of one step, at most 0.1 so that contact stays stable; a step that is too
            long for the damping of fast motion is cut into parts.
        steps: Number of steps.
    """
    x = state.copy()
    slope, total, probe = np.empty(15), np.empty(15), np.empty(15)
    for step in range(steps):
        parts = _stable_parts(x, packed, dt_s)
        h = dt_s / parts
        for part in range(parts):
            t = time_s + step * dt_s + part * h
            _extended_step(x, command, packed, surroundings, t, h, slope, total, probe)
    return x


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    packed = np.ones(body.DELTA_RATE + 1)
    surroundings = np.zeros(9)
    extended_state_derivative(np.zeros(15), np.zeros(4), packed, surroundings)
    advance(np.zeros(15), np.zeros(5), packed, surroundings, 0.0, 0.01, 1)
