"""Swimming along a reference, readable; ``swimming_kernel`` is the fast twin."""

import math
from dataclasses import dataclass, replace

from autonomy.arrays import FloatArray
from autonomy.control.controller import ActuatorCommand
from autonomy.control.reference.integral import integral_inputs
from autonomy.control.swimming_config import SLOWEST_M_S, TURNING_SHARE, SwimmingConfig
from autonomy.control.trajectory import Reference
from autonomy.vehicle.config import Vehicle, VehicleParameters


@dataclass(frozen=True, slots=True)
class Course:
    """Where to swim, and how fast."""

    heading_error_rad: float
    """Wanted course minus heading, within half a turn."""
    speed_m_s: float
    """Wanted speed along the heading."""


def swimming_command(
    state: FloatArray,
    reference: Reference,
    learned: FloatArray,
    config: SwimmingConfig,
    vehicle: Vehicle,
    dt_s: float,
) -> tuple[ActuatorCommand, FloatArray]:
    """Set points inside the end stops, and what was learned of net buoyancy and mass position.

    Args:
        state: The 12 states or their estimate, shape ``(12,)``.
        reference: Where the vehicle should be; its pitch is not tracked.
        learned: As of ``integral_inputs``.
        config: Gains and gait.
        vehicle: The model, the end stops and the servo's rate.
        dt_s: Time since the last call.
    """
    pitch = state[4]
    forward = math.cos(pitch) * state[6] + math.sin(pitch) * state[8]
    course = wanted_course(state, reference, config.position_gain)
    sink = reference.velocity_ned[2] + config.depth_gain * (reference.position_ned[2] - state[2])
    wanted_pitch = -math.atan2(sink, max(forward, SLOWEST_M_S))
    most = config.pitch_most_rad
    level = replace(
        reference,
        pitch_rad=min(max(wanted_pitch, -most), most),
        pitch_rate_rad_s=0.0,
        pitch_acceleration_rad_s2=0.0,
    )
    inputs, learned = integral_inputs(state, level, learned, config, vehicle, dt_s)
    turn_rate = state[11] / math.cos(pitch)
    bias = config.heading_rate_gain * turn_rate - config.heading_gain * course.heading_error_rad
    bias = min(max(bias, -config.bias_most_rad), config.bias_most_rad)
    speed = course.speed_m_s + config.speed_gain * (course.speed_m_s - forward)
    amplitude = amplitude_for(speed, bias, config, vehicle)
    m0, rp1, tail = vehicle.limits.clip(float(inputs[0]), float(inputs[1]), bias)
    return ActuatorCommand(m0, rp1, tail, amplitude, config.frequency_hz), learned


def wanted_course(state: FloatArray, reference: Reference, position_gain: float) -> Course:
    """Add what closes the horizontal error to the reference's velocity.

    Args:
        state: The 12 states or their estimate, shape ``(12,)``.
        reference: Where the vehicle should be.
        position_gain: Speed by distance, 1/s.
    """
    north = reference.velocity_ned[0] + position_gain * (reference.position_ned[0] - state[0])
    east = reference.velocity_ned[1] + position_gain * (reference.position_ned[1] - state[1])
    sp, cp = math.sin(state[5]), math.cos(state[5])
    along, cross = north * cp + east * sp, -north * sp + east * cp
    return Course(math.atan2(cross, along), max(along, TURNING_SHARE * math.hypot(along, cross)))


def amplitude_for(
    speed_m_s: float, bias_rad: float, config: SwimmingConfig, vehicle: Vehicle
) -> float:
    """Amplitude rad at which mean thrust and drag of a straight swim are in balance.

    With the tail at ``bias + a sin(w t)`` the corrected thrust of section 5.3 has the mean
    ``m l w^2 a^2 cos(bias) / 2``, and the drag grows by the mean square of the tail's angle. The
    servo follows a flap with a share of its amplitude and no faster than its rate.

    Args:
        speed_m_s: Wanted, through the water.
        bias_rad: Angle about which the tail flaps.
        config: Frequency and greatest amplitude.
        vehicle: Its model and the servo's rate.
    """
    p, w = vehicle.parameters, 2.0 * math.pi * config.frequency_hz
    thrust, follows = _mean_thrust(p, config.frequency_hz)
    thrust *= math.cos(bias_rad)
    pressure = 0.5 * p.water_density_kg_m3 * p.area_m2 * max(speed_m_s, 0.0) ** 2
    steady = pressure * (p.drag_0 + p.drag_delta * bias_rad**2)
    flapping = 0.5 * pressure * p.drag_delta * follows**2
    most = min(
        config.amplitude_most_rad,
        vehicle.limits.delta_rate_rad_s / w,
        max(vehicle.limits.delta_max_rad - abs(bias_rad), 0.0),
    )
    if thrust <= flapping:
        return most if speed_m_s > 0.0 else 0.0
    return min(math.sqrt(steady / (thrust - flapping)), most)


def swimming_speed(vehicle: Vehicle) -> float:
    """Speed m/s at which thrust and drag of the vehicle's own gait are in balance."""
    p, gait = vehicle.parameters, vehicle.swim
    thrust, follows = _mean_thrust(p, gait.frequency_hz)
    fastest = vehicle.limits.delta_rate_rad_s / (2.0 * math.pi * gait.frequency_hz)
    squared = min(gait.amplitude_rad, fastest) ** 2
    drag = p.drag_0 + 0.5 * p.drag_delta * follows**2 * squared
    return math.sqrt(2.0 * thrust * squared / (p.water_density_kg_m3 * p.area_m2 * drag))


def _mean_thrust(p: VehicleParameters, frequency_hz: float) -> tuple[float, float]:
    """Mean thrust N by squared amplitude, and the share of an amplitude that the servo follows."""
    w = 2.0 * math.pi * frequency_hz
    follows = p.tail_response_per_s / math.hypot(p.tail_response_per_s, w)
    water_kg = p.water_density_kg_m3 * p.tail_area_m2 * p.tail_water_length_m
    return 0.5 * water_kg * p.tail_centre_m * (w * follows) ** 2, follows
