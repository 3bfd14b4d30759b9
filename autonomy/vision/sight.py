"""Where cameras see tags: the compiled sight for many views at once, and its readable form."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.vision import reference
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


def corners_seen_plainly(
    camera: Camera, corners_ned_m: FloatArray, level_m: float, index: float
) -> FloatArray:
    """Return the same by the readable optics; the tag must be seen whole."""
    eye = camera.pose.position_m
    seen = corners_ned_m.copy()
    wet = corners_ned_m[:, 2] > level_m
    if camera.port is None and wet.any():
        flat = corners_ned_m[wet, :2] - eye[:2]
        distance = np.hypot(flat[:, 0], flat[:, 1])
        height = np.full(len(flat), level_m - eye[2])
        depth = corners_ned_m[wet, 2] - level_m
        way = reference.surface_way_m(distance, height, depth, index)
        seen[wet, :2] = eye[:2] + flat * (way / distance)[:, None]
        seen[wet, 2] = level_m
    before = camera.pose.inverse.of_points(seen)
    if camera.port is not None:
        distance = np.hypot(before[:, 0], before[:, 1])
        slope = reference.port_slope(camera.port, distance, before[:, 2], index)
        before = np.column_stack([before[:, :2] * (slope / distance)[:, None], np.ones(4)])
    pixels = reference.project(camera.lens, before)
    ahead = np.roll(pixels, -1, axis=0) - pixels
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return pixels + camera.edge_px * (ahead - np.roll(ahead, 1, axis=0))
