"""Corners of a tag to a tenth of a pixel: straight lines through its edges, in linear light.

A camera's curve (gamma) makes the black square look smaller than it is, by a quarter to a third of
a pixel where the lens blurs; in light that adds up, the middle of a blurred edge is its place. On
each side the gradient's centroid is taken along profiles across it; a line that a few wrong ones do
not bend goes through them; the corners are where lines meet. This is done thrice, each time from
the corners found before.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray
from autonomy.vision import corner_kernel as kernel

AROUND = np.array([1, 2, 3, 0])
"""The corner after each."""
GAMMA = 2.2
"""Of a camera whose curve is not known."""
_SIGMA_PX, _SIGMA_SIDE_PX, _SIGMA_POWER, _SHARP_PX = 0.05, 32.0, 1.7, 0.8
_FARTHEST_PX, _FARTHEST_SHARE = 3.0, 0.1
_FARTHEST_PIXEL = 1e5
_UNFITTED = 3.0
"""How much more noise the corners have that the detector found."""


def light_of_grey(gamma: float = GAMMA) -> FloatArray:
    """Return the light of each grey value of 8 bits, 0 to 1, shape ``(256,)``."""
    return (np.arange(256) / 255.0) ** gamma


@dataclass(frozen=True, slots=True, eq=False)
class CornerFit:
    """The corners of one tag in one picture."""

    corners_px: FloatArray
    """In order, shape ``(4, 2)``."""
    sigma_px: float
    """Standard deviation of each coordinate."""
    blur_px: float
    """Standard deviation of the blur that the edges show; 0 where there is no fit."""
    is_fitted: bool
    """False where the detector's corners were kept."""


def fit_corners(
    picture: kernel.Picture, corners_px: npt.ArrayLike, light: FloatArray | None = None
) -> CornerFit:
    """Fit the corners of one tag.

    Args:
        picture: Grey values, shape ``(rows, columns)``.
        corners_px: As the detector found them, in order, shape ``(4, 2)``.
        light: Light of each grey value, shape ``(256,)``; of gamma 2.2 if not given.

    Returns:
        The corners; those of the detector, with three times the noise, where an edge is not seen or
        a corner would move by more than 3 px and a tenth of the side.
    """
    start = np.array(corners_px, dtype=np.float64)
    if not are_pixels(start):
        return CornerFit(start, _UNFITTED * corner_sigma_px(0.0, 0.0), 0.0, is_fitted=False)
    table = light_of_grey() if light is None else light
    found, variance = start.copy(), -1.0
    if min(picture.shape) >= 2:
        variance = kernel.fit_into(np.ascontiguousarray(picture), table, found)
    return judged(start, found, variance)


def judged(start_px: FloatArray, found_px: FloatArray, variance_px2: float) -> CornerFit:
    """Take fitted corners, or the detector's where there is no fit or it went too far."""
    side = mean_side_px(start_px)
    moved = float(np.linalg.norm(found_px - start_px, axis=1).max())
    if variance_px2 < 0.0 or not moved <= _FARTHEST_PX + _FARTHEST_SHARE * side:
        return CornerFit(start_px, _UNFITTED * corner_sigma_px(side, 0.0), 0.0, is_fitted=False)
    width2 = variance_px2 / kernel.TAIL_VARIANCE
    blur = float(np.sqrt(max(width2 - kernel.BOX_VARIANCE_PX2, 0.0)))
    sigma = corner_sigma_px(mean_side_px(found_px), blur)
    return CornerFit(found_px, sigma, blur, is_fitted=True)


def are_pixels(corners_px: FloatArray) -> bool:
    """Tell whether these are four finite places that may be in a picture or around it."""
    return corners_px.shape == (4, 2) and bool((np.abs(corners_px) <= _FARTHEST_PIXEL).all())


def corner_sigma_px(side_px: float, blur_px: float) -> float:
    """Return the noise of a fitted corner's coordinates.

    Args:
        side_px: Mean side of the tag in the picture.
        blur_px: Standard deviation of the blur of its edges.
    """
    small = max(1.0, (_SIGMA_SIDE_PX / max(side_px, 1.0)) ** _SIGMA_POWER)
    return _SIGMA_PX * small * max(1.0, (blur_px / _SHARP_PX) ** 2)


def mean_side_px(corners_px: FloatArray) -> float:
    """Return the mean side of a tag in the picture."""
    return float(np.linalg.norm(corners_px[AROUND] - corners_px, axis=1).mean())


def area_px2(corners_px: FloatArray) -> float:
    """Return the area of a tag in the picture, negative where its corners run the wrong way."""
    u, v = corners_px[:, 0], corners_px[:, 1]
    return 0.5 * float(np.sum(u * v[AROUND] - v * u[AROUND]))
