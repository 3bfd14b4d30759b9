"""Errors that stay as they are from fix to fix, as shifts of the corners in the pictures."""

import math
from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray, IntArray
from autonomy.vision import sight_kernel as kernel
from autonomy.vision.camera import Rig
from autonomy.vision.constants import CAMERA_ERRORS
from autonomy.vision.rigid import Pose, skew
from autonomy.vision.tag import Tag

EDGE_SHARE = 0.6
"""Standard deviation of the edge error that is common to all tags, over the corners' noise."""


def considered_root(
    rig: Rig,
    tags: Sequence[Tag],
    numbers: IntArray,
    slopes: FloatArray,
    sigmas_px: FloatArray,
    *,
    eyes_m: FloatArray,
    carrier: Pose,
    after_s: FloatArray,
    velocity_std_m_s: float,
    velocity_ned_m_s: FloatArray | None = None,
    seeks_eye: bool = False,
) -> FloatArray:
    """Return by how much each considered error of one standard deviation moves the corners.

    Args:
        rig: Cameras with their covariance, the water and its ripples.
        tags: Of each view, in the carrier's axes, ``m`` of them.
        numbers: Which camera each view is of, shape ``(m,)``.
        slopes: Derivatives of the corners, shape ``(m, 8, 24)``.
        sigmas_px: Noise of each view, shape ``(m,)``.
        eyes_m: Where the cameras are, shape ``(n, 3)``.
        carrier: Takes the carrier's axes into NED.
        after_s: How long after the moment of the fix each view is, shape ``(m,)``.
        velocity_std_m_s: How well the velocity in between is known, per axis.
        velocity_ned_m_s: With which the carrier moves, shape ``(3,)``; None where it lies still.
        seeks_eye: Whether the camera's own pose is sought, and so is no error of what was known.

    Returns:
        Shape ``(m, 8, k)``, px: with R these, ``R R'`` is the covariance of the corners.
    """
    m = len(tags)
    parts = [
        _of_cameras(rig, numbers, slopes, seeks_eye=seeks_eye),
        slopes[:, :, [kernel.BY_INDEX]] * rig.index_std,
        slopes[:, :, [kernel.BY_EDGE]] * (EDGE_SHARE * sigmas_px)[:, None, None],
        _of_tags(tags, slopes, carrier),
    ]
    if after_s.any():
        place = slopes[:, :, kernel.BODY_PLACE : kernel.BODY_TURN]
        parts.append(place * (after_s * velocity_std_m_s)[:, None, None])
    if velocity_ned_m_s is not None:
        parts.append(_of_latency(rig, numbers, slopes, velocity_ned_m_s))
    if rig.ripple_slope_rad > 0.0:
        sizes = [
            ripple_px(
                rig,
                int(numbers[i]),
                eyes_m[numbers[i]],
                carrier.of_points(tag.position_m),
                rig.ripple_slope_rad,
            )
            for i, tag in enumerate(tags)
        ]
        ripples = np.zeros((m, 8, 2 * m))
        for i, size in enumerate(sizes):
            ripples[i, 0::2, 2 * i] = ripples[i, 1::2, 2 * i + 1] = size
        parts.append(ripples)
    return np.concatenate(parts, axis=2)


def ripple_px(
    rig: Rig, number: int, eye_m: FloatArray, place_m: FloatArray, slope_rad: float
) -> float:
    """Return by how much ripples move what is under water in a picture, rms per axis, px.

    A slope s of the surface bends the ray by ``(1 - 1/n) s``, which at the depth z is ``z`` times
    that; the point looks to be ``rho`` away, at ``z / n``.
    """
    port = rig.cameras[number].port
    depth = float(place_m[2]) - rig.level_m
    if port is not None or depth <= 0.0:
        return 0.0
    height = rig.level_m - float(eye_m[2])
    away = math.hypot(*(place_m[:2] - eye_m[:2]).tolist(), height + depth / rig.index)
    focal = sum(rig.cameras[number].lens.focal_px) / 2.0
    return focal / away * depth * (1.0 - 1.0 / rig.index) * slope_rad


def _of_cameras(rig: Rig, numbers: IntArray, slopes: FloatArray, *, seeks_eye: bool) -> FloatArray:
    """Return what the calibration's errors do: cameras with lens and edge, and the level."""
    own = slopes[:, :, kernel.EYE_PLACE : kernel.BY_LEVEL].copy()
    if seeks_eye:
        own[:, :, : kernel.BY_LENS - kernel.EYE_PLACE] = 0.0
    rows = rig.root[:-1].reshape(len(rig.cameras), CAMERA_ERRORS, -1)[numbers]
    return own @ rows + slopes[:, :, [kernel.BY_LEVEL]] * rig.root[-1]


def _of_latency(
    rig: Rig, numbers: IntArray, slopes: FloatArray, velocity_ned_m_s: FloatArray
) -> FloatArray:
    """Return what a carrier's way does while a camera is late by more, or less, than was told."""
    late = np.zeros((len(numbers), 8, len(rig.cameras)))
    moved = slopes[:, :, kernel.BODY_PLACE : kernel.BODY_TURN] @ velocity_ned_m_s  # (m, 8), px/s
    for i, number in enumerate(numbers.tolist()):
        late[i, :, number] = moved[i] * rig.cameras[number].latency_std_s
    return late


def _of_tags(tags: Sequence[Tag], slopes: FloatArray, carrier: Pose) -> FloatArray:
    """Return what a tag does that is shifted and turned on its carrier, in all views alike."""
    ids = sorted({tag.id for tag in tags})
    shifted = np.zeros((len(tags), 8, 6 * len(ids)))
    for i, tag in enumerate(tags):
        place = slopes[i, :, kernel.BODY_PLACE : kernel.BODY_TURN]
        turn = slopes[i, :, kernel.BODY_TURN : kernel.EYE_PLACE]
        # To turn about the tag's middle b is to turn about the origin and to shift by b x turn.
        about = turn + place @ carrier.rotation @ skew(np.array(tag.position_m))
        at = 6 * ids.index(tag.id)
        shifted[i, :, at : at + 3] = place * tag.place_std_m
        shifted[i, :, at + 3 : at + 6] = about * tag.turn_std_rad
    return shifted
