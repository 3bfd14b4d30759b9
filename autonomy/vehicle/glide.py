"""Straight glides by algebra: the angle of attack, and where pump and sliding mass stand for them.

A steady glide or spiral of given actuators, which has to be searched, is found by ``steady``.
"""

import math
from typing import cast

import numpy as np

from autonomy.vehicle.config import ActuatorLimits, Vehicle, VehicleParameters
from autonomy.vehicle.reference.dynamics import hydrodynamic_wrench

_STEEPEST_FLOW_RAD = math.radians(60.0)


class NoSteadyGlideError(ValueError):
    """The vehicle has no steady motion as asked; the message says why."""


def angle_of_attack(parameters: VehicleParameters, glide_angle_rad: float) -> float:
    """Angle of attack of a straight glide along a path; the speed does not matter.

    Along and across the path, lift to drag is minus the cotangent of the glide angle. Lift and
    drag are those of the extended model.

    Args:
        parameters: The vehicle's model.
        glide_angle_rad: Inclination of the path, negative down, not 0.

    Raises:
        NoSteadyGlideError: If the path is flatter than the vehicle can glide.
    """
    from scipy.optimize import brentq  # here: a station that starts need not wait for it

    p = parameters
    cot = 1.0 / math.tan(glide_angle_rad)

    def unbalance(alpha: float) -> float:
        lift = (p.lift_0 + p.lift_alpha * alpha) * math.cos(alpha)
        return lift + cot * (p.drag_0 + p.drag_alpha * alpha**2)

    without_lift = -p.lift_0 / p.lift_alpha
    at_start = unbalance(without_lift)
    # gentle flow is the stable branch: search away from zero lift, up to the first change of sign
    for alpha in np.linspace(without_lift, -math.copysign(_STEEPEST_FLOW_RAD, cot), 200)[1:]:
        if unbalance(float(alpha)) * at_start <= 0.0:
            return cast("float", brentq(unbalance, without_lift, float(alpha), xtol=1e-15))
    raise NoSteadyGlideError(
        f"a path of {math.degrees(glide_angle_rad):.0f} deg is flatter than this vehicle glides"
    )


def glide_inputs(
    vehicle: Vehicle, glide_angle_rad: float, vertical_speed_m_s: float
) -> tuple[float, float]:
    """Find net mass kg and sliding mass m for a straight glide.

    Args:
        vehicle: The robot.
        glide_angle_rad: Inclination of the path, negative down, not 0.
        vertical_speed_m_s: Speed of depth, a magnitude.

    Raises:
        NoSteadyGlideError: If the path is too flat or an actuator's range does not allow it.
    """
    p = vehicle.parameters
    alpha = angle_of_attack(p, glide_angle_rad)
    pitch = glide_angle_rad + alpha
    speed = vertical_speed_m_s / abs(math.sin(glide_angle_rad))
    velocity = speed * np.array([math.cos(alpha), 0.0, math.sin(alpha)])
    force, moment = hydrodynamic_wrench(velocity, np.zeros(3), 0.0, p, extended=True)
    # weight balances the force along the path; the moments about the starboard axis vanish
    along = force @ velocity / speed
    m0 = along / (p.gravity_m_s2 * math.sin(glide_angle_rad))
    munk = (p.mass_3_kg - p.mass_1_kg) * velocity[0] * velocity[2]
    hang = p.offset_mass_kg * p.offset_mass_depth_m * p.gravity_m_s2 * math.sin(pitch)
    rp1 = (munk + moment[1] - hang) / (p.sliding_mass_kg * p.gravity_m_s2 * math.cos(pitch))
    _check_range(float(m0), float(rp1), vehicle.limits)
    return float(m0), float(rp1)


def _check_range(m0: float, rp1: float, limits: ActuatorLimits) -> None:
    if not limits.m0_min_kg <= m0 <= limits.m0_max_kg:
        raise NoSteadyGlideError(
            f"the glide needs a net mass of {m0 * 1e3:.1f} g; the pump reaches"
            f" {limits.m0_min_kg * 1e3:.1f} to {limits.m0_max_kg * 1e3:.1f} g"
        )
    if not limits.rp1_min_m <= rp1 <= limits.rp1_max_m:
        raise NoSteadyGlideError(
            f"the glide needs the sliding mass at {rp1 * 1e3:.1f} mm; it reaches"
            f" {limits.rp1_min_m * 1e3:.1f} to {limits.rp1_max_m * 1e3:.1f} mm"
        )
