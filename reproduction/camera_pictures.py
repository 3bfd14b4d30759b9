"""The same poses from real pictures: drawn by ray tracing, sent as JPEG, searched by the detector.

It takes most of a second a set, so it is done at some places of a way, to hold the corners that
``camera_poses`` draws against. It needs the extra ``camera``.
"""

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import wrap_angle
from autonomy.vision.fix import NoFix, Sighting, find_robot
from autonomy.vision.rigid import Pose
from reproduction.camera_poses import ROBOT, Laboratory
from robot_link.camera.extra import check_extra
from simulator.camera.painter import Painter
from simulator.camera.scene import Motion


def picture_errors(known: Laboratory, states: FloatArray) -> FloatArray:
    """Return what fixes from pictures are off by.

    Args:
        known: The laboratory.
        states: True position in the tank's NED (m) and Euler angles (rad) at each set of pictures,
            shape ``(n, 6)``.

    Returns:
        Fixes less truth, shape ``(m, 6)``, for the sets that gave a fix.

    Raises:
        CameraExtraMissingError: If the extra is not installed.
    """
    check_extra()
    from robot_link.camera.detector import TagDetector
    from robot_link.camera.picture import grey_picture

    painters = [Painter(known.scene, camera) for camera in known.scene.cameras]
    detector = TagDetector(known.scene.sensor.gamma)
    errors: list[FloatArray] = []
    for k, state in enumerate(states):
        body = Pose.of_angles(state[:3], *state[3:6].tolist())
        seen: list[Sighting] = []
        for painter in painters:
            drawn = painter.picture(float(k), {ROBOT: Motion(body)})
            found = detector.find(grey_picture(painter.jpeg(drawn)), decimate=1.0)
            seen += [
                Sighting(painter.camera.name, tag.id, np.array(tag.corners_px), tag.sigma_px)
                for tag in found.tags
            ]
        fix = find_robot(known.rig, known.bundle.tags, seen)
        if not isinstance(fix, NoFix):
            off = wrap_angle(np.array(fix.pose.angles_rad) - state[3:6])
            errors.append(np.append(fix.pose.position_m - state[:3], off))
    return np.array(errors).reshape(-1, 6)
