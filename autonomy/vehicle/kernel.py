"""Compiled 12-state model of the glider; ``reference.dynamics`` is the readable one.

Arrays are packed as ``Vehicle.packed`` makes them: parameters and limits, each in their order of
declaration, what the hull displaces and how it gives, and the prices of energy; the names below
are the indices. A model of the body alone needs no more than parameters and limits.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, kernel

# fmt: off
(
    MASS_1, MASS_2, MASS_3, INERTIA_1, INERTIA_2, INERTIA_3,
    SLIDING_MASS, OFFSET_MASS, OFFSET_MASS_DEPTH, GRAVITY, WATER_DENSITY, AREA,
    DRAG_0, DRAG_ALPHA, DRAG_DELTA, SIDE_BETA, SIDE_DELTA, LIFT_0, LIFT_ALPHA,
    ROLL_BETA, ROLL_DAMPING, PITCH_0, PITCH_ALPHA, PITCH_DAMPING,
    YAW_BETA, YAW_DAMPING, YAW_DELTA,
    TAIL_RESPONSE, TAIL_AREA, TAIL_WATER_LENGTH, TAIL_CENTRE, TAIL_ARM,
    CROSSFLOW_1, CROSSFLOW_2, CROSSFLOW_3,
    CONTACT_STIFFNESS, CONTACT_DAMPING, SURFACE_DAMPING,
    M0_MIN, M0_MAX, M0_RATE, RP1_MIN, RP1_MAX, RP1_RATE, DELTA_MAX, DELTA_RATE,
    HULL_MASS, HULL_COMPRESSIBILITY,
    ENERGY_0, ENERGY_M0, ENERGY_RP1, ENERGY_DELTA,
) = range(52)
# fmt: on
"""Index of each number in a packed vehicle."""

COS_PITCH_FLOOR = 0.02
"""Smallest cosine of pitch in the Euler rates, which are singular at 90 degrees."""

Six = tuple[float, float, float, float, float, float]
"""Three components along the body axes and three about them."""


@inlined_kernel
def hydrodynamic_wrench(
    v1: float,
    v2: float,
    v3: float,
    w1: float,
    w2: float,
    w3: float,
    delta: float,
    p: FloatArray,
    extended: bool,
) -> Six:
    """Force N and moment N m of the water in body axes (thesis Eq. 3.4, or 5.18 if extended).

    ``R_bv`` needs no trigonometry: its sines and cosines are ratios of the velocities.
    """
    across = math.sqrt(v1 * v1 + v3 * v3)
    speed = math.sqrt(v1 * v1 + v2 * v2 + v3 * v3)
    if speed == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    ca, sa = (v1 / across, v3 / across) if across > 0.0 else (1.0, 0.0)
    cb, sb = across / speed, v2 / speed
    alpha = math.atan2(v3, v1)
    beta = math.atan2(v2, across)
    q = 0.5 * p[WATER_DENSITY] * speed * speed * p[AREA]
    drag = q * (p[DRAG_0] + p[DRAG_ALPHA] * alpha * alpha + p[DRAG_DELTA] * delta * delta)
    side = q * (p[SIDE_BETA] * beta + p[SIDE_DELTA] * delta)
    lift = q * (p[LIFT_0] + p[LIFT_ALPHA] * alpha)
    pitch_alpha = alpha
    if extended:
        lift *= ca
        pitch_alpha = sa * ca
    roll = q * (p[ROLL_BETA] * beta + p[ROLL_DAMPING] * w1)
    pitch = q * (p[PITCH_0] + p[PITCH_ALPHA] * pitch_alpha + p[PITCH_DAMPING] * w2)
    yaw = q * (p[YAW_BETA] * beta + p[YAW_DAMPING] * w3 + p[YAW_DELTA] * delta)
    return (
        -ca * cb * drag - ca * sb * side + sa * lift,
        -sb * drag + cb * side,
        -sa * cb * drag - sa * sb * side - ca * lift,
        ca * cb * roll - ca * sb * pitch - sa * yaw,
        sb * roll + cb * pitch,
        sa * cb * roll - sa * sb * pitch + ca * yaw,
    )


@inlined_kernel
def rigid_body(
    x: FloatArray, m0: float, rp1: float, wrench: Six, p: FloatArray, out: FloatArray
) -> None:
    """Write the 12 rates of a body under ``wrench``, gravity and net buoyancy into ``out``."""
    sf, cf = math.sin(x[3]), math.cos(x[3])
    st, ct = math.sin(x[4]), math.cos(x[4])
    sp, cp = math.sin(x[5]), math.cos(x[5])
    v1, v2, v3, w1, w2, w3 = x[6], x[7], x[8], x[9], x[10], x[11]
    m1, m2, m3 = p[MASS_1], p[MASS_2], p[MASS_3]
    j1, j2, j3 = p[INERTIA_1], p[INERTIA_2], p[INERTIA_3]
    g = p[GRAVITY]
    out[0] = ct * cp * v1 + (cp * st * sf - cf * sp) * v2 + (sf * sp + cf * cp * st) * v3
    out[1] = ct * sp * v1 + (cf * cp + st * sf * sp) * v2 + (cf * st * sp - cp * sf) * v3
    out[2] = -st * v1 + ct * sf * v2 + ct * cf * v3
    safe = ct if abs(ct) >= COS_PITCH_FLOOR else math.copysign(COS_PITCH_FLOOR, ct)
    turn = (sf * w2 + cf * w3) / safe
    out[3] = w1 + st * turn
    out[4] = cf * w2 - sf * w3
    out[5] = turn
    weight = m0 * g
    out[6] = (m2 * v2 * w3 - m3 * v3 * w2 - weight * st + wrench[0]) / m1
    out[7] = (m3 * v3 * w1 - m1 * v1 * w3 + weight * ct * sf + wrench[1]) / m2
    out[8] = (m1 * v1 * w2 - m2 * v2 * w1 + weight * ct * cf + wrench[2]) / m3
    hang = p[OFFSET_MASS] * g * p[OFFSET_MASS_DEPTH]
    tilt = p[SLIDING_MASS] * g * rp1
    out[9] = ((j2 - j3) * w2 * w3 + (m2 - m3) * v2 * v3 + wrench[3] - hang * ct * sf) / j1
    out[10] = (
        (j3 - j1) * w3 * w1 + (m3 - m1) * v3 * v1 + wrench[4] - hang * st - tilt * ct * cf
    ) / j2
    out[11] = ((j1 - j2) * w1 * w2 + (m1 - m2) * v1 * v2 + wrench[5] + tilt * ct * sf) / j3


@inlined_kernel
def derivative_into(
    x: FloatArray, m0: float, rp1: float, delta: float, p: FloatArray, out: FloatArray
) -> None:
    """Write the rates of the 12-state model of thesis Eq. 3.2 into ``out``, shape ``(12,)``."""
    wrench = hydrodynamic_wrench(x[6], x[7], x[8], x[9], x[10], x[11], delta, p, False)
    rigid_body(x, m0, rp1, wrench, p, out)


@kernel
def state_derivative(state: FloatArray, inputs: FloatArray, packed: FloatArray) -> FloatArray:
    """Rates of the 12-state model, shape ``(12,)``; ``inputs`` is net mass, sliding mass, tail."""
    out = np.empty(12)
    derivative_into(state, inputs[0], inputs[1], inputs[2], packed, out)
    return out


@inlined_kernel
def rk4_into(
    x: FloatArray,
    m0: float,
    rp1: float,
    delta: float,
    p: FloatArray,
    dt_s: float,
    slope: FloatArray,
    total: FloatArray,
    probe: FloatArray,
) -> None:
    """Advance ``x`` in place by one Runge-Kutta step; the last three are scratch, ``(12,)``."""
    derivative_into(x, m0, rp1, delta, p, total)
    for i in range(12):
        probe[i] = x[i] + 0.5 * dt_s * total[i]
    derivative_into(probe, m0, rp1, delta, p, slope)
    for i in range(12):
        total[i] += 2.0 * slope[i]
        probe[i] = x[i] + 0.5 * dt_s * slope[i]
    derivative_into(probe, m0, rp1, delta, p, slope)
    for i in range(12):
        total[i] += 2.0 * slope[i]
        probe[i] = x[i] + dt_s * slope[i]
    derivative_into(probe, m0, rp1, delta, p, slope)
    for i in range(12):
        x[i] += dt_s / 6.0 * (total[i] + slope[i])


@kernel
def rk4_step(
    state: FloatArray, inputs: FloatArray, packed: FloatArray, dt_s: float, steps: int
) -> FloatArray:
    """Return the 12 states after ``steps`` Runge-Kutta steps with constant inputs."""
    x = state.copy()
    slope, total, probe = np.empty(12), np.empty(12), np.empty(12)
    m0, rp1, delta = inputs[0], inputs[1], inputs[2]
    for _ in range(steps):
        rk4_into(x, m0, rp1, delta, packed, dt_s, slope, total, probe)
    return x


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    packed = np.ones(DELTA_RATE + 1)
    state, inputs = np.zeros(12), np.zeros(3)
    state_derivative(state, inputs, packed)
    rk4_step(state, inputs, packed, 0.01, 1)
