"""The proposed backstepping controller, readable; ``autonomy.control.kernel`` is the fast twin."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.control.config import BacksteppingConfig
from autonomy.control.reference.error import TrackingError, tracking_error
from autonomy.control.trajectory import Reference
from autonomy.vehicle.config import Vehicle, VehicleParameters
from autonomy.vehicle.reference.dynamics import flow_angles, flow_rotation, state_derivative


@dataclass(frozen=True, slots=True)
class Drift:
    """What the model does without inputs at roll 0, and what the tail adds."""

    acceleration: FloatArray
    """Rate of v at neutral buoyancy and straight tail, in body axes, shape ``(3,)``."""
    turning: FloatArray
    """``w x v``, shape ``(3,)``."""
    pitch_acceleration: float
    yaw_acceleration: float
    tail_linear: FloatArray
    """Acceleration by tail angle (B), shape ``(3,)``."""
    tail_square: FloatArray
    """Acceleration by squared tail angle (C), shape ``(3,)``."""
    tail_yaw: float
    """Yaw acceleration by tail angle."""


@dataclass(frozen=True, slots=True)
class Solution:
    """What the law asks for, and what laws that build on it need."""

    inputs: FloatArray
    """Net mass kg, sliding mass m, tail angle rad, not yet limited, shape ``(3,)``."""
    error: TrackingError
    mass_effect: float
    """Second derivative of the depth error by net mass, m/(s2 kg) (f_11)."""
    slide_effect: float
    """Second derivative of the hybrid error by sliding mass, rad/(s2 m) (f_32)."""


def backstepping_inputs(
    state: FloatArray, reference: Reference, config: BacksteppingConfig, vehicle: Vehicle
) -> FloatArray:
    """Net mass kg, sliding mass m and tail angle rad that the law asks for, not yet limited.

    Args:
        state: The 12 states or their estimate, shape ``(12,)``; roll is taken as 0.
        reference: Where the vehicle should be.
        config: Gains; a ``pitch_trade_rad`` of 0 makes it the baseline controller.
        vehicle: The model, and the end stop of the tail whose clipped angle the other laws use.

    Returns:
        Shape ``(3,)``.

    Source:
        Thesis Eq. 3.19, solved in the order tail, net mass, sliding mass.
    """
    return solve(state, reference, config, vehicle).inputs


def solve(
    state: FloatArray,
    reference: Reference,
    config: BacksteppingConfig,
    vehicle: Vehicle,
    added_along_m: float = 0.0,
) -> Solution:
    """Solve the law; arguments as of ``backstepping_inputs`` and ``tracking_error``."""
    p = vehicle.parameters
    error = tracking_error(
        state,
        reference,
        pitch_trade_rad=config.pitch_trade_rad,
        near_m=config.near_m,
        near_offset_m=config.near_offset_m,
        added_along_m=added_along_m,
    )
    drift = model_drift(state, p)
    st, ct = math.sin(state[4]), math.cos(state[4])
    w2, w3 = state[10], state[11]

    f25 = drift.yaw_acceleration / ct + w3 * w2 * st / ct**2
    f23 = drift.tail_yaw / ct
    f23 = math.copysign(max(abs(f23), config.tail_effect_min), p.yaw_delta_m)
    wanted = -f25 - config.k_2 * error.direction_rate - config.k_psi * error.direction
    tail = wanted / f23 if f23 != 0.0 else 0.0
    stop = vehicle.limits.delta_max_rad
    reachable = min(max(tail, -stop), stop) if config.is_tail_clipped_first else tail

    # -z'' of the vehicle is s_th (.)_1 - c_th (.)_3
    up = np.array([st, 0.0, -ct])
    f15 = reference.acceleration_ned[2] + up @ (drift.acceleration + drift.turning)
    f11 = -p.gravity_m_s2 * (st**2 / p.mass_1_kg + ct**2 / p.mass_3_kg)
    by_tail = up @ drift.tail_linear * reachable + up @ drift.tail_square * reachable**2
    net_mass = (-f15 - config.k_1 * error.depth_rate - config.k_z * error.depth - by_tail) / f11

    c = config.pitch_trade_rad
    slope = 1.0 + c * _sech2(state[4]) * math.tanh(error.traded)
    f32 = p.sliding_mass_kg * p.gravity_m_s2 / p.inertia_2_kg_m2 * ct * slope
    f35 = reference.pitch_acceleration_rad_s2 - slope * drift.pitch_acceleration
    f35 -= c * _trade_acceleration(state, reference, error, drift, f25)
    sliding = (-f35 - config.k_3 * error.hybrid_rate - config.k_xi * error.hybrid) / f32
    return Solution(np.array([net_mass, sliding, tail]), error, f11, f32)


def model_drift(state: FloatArray, p: VehicleParameters) -> Drift:
    """Split the model's accelerations in states ``(12,)``, at roll 0, into drift and the tail's."""
    level = state.copy()
    level[3] = 0.0
    rates = state_derivative(level, np.zeros(3), p)
    v, w = state[6:9], state[9:12]
    alpha, beta = flow_angles(v)
    to_body = flow_rotation(alpha, beta)
    q = 0.5 * p.water_density_kg_m3 * float(v @ v) * p.area_m2
    mass = np.array([p.mass_1_kg, p.mass_2_kg, p.mass_3_kg])
    return Drift(
        acceleration=rates[6:9],
        turning=np.cross(w, v),
        pitch_acceleration=float(rates[10]),
        yaw_acceleration=float(rates[11]),
        tail_linear=to_body[:, 1] * q * p.side_delta / mass,
        tail_square=-to_body[:, 0] * q * p.drag_delta / mass,
        tail_yaw=math.cos(alpha) * q * p.yaw_delta_m / p.inertia_3_kg_m2,
    )


def _trade_acceleration(
    state: FloatArray, reference: Reference, error: TrackingError, drift: Drift, turn_drift: float
) -> float:
    """Second derivative of ``tanh(theta) tanh(along)`` without inputs and without ``theta''``."""
    pitch, heading = state[4], state[5]
    st, ct = math.sin(pitch), math.cos(pitch)
    sp, cp = math.sin(heading), math.cos(heading)
    v1, _, v3 = state[6:9]
    w2, turn_rate = state[10], state[11] / ct
    ax, ay, _ = reference.acceleration_ned
    vx, vy, _ = reference.velocity_ned
    # f = c_th v1 + s_th v3 is the speed along the heading
    forward_rate = (
        ct * drift.acceleration[0] + st * drift.acceleration[2] + w2 * (ct * v3 - st * v1)
    )
    along_acceleration = (
        ax * cp
        + ay * sp
        + turn_rate * (-vx * sp + vy * cp)
        - forward_rate
        + turn_drift * error.cross
        + turn_rate * error.cross_rate
    )
    tanh_pitch, tanh_along = math.tanh(pitch), math.tanh(error.traded)
    sech2_pitch, sech2_along = _sech2(pitch), _sech2(error.traded)
    return (
        -2.0 * sech2_pitch * tanh_pitch * w2**2 * tanh_along
        + 2.0 * sech2_pitch * sech2_along * w2 * error.along_rate
        + tanh_pitch
        * (sech2_along * along_acceleration - 2.0 * sech2_along * tanh_along * error.along_rate**2)
    )


def _sech2(x: float) -> float:
    return 1.0 - math.tanh(x) ** 2
