"""Pictures of tags, drawn exactly: their light blurred, noise added, then the camera's curve."""

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

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
) -> npt.NDArray[np.uint8]:
    """Return a picture of a tag with a random pattern.

    Args:
        corners_px: Corners of the black square, shape ``(4, 2)``.
        size: Rows and columns of the picture.
        rng: Draws pattern and noise.
        blur_px: Standard deviation of the lens's blur.
        noise: Standard deviation of the grey values.
        gamma: Of the camera's curve.
    """
    cells = np.full((10, 10), _WHITE)
    cells[1:9, 1:9] = _BLACK
    cells[2:8, 2:8] = rng.choice([_BLACK, _WHITE], size=(6, 6))
    fine = (np.arange(size * _FINE) + 0.5) / _FINE - 0.5
    u, v = np.meshgrid(fine, fine)
    x, y, w = np.tensordot(homography(corners_px), np.stack([u, v, np.ones_like(u)]), axes=1)
    column, row = np.floor(x / w).astype(int) + 1, np.floor(y / w).astype(int) + 1
    inside = (column >= 0) & (column < 10) & (row >= 0) & (row < 10)
    light = np.where(inside, cells[row.clip(0, 9), column.clip(0, 9)], _BEHIND)
    light = gaussian_filter(light, blur_px * _FINE, mode="nearest")
    light = light.reshape(size, _FINE, size, _FINE).mean(axis=(1, 3))
    grey = 255.0 * light ** (1.0 / gamma) + rng.normal(0.0, noise, light.shape)
    return np.clip(np.round(grey), 0, 255).astype(np.uint8)


def tilted_square(side_px: float, tilt_rad: float, turn_rad: float, middle_px: float) -> FloatArray:
    """Return the corners of a tag that is tilted and turned, seen from far, shape ``(4, 2)``."""
    square = side_px * np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    square[:, 0] *= np.cos(tilt_rad)
    square *= 1.0 + 0.02 * np.sin(tilt_rad) * np.sign(square[:, :1])
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    return square @ np.array([[c, s], [-s, c]]) + middle_px
