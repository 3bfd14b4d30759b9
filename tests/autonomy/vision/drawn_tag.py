"""Pictures of tags, drawn exactly: their light blurred, noise added, then the camera's curve."""

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter, uniform_filter1d

from autonomy.arrays import FloatArray

_FINE = 5
"""Places a pixel along each side."""
_WHITE, _BLACK, _BEHIND = 0.75, 0.04, 0.25


def homography(corners_px: FloatArray) -> FloatArray:
    """Return what takes pixels to the tag's cells: 0 and 8 at the corners, shape ``(3, 3)``."""
    cells = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 8.0], [0.0, 8.0]])
    rows: list[list[float]] = []
    for (u, v), (x, y) in zip(corners_px.tolist(), cells.tolist(), strict=True):
        rows.append([u, v, 1.0, 0.0, 0.0, 0.0, -x * u, -x * v, -x])
        rows.append([0.0, 0.0, 0.0, u, v, 1.0, -y * u, -y * v, -y])
    return np.linalg.svd(np.array(rows))[2][-1].reshape(3, 3)


def draw(
    corners_px: FloatArray,
    size: int,
    rng: np.random.Generator,
    *,
    blur_px: float = 0.8,
    noise: float = 3.0,
    gamma: float = 2.2,
    pattern: npt.NDArray[np.bool_] | None = None,
    motion_px: float = 0.0,
    caustics: float = 0.0,
) -> npt.NDArray[np.uint8]:
    """Return a picture of a tag.

    Args:
        corners_px: Corners of the black square, shape ``(4, 2)``.
        size: Rows and columns of the picture.
        rng: Draws pattern and noise.
        blur_px: Standard deviation of the lens's blur.
        noise: Standard deviation of the grey values.
        gamma: Of the camera's curve.
        pattern: Which inner cells are white, as printed, shape ``(6, 6)``; random if not given.
        motion_px: How far the tag moves to the right while the picture is taken.
        caustics: Relative strength of a net of light on everything, below 1.
    """
    cells = np.full((10, 10), _WHITE)
    cells[1:9, 1:9] = _BLACK
    white = rng.random((6, 6)) < 0.5 if pattern is None else pattern
    cells[2:8, 2:8] = np.where(white, _WHITE, _BLACK)
    fine = (np.arange(size * _FINE) + 0.5) / _FINE - 0.5
    u, v = np.meshgrid(fine, fine)
    x, y, w = np.tensordot(homography(corners_px), np.stack([u, v, np.ones_like(u)]), axes=1)
    column, row = np.floor(x / w).astype(int) + 1, np.floor(y / w).astype(int) + 1
    inside = (column >= 0) & (column < 10) & (row >= 0) & (row < 10)
    light = np.where(inside, cells[row.clip(0, 9), column.clip(0, 9)], _BEHIND)
    if caustics:
        light *= 1.0 + caustics * _net(u, v, rng)
    light = gaussian_filter(light, blur_px * _FINE, mode="nearest")
    if motion_px:
        light = uniform_filter1d(light, round(motion_px * _FINE), axis=1, mode="nearest")
    light = light.reshape(size, _FINE, size, _FINE).mean(axis=(1, 3))
    grey = 255.0 * light ** (1.0 / gamma) + rng.normal(0.0, noise, light.shape)
    return np.clip(np.round(grey), 0, 255).astype(np.uint8)


def _net(u: FloatArray, v: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return crossing stripes of random directions, 30 px from one to the next, -1 to 1."""
    waves = np.zeros_like(u)
    for turn in rng.uniform(0.0, np.pi, 3):
        phase = rng.uniform(0.0, 2.0 * np.pi)
        waves += np.sin((u * np.cos(turn) + v * np.sin(turn)) * 2.0 * np.pi / 30.0 + phase)
    return waves / 3.0


def tilted_square(side_px: float, tilt_rad: float, turn_rad: float, middle_px: float) -> FloatArray:
    """Return the corners of a tag that is tilted and turned, seen from far, shape ``(4, 2)``."""
    square = side_px * np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    square[:, 0] *= np.cos(tilt_rad)
    square *= 1.0 + 0.02 * np.sin(tilt_rad) * np.sign(square[:, :1])
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return square @ np.array([[c, s], [-s, c]]) + middle_px
