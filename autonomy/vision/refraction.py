r"""Refraction: through the surface of still water seen from above, and through a flat port.

An eye at the height h above the surface sees a point at the depth d below it and at the horizontal
distance r where its light leaves the water, at the distance x from the eye's foot, with

.. math:: \frac{x}{\sqrt{x^2 + h^2}} = n \frac{r - x}{\sqrt{(r - x)^2 + d^2}}.

A camera projects that point of the surface, not the one under water. What is dry is seen straight,
so a plate that is half out of the water is seen corner by corner as it is.

Frames: NED of the tank with the surface at ``level_m`` (positive where the water is low). A port
belongs to a camera under water, and is told in camera axes.

Source:
    Snell's law; Glassner, *An Introduction to Ray Tracing*, 1989, section 4.2 for its vector form.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.vision import refraction_kernel as kernel

FRESH_WATER_INDEX = 1.333
"""Of visible light at 20 degC; of sea water about 1.34."""
LEAST_INDEX, GREATEST_INDEX = 1.30, 1.36
"""Outside of these no water is."""


@dataclass(frozen=True, slots=True)
class FlatPort:
    """The window before a lens under water; its normal is the optical axis.

    Raises:
        ValueError: If a length is negative or the glass has an index below 1.
    """

    distance_m: float = 0.010
    """From the lens's centre of projection to the inner face."""
    thickness_m: float = 0.005
    glass_index: float = 1.49
    """Index of refraction; as delivered that of acrylic."""

    def __post_init__(self) -> None:
        if not (self.distance_m >= 0.0 and self.thickness_m >= 0.0 and self.glass_index >= 1.0):
            raise ValueError(
                "port: distance_m and thickness_m may not be negative, nor glass_index below 1"
            )

    @property
    def packed(self) -> FloatArray:
        """The same for the kernels, shape ``(3,)``."""
        return np.array([self.distance_m, self.thickness_m, self.glass_index])

    def sights(
        self, points_camera_m: npt.ArrayLike, index: float = FRESH_WATER_INDEX
    ) -> tuple[FloatArray, FloatArray]:
        """Return along which directions the lens sees points in the water.

        Args:
            points_camera_m: In camera axes, shape ``(..., 3)``, m.
            index: Index of refraction of the water.

        Returns:
            Directions of which z is 1, shape ``(..., 3)``, to be given to ``Lens.project``; and
            their derivatives by the point (3 columns, 1/m) and by the index, ``(..., 3, 4)``. NaN
            where a point is not behind the window.
        """
        points, flat = _rows(points_camera_m)
        sights, slopes = np.empty(flat.shape), np.empty((len(flat), 3, 4))
        kernel.through_port(self.packed, flat, index, sights, slopes)
        return sights.reshape(points.shape), slopes.reshape(*points.shape, 4)

    def rays(
        self, directions: npt.ArrayLike, index: float = FRESH_WATER_INDEX
    ) -> tuple[FloatArray, FloatArray]:
        """Return where rays of the lens enter the water, and their directions there.

        Args:
            directions: In camera axes, of length 1, shape ``(..., 3)``.
            index: Index of refraction of the water.

        Returns:
            Points on the outer face, m, and directions of length 1, in camera axes, ``(..., 3)``.
        """
        asked, flat = _rows(directions)
        exits, inside = np.empty(flat.shape), np.empty(flat.shape)
        kernel.port_rays(self.packed, flat, index, exits, inside)
        return exits.reshape(asked.shape), inside.reshape(asked.shape)


def surface_sights(
    eye_ned_m: npt.ArrayLike,
    points_ned_m: npt.ArrayLike,
    level_m: float = 0.0,
    index: float = FRESH_WATER_INDEX,
) -> tuple[FloatArray, FloatArray]:
    """Return the ways from an eye above the water to where it sees points.

    Args:
        eye_ned_m: Shape ``(3,)``, m.
        points_ned_m: Under water or above it, shape ``(..., 3)``, m.
        level_m: Down coordinate of the surface.
        index: Index of refraction of the water.

    Returns:
        Ways in NED, shape ``(..., 3)``, m, which end at the surface or at a dry point; and their
        derivatives by eye (3 columns), point (3), level and index, ``(..., 3, 8)``. NaN where the
        eye is not above the water.
    """
    points, flat = _rows(points_ned_m)
    eye = np.ascontiguousarray(eye_ned_m, dtype=np.float64)
    sights, slopes = np.empty(flat.shape), np.empty((len(flat), 3, 8))
    kernel.seen(eye, flat, level_m, index, sights, slopes)
    return sights.reshape(points.shape), slopes.reshape(*points.shape, 8)


def underwater_rays(
    eye_ned_m: npt.ArrayLike,
    directions_ned: npt.ArrayLike,
    level_m: float = 0.0,
    index: float = FRESH_WATER_INDEX,
) -> tuple[FloatArray, FloatArray]:
    """Return where rays from an eye above the water enter it, and their directions there.

    Args:
        eye_ned_m: Shape ``(3,)``, m.
        directions_ned: Of length 1, shape ``(..., 3)``.
        level_m: Down coordinate of the surface.
        index: Index of refraction of the water.

    Returns:
        Points on the surface, m, and directions of length 1, shape ``(..., 3)``; NaN where a ray
        does not meet the water.
    """
    asked, flat = _rows(directions_ned)
    eye = np.ascontiguousarray(eye_ned_m, dtype=np.float64)
    entries, inside = np.empty(flat.shape), np.empty(flat.shape)
    kernel.into_water(eye, flat, level_m, index, entries, inside)
    return entries.reshape(asked.shape), inside.reshape(asked.shape)


def deepened(
    eye_ned_m: npt.ArrayLike,
    apparent_ned_m: npt.ArrayLike,
    level_m: float = 0.0,
    index: float = FRESH_WATER_INDEX,
) -> FloatArray:
    """Return where points are that look, taken as if in air, to be beyond the surface.

    A point that looks to be at ``E + l d`` lies at about ``S + n (l - |S - E|) w``: the light that
    spreads from it looks n times nearer behind the surface.

    Args:
        eye_ned_m: Shape ``(..., 3)``, m, above the surface; one for all or one for each.
        apparent_ned_m: Shape ``(..., 3)``, m.
        level_m: Down coordinate of the surface.
        index: Index of refraction of the water.

    Returns:
        The places, shape ``(..., 3)``, m; those above the surface stay where they are.
    """
    eye = np.asarray(eye_ned_m, dtype=np.float64)
    apparent = np.asarray(apparent_ned_m, dtype=np.float64)
    way = apparent - eye
    length = np.maximum(np.sqrt((way * way).sum(axis=-1, keepdims=True)), 1e-12)
    down = way[..., 2:] / length
    above = (level_m - eye[..., 2:]) / np.where(down > 0.0, down, np.inf)  # along the way
    steeper = np.sqrt(1.0 - (1.0 - down * down) / index**2) - down / index
    inside = way / length / index
    inside[..., 2:] += steeper
    deeper = eye + way / length * above + index * (length - above) * inside
    return np.where((down > 0.0) & (length > above), deeper, apparent)


def _rows(vectors: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return vectors as they are, and as rows for a kernel."""
    array = np.asarray(vectors, dtype=np.float64)
    return array, np.ascontiguousarray(array.reshape(-1, 3))
