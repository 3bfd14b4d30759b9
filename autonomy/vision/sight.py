"""Where cameras see tags: the compiled sight for many views at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.vision import sight_kernel as kernel
from autonomy.vision.camera import Camera
from autonomy.vision.rigid import Pose


@dataclass(frozen=True, slots=True, eq=False)
class Sights:
    """Where cameras see tags, and how that changes."""

    pixels: FloatArray
    """Corners in order, shape ``(m, 4, 2)``; NaN where a tag is not seen whole."""
    slopes: FloatArray
    """Derivatives in the columns of ``sight_kernel``, shape ``(m, 8, 24)``."""


def sights(
    cameras: FloatArray,
    numbers: IntArray,
    carriers: Sequence[Pose],
    corners_m: FloatArray,
    level_m: float,
    index: float,
) -> Sights:
    """Return where cameras see tags.

    Args:
        cameras: Packed cameras, shape ``(n, 28)``.
        numbers: Which camera each view is of, shape ``(m,)``.
        carriers: Takes the axes in which the corners are told into NED, for each view.
        corners_m: Corners in order, shape ``(m, 4, 3)``, m.
        level_m: Down coordinate of the surface.
        index: Index of refraction of the water.
    """
    m = len(numbers)
    pixels, slopes = np.empty((m, 4, 2)), np.zeros((m, 8, kernel.COLUMNS))
    rotations = np.array([carrier.rotation for carrier in carriers]).reshape(m, 3, 3)
    places = np.array([carrier.position_m for carrier in carriers]).reshape(m, 3)
    kernel.views(cameras, numbers, rotations, places, corners_m, level_m, index, pixels, slopes)
    return Sights(pixels, slopes)


def corners_seen(
    camera: Camera, corners_ned_m: FloatArray, level_m: float, index: float
) -> FloatArray:
    """Return where a camera sees the corners of one tag, shapes ``(4, 3)`` m and ``(4, 2)`` px.

    NaN where one is not seen.
    """
    one = np.zeros(1, dtype=np.int64)
    carriers = [Pose.identity()]
    return sights(camera.packed[None], one, carriers, corners_ned_m[None], level_m, index).pixels[0]
