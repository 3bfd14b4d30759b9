"""Line fit of a tag's corners in its readable form."""

import numpy as np
from scipy.ndimage import map_coordinates

from autonomy.arrays import FloatArray
from autonomy.vision import corner_kernel as kernel
from autonomy.vision.corner import area_px2


def fit_corners(
    picture: kernel.Picture, corners_px: FloatArray, light: FloatArray
) -> tuple[FloatArray, float]:
    """Fit the corners as the kernel does, in readable form; an edge that is not seen is an error.

    Returns:
        Corners, shape ``(4, 2)``, px, and the mean square of the gradients' width, px^2.
    """
    corners, width2 = corners_px, 0.0
    for _ in range(kernel.ROUNDS):
        sides = [_side(light[picture], corners, k) for k in range(4)]
        width2 = float(np.mean([side[2] for side in sides]))
        meeting: list[FloatArray] = []
        for k in range(4):
            (p, along_p, _), (q, along_q, _) = sides[k - 1], sides[k]
            way = np.linalg.solve(np.column_stack([along_p, -along_q]), q - p)
            meeting.append(p + way[0] * along_p)
        corners = np.array(meeting)
    return corners, width2


def _side(light: FloatArray, corners: FloatArray, k: int) -> tuple[FloatArray, FloatArray, float]:
    """Return a point and the direction of one side's line, and the median width^2."""
    start, way = corners[k], corners[(k + 1) % 4] - corners[k]
    length = float(np.linalg.norm(way))
    ahead = way / length
    outward = np.array([ahead[1], -ahead[0]])
    reach = kernel.REACH_CELLS * area_px2(corners) / length / kernel.CELLS
    half = int(np.clip(reach, kernel.LEAST_REACH_PX, kernel.GREATEST_REACH_PX) / kernel.STEP_PX)
    n = int(np.clip(length, kernel.FEWEST_SAMPLES, kernel.MOST_SAMPLES))
    along = length * np.linspace(kernel.FROM_SHARE, kernel.TO_SHARE, n)
    across = kernel.STEP_PX * np.arange(-half, half + 1, dtype=np.float64)
    places = start + along[:, None, None] * ahead + across[:, None] * outward  # (n, profile, 2)
    profile: FloatArray = map_coordinates(light, [places[..., 1], places[..., 0]], order=1)
    rises = profile[:, 2:] - profile[:, :-2]
    peaks = rises.max(axis=1)
    keep = peaks > kernel.FAINT * np.median(peaks)
    crossings = np.array([_centroid(rise, across[1:-1]) for rise in rises[keep]])
    offset, slope = _line(along[keep], crossings[:, 0])
    return start + offset * outward, ahead + slope * outward, float(np.median(crossings[:, 1]))


def _centroid(rise: FloatArray, across: FloatArray) -> tuple[float, float]:
    """Return mean and variance of the gradient around its peak."""
    at = int(rise.argmax())
    faint = np.flatnonzero(rise <= kernel.TAIL * rise[at])
    first = max(faint[faint < at], default=-1) + 1
    last = min(faint[faint > at], default=len(rise))
    weight, places = rise[first:last], across[first:last]
    mean = float(np.average(places, weights=weight))
    return mean, float(np.average((places - mean) ** 2, weights=weight))


def _line(along: FloatArray, across: FloatArray) -> tuple[float, float]:
    """Return offset and slope of a line that outliers bend little (Huber's weights)."""
    weight = np.ones(len(along))
    offset, slope = 0.0, 0.0
    for _ in range(kernel.REWEIGHTINGS):
        slope, offset = np.polyfit(along, across, 1, w=np.sqrt(weight)).tolist()
        off = np.abs(across - offset - slope * along)
        scatter = max(kernel.MAD_TO_STD * float(np.median(off)), kernel.LEAST_SCATTER_PX)
        weight = 1.0 / np.maximum(1.0, off / (kernel.OUTLYING * scatter))
    return offset, slope
