"""The regular grid of points at which a map is kept."""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import GridShape
from autonomy.site import Box


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Axes of a regular grid in the site's NED frame, and its points, x slowest and z fastest."""

    x_m: FloatArray
    """Northings, shape ``(nx,)``."""
    y_m: FloatArray
    """Eastings, shape ``(ny,)``."""
    z_m: FloatArray
    """Depths, shape ``(nz,)``."""
    points: FloatArray
    """All points, shape ``(nx * ny * nz, 3)``."""

    @classmethod
    def over(cls, box: Box, shape: GridShape) -> "Grid":
        """Lay a grid over a box, edges included."""
        x = np.linspace(box.x_min_m, box.x_max_m, shape.x)
        y = np.linspace(box.y_min_m, box.y_max_m, shape.y)
        z = np.linspace(0.0, box.depth_max_m, shape.z)
        points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
        return cls(x, y, z, points)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of points along x, y and z."""
        return (len(self.x_m), len(self.y_m), len(self.z_m))
