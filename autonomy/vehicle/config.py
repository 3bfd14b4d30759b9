"""The numbers of a vehicle: model, actuators, hull and energy, and the vehicles that are known."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.configuration import Configuration, quantity
from autonomy.vehicle.energy import EnergyPrices
from autonomy.vehicle.hull import Hull
from autonomy.vehicle.limits import ActuatorLimits


class VehicleParameters(Configuration):
    """Rigid body, hydrodynamics, tail and contact of a gliding robotic fish.

    The defaults are the Miniglider of thesis Table 3.2. The fields after ``yaw_delta_m`` have no
    value in the thesis (sections 5.3 and 5.4 leave them open) and are estimated from the hull's
    geometry. Indices 1, 2, 3 are the body axes: forward, starboard, down.
    """

    mass_1_kg: float = quantity(15.011, "kg", title="Mass, forward", gt=0.0)
    """Mass with added mass along the body's forward axis (m1)."""
    mass_2_kg: float = quantity(6.077, "kg", title="Mass, sideways", gt=0.0)
    """Mass with added mass along the body's starboard axis (m2)."""
    mass_3_kg: float = quantity(8.291, "kg", title="Mass, downwards", gt=0.0)
    """Mass with added mass along the body's down axis (m3)."""
    inertia_1_kg_m2: float = quantity(0.801, "kg m2", title="Inertia, roll", gt=0.0)
    """Inertia with added inertia about the forward axis (J1)."""
    inertia_2_kg_m2: float = quantity(0.076, "kg m2", title="Inertia, pitch", gt=0.0)
    """Inertia with added inertia about the starboard axis (J2)."""
    inertia_3_kg_m2: float = quantity(1.60, "kg m2", title="Inertia, yaw", gt=0.0)
    """Inertia with added inertia about the down axis (J3)."""
    sliding_mass_kg: float = quantity(0.287, "kg", title="Sliding mass", gt=0.0)
    """The mass that a linear actuator moves along the forward axis."""
    offset_mass_kg: float = quantity(0.819, "kg", title="Offset mass", gt=0.0)
    """The mass that hangs below the centre and keeps the robot upright (m_w)."""
    offset_mass_depth_m: float = quantity(0.011, "m", title="Depth of the offset mass", gt=0.0)
    """Distance of the offset mass below the hull's centre (r_w3)."""
    gravity_m_s2: float = quantity(9.82, "m/s2", title="Gravity", gt=0.0)
    """Acceleration of free fall."""
    water_density_kg_m3: float = quantity(992.2, "kg/m3", title="Water density", gt=0.0)
    """Density of the water around the robot."""
    area_m2: float = quantity(0.013, "m2", title="Characteristic area", gt=0.0)
    """Area that the hydrodynamic coefficients refer to (S)."""
    drag_0: float = quantity(1.985, "", title="Drag, constant")
    """Drag coefficient at zero angle of attack (C_D0)."""
    drag_alpha: float = quantity(39.50, "1/rad2", title="Drag, angle of attack")
    """Growth of drag with the square of the angle of attack."""
    drag_delta: float = quantity(4.694, "1/rad2", title="Drag, tail")
    """Growth of drag with the square of the tail angle."""
    side_beta: float = quantity(-4.650, "1/rad", title="Side force, sideslip")
    """Side force by sideslip angle."""
    side_delta: float = quantity(-3.529, "1/rad", title="Side force, tail")
    """Side force by tail angle."""
    lift_0: float = quantity(0.588, "", title="Lift, constant")
    """Lift coefficient at zero angle of attack (C_L0)."""
    lift_alpha: float = quantity(24.66, "1/rad", title="Lift, angle of attack")
    """Lift by angle of attack."""
    roll_beta_m: float = quantity(0.631, "m/rad", title="Roll moment, sideslip")
    """Roll moment by sideslip angle."""
    roll_damping_m_s: float = quantity(-11.97, "m s/rad", title="Roll damping")
    """Roll moment by roll rate (K_q1)."""
    pitch_0_m: float = quantity(0.321, "m", title="Pitch moment, constant")
    """Pitch moment at zero angle of attack (C_M0)."""
    pitch_alpha_m: float = quantity(0.279, "m/rad", title="Pitch moment, angle of attack")
    """Pitch moment by angle of attack."""
    pitch_damping_m_s: float = quantity(-14.96, "m s/rad", title="Pitch damping")
    """Pitch moment by pitch rate (K_q2)."""
    yaw_beta_m: float = quantity(14.0, "m/rad", title="Yaw moment, sideslip")
    """Yaw moment by sideslip angle."""
    yaw_damping_m_s: float = quantity(-12.1, "m s/rad", title="Yaw damping")
    """Yaw moment by yaw rate (K_q3)."""
    yaw_delta_m: float = quantity(-0.210, "m/rad", title="Yaw moment, tail")
    """Yaw moment by tail angle; a positive tail angle turns to port."""

    tail_response_per_s: float = quantity(10.0, "1/s", title="Tail response", gt=0.0)
    """Rate constant with which the servo follows its reference (k_delta); estimated."""
    tail_area_m2: float = quantity(0.17 * 0.15, "m2", title="Tail area", gt=0.0)
    """Flat plate of the tail (S_delta): 17 cm from hull to tip (57 - 40 cm), 15 cm high."""
    tail_water_length_m: float = quantity(0.15 * math.pi / 4.0, "m", title="Water length", gt=0.0)
    """Length of the water that moves with the tail (l_c): a strip's added mass, pi/4 x height."""
    tail_centre_m: float = quantity(0.085, "m", title="Tail centre", gt=0.0)
    """From the tail's hinge to its centre of mass (l_delta0): half of its length."""
    tail_arm_m: float = quantity(0.285, "m", title="Tail arm", gt=0.0)
    """From the hull's centre to the tail's centre (l_delta1): half a hull and half a tail."""
    crossflow_1_n_m_s2: float = quantity(0.028, "N m s2", title="Cross-flow drag, roll", ge=0.0)
    """Moment by squared roll rate at rest; wings of 8 cm chord, drag coefficient 1.2."""
    crossflow_2_n_m_s2: float = quantity(0.235, "N m s2", title="Cross-flow drag, pitch", ge=0.0)
    """Moment by squared pitch rate at rest; hull and tail as a plate 57 x 12 cm."""
    crossflow_3_n_m_s2: float = quantity(0.235, "N m s2", title="Cross-flow drag, yaw", ge=0.0)
    """Moment by squared yaw rate at rest; hull and tail as a plate 57 x 12 cm."""
    contact_stiffness_n_m: float = quantity(467.0, "N/m", title="Contact stiffness", gt=0.0)
    """Force by distance past surface, floor or wall: density x gravity x 40 x 12 cm waterplane."""
    contact_damping_n_s_m: float = quantity(62.0, "N s/m", title="Contact damping", ge=0.0)
    """Force by speed into surface, floor or wall: half of critical for heave."""
    surface_damping_per_s: float = quantity(0.5, "1/s", title="Surface damping", ge=0.0)
    """Decay rate of roll and pitch rates of a robot that lies at the surface."""

    def packed(self) -> FloatArray:
        """Return the values in the order of declaration, as the kernels index them."""
        return np.array(list(self.model_dump().values()), dtype=np.float64)


class SwimGait(Configuration):
    """A tail flap that the servo can follow: ``2 pi frequency amplitude`` is below its rate.

    Thesis section 5.4.2 asks that frequency and amplitude respect the actuator; 0.35 rad at 1 Hz
    would need 2.2 rad/s of a tail that does 1.05.
    """

    amplitude_rad: float = quantity(
        0.40, "rad", title="Tail amplitude", gt=0.0, le=math.pi / 2.0, display_unit="deg"
    )
    """How far the tail beats to either side of its bias."""
    frequency_hz: float = quantity(0.40, "Hz", title="Tail frequency", gt=0.0, le=10.0)
    """Beats per second."""
    rp1_m: float = quantity(0.005, "m", title="Sliding mass", display_unit="mm")
    """Sliding mass that keeps the robot level at its swimming speed."""


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A kind of robot: its model, its actuators, how it swims, and how well all this is known."""

    key: str
    title: str
    note: str
    """What an operator must know about the model, "" if it was identified."""
    parameters: VehicleParameters
    limits: ActuatorLimits
    swim: SwimGait
    hull: Hull
    energy: EnergyPrices

    def packed(self) -> FloatArray:
        """Return parameters, limits, hull and energy prices as one array for the kernels."""
        return np.concatenate(
            [
                self.parameters.packed(),
                self.limits.packed(),
                [self.hull.displaced_mass_kg, self.hull.compressibility_per_m],
                self.energy.packed(self.limits),
            ]
        )


MINIGLIDER = Vehicle(
    key="miniglider",
    title="Miniglider",
    note="",
    parameters=VehicleParameters(),
    limits=ActuatorLimits(),
    swim=SwimGait(),
    hull=Hull(),
    energy=EnergyPrices(),
)
"""The robot of thesis Table 3.2."""

_WEIGHT = 33.0 / 5.0
_HULL = 100.0 / 40.0
_WINGSPAN = 85.0 / 37.0
_BUOYANCY = 420.0 / 50.0
_TIME = math.sqrt(_HULL)
"""Ratios GRACE 3 : Miniglider from thesis Table 2.2; Froude's law makes time the root of length."""


def _scaled_parameters(small: VehicleParameters) -> VehicleParameters:
    """Scale a model to GRACE 3, each quantity by the ratio nearest to it.

    Masses follow the weight, lengths the hull, hydrodynamic area the square of the wingspan,
    inertia mass times length squared, times Froude's root of length; angles and dimensionless
    coefficients stay. Strict similarity would need one ratio for all (weight 6.6 is 1.88 cubed,
    not 2.5 cubed, because much of GRACE 3's hull is free-flooding).
    """
    factors = {
        "mass_1_kg": _WEIGHT,
        "mass_2_kg": _WEIGHT,
        "mass_3_kg": _WEIGHT,
        "sliding_mass_kg": _WEIGHT,
        "offset_mass_kg": _WEIGHT,
        "inertia_1_kg_m2": _WEIGHT * _HULL**2,
        "inertia_2_kg_m2": _WEIGHT * _HULL**2,
        "inertia_3_kg_m2": _WEIGHT * _HULL**2,
        "offset_mass_depth_m": _HULL,
        "area_m2": _WINGSPAN**2,
        "roll_beta_m": _HULL,
        "pitch_0_m": _HULL,
        "pitch_alpha_m": _HULL,
        "yaw_beta_m": _HULL,
        "yaw_delta_m": _HULL,
        "roll_damping_m_s": _HULL * _TIME,
        "pitch_damping_m_s": _HULL * _TIME,
        "yaw_damping_m_s": _HULL * _TIME,
        "tail_response_per_s": 1.0 / _TIME,
        "tail_area_m2": _HULL**2,
        "tail_water_length_m": _HULL,
        "tail_centre_m": _HULL,
        "tail_arm_m": _HULL,
        "crossflow_1_n_m_s2": _HULL**5,
        "crossflow_2_n_m_s2": _HULL**5,
        "crossflow_3_n_m_s2": _HULL**5,
        "contact_stiffness_n_m": _HULL**2,
        "contact_damping_n_s_m": _HULL * math.sqrt(_WEIGHT),
        "surface_damping_per_s": 1.0 / _TIME,
    }
    values = small.model_dump()
    return VehicleParameters(**(values | {key: values[key] * k for key, k in factors.items()}))


def _scaled_limits(small: ActuatorLimits) -> ActuatorLimits:
    """Scale end stops and rates to GRACE 3: buoyancy by its module, stroke by the hull."""
    return ActuatorLimits(
        m0_min_kg=small.m0_min_kg * _BUOYANCY,
        m0_max_kg=small.m0_max_kg * _BUOYANCY,
        m0_rate_kg_s=small.m0_rate_kg_s * _BUOYANCY / _TIME,
        rp1_min_m=small.rp1_min_m * _HULL,
        rp1_max_m=small.rp1_max_m * _HULL,
        rp1_rate_m_s=small.rp1_rate_m_s * _HULL / _TIME,
        delta_max_rad=small.delta_max_rad,
        delta_rate_rad_s=small.delta_rate_rad_s / _TIME,
    )


GRACE3 = Vehicle(
    key="grace3",
    title="GRACE 3",
    note="scaled, not identified",
    parameters=_scaled_parameters(MINIGLIDER.parameters),
    limits=_scaled_limits(MINIGLIDER.limits),
    swim=SwimGait(
        amplitude_rad=MINIGLIDER.swim.amplitude_rad,
        frequency_hz=MINIGLIDER.swim.frequency_hz / _TIME,
        rp1_m=0.03,
    ),
    hull=Hull(
        length_m=1.00,
        width_m=0.30,
        height_m=0.53,
        tail_to_nose_m=1.70,
        wingspan_m=0.85,
        displaced_mass_kg=33.0,
    ),
    energy=EnergyPrices(electronics_w=8.0, pump_full_w=60.0, mass_full_w=25.0, tail_full_w=15.0),
)
"""The Miniglider's model scaled by thesis Table 2.2, until an identification replaces it."""

VEHICLES: dict[str, Vehicle] = {vehicle.key: vehicle for vehicle in (MINIGLIDER, GRACE3)}
"""Every known vehicle by its key."""
