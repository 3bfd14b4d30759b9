"""What the tasks about vehicles are given, and their names; like every ``task``, without numba."""

from dataclasses import dataclass
from typing import Final

from autonomy.vehicle.config import Vehicle

CAPABILITY: Final = "server.vehicle.capability_task:run"
"""Takes a ``CapabilityProblem``, leaves primitives and energies as a JSON document."""
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


@dataclass(frozen=True, slots=True)
class CapabilityProblem:
    """A vehicle of which it is asked what it can fly."""

    vehicle: Vehicle
    depth_m: float | None
    """Depth of the water; ``None`` for as deep as it needs."""
