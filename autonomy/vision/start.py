r"""First guesses of poses: both poses in which a square may be seen, behind the water's surface.

A square that is seen small looks alike in two poses, about mirrored. Of the map from its plane to
the picture, the derivative J at its middle and the place v of the middle tell both in closed form.
Where the square is under water it is taken as if it were in air, then put to the depth at
which it would look to be there.

Source:
    Collins and Bartoli, "Infinitesimal plane-based pose estimation", International Journal of
    Computer Vision 109, 2014, section 4; Heckbert, *Fundamentals of texture mapping*, 1989, section
    2.2.3 for the map of a square.
"""

from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.vision.camera import Camera
from autonomy.vision.refraction import deepened
from autonomy.vision.tag import CORNERS

_TINY = 1e-12


def both_poses(slopes: FloatArray, sizes_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the two poses of squares that explain their corners best.

    Args:
        slopes: Corners in order, as slopes x/z and y/z of their rays, shape ``(m, 4, 2)``.
        sizes_m: Sides of the squares, shape ``(m,)``.

    Returns:
        Rotations from the squares' axes to the camera's, shape ``(m, 2, 3, 3)``, and their middles
        in camera axes, shape ``(m, 2, 3)``, m. Not finite where the corners are on a line.
    """
    middle, by_share = _middle_and_slope(slopes)
    J = by_share / sizes_m[:, None, None]
    to_middle = _rotation_to(middle)
    B = to_middle[:, :2, :2] - middle[:, :, None] * to_middle[:, 2:, :2]  # [I | -v] R_v
    A = np.linalg.solve(B, J)
    gamma = np.linalg.svd(A, compute_uv=False)[:, 0]
    flat = A / gamma[:, None, None]
    left = np.eye(2) - np.swapaxes(flat, 1, 2) @ flat  # b b'
    b0 = np.sqrt(np.maximum(left[:, 0, 0], 0.0))
    b1 = np.copysign(np.sqrt(np.maximum(left[:, 1, 1], 0.0)), left[:, 0, 1])
    rotations = np.empty((len(slopes), 2, 3, 3))
    for i, sign in enumerate((1.0, -1.0)):
        rotations[:, i, :2, :2] = flat
        rotations[:, i, 2, 0], rotations[:, i, 2, 1] = sign * b0, sign * b1
        rotations[:, i, :, 2] = _cross(rotations[:, i, :, 0], rotations[:, i, :, 1])
    rotations = to_middle[:, None] @ rotations
    return rotations, _places(slopes, sizes_m, rotations)


def tag_poses(
    cameras: Sequence[Camera],
    numbers: IntArray,
    corners_px: FloatArray,
    sizes_m: FloatArray,
    level_m: float | None,
    index: float,
) -> tuple[FloatArray, FloatArray]:
    """Return both poses of each tag that cameras see, in the tank's NED.

    Args:
        cameras: Above the water, or in it behind their ports.
        numbers: Which camera each tag is seen by, shape ``(m,)``.
        corners_px: Corners in order, shape ``(m, 4, 2)``.
        sizes_m: Of the tags, shape ``(m,)``.
        level_m: Down coordinate of the surface; none where nothing is to be put deeper.
        index: Index of refraction of the water.

    Returns:
        Rotations from the tags' axes to NED, shape ``(m, 2, 3, 3)``, and middles, ``(m, 2, 3)``, m;
        not finite where corners have no rays.
    """
    rays = np.empty((len(numbers), 4, 3))
    is_wet = np.zeros(len(numbers), dtype=np.bool_)
    for i, camera in enumerate(cameras):
        rays[numbers == i] = _rays(camera, corners_px[numbers == i], index)
        is_wet[numbers == i] = camera.port is not None
    slopes = rays[..., :2] / rays[..., 2:]
    is_seen = np.isfinite(slopes).all(axis=(1, 2))
    slopes[~is_seen] = CORNERS[:, :2]
    rotations, places = both_poses(slopes, sizes_m)
    turns = np.array([camera.pose.rotation for camera in cameras])[numbers][:, None]
    eyes = np.array([camera.pose.position_m for camera in cameras])[numbers][:, None, None]
    corners = sizes_m[:, None, None, None] * CORNERS  # (m, 1, 4, 3)
    seen = corners @ np.swapaxes(rotations, 2, 3) + places[:, :, None]  # (m, 2, 4, 3)
    there = seen @ np.swapaxes(turns, 2, 3) + eyes
    if level_m is not None:
        deeper = deepened(eyes, there, level_m, index)
        there = np.where(is_wet[:, None, None, None], there, deeper)
    there[~is_seen] = np.nan
    return _squares_through(there)


def _rays(camera: Camera, corners_px: FloatArray, index: float) -> FloatArray:
    """Return the rays to corners in camera axes; in the water behind a port."""
    rays = camera.lens.rays(corners_px)
    return rays if camera.port is None else camera.port.rays(rays, index)[1]


def _squares_through(p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return rotations and middles of squares near their four points, shape ``(..., 4, 3)``."""
    p0, p1, p2, p3 = (p[..., i, :] for i in range(4))
    x, y = _unit(p1 + p2 - p0 - p3), _unit(p2 + p3 - p0 - p1)
    first, second = _unit(x + y), _unit(x - y)
    x, y = (first + second) * np.sqrt(0.5), (first - second) * np.sqrt(0.5)
    return np.stack([x, y, _cross(x, y)], axis=-1), p.mean(axis=-2)


def _unit(vectors: FloatArray) -> FloatArray:
    return vectors / np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return cross products, which numpy's own takes ten times as long for when there are few."""
    (a0, a1, a2), (b0, b1, b2) = np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)
    return np.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], axis=-1)


def _middle_and_slope(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where the middle of unit squares is seen, and the derivative there, ``(m, 2, 2)``."""
    p0, p1, p2, p3 = (corners[:, i] for i in range(4))
    one, three, all_of = p1 - p2, p3 - p2, p0 - p1 + p2 - p3
    area = one[:, 0] * three[:, 1] - one[:, 1] * three[:, 0]
    area = np.where(np.abs(area) > _TINY, area, np.nan)
    g = (all_of[:, 0] * three[:, 1] - all_of[:, 1] * three[:, 0]) / area
    h = (one[:, 0] * all_of[:, 1] - one[:, 1] * all_of[:, 0]) / area
    a, b = p1 - p0 + g[:, None] * p1, p3 - p0 + h[:, None] * p3
    w = (0.5 * g + 0.5 * h + 1.0)[:, None]
    middle = (0.5 * a + 0.5 * b + p0) / w
    by_x, by_y = (a - middle * g[:, None]) / w, (b - middle * h[:, None]) / w
    return middle, np.stack([by_x, by_y], axis=-1)


def _rotation_to(slopes: FloatArray) -> FloatArray:
    """Return rotations that take the optical axis to rays of these slopes, shape ``(m, 3, 3)``."""
    length = np.sqrt(1.0 + (slopes**2).sum(axis=1))
    x, y, z = slopes[:, 0] / length, slopes[:, 1] / length, 1.0 / length
    over = 1.0 / (1.0 + z)
    rows = [
        [1.0 - x * x * over, -x * y * over, x],
        [-x * y * over, 1.0 - y * y * over, y],
        [-x, -y, z],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _places(slopes: FloatArray, sizes_m: FloatArray, rotations: FloatArray) -> FloatArray:
    """Return the middles that fit the corners best under given rotations, shape ``(m, 2, 3)``."""
    corners = sizes_m[:, None, None] * CORNERS
    turned = np.einsum("mskj,mcj->msck", rotations, corners)  # (m, 2, 4, 3)
    u, v = slopes[:, None, :, 0], slopes[:, None, :, 1]
    one, none = np.ones_like(u), np.zeros_like(u)
    rows = np.stack(
        [np.stack([one, none, -u], axis=-1), np.stack([none, one, -v], axis=-1)], axis=-2
    )  # (m, 1, 4, 2, 3)
    wanted = -np.stack(
        [turned[..., 0] - u * turned[..., 2], turned[..., 1] - v * turned[..., 2]], axis=-1
    )
    normal = np.einsum("mscij,mscik->msjk", rows, rows)
    right = np.einsum("mscij,msci->msj", np.broadcast_to(rows, (*wanted.shape, 3)), wanted)
    return np.linalg.solve(normal, right[..., None])[..., 0]
