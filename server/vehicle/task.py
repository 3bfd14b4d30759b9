"""What the tasks about vehicles are given, and their names; like every ``task``, without numba."""

from dataclasses import dataclass
from typing import Final

from autonomy.vehicle.config import Vehicle

POLAR: Final = "server.vehicle.motion_task:polar_document"
"""Takes a ``Vehicle``, leaves the JSON document of its polar."""
STEADY: Final = "server.vehicle.motion_task:steady_document"
"""Takes a ``SteadyProblem``, leaves a JSON document or a ``Refusal``."""


@dataclass(frozen=True, slots=True)
class SteadyProblem:
    """A vehicle with its actuators held still."""

    vehicle: Vehicle
    m0_kg: float
    rp1_m: float
    delta_rad: float
