"""The regular grid of points at which a map is kept."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.field.config import FieldConfig, GridShape
from autonomy.field.mask import water_mask
from autonomy.site import Box, Site


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
    mask: BoolArray
    """True where there is water, shape ``(nx * ny * nz,)``; maps are kept at all points."""

    @classmethod
    def over(
        cls,
        box: Box,
        shape: GridShape,
        mask: Callable[[FloatArray], BoolArray] | BoolArray | None = None,
    ) -> "Grid":
        """Lay a grid over a box, edges included.

        Args:
            box: What the grid spans.
            shape: Number of points along each axis.
            mask: Where there is water: a flag for each point, or a function of the points, such
                as ``water_mask`` of a site; everywhere if not given.

        Raises:
            ValueError: If the flags are not one for each point.
        """
        x = np.linspace(box.x_min_m, box.x_max_m, shape.x)
        y = np.linspace(box.y_min_m, box.y_max_m, shape.y)
        z = np.linspace(0.0, box.depth_max_m, shape.z)
        points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
        water = np.ones(len(points), dtype=np.bool_)
        if mask is not None:
            water = np.asarray(mask(points) if callable(mask) else mask, dtype=np.bool_).reshape(-1)
        if len(water) != len(points):
            raise ValueError(f"the mask has {len(water)} flags for {len(points)} grid points")
        return cls(x, y, z, points, water)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of points along x, y and z."""
        return (len(self.x_m), len(self.y_m), len(self.z_m))


def grid_of(config: FieldConfig, domain: Box, site: Site) -> Grid:
    """Return the grid of a map with its mask of the water."""
    if site.shore is None and site.depth_lines is None:
        return Grid.over(domain, config.grid)
    return Grid.over(domain, config.grid, partial(water_mask, site))
