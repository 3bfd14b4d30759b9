"""The thesis's formula for a robot's pose, as a baseline to compare with.

One fixed tag and one tag of the robot in the same picture give the robot's pose by three
transformations; there is no water in it, and each tag's pose is the first that a detector tells.
Poses of several tags and cameras are averaged.
"""

from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.camera import Camera, Rig
from autonomy.vision.fix import Sighting, sighting_fault
from autonomy.vision.rigid import Pose, nearest_rotation
from autonomy.vision.start import both_poses
from autonomy.vision.tag import CORNERS, Bundle, Layout


def formula_pose(
    rig: Rig, layout: Layout, bundle: Bundle, sightings: Sequence[Sighting]
) -> Pose | None:
    """Return the pose of a robot by the formula, averaged over tags and cameras.

    Each tag of the robot is taken with the fixed tag that is nearest to it in the same picture.

    Args:
        rig: Cameras, of which only the lenses are used.
        layout: The fixed tags as surveyed.
        bundle: Tags of the robot.
        sightings: Of one moment, of both kinds of tags.

    Returns:
        The pose in the tank's NED; none where no picture shows both kinds.

    Source:
        Coleman, thesis, section 2.2.2.
    """
    found: list[Pose] = []
    for camera in rig.cameras:
        mine = [s for s in sightings if s.camera == camera.name and not sighting_fault(s, rig)]
        fixed = [(s, tag) for s in mine if (tag := layout.tag(s.tag_id)) is not None]
        for sighting in mine:
            tag = bundle.tag(sighting.tag_id)
            if tag is None or not fixed:
                continue
            middle = sighting.corners_px.mean(axis=0)
            away = [float(np.linalg.norm(s.corners_px.mean(axis=0) - middle)) for s, _ in fixed]
            near, known = fixed[int(np.argmin(away))]
            of_fixed = _pose_before(camera, near.corners_px, known.size_m)
            of_robot = _pose_before(camera, sighting.corners_px, tag.size_m)
            found.append(known.pose @ of_fixed.inverse @ of_robot @ tag.pose.inverse)
    if not found:
        return None
    rotation = nearest_rotation(np.mean([pose.rotation for pose in found], axis=0))
    return Pose(rotation, np.mean([pose.position_m for pose in found], axis=0))


def _pose_before(camera: Camera, corners_px: FloatArray, size_m: float) -> Pose:
    """Return the pose of a tag before a camera that explains its corners better, as if in air."""
    rays = camera.lens.rays(corners_px)
    slopes = rays[:, :2] / rays[:, 2:]
    turns, places = both_poses(slopes[None], np.array([size_m]))
    off = [
        float(np.square(seen[:, :2] / seen[:, 2:] - slopes).sum())
        for turn, place in zip(turns[0], places[0], strict=True)
        for seen in [Pose(turn, place).of_points(size_m * CORNERS)]
    ]
    best = int(np.argmin(off))
    return Pose(turns[0, best], places[0, best])
