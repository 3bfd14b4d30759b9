"""End stops and greatest rates of a robot's actuators."""

import math
from typing import Self

import numpy as np
from pydantic import model_validator

from autonomy.arrays import FloatArray
from autonomy.configuration import Configuration, quantity


class ActuatorLimits(Configuration):
    """End stops and greatest rates of the three actuators (thesis section 3.3)."""

    m0_min_kg: float = quantity(-0.0279, "kg", title="Net buoyancy, lightest", display_unit="g")
    """Smallest net mass: the robot rises."""
    m0_max_kg: float = quantity(0.0225, "kg", title="Net buoyancy, heaviest", display_unit="g")
    """Greatest net mass: the robot sinks."""
    m0_rate_kg_s: float = quantity(
        0.00172, "kg/s", title="Net buoyancy rate", gt=0.0, display_unit="g/s"
    )
    """Greatest rate of the buoyancy pump."""
    rp1_min_m: float = quantity(-0.0555, "m", title="Sliding mass, aft", display_unit="mm")
    """Aft end stop of the sliding mass."""
    rp1_max_m: float = quantity(0.0445, "m", title="Sliding mass, forward", display_unit="mm")
    """Forward end stop of the sliding mass."""
    rp1_rate_m_s: float = quantity(
        0.0125, "m/s", title="Sliding mass rate", gt=0.0, display_unit="mm/s"
    )
    """Greatest speed of the sliding mass."""
    delta_max_rad: float = quantity(
        1.92, "rad", title="Tail angle", gt=0.0, le=math.pi, display_unit="deg"
    )
    """End stop of the tail, either way."""
    delta_rate_rad_s: float = quantity(
        1.05, "rad/s", title="Tail rate", gt=0.0, display_unit="deg/s"
    )
    """Greatest rate of the tail servo."""

    @model_validator(mode="after")
    def _ranges_hold_zero(self) -> Self:
        if not self.m0_min_kg < 0.0 < self.m0_max_kg:
            raise ValueError("the net buoyancy's range must hold zero inside")
        if not self.rp1_min_m < 0.0 < self.rp1_max_m:
            raise ValueError("the sliding mass's range must hold zero inside")
        return self

    def packed(self) -> FloatArray:
        """Return the values in the order of declaration, as the kernels index them."""
        return np.array(list(self.model_dump().values()), dtype=np.float64)

    def clip(self, m0_kg: float, rp1_m: float, delta_rad: float) -> tuple[float, float, float]:
        """Return the command that the end stops allow."""
        return (
            min(max(m0_kg, self.m0_min_kg), self.m0_max_kg),
            min(max(rp1_m, self.rp1_min_m), self.rp1_max_m),
            min(max(delta_rad, -self.delta_max_rad), self.delta_max_rad),
        )
