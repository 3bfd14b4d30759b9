"""A bumped camera's pose found again; lenses, level and the other cameras stay as they were."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.calibration.adjustment import GREATEST_RMS, placed
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.camera import Camera, Rig
from autonomy.vision.constants import CAMERA_ERRORS
from autonomy.vision.fix import Fix, NoFix, Sighting, find_camera
from autonomy.vision.tag import Layout

_POSE = 6
_SMALL = 1e-12


def readjusted(rig: Rig, layout: Layout, name: str, sightings: Sequence[Sighting]) -> Rig | Refusal:
    """Find the pose of one camera again.

    Args:
        rig: As it was calibrated, at the level of now.
        layout: Tags where the calibration found them.
        name: Of the camera.
        sightings: Means over many pictures (``adjustment.averaged``).

    Returns:
        The rig with that camera where it is now, and the joint covariance that follows; or why the
        camera cannot be placed.

    Raises:
        ValueError: If the rig has no such camera.
    """
    number = rig.number(name)
    if number is None:
        raise ValueError(f"name: the rig has no camera {name}")
    camera = rig.cameras[number]
    mine = [s for s in sightings if s.camera == name and layout.tag(s.tag_id) is not None]
    begun = placed(camera, mine, layout, rig.level_m, rig.index)
    if isinstance(begun, Refusal):
        return begun
    alone = _alone(rig, number, begun)
    fix = find_camera(alone, layout.tags, mine, guess=begun.pose)
    if isinstance(fix, NoFix):
        return Refusal(f"{name} cannot be placed: {fix.reason}")
    if not fix.rms <= GREATEST_RMS:
        return Refusal(f"{name} and the tags do not fit together (rms {fix.rms:.1f})")
    cameras = list(rig.cameras)
    cameras[number] = replace(camera, pose=fix.pose)
    return replace(rig, cameras=tuple(cameras), covariance=_joint(rig, number, alone, fix))


def _rows(rig: Rig, number: int) -> list[int]:
    """Return where the errors of one camera and of the level are among those of the rig."""
    first = CAMERA_ERRORS * number
    return [*range(first, first + CAMERA_ERRORS), CAMERA_ERRORS * len(rig.cameras)]


def _alone(rig: Rig, number: int, camera: Camera) -> Rig:
    """Return the camera alone, with independent errors of lens, edge and level."""
    errors = np.zeros(CAMERA_ERRORS + 1)
    if rig.covariance is not None:
        errors[:] = np.diag(rig.covariance)[_rows(rig, number)]
    errors[:_POSE] = 0.0
    return Rig((camera,), rig.level_m, np.diag(errors), rig.index, rig.index_std)


def _joint(rig: Rig, number: int, alone: Rig, fix: Fix) -> FloatArray:
    """Return the joint covariance in which the pose's error follows lens, edge and level."""
    size = CAMERA_ERRORS * len(rig.cameras) + 1
    before = np.zeros((size, size)) if rig.covariance is None else rig.covariance
    gain = fix.by_rig @ np.linalg.pinv(alone.root, rcond=_SMALL)  # (6, 17)
    rows = _rows(rig, number)
    follow = np.eye(size)
    follow[rows[:_POSE]] = 0.0
    follow[np.ix_(rows[:_POSE], rows)] = -gain
    covariance = follow @ before @ follow.T
    own = fix.tank_covariance - fix.by_rig @ fix.by_rig.T
    covariance[np.ix_(rows[:_POSE], rows[:_POSE])] += own
    return 0.5 * (covariance + covariance.T)
