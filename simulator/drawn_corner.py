"""Corners as the line fit would place them, without a picture: where they are exactly, and noise.

Each coordinate has a normal error of the size that ``autonomy.vision.corner`` states; all corners
of a picture lie too far in or out by an edge error that they have in common. Small tags are missed
as often as the detector misses them in a whole picture, searched as it is.
"""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.corner import AROUND, area_px2, corner_sigma_px
from autonomy.vision.fix import LEAST_AREA_PX2

BLUR_PX = 0.8
EDGE_SHARE = 0.6
"""Standard deviation of the common edge error, over the noise."""
_FOUND_SIDES_PX, _FOUND_SHARES = (12.0, 14.0, 16.0, 20.0), (0.0, 0.15, 0.6, 1.0)
"""Sides of tags, and which share of them is found."""


def drawn_corners(
    exact_px: FloatArray, edge: float, rng: np.random.Generator
) -> tuple[FloatArray, float] | None:
    """Return the corners of one tag and their noise; nothing where the tag is not found.

    Args:
        exact_px: Where they are, in order, shape ``(4, 2)``.
        edge: The picture's edge error, in standard deviations of the noise.
        rng: Draws noise and misses.
    """
    if area_px2(exact_px) < LEAST_AREA_PX2:
        return None
    along = exact_px[AROUND] - exact_px
    sides = np.linalg.norm(along, axis=1)
    share = float(np.interp(float(sides.min()), _FOUND_SIDES_PX, _FOUND_SHARES))
    if rng.random() >= share:
        return None
    sigma = corner_sigma_px(float(sides.mean()), BLUR_PX)
    ahead = along / sides[:, None]
    moved = exact_px + edge * sigma * (ahead - np.roll(ahead, 1, axis=0))
    return rng.normal(moved, sigma), sigma
