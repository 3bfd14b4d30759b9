"""What a scenario means for one seed: reference, true vehicle, start and noise as arrays."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.control.trajectory import (
    Reference,
    diagonal,
    figure_eight,
    linear_glide,
    sawtooth,
    straight_glide,
)
from autonomy.current.table import FlowTable, uniform_table
from autonomy.vehicle.config import Vehicle, VehicleParameters
from autonomy.vehicle.glide import angle_of_attack
from autonomy.vehicle.surroundings import Surroundings
from autonomy.whatif.config import StraightConfig, TrialConfig
from autonomy.whatif.kernel import correlate

_THESIS: dict[str, Callable[[float], Reference]] = {
    "linear_glide": linear_glide,
    "sawtooth": sawtooth,
    "diagonal": diagonal,
    "figure_eight": figure_eight,
}
_KNOWN_EXACTLY = frozenset({"gravity_m_s2", "water_density_kg_m3", "area_m2"})
"""Parameters that are measured apart or enter only as products with others."""
_START, _PARAMETERS, _NOISE = range(3)
"""Streams of random numbers of one seed: what one of them draws does not move the others."""


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """Everything of one seed that does not depend on the controller."""

    references: FloatArray
    """Packed reference at each command, shape ``(n, 12)``."""
    true: FloatArray
    """``Vehicle.packed()`` of the robot that flies."""
    start: FloatArray
    """Shape ``(12,)``."""
    noise: FloatArray
    """Shape ``(n, 9)``, or ``(0, 9)`` for exact states."""
    conditions: FloatArray
    """Shape ``(6,)``, as ``autonomy.whatif.kernel`` indexes it."""
    surroundings: FloatArray
    """``Surroundings.packed()`` of the water."""
    delay_steps: int
    """Steps by which a command comes late."""
    flow: FlowTable
    """The current by place, depth and time of the flight."""


def reference_function(vehicle: Vehicle, config: TrialConfig) -> Callable[[float], Reference]:
    """Return the scenario's trajectory as a function of time.

    Raises:
        NoSteadyGlideError: If a straight glide is flatter than the vehicle can glide.
    """
    if config.reference == "straight_glide":
        return _straight(vehicle, config.straight)
    if config.reference == "level_swim":
        return _level(config.straight)
    return _THESIS[config.reference]


def packed_references(vehicle: Vehicle, config: TrialConfig) -> FloatArray:
    """Return the packed reference at each command, shape ``(n, 12)``."""
    trajectory = reference_function(vehicle, config)
    packed = np.empty((config.periods, 12))
    for k in range(config.periods):
        packed[k] = trajectory(k * config.period_s).packed()
    return packed


def setting(
    vehicle: Vehicle,
    config: TrialConfig,
    seed: int,
    references: FloatArray,
    flow: FlowTable | None = None,
) -> Setting:
    """Draw what one seed decides.

    Args:
        vehicle: The robot that the controllers believe in.
        config: The scenario.
        seed: Of this run; the same for every controller.
        references: From ``packed_references``, shape ``(n, 12)``.
        flow: The current by place, depth and time of the flight; that of the scenario by default.
    """
    off, sensing = config.disturbance, config.sensing
    current = (off.current_north_m_s, off.current_east_m_s)
    return Setting(
        references=references,
        true=_true_vehicle(vehicle, config, seed).packed(),
        start=_start(config, seed, references[0]),
        noise=_noise(config, seed, len(references)),
        conditions=np.array(
            [
                off.net_buoyancy_error_kg,
                off.mass_position_error_m,
                *current,
                sensing.observer_velocity_gain,
                sensing.observer_depth_gain,
            ]
        ),
        surroundings=Surroundings(current_ned_m_s=(*current, 0.0)).packed(),
        delay_steps=round(off.actuator_delay_s / config.step_s),
        flow=uniform_table(*current) if flow is None else flow,
    )


def _straight(vehicle: Vehicle, straight: StraightConfig) -> Callable[[float], Reference]:
    angle = straight.glide_angle_rad
    pitch = angle + angle_of_attack(vehicle.parameters, angle)
    sink = -math.copysign(straight.vertical_speed_m_s, angle)
    along = straight.vertical_speed_m_s / math.tan(abs(angle))
    velocity = (
        along * math.cos(straight.heading_rad),
        along * math.sin(straight.heading_rad),
        sink,
    )
    return lambda time_s: straight_glide((0.0, 0.0, straight.depth_m), velocity, pitch, time_s)


def _level(straight: StraightConfig) -> Callable[[float], Reference]:
    speed, heading = straight.swim_speed_m_s, straight.heading_rad
    velocity = (speed * math.cos(heading), speed * math.sin(heading), 0.0)
    return lambda time_s: straight_glide((0.0, 0.0, straight.depth_m), velocity, 0.0, time_s)


def _true_vehicle(vehicle: Vehicle, config: TrialConfig, seed: int) -> Vehicle:
    off = config.disturbance
    rate = vehicle.limits.rp1_rate_m_s * off.actuator_rate_share
    limits = vehicle.limits.model_copy(update={"rp1_rate_m_s": rate})
    parameters = vehicle.parameters
    if off.parameter_error > 0.0:
        rng = np.random.default_rng([seed, _PARAMETERS])
        names = [name for name in VehicleParameters.model_fields if name not in _KNOWN_EXACTLY]
        # cut so that no mass changes its sign
        factors = 1.0 + np.clip(off.parameter_error * rng.standard_normal(len(names)), -0.8, 2.0)
        values = parameters.model_dump()
        wrong = {name: values[name] * f for name, f in zip(names, factors.tolist(), strict=True)}
        parameters = VehicleParameters(**(values | wrong))
    return replace(vehicle, parameters=parameters, limits=limits)


def _start(config: TrialConfig, seed: int, first: FloatArray) -> FloatArray:
    start = config.start
    scatter = np.random.default_rng([seed, _START]).standard_normal(3)
    state = np.zeros(12)
    state[0] = first[0] + start.north_m + start.position_scatter_m * scatter[0]
    state[1] = first[1] + start.east_m + start.position_scatter_m * scatter[1]
    state[2] = first[2] + start.down_m
    state[4] = start.pitch_rad
    state[5] = start.heading_rad + start.heading_scatter_rad * scatter[2]
    state[6] = start.forward_speed_m_s
    return state


def _noise(config: TrialConfig, seed: int, count: int) -> FloatArray:
    """Return noise of north, east, depth, roll, pitch, heading and three gyros, ``(n, 9)``."""
    sensing = config.sensing
    if sensing.exact:
        return np.empty((0, 9))
    white = np.random.default_rng([seed, _NOISE]).standard_normal((count, 9))
    if sensing.position_correlation_s > 0.0:
        correlate(white, 2, math.exp(-config.period_s / sensing.position_correlation_s))
    s = sensing
    std = [s.position_std_m] * 2 + [s.depth_std_m] + [s.tilt_std_rad] * 2 + [s.heading_std_rad]
    white *= np.array(std + [s.gyro_std_rad_s] * 3)
    return white
