"""Compiled rates of the extended model: tail, contact and water around the rigid body.

``autonomy.vehicle.reference.dynamics`` is the readable reference; arrays are packed as in
``autonomy.vehicle.kernel``.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inner_kernel, kernel
from autonomy.vehicle import kernel as body
from autonomy.vehicle import water_kernel as water

hydrodynamic_wrench = body.hydrodynamic_wrench
rigid_body = body.rigid_body
water_flow = water.water_flow
net_mass_and_density = water.net_mass_and_density
water_surface = water.surface
PLAIN = water.PLAIN
"""Names that numba resolves once, when it compiles."""


@inner_kernel
def contact_force(
    x: FloatArray,
    rate: FloatArray,
    surroundings: FloatArray,
    p: FloatArray,
    level: float,
    level_rate: float,
) -> tuple[float, float, float]:
    """Force N of surface, floor and walls on the robot in NED; they push and never pull.

    Args:
        x: State; its first three are the position.
        rate: Velocity over ground in NED in the first three, m/s.
        surroundings: As in ``advance``.
        p: Packed vehicle.
        level: Depth of the surface where the robot is, m; 0 without waves.
        level_rate: Its rate, m/s.
    """
    k, c = p[body.CONTACT_STIFFNESS], p[body.CONTACT_DAMPING]
    north, east, down = 0.0, 0.0, 0.0
    if x[2] < level:
        down = max(0.0, -k * (x[2] - level) - c * (rate[2] - level_rate))
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


@inner_kernel
def _in_body_axes(
    x: FloatArray, north: float, east: float, down: float
) -> tuple[float, float, float]:
    """Return the components of a NED vector along the robot's axes."""
    sf, cf = math.sin(x[3]), math.cos(x[3])
    st, ct = math.sin(x[4]), math.cos(x[4])
    sp, cp = math.sin(x[5]), math.cos(x[5])
    return (
        ct * cp * north + ct * sp * east - st * down,
        (cp * st * sf - cf * sp) * north + (cf * cp + st * sf * sp) * east + ct * sf * down,
        (sf * sp + cf * cp * st) * north + (cf * st * sp - cp * sf) * east + ct * cf * down,
    )


@inner_kernel
def _apply_contact(
    x: FloatArray,
    surroundings: FloatArray,
    p: FloatArray,
    level: float,
    level_rate: float,
    out: FloatArray,
) -> None:
    """Add what surface, floor and walls do to the rates in ``out``."""
    north, east, down = contact_force(x, out, surroundings, p, level, level_rate)
    if north != 0.0 or east != 0.0 or down != 0.0:
        f1, f2, f3 = _in_body_axes(x, north, east, down)
        out[6] += f1 / p[body.MASS_1]
        out[7] += f2 / p[body.MASS_2]
        out[8] += f3 / p[body.MASS_3]
    if x[2] < level:
        out[9] -= p[body.SURFACE_DAMPING] * x[9]
        out[10] -= p[body.SURFACE_DAMPING] * x[10]


@inner_kernel
def _apply_flow(
    x: FloatArray,
    m0: float,
    surroundings: FloatArray,
    time_s: float,
    p: FloatArray,
    out: FloatArray,
) -> None:
    """Add to the rates in ``out`` what water does that moves differently here and there.

    See ``dynamics.flow_acceleration``.
    """
    flow = water_flow(x, time_s, surroundings)
    north, east, down = out[0], out[1], out[2]
    out[0] += flow[0]
    out[1] += flow[1]
    out[2] += flow[2]
    met, own = np.empty(3), np.empty(3)
    for i in range(3):
        row = 3 + 3 * i
        met[i] = flow[row] * north + flow[row + 1] * east + flow[row + 2] * down
        carried = flow[row] * flow[0] + flow[row + 1] * flow[1] + flow[row + 2] * flow[2]
        own[i] = m0 * (flow[12 + i] + carried)
    a1, a2, a3 = _in_body_axes(x, met[0], met[1], met[2])
    f1, f2, f3 = _in_body_axes(x, own[0], own[1], own[2])
    out[6] -= a1 + f1 / p[body.MASS_1]
    out[7] -= a2 + f2 / p[body.MASS_2]
    out[8] -= a3 + f3 / p[body.MASS_3]


@inner_kernel
def extended_derivative_into(
    x: FloatArray,
    m0_rate: float,
    rp1_rate: float,
    tail_target: float,
    flap_acceleration: float,
    p: FloatArray,
    surroundings: FloatArray,
    out: FloatArray,
    time_s: float = 0.0,
) -> None:
    """Write the rates of the 15-state model of thesis Eq. 5.17 into ``out``, shape ``(15,)``."""
    delta, m0, density = x[14], x[12], 1.0
    is_mixed = surroundings.shape[0] > PLAIN
    is_layered = p.shape[0] > body.HULL_COMPRESSIBILITY and (
        is_mixed or p[body.HULL_COMPRESSIBILITY] > 0.0
    )
    f1, f2, f3, t1, t2, t3 = hydrodynamic_wrench(
        x[6], x[7], x[8], x[9], x[10], x[11], delta, p, True
    )
    out[12] = m0_rate
    out[13] = rp1_rate
    wanted = p[body.TAIL_RESPONSE] * (tail_target - delta)
    out[14] = min(max(wanted, -p[body.DELTA_RATE]), p[body.DELTA_RATE])
    water_kg = p[body.WATER_DENSITY] * p[body.TAIL_AREA] * p[body.TAIL_WATER_LENGTH]
    thrust = -water_kg * p[body.TAIL_CENTRE] * flap_acceleration
    push, turn = 0.0, 0.0
    if thrust != 0.0:  # a tail that does not flap needs no trigonometry
        push, turn = thrust * math.sin(delta), p[body.TAIL_ARM] * thrust * math.cos(delta)
    f1 += push
    t1 -= p[body.CROSSFLOW_1] * abs(x[9]) * x[9]
    t2 -= p[body.CROSSFLOW_2] * abs(x[10]) * x[10]
    t3 += turn - p[body.CROSSFLOW_3] * abs(x[11]) * x[11]
    if is_layered:
        m0, density = net_mass_and_density(m0, x[2], p, surroundings)
        f1, f2, f3 = density * f1, density * f2, density * f3
        t1, t2, t3 = density * t1, density * t2, density * t3
    rigid_body(x, m0, x[13], (f1, f2, f3, t1, t2, t3), p, out)
    level, level_rate = 0.0, 0.0
    if is_mixed:
        _apply_flow(x, m0, surroundings, time_s, p, out)
        level, level_rate = water_surface(x, out, time_s, surroundings)
    else:
        out[0] += surroundings[0]
        out[1] += surroundings[1]
        out[2] += surroundings[2]
    _apply_contact(x, surroundings, p, level, level_rate, out)


@kernel
def extended_state_derivative(
    state: FloatArray,
    actuator: FloatArray,
    packed: FloatArray,
    surroundings: FloatArray,
    time_s: float = 0.0,
) -> FloatArray:
    """Rates of the 15-state model, shape ``(15,)``.

    Args:
        state: Shape ``(15,)``: the 12 states, net mass kg, sliding mass m, tail rad.
        actuator: Rate of the net mass kg/s, of the sliding mass m/s, reference of the tail rad,
            acceleration of the tail's flap rad/s2.
        packed: ``Vehicle.packed()``.
        surroundings: As in ``advance``.
        time_s: Time, which the waves depend on.
    """
    out = np.empty(15)
    m0_rate, rp1_rate, target, flap = actuator[0], actuator[1], actuator[2], actuator[3]
    extended_derivative_into(
        state, m0_rate, rp1_rate, target, flap, packed, surroundings, out, time_s
    )
    return out


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    packed, surroundings = np.ones(body.ENERGY_DELTA + 1), np.zeros(PLAIN)
    extended_state_derivative(np.zeros(15), np.zeros(4), packed, surroundings, 0.0)
