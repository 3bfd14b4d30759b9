"""The trim that a mission brings: what set points gain, and what the sensors say without it."""

from dataclasses import dataclass, replace
from typing import Self

from autonomy.vehicle.config import ActuatorLimits
from onboard.flight.hardware import Readings, SetPoints
from robot_link.mission import MissionSettings


@dataclass(frozen=True, slots=True)
class Trim:
    """Standing offsets between what the model calls net mass and mass position and what sensors do.

    The model of the robot is exact only up to its ballast and the zeros of its sensors. The rest of
    the onboard program speaks the model's language; set points and feedback are translated here.
    """

    net_buoyancy_kg: float = 0.0
    mass_position_m: float = 0.0

    @classmethod
    def of(cls, settings: MissionSettings) -> Self:
        """Return the trim that a mission asks for."""
        return cls(settings.net_buoyancy_offset_kg, settings.mass_position_offset_m)

    def command(self, wanted: SetPoints, limits: ActuatorLimits) -> SetPoints:
        """Return what the actuators are told, inside their end stops."""
        net_buoyancy_kg, mass_position_m, _ = limits.clip(
            wanted.net_buoyancy_kg + self.net_buoyancy_kg,
            wanted.mass_position_m + self.mass_position_m,
            wanted.tail_rad,
        )
        return replace(wanted, net_buoyancy_kg=net_buoyancy_kg, mass_position_m=mass_position_m)

    def in_model_terms(self, readings: Readings) -> Readings:
        """Return readings with the actuators' feedback as the model would have it."""
        return replace(
            readings,
            net_buoyancy_kg=readings.net_buoyancy_kg - self.net_buoyancy_kg,
            mass_position_m=readings.mass_position_m - self.mass_position_m,
        )
