"""What a vehicle's primitives take from its battery, by its actuators' powers and rates."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.energy_use import Use
from autonomy.planner.config import EnergyConfig, PrimitiveConfig
from autonomy.vehicle.battery import swimming_power_w
from autonomy.vehicle.config import Vehicle
from autonomy.vehicle.glide import NoSteadyGlideError, glide_inputs

CHANGE_SHARE = 1.0 / 3.0
"""Smallest change of depth as a share of the depth."""
SPIRAL_TAILS_RAD = (math.radians(25.0), math.radians(45.0))
DIVE_PUMP_SHARE = 0.5
CONTROL_SHARE = {Use.GLIDE: 0.75, Use.SPIRAL: 0.25, Use.DIVE: 0.5}
"""Power that control takes under water, as a part of the pump's full power: depth and pitch are
held against noise and water that moves. Of the two simulated robots over drawn missions it is 0.70
(Miniglider) and 0.78 (GRACE 3) in glides, 0.20 and 0.26 in spirals, 0.54 and 0.52 in dives."""


@dataclass(frozen=True, slots=True)
class Work:
    """Electrical energy that primitives take, J."""

    glide_j: float
    """Change-over of pump and sliding mass at the beginning of a glide."""
    spiral_j: float
    """As of a glide, and the tail's way to its place and back."""
    dive_j: float
    """Change-over of the pump at the beginning of a flat dive."""
    tail_j_s_rad2: float
    """Multiplies the integral of the squared tail rate while swimming."""
    electronics_w: float
    """Taken all the time."""


def work_of(vehicle: Vehicle, motion: PrimitiveConfig) -> Work:
    """Return what primitives take from the battery (thesis Eq. 5.20 with actuators at full rate).

    Args:
        vehicle: Its actuators and their power.
        motion: Speeds and angles of the primitives.

    Raises:
        NoSteadyGlideError: If it cannot fly these glides.
    """
    limits, prices = vehicle.limits, vehicle.energy
    middle = 0.5 * (motion.glide_angle_min_rad + motion.glide_angle_max_rad)
    down = glide_inputs(vehicle, -middle, motion.glide_speed_m_s)
    up = glide_inputs(vehicle, middle, motion.glide_speed_m_s)
    pump_j_kg = prices.pump_full_w / limits.m0_rate_kg_s
    slide_j_m = prices.mass_full_w / limits.rp1_rate_m_s
    glide_j = abs(down[0] - up[0]) * pump_j_kg + abs(down[1] - up[1]) * slide_j_m
    tail_s = 2.0 * float(np.mean(SPIRAL_TAILS_RAD)) / limits.delta_rate_rad_s
    dive_kg = 2.0 * DIVE_PUMP_SHARE * min(limits.m0_max_kg, -limits.m0_min_kg)
    return Work(
        glide_j=glide_j,
        spiral_j=glide_j + tail_s * prices.tail_full_w,
        dive_j=dive_kg * pump_j_kg,
        tail_j_s_rad2=prices.tail_full_w / limits.delta_rate_rad_s**2,
        electronics_w=prices.electronics_w,
    )


def joules_per_unit(vehicle: Vehicle, motion: PrimitiveConfig, energy: EnergyConfig) -> float:
    """Return how many joules stand behind one energy unit of settings, for showing both.

    Units price actuators otherwise than a battery does, so this is the ratio for the dive that
    surveys are made of: a glide down and one up through three times the smallest change of depth.

    Raises:
        NoSteadyGlideError: If the vehicle cannot fly these glides.
    """
    work = work_of(vehicle, motion)
    glide_s = motion.depth_change_min_m / CHANGE_SHARE / motion.glide_speed_m_s
    control_w = CONTROL_SHARE[Use.GLIDE] * vehicle.energy.pump_full_w
    joules = work.glide_j + (work.electronics_w + control_w) * glide_s
    return joules / (energy.glide + energy.time_factor * glide_s)


def powers_of_uses(vehicle: Vehicle, motion: PrimitiveConfig) -> FloatArray:
    """Return what the model takes each use to draw, W, shape ``(5,)`` by ``Use``.

    A glide, a spiral and a dive are those of ``joules_per_unit``: through three times the smallest
    change of depth. Of a vehicle that cannot glide so, its primitives are taken to draw what its
    electronics and half of its pump draw.
    """
    powers = np.empty(len(Use))
    powers[Use.AFLOAT] = electronics = vehicle.energy.electronics_w
    powers[Use.SWIM] = swimming_power_w(vehicle, is_deep=False)
    change_m = motion.depth_change_min_m / CHANGE_SHARE
    try:
        work = work_of(vehicle, motion)
    except NoSteadyGlideError:
        powers[[Use.GLIDE, Use.SPIRAL, Use.DIVE]] = electronics + 0.5 * vehicle.energy.pump_full_w
        return powers
    powers[Use.GLIDE] = electronics + work.glide_j * motion.glide_speed_m_s / change_m
    powers[Use.SPIRAL] = electronics + work.spiral_j * motion.spiral_speed_m_s / change_m
    powers[Use.DIVE] = electronics + work.dive_j * motion.dive_speed_m_s / change_m
    for use, share in CONTROL_SHARE.items():
        powers[use] += share * vehicle.energy.pump_full_w
    return powers
