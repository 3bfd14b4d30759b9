"""Lens, surface and port in their readable form, and where a camera sees a tag through them.

Nothing is fast here and nothing is differentiated; inverses are found by bisection.
"""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.camera import Camera
from autonomy.vision.lens import Lens
from autonomy.vision.refraction import FlatPort

_HALVINGS = 200


def project(lens: Lens, points_camera_m: FloatArray) -> FloatArray:
    """Return the pixels of points before a lens, shapes ``(n, 3)`` m and ``(n, 2)``."""
    x = points_camera_m[:, 0] / points_camera_m[:, 2]
    y = points_camera_m[:, 1] / points_camera_m[:, 2]
    r2 = x**2 + y**2
    k = (*lens.distortion, *np.zeros(5 - len(lens.distortion)))
    if lens.kind == "pinhole":
        radial = 1.0 + k[0] * r2 + k[1] * r2**2 + k[4] * r2**3
        bent_x = x * radial + 2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x**2)
        bent_y = y * radial + k[2] * (r2 + 2.0 * y**2) + 2.0 * k[3] * x * y
    else:
        r = np.sqrt(r2)
        t = np.arctan(r)
        bent_t = t * (1.0 + k[0] * t**2 + k[1] * t**4 + k[2] * t**6 + k[3] * t**8)
        bent_x, bent_y = x * bent_t / r, y * bent_t / r
    u = lens.focal_px[0] * bent_x + lens.principal_px[0]
    v = lens.focal_px[1] * bent_y + lens.principal_px[1]
    return np.column_stack([u, v])


def surface_way_m(
    distance_m: FloatArray, height_m: FloatArray, depth_m: FloatArray, index: float
) -> FloatArray:
    """Return how far from the eye's foot light leaves the water, by bisection, shape ``(n,)``."""

    def excess(x: FloatArray) -> FloatArray:
        above = x / np.hypot(x, height_m)
        rest = distance_m - x
        return above - index * rest / np.hypot(rest, depth_m)

    low, high = np.zeros_like(distance_m), distance_m.copy()
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        is_below = excess(middle) < 0.0
        low, high = np.where(is_below, middle, low), np.where(is_below, high, middle)
    return 0.5 * (low + high)


def port_slope(
    port: FlatPort, distance_m: FloatArray, forward_m: FloatArray, index: float
) -> FloatArray:
    """Return the slope before the window of the ray to points, by bisection, shape ``(n,)``.

    Args:
        port: The window.
        distance_m: Of the points from the optical axis, shape ``(n,)``.
        forward_m: Of the points along it, shape ``(n,)``.
        index: Index of refraction of the water.
    """
    in_water_m = forward_m - port.distance_m - port.thickness_m

    def reach_m(angle: FloatArray) -> FloatArray:
        in_glass = np.arcsin(np.sin(angle) / port.glass_index)
        in_water = np.arcsin(np.sin(angle) / index)
        return (
            port.distance_m * np.tan(angle)
            + port.thickness_m * np.tan(in_glass)
            + in_water_m * np.tan(in_water)
        )

    low, high = np.zeros_like(distance_m), np.full_like(distance_m, 0.5 * np.pi)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        is_below = reach_m(middle) < distance_m
        low, high = np.where(is_below, middle, low), np.where(is_below, high, middle)
    return np.tan(0.5 * (low + high))


def corners_seen(
    camera: Camera, corners_ned_m: FloatArray, level_m: float, index: float
) -> FloatArray:
    """Return where a camera sees the corners of one tag, shapes ``(4, 3)`` m and ``(4, 2)`` px.

    The tag must be seen whole.
    """
    eye = camera.pose.position_m
    seen = corners_ned_m.copy()
    wet = corners_ned_m[:, 2] > level_m
    if camera.port is None and wet.any():
        flat = corners_ned_m[wet, :2] - eye[:2]
        distance = np.hypot(flat[:, 0], flat[:, 1])
        height = np.full(len(flat), level_m - eye[2])
        depth = corners_ned_m[wet, 2] - level_m
        way = surface_way_m(distance, height, depth, index)
        seen[wet, :2] = eye[:2] + flat * (way / distance)[:, None]
        seen[wet, 2] = level_m
    before = camera.pose.inverse.of_points(seen)
    if camera.port is not None:
        distance = np.hypot(before[:, 0], before[:, 1])
        slope = port_slope(camera.port, distance, before[:, 2], index)
        before = np.column_stack([before[:, :2] * (slope / distance)[:, None], np.ones(4)])
    pixels = project(camera.lens, before)
    ahead = np.roll(pixels, -1, axis=0) - pixels
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    return pixels + camera.edge_px * (ahead - np.roll(ahead, 1, axis=0))
