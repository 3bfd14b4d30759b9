"""What a vehicle can fly, as the planner's primitives and prices, from its own model.

Speeds and angles follow from the polar, the actuators' ends and rates, and the gait; how coarse
the primitives are follows from the depth that they must fit into.
"""

import math
from collections.abc import Callable

import numpy as np

from autonomy.planner.config import EnergyConfig, PrimitiveConfig
from autonomy.planner.work import CHANGE_SHARE, DIVE_PUMP_SHARE, SPIRAL_TAILS_RAD, work_of
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.extended_kernel import advance
from autonomy.vehicle.glide import NoSteadyGlideError, angle_of_attack, glide_inputs
from autonomy.vehicle.steady import SteadyGlide, steady_glide
from autonomy.vehicle.surroundings import Surroundings

_DEPTH_IN_LENGTHS = 10.0
"""Depth of the water if nobody says otherwise, in lengths of the robot from tail to nose."""
_CHANGEOVER_SHARE = 0.5
"""Part of the shortest glide within which pump and sliding mass must have changed over."""
_PUMP_SHARE = 2.0 / 3.0
"""Part of the pump's range that a glide may take; control needs the rest."""
_SLIDE_SHARE = 0.97
"""Part of the sliding mass's range that a glide may take."""
_STALL_MARGIN_RAD = math.radians(3.0)
"""Flattest glides are this much steeper than the best ratio of lift to drag."""
_STEP_RAD = math.radians(0.25)
_SPIRAL_SPEED_SHARE = 0.8
_SPIRAL_GLIDE_RAD = math.radians(45.0)
_DIVE_SHARE = 0.9
"""Part of the speed with half of the pump that a flat dive is planned with."""
_SWIM_SHARE = 0.75
"""Part of the gait's speed that a swim is planned with: it begins at rest and holds a course."""
_SWIM_MIN_SHARE = 0.4
"""Shortest swim as a share of the depth; the longest is as long as the water is deep."""
_SWIM_SETTLING_S = 180.0
_SWIM_MEASURED_S = 60.0
_FLOATING_SHARE = 0.3
_PHYSICS_STEP_S = 0.02
_POINTS_PER_GLIDE = 20
_BISECTIONS = 40
_FASTEST_M_S = 2.0
_SLOWEST_M_S = 1e-3
_MIDDLE = 0.5


def motion_of(vehicle: Vehicle, depth_m: float | None = None) -> PrimitiveConfig:
    """Return the primitives that a vehicle can fly.

    Args:
        vehicle: The robot.
        depth_m: Depth of the water to explore: deeper water leaves actuators more time, so glides
            may be faster. By default ten lengths of the robot.

    Raises:
        NoSteadyGlideError: If its model has no glide down or none up that leaves its actuators
            room; the message says which.
    """
    depth = _DEPTH_IN_LENGTHS * vehicle.hull.tail_to_nose_m if depth_m is None else depth_m
    change = CHANGE_SHARE * depth
    flattest = _flattest_rad(vehicle)
    speed = _glide_speed(vehicle, flattest, change)
    steepest = _steepest_rad(vehicle, flattest, speed)
    spiral_speed = _SPIRAL_SPEED_SHARE * speed
    wide, tight = _spirals(vehicle, spiral_speed)
    return PrimitiveConfig(
        glide_speed_m_s=speed,
        glide_angle_min_rad=flattest,
        glide_angle_max_rad=steepest,
        spiral_speed_m_s=spiral_speed,
        spiral_radius_min_m=tight.turn_radius_m,
        spiral_radius_max_m=wide.turn_radius_m,
        spiral_rise_min_m_rad=_rise(tight),
        spiral_rise_max_m_rad=_rise(wide),
        dive_speed_m_s=_dive_speed(vehicle),
        swim_speed_m_s=_SWIM_SHARE * swimming_speed_m_s(vehicle),
        swim_length_min_m=_SWIM_MIN_SHARE * depth,
        swim_length_max_m=depth,
        swims_under_water=False,
        depth_change_min_m=change,
        bearing_noise_rad=0.35,
        point_interval_s=depth / speed / _POINTS_PER_GLIDE,
    )


def energy_of(vehicle: Vehicle, motion: PrimitiveConfig | None = None) -> EnergyConfig:
    """Return the prices of a vehicle's primitives, in units in which time costs what it always did.

    The unit is the work that the thesis's price of time makes of the vehicle's electronics
    (``time_unit_j``); everything else is priced by what it takes from the battery. The presets
    keep the thesis's prices of actuators, which are many times dearer on purpose, so that plans in
    a tank look like those of a large field.

    Args:
        vehicle: The robot.
        motion: Its primitives, by default ``motion_of(vehicle)``.

    Raises:
        NoSteadyGlideError: If it cannot fly them.
    """
    work = work_of(vehicle, motion_of(vehicle) if motion is None else motion)
    unit_j = time_unit_j(vehicle)
    return EnergyConfig(
        dive=work.dive_j / unit_j,
        glide=work.glide_j / unit_j,
        spiral=work.spiral_j / unit_j,
        swim_factor=work.tail_j_s_rad2 / unit_j,
        tail_amplitude_rad=vehicle.swim.amplitude_rad,
        tail_frequency_hz=vehicle.swim.frequency_hz,
    )


def time_unit_j(vehicle: Vehicle) -> float:
    """Return the joules of one energy unit by the price of time, which all settings share.

    A robot without electronics that draw power has its unit by one watt.
    """
    return (vehicle.energy.electronics_w or 1.0) / EnergyConfig().time_factor


def swimming_speed_m_s(vehicle: Vehicle) -> float:
    """Return the mean speed along the surface that a vehicle's gait settles at."""
    state = np.zeros(15)
    floating_kg = _FLOATING_SHARE * vehicle.limits.m0_min_kg
    state[12:14] = floating_kg, vehicle.swim.rp1_m
    gait = vehicle.swim
    command = np.array([floating_kg, gait.rp1_m, 0.0, gait.amplitude_rad, gait.frequency_hz])
    packed, water = vehicle.packed(), Surroundings().packed()

    def after(x: np.ndarray, begin_s: float, duration_s: float) -> np.ndarray:
        steps = round(duration_s / _PHYSICS_STEP_S)
        return advance(x, command, packed, water, begin_s, _PHYSICS_STEP_S, steps)

    settled = after(state, 0.0, _SWIM_SETTLING_S)
    later = after(settled, _SWIM_SETTLING_S, _SWIM_MEASURED_S)
    return math.dist(settled[:2].tolist(), later[:2].tolist()) / _SWIM_MEASURED_S


def _flattest_rad(vehicle: Vehicle) -> float:
    """Return the angle that is safely steeper than the best ratio of lift to drag, up and down."""

    def exists(angle: float) -> bool:
        try:
            for direction in (-1.0, 1.0):
                angle_of_attack(vehicle.parameters, direction * angle)
        except NoSteadyGlideError:
            return False
        return True

    low, high = math.radians(1.0), math.radians(85.0)
    if not exists(high):
        raise NoSteadyGlideError("this vehicle does not glide both down and up")
    return _boundary(exists, high, low) + _STALL_MARGIN_RAD


def _glide_speed(vehicle: Vehicle, flattest: float, change: float) -> float:
    """Return the fastest vertical speed that leaves pump and sliding mass room and time."""

    def is_fine(speed: float) -> bool:
        inputs = _inputs_both_ways(vehicle, flattest, speed)
        if inputs is None:
            return False
        (down_kg, down_m), (up_kg, up_m) = inputs
        limits = vehicle.limits
        if down_kg > _PUMP_SHARE * limits.m0_max_kg or up_kg < _PUMP_SHARE * limits.m0_min_kg:
            return False
        changeover_s = max(
            abs(down_kg - up_kg) / limits.m0_rate_kg_s, abs(down_m - up_m) / limits.rp1_rate_m_s
        )
        return changeover_s <= _CHANGEOVER_SHARE * change / speed

    slowest = _SLOWEST_M_S
    if not is_fine(slowest):
        raise NoSteadyGlideError(
            f"no glide at {math.degrees(flattest):.0f} deg, down and up, leaves the pump and the"
            " sliding mass of this vehicle enough range and time"
        )
    return _boundary(is_fine, slowest, _FASTEST_M_S)


def _steepest_rad(vehicle: Vehicle, flattest: float, speed: float) -> float:
    """Return the steepest angle that the sliding mass allows, down and up."""
    angle = flattest
    while angle + _STEP_RAD < math.radians(80.0):
        if _inputs_both_ways(vehicle, angle + _STEP_RAD, speed) is None:
            break
        angle += _STEP_RAD
    return angle


def _inputs_both_ways(
    vehicle: Vehicle, angle: float, speed: float
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Return net mass and sliding mass of the glides down and up, None where there is none."""
    try:
        down = glide_inputs(vehicle, -angle, speed)
        up = glide_inputs(vehicle, angle, speed)
    except NoSteadyGlideError:
        return None
    limits = vehicle.limits
    if max(down[1], up[1]) > _SLIDE_SHARE * limits.rp1_max_m:
        return None
    return (down, up) if min(down[1], up[1]) >= _SLIDE_SHARE * limits.rp1_min_m else None


def _spirals(vehicle: Vehicle, speed: float) -> tuple[SteadyGlide, SteadyGlide]:
    """Return the widest and the tightest spiral that are planned with."""
    m0, rp1 = glide_inputs(vehicle, -_SPIRAL_GLIDE_RAD, speed)
    wide, tight = (
        steady_glide(vehicle.parameters, m0, rp1, tail, extended=True) for tail in SPIRAL_TAILS_RAD
    )
    return wide, tight


def _rise(spiral: SteadyGlide) -> float:
    return abs(spiral.vertical_speed_m_s / spiral.turn_rate_rad_s)


def _dive_speed(vehicle: Vehicle) -> float:
    """Return the speed straight down or up with level hull, broadside to the flow.

    Drag alone carries the weight then: the lift of the extended model vanishes with cos(alpha).
    """
    p = vehicle.parameters
    net = DIVE_PUMP_SHARE * min(vehicle.limits.m0_max_kg, -vehicle.limits.m0_min_kg)
    drag_area = p.area_m2 * (p.drag_0 + p.drag_alpha * (0.5 * math.pi) ** 2)
    return _DIVE_SHARE * math.sqrt(2.0 * net * p.gravity_m_s2 / (p.water_density_kg_m3 * drag_area))


def _boundary(holds: Callable[[float], bool], yes: float, no: float) -> float:
    """Return the last value towards ``no`` at which something holds; it holds at ``yes``."""
    if holds(no):
        return no
    for _ in range(_BISECTIONS):
        middle = _MIDDLE * (yes + no)
        yes, no = (middle, no) if holds(middle) else (yes, middle)
    return yes
