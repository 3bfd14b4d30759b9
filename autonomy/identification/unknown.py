"""What an identification may change, in units that make all of it of size one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.identification.config import FreeParameters, IdentificationConfig
from autonomy.vehicle.config import Vehicle, VehicleParameters

GROUPS: dict[str, tuple[str, ...]] = {
    "masses": ("mass_1_kg", "mass_2_kg", "mass_3_kg"),
    "inertias": ("inertia_1_kg_m2", "inertia_2_kg_m2", "inertia_3_kg_m2"),
    "sliding_mass": ("sliding_mass_kg",),
    "offset_mass": ("offset_mass_kg", "offset_mass_depth_m"),
    "drag": ("drag_0", "drag_alpha", "drag_delta"),
    "side_force": ("side_beta", "side_delta"),
    "lift": ("lift_0", "lift_alpha"),
    "roll_moment": ("roll_beta_m", "roll_damping_m_s"),
    "pitch_moment": ("pitch_0_m", "pitch_alpha_m", "pitch_damping_m_s"),
    "yaw_moment": ("yaw_beta_m", "yaw_damping_m_s", "yaw_delta_m"),
}
"""The 24 parameters of thesis Table 3.2 that data can speak of, by field of ``FreeParameters``."""

SIGN_KEPT = frozenset(
    (
        *(*GROUPS["masses"], *GROUPS["inertias"], *GROUPS["sliding_mass"], *GROUPS["offset_mass"]),
        *(*GROUPS["drag"], "roll_damping_m_s", "pitch_damping_m_s", "yaw_damping_m_s"),
    )
)
"""Parameters that physics holds to one sign: masses are positive, and drag and damping take energy.
"""

ALWAYS_FIXED: dict[str, str] = {
    "gravity_m_s2": "a constant of nature",
    "water_density_kg_m3": "only its product with the coefficients enters; measure it",
    "area_m2": "only its product with the coefficients enters: it is a convention",
}
"""Parameters of the table that no flight can tell, and why."""

NET_BUOYANCY_OFFSET = "net_buoyancy_offset_kg"
MASS_POSITION_OFFSET = "mass_position_offset_m"
_OFFSET_SHARE = 0.2
"""Unit of an actuator's offset as a part of the actuator's range."""


@dataclass(frozen=True, slots=True)
class Unknown:
    """One number that is sought: ``value = nominal + scale * u`` with ``low <= u <= high``."""

    name: str
    title: str
    unit: str
    nominal: float
    scale: float
    low: float
    high: float
    index: int
    """Place in the packed vehicle; -1 and -2 are the offsets of net mass and sliding mass."""

    def value(self, u: float) -> float:
        """Return the quantity in its own unit."""
        return self.nominal + self.scale * u


def parameter_title(name: str) -> tuple[str, str]:
    """Return title and unit of a field of ``VehicleParameters``."""
    field = VehicleParameters.model_fields[name]
    extra = field.json_schema_extra
    unit = str(extra.get("unit", "")) if isinstance(extra, dict) else ""
    return field.title or name, unit


def free_names(free: FreeParameters) -> list[str]:
    """Return the parameters of all groups that may change."""
    return [name for group, names in GROUPS.items() if getattr(free, group) for name in names]


def unknowns(vehicle: Vehicle, config: IdentificationConfig) -> tuple[Unknown, ...]:
    """List what is sought; a parameter that is 0 has no range to search and stays.

    Args:
        vehicle: Where the search starts.
        config: What may change, and how far.
    """
    values = vehicle.parameters.model_dump()
    order = list(values)
    share = config.bounds_share
    found: list[Unknown] = []
    for name in free_names(config.free):
        title, unit = parameter_title(name)
        nominal = float(values[name])
        if nominal != 0.0:
            found.append(
                Unknown(name, title, unit, nominal, abs(nominal), -share, share, order.index(name))
            )
    return (*found, *offset_unknowns(vehicle)) if config.fits_offsets else tuple(found)


def offset_unknowns(vehicle: Vehicle) -> tuple[Unknown, Unknown]:
    """Return the constant errors of the two actuators' feedback: truth = feedback - offset."""
    limits = vehicle.limits
    stroke_kg = _OFFSET_SHARE * (limits.m0_max_kg - limits.m0_min_kg)
    stroke_m = _OFFSET_SHARE * (limits.rp1_max_m - limits.rp1_min_m)
    return (
        Unknown(NET_BUOYANCY_OFFSET, "Net buoyancy offset", "kg", 0.0, stroke_kg, -0.5, 0.5, -1),
        Unknown(MASS_POSITION_OFFSET, "Mass position offset", "m", 0.0, stroke_m, -0.5, 0.5, -2),
    )


def packed_candidates(
    vehicle: Vehicle, sought: Sequence[Unknown], u: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return packed vehicles and actuator offsets of several candidates.

    Args:
        vehicle: Gives what is not sought.
        sought: The unknowns.
        u: Their values in units of their scales, shape ``(m, n)``.

    Returns:
        Arrays of shape ``(m, k)`` and ``(m, 2)``.
    """
    packed = np.repeat(vehicle.packed()[None, :], u.shape[0], axis=0)
    offsets = np.zeros((u.shape[0], 2))
    for column, unknown in enumerate(sought):
        values = unknown.nominal + unknown.scale * u[:, column]
        if unknown.index >= 0:
            packed[:, unknown.index] = values
        else:
            offsets[:, -1 - unknown.index] = values
    return packed, offsets
