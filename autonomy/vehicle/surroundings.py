"""What a robot's body meets: moving water, the floor and the walls."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import Site


@dataclass(frozen=True, slots=True)
class Surroundings:
    """Current and borders of the water around one robot, in the site's NED frame."""

    current_ned_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    x_min_m: float = -math.inf
    x_max_m: float = math.inf
    y_min_m: float = -math.inf
    y_max_m: float = math.inf
    floor_m: float = math.inf
    """Depth at which the hull meets the floor."""
    has_walls: bool = False

    @classmethod
    def of_site(
        cls, site: Site, current_ned_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> Self:
        """Take the borders of a site's water; only a tank has walls."""
        water = site.water
        return cls(
            current_ned_m_s,
            water.x_min_m,
            water.x_max_m,
            water.y_min_m,
            water.y_max_m,
            water.depth_max_m,
            site.kind == "tank",
        )

    def packed(self) -> FloatArray:
        """Return the array that ``extended_kernel.advance`` takes, shape ``(9,)``."""
        return np.array(
            [
                *self.current_ned_m_s,
                self.x_min_m,
                self.x_max_m,
                self.y_min_m,
                self.y_max_m,
                self.floor_m,
                float(self.has_walls),
            ]
        )
