r"""Where a robot is by its own camera: from the tank's tags that it sees, through its window.

The camera's pose comes from one least squares over all tags in view, with the down and the depth of
the robot's own sensors as rows, and the robot's from it by :math:`T_B^W = T_C^W T_B^C`. Seen from
so near, it is the survey of the tags that errs most, which is why the corners are weighed by it
(``gauss_markov``). To the considered errors of the fix comes that of the mount.

Source:
    Coleman, thesis, section 2.1.2; for one tag this is the formula of section 2.2.2.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision.camera import Camera, Rig
from autonomy.vision.constants import CAMERA_ERRORS
from autonomy.vision.fix import Fix, NoFix, Sighting, Telemetry, find_camera
from autonomy.vision.onboard.gauss_markov import weighed
from autonomy.vision.onboard.own_camera import Mount, OwnCamera
from autonomy.vision.rigid import Pose
from autonomy.vision.tag import Layout

CAMERA = "onboard"
"""Name of the camera in sightings and fixes."""
EDGE_STD_PX = 0.1
_DRY_M = 1e4
"""So deep lies the surface of a tank in which everything is seen straight."""
_POSE = 6


@dataclass(frozen=True, slots=True)
class TankWater:
    """Where the surface of the tank is."""

    level_m: float = 0.0
    """Down coordinate of the surface in the tank's NED."""
    level_std_m: float = 0.005


def find_eye(
    camera: OwnCamera,
    layout: Layout,
    water: TankWater,
    sightings: Sequence[Sighting],
    *,
    telemetry: Telemetry | None = None,
    guess: Pose | None = None,
) -> Fix | NoFix:
    """Find the pose of a robot's own camera.

    Args:
        camera: That camera.
        layout: Tags of the tank; those above the water are passed over.
        water: Where the surface is.
        sightings: Of one picture, of the camera ``CAMERA``.
        telemetry: Down in camera axes, and the camera's depth, if they are known.
        guess: Where the camera should be, if that is known.
    """
    if camera.refusal:
        return NoFix(camera.refusal)
    tags = {t.id: t for t in layout.tags if t.corners_m[:, 2].min() > water.level_m}
    rig = _rig(camera, water)
    rows = telemetry or Telemetry()
    if camera.port is None and rows.depth_m is not None:
        rows = replace(rows, depth_m=rows.depth_m + water.level_m - rig.level_m)
    found = find_camera(rig, list(tags.values()), sightings, guess=guess, telemetry=rows)
    if isinstance(found, NoFix):
        return found
    found = weighed(found, rig, [tags[s.tag_id] for s in found.used], rows)
    if found is None:
        return NoFix("no pose explains what is seen")
    found = replace(found, level_m=water.level_m)
    return found if found.depth_m > 0.0 else NoFix("the camera is out of the water")


def find_self(
    camera: OwnCamera,
    layout: Layout,
    water: TankWater,
    sightings: Sequence[Sighting],
    *,
    telemetry: Telemetry | None = None,
    guess: Pose | None = None,
) -> Fix | NoFix:
    """Find the pose of a robot by its own camera.

    Args:
        camera: That camera.
        layout: Tags of the tank; those above the water are passed over.
        water: Where the surface is.
        sightings: Of one picture, of the camera ``CAMERA``.
        telemetry: What the robot's own sensors say, in its body axes.
        guess: Pose of the robot, if it is known about.

    Returns:
        The fix of the robot, or why there is none.
    """
    mount = camera.mount
    eye = None if guess is None else guess @ mount.pose.inverse
    rows = None if telemetry is None else _of_camera(telemetry, mount)
    found = find_eye(camera, layout, water, sightings, telemetry=rows, guess=eye)
    if isinstance(found, NoFix):
        return found
    return _with_mount(found.of_carrier(mount.pose), found.pose, mount)


def _of_camera(telemetry: Telemetry, mount: Mount) -> Telemetry:
    """Return what a robot says of itself as if its camera said it.

    Where the robot does not say what is down, its depth tells nothing of the camera's.
    """
    if telemetry.down is None:
        return Telemetry()
    x, y, z = (mount.pose.rotation @ np.array(telemetry.down)).tolist()
    depth_m = telemetry.depth_m
    if depth_m is not None:
        depth_m += float(np.array(telemetry.down) @ mount.position_m)
    return replace(telemetry, down=(x, y, z), depth_m=depth_m)


def _rig(camera: OwnCamera, water: TankWater) -> Rig:
    """Return the camera as a rig; one that sees straight is in a tank without water."""
    covariance = np.zeros((CAMERA_ERRORS + 1, CAMERA_ERRORS + 1))
    if camera.lens_covariance is not None:
        covariance[_POSE : CAMERA_ERRORS - 1, _POSE : CAMERA_ERRORS - 1] = camera.lens_covariance
    covariance[CAMERA_ERRORS - 1, CAMERA_ERRORS - 1] = EDGE_STD_PX**2
    covariance[-1, -1] = water.level_std_m**2
    eye = Camera(CAMERA, camera.lens, Pose.identity(), port=camera.port)
    level_m = _DRY_M if camera.port is None else water.level_m
    return Rig((eye,), level_m, covariance, camera.index)


def _with_mount(fix: Fix, camera: Pose, mount: Mount) -> Fix:
    """Return a robot's fix that also counts how unsure the mount is."""
    move: FloatArray = np.eye(_POSE)
    move[:3, :3] = camera.rotation
    more = move @ mount.covariance @ move.T
    return replace(
        fix,
        considered_covariance=fix.considered_covariance + more,
        tank_considered_covariance=fix.tank_considered_covariance + more,
    )
