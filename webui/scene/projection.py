"""The frame of the 3D view: x east, y north, z up, horizontally as wide as ``VIEW_WIDTH``.

Scenes of every size share one scale, so cameras, labels and markers need no numbers of their own.
Children of the ``/world`` node are given in ENU metres and scaled by that node; the vertical
exaggeration is a property of the node alone.
"""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import ned_to_enu
from autonomy.site import Site

VIEW_WIDTH = 10.0
"""Horizontal extent of the water in view units."""
_TALLEST = 0.3
"""Default exaggeration makes the water's depth this share of its width, if it is shallower."""


@dataclass(frozen=True, slots=True)
class Projection:
    """Scale and centre of one site in the view."""

    centre_ned: tuple[float, float, float]
    view_per_m: float
    default_exaggeration: float

    @classmethod
    def of_site(cls, site: Site) -> "Projection":
        """Fit a site's water into the view."""
        water = site.water
        width_m = max(water.x_max_m - water.x_min_m, water.y_max_m - water.y_min_m)
        centre = ((water.x_min_m + water.x_max_m) / 2, (water.y_min_m + water.y_max_m) / 2, 0.0)
        needed = _TALLEST * width_m / water.depth_max_m
        exaggeration = 1.0 if needed <= 2.0 else float(round(min(needed, 40.0)))
        return cls(centre, VIEW_WIDTH / width_m, exaggeration)

    def scale(self, exaggeration: float) -> tuple[float, float, float]:
        """Return the scale of the ``/world`` node."""
        return (self.view_per_m, self.view_per_m, self.view_per_m * exaggeration)

    def offset(self) -> tuple[float, float, float]:
        """Return the position of the ``/world`` node, which puts the site's centre at 0."""
        east, north, _ = ned_to_enu(np.array(self.centre_ned))
        return (-east * self.view_per_m, -north * self.view_per_m, 0.0)

    def point(self, position_ned: FloatArray, exaggeration: float) -> FloatArray:
        """Return a NED point in view units, for nodes that must not be stretched."""
        return ned_to_enu(position_ned) * np.array(self.scale(exaggeration)) + np.array(
            self.offset()
        )
