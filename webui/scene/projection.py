"""The frame of the 3D view: x east, y north, z up, horizontally as wide as ``VIEW_WIDTH``.

Scenes of every size share one scale, so cameras, labels and markers need no numbers of their own.
Children of the ``/world`` node are given in ENU metres and scaled by that node; the vertical
exaggeration is a property of the node alone.
"""

from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import Site

VIEW_WIDTH = 10.0
"""Horizontal extent of the water in view units."""
_NED_TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_TALLEST = 0.3
"""Default exaggeration makes the water's depth this share of its width, if it is shallower."""


def enu(position_ned: FloatArray) -> FloatArray:
    """Turn NED points into east, north, up; shape ``(..., 3)``, m."""
    return position_ned @ _NED_TO_ENU.T


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
        east, north, _ = enu(np.array(self.centre_ned))
        return (-east * self.view_per_m, -north * self.view_per_m, 0.0)

    def point(self, position_ned: FloatArray, exaggeration: float) -> FloatArray:
        """Return a NED point in view units, for nodes that must not be stretched."""
        return enu(position_ned) * np.array(self.scale(exaggeration)) + np.array(self.offset())


def body_to_view(roll_rad: float, pitch_rad: float, heading_rad: float) -> FloatArray:
    """Return the quaternion (w, x, y, z) that turns forward-starboard-down into the view frame.

    Source: thesis section 5.3, R with the ZYX convention.
    """
    cr, sr = np.cos(roll_rad), np.sin(roll_rad)
    cp, sp = np.cos(pitch_rad), np.sin(pitch_rad)
    ch, sh = np.cos(heading_rad), np.sin(heading_rad)
    rotation = np.array(
        [
            [cp * ch, ch * sp * sr - cr * sh, sr * sh + cr * ch * sp],
            [cp * sh, cr * ch + sp * sr * sh, cr * sp * sh - ch * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return _quaternion(_NED_TO_ENU @ rotation)


def _quaternion(rotation: FloatArray) -> FloatArray:
    """Convert a rotation matrix by its dominant eigenvector (Bar-Itzhack 2000)."""
    m = rotation
    symmetric = np.array(
        [
            [m[0, 0] + m[1, 1] + m[2, 2], 0.0, 0.0, 0.0],
            [m[2, 1] - m[1, 2], m[0, 0] - m[1, 1] - m[2, 2], 0.0, 0.0],
            [m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0.0],
            [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1]],
        ]
    )
    _, vectors = np.linalg.eigh(symmetric, UPLO="L")
    return vectors[:, -1]
