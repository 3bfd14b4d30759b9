"""Vehicles of the catalogue, and how they move."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated

from server.base.view import SettingsDocument, View, one_of

Table = list[list[float | None]]


@dataclass(frozen=True, slots=True)
class VehicleView(View):
    """A vehicle that a robot can be."""

    key: str
    """By which a robot names it as its model."""
    title: str
    note: str
    """What an operator must know of the model, such as ``scaled, not identified``; empty if it was
    identified."""
    origin: Annotated[str, one_of("built-in", "file", "identified")]
    """``built-in``, ``file`` or ``identified``."""
    robots: list[str]
    """Robots that are of this model now."""
    created_at: datetime | None
    """When it was added; null for a built-in one."""
    created_by: str
    """Who added it; empty for a built-in one."""


@dataclass(frozen=True, slots=True)
class VehiclesView(View):
    """The catalogue, built-in vehicles first."""

    vehicles: list[VehicleView]


@dataclass(frozen=True, slots=True)
class PolarView(View):
    """Steady glides of a vehicle: a row for each net buoyancy, a column for each mass position.

    A cell is null where there is no steady glide.
    """

    vehicle: str
    title: str
    note: str
    m0_kg: list[float]
    """Net buoyancy of each row, positive heavy."""
    rp1_m: list[float]
    """Position of the sliding mass of each column, positive forward."""
    speed_m_s: Table
    """Speed through the water."""
    glide_angle_rad: Table
    """Inclination of the path, positive up."""
    pitch_rad: Table
    """Positive nose up."""
    angle_of_attack_rad: Table
    vertical_speed_m_s: Table
    """Positive down."""
    horizontal_speed_m_s: Table
    greatest_growth_per_s: Table
    """Largest real part of the eigenvalues: below 0 a disturbance dies away."""
    stable: list[list[bool | None]]


@dataclass(frozen=True, slots=True)
class EigenvalueView(View):
    """How one small disturbance of a motion grows, 1/s, and swings, rad/s."""

    real: float
    imag: float


@dataclass(frozen=True, slots=True)
class SteadyView(View):
    """What a vehicle settles into with its actuators held still: a glide, or a spiral."""

    pitch_rad: float
    """Positive nose up."""
    roll_rad: float
    speed_m_s: float
    """Speed through the water."""
    glide_angle_rad: float
    """Inclination of the path, positive up."""
    angle_of_attack_rad: float
    vertical_speed_m_s: float
    """Positive down."""
    horizontal_speed_m_s: float
    turn_rate_rad_s: float
    """Positive to starboard."""
    turn_radius_m: float | None
    """Null for a straight glide."""
    stable: bool
    eigenvalues: list[EigenvalueView]


@dataclass(frozen=True, slots=True)
class CapabilityView(View):
    """What the planner may ask of a vehicle, by its polar, its actuators and its energies."""

    primitives: SettingsDocument
    """Values of the planner's ``primitives``."""
    energy: SettingsDocument
    """Values of the planner's ``energy``."""
    joules_per_unit: float
    """Joules behind one energy unit of these settings, by a dive of glides."""
