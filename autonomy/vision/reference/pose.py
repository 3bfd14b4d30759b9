"""Search for a pose in its readable form: residuals by the readable optics, and scipy's solver."""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from autonomy.arrays import FloatArray
from autonomy.vision import pose_kernel as kernel
from autonomy.vision.camera import Rig
from autonomy.vision.fix import Sighting, Telemetry
from autonomy.vision.reference.optics import corners_seen
from autonomy.vision.rigid import Pose
from autonomy.vision.tag import Tag


def robot_pose(
    rig: Rig,
    tags: Sequence[Tag],
    sightings: Sequence[Sighting],
    start: Pose,
    telemetry: Telemetry | None = None,
) -> tuple[Pose, FloatArray]:
    """Return the pose of a robot near a start, and the covariance of its noise, ``(6, 6)``.

    Args:
        rig: Cameras and water.
        tags: Of the robot.
        sightings: Of one moment, all of these tags.
        start: From where the search goes.
        telemetry: What the robot says of itself.
    """
    known = {tag.id: tag for tag in tags}
    cameras = {camera.name: camera for camera in rig.cameras}

    def rows(step: FloatArray) -> FloatArray:
        pose = start.moved(step[:3], step[3:])
        all_rows: list[FloatArray] = []
        for sighting in sightings:
            corners = pose.of_points(known[sighting.tag_id].corners_m)
            seen = corners_seen(cameras[sighting.camera], corners, rig.level_m, rig.index)
            off = (seen - sighting.corners_px) / sighting.sigma_px
            size = np.linalg.norm(off, axis=1, keepdims=True)
            # Half the square of what is returned is Huber's function of the size.
            robust = np.sqrt(np.maximum(2.0 * kernel.HUBER * size - kernel.HUBER**2, size**0))
            all_rows.append(np.where(size <= kernel.HUBER, off, off / size * robust).ravel())
        if telemetry is not None and telemetry.down is not None:
            all_rows.append((pose.rotation[2] - telemetry.down) / telemetry.tilt_std_rad)
        if telemetry is not None and telemetry.depth_m is not None:
            deep = pose.position_m[2] - rig.level_m - telemetry.depth_m
            all_rows.append(np.array([deep / telemetry.depth_std_m]))
        return np.concatenate(all_rows)

    found = least_squares(rows, np.zeros(6), method="lm", x_scale="jac", xtol=1e-14, ftol=1e-14)
    pose = start.moved(found.x[:3], found.x[3:])
    start = pose  # derivatives by a turn from here
    J = least_squares(rows, np.zeros(6), method="lm", max_nfev=1).jac
    return pose, np.linalg.inv(J.T @ J)
