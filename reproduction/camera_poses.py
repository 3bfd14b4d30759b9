"""Poses of a robot by three cameras over the tank, along a way that it swam: what they are off by.

The laboratory is the emulated one (``simulator.camera.laboratory``): lenses, cameras, tags and
robot are as a seed draws them, and what is told of them is what somebody measured. The cameras are
calibrated as the station does it, from fifty pictures of the fixed tags. No picture is drawn here:
the corners lie where refraction puts them, with the noise of the line fit
(``simulator.drawn_corner``), and each set of pictures is solved as the station does it.
"""

from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.frames import wrap_angle
from autonomy.vision.calibration.adjustment import adjust, averaged
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.camera import Camera, Rig
from autonomy.vision.fix import NoFix, Sighting, find_robot
from autonomy.vision.lens import PARAMETERS, Lens
from autonomy.vision.quality import judge
from autonomy.vision.rigid import Pose
from autonomy.vision.sight import sights
from autonomy.vision.tag import Bundle, Tag
from simulator.camera.laboratory import told_bundle, told_layout, true_scene
from simulator.camera.scene import Scene
from simulator.drawn_corner import EDGE_SHARE, drawn_corners

ROBOT = "mini-1"
CALIBRATION_PICTURES = 50
LENS_STD = np.array([0.15, 0.15, 0.3, 0.3, 1e-3, 1e-3, 1e-4, 1e-4, 0.0])
"""How well twenty boards tell each parameter of a lens, about."""
_BORDER_PX = 5.0


@dataclass(frozen=True, slots=True, eq=False)
class Laboratory:
    """A tank with cameras as it is, and as it is known."""

    scene: Scene
    """The truth."""
    rig: Rig
    """The cameras as they were calibrated."""
    bundle: Bundle
    """The robot's tags as they were measured."""


def laboratory(seed: int) -> Laboratory:
    """Draw a laboratory and calibrate its cameras.

    Raises:
        RuntimeError: If the calibration is refused.
    """
    scene = true_scene([ROBOT], seed=seed)
    rng = np.random.default_rng([seed, 33])
    seen: list[Sighting] = []
    for _ in range(CALIBRATION_PICTURES):
        seen += _sets(scene, scene.layout.tags, [Pose.identity()], rng)[0]
    told = [
        replace(camera, lens=_told(camera.lens, rng), pose=Pose.identity())
        for camera in scene.cameras
    ]
    lens_covariance = np.diag(LENS_STD**2)
    found = adjust(told, [lens_covariance] * len(told), told_layout(), averaged(seen))
    if isinstance(found, Refusal):
        raise RuntimeError(f"no calibration: {found.reason}")  # noqa: TRY004 - a seed of bad luck
    return Laboratory(scene, found.rig, told_bundle(ROBOT, 0))


def pose_errors(known: Laboratory, states: FloatArray, seed: int) -> tuple[FloatArray, float]:
    """Return what the cameras' poses are off by along a way.

    Args:
        known: The laboratory.
        states: True position in the tank's NED (m) and Euler angles (rad) at each set of pictures,
            shape ``(n, 6)``.
        seed: Draws the noise.

    Returns:
        Fixes less truth, shape ``(n, 6)``, where there is none that of the last one; and the part
        of the sets that gave a fix.
    """
    bodies = [Pose.of_angles(state[:3], *state[3:6].tolist()) for state in states]
    rng = np.random.default_rng([seed, 34])
    errors = np.zeros((len(states), 6))
    guess: Pose | None = None
    missing = 0
    for k, seen in enumerate(_sets(known.scene, known.scene.bundles[0].tags, bodies, rng)):
        found = find_robot(known.rig, known.bundle.tags, seen, guess=guess)
        if isinstance(found, NoFix) or judge(found).quality != "good":
            errors[k] = errors[k - 1]
            missing += 1
            continue
        guess = found.pose
        errors[k, :3] = found.pose.position_m - states[k, :3]
        errors[k, 3:] = wrap_angle(np.array(found.pose.angles_rad) - states[k, 3:6])
    return errors, 1.0 - missing / len(states)


def _sets(
    scene: Scene, tags: tuple[Tag, ...], bodies: list[Pose], rng: np.random.Generator
) -> list[list[Sighting]]:
    """Return what all cameras see of tags on a body, for each of its poses."""
    m = len(tags)
    packed = np.array([camera.packed for camera in scene.cameras])
    cameras = np.repeat(np.arange(len(scene.cameras)), m)
    numbers = np.tile(cameras, len(bodies))
    carriers = [body for body in bodies for _ in cameras]
    corners_m = np.tile([tag.corners_m for tag in tags], (len(bodies) * len(scene.cameras), 1, 1))
    pixels = sights(packed, numbers, carriers, corners_m, scene.level_m, scene.index).pixels
    of_camera = pixels.reshape(len(bodies), len(scene.cameras), m, 4, 2)
    return [
        [
            sighting
            for camera, exact in zip(scene.cameras, of_body, strict=True)
            for sighting in _seen(camera, tags, exact, rng)
        ]
        for of_body in of_camera
    ]


def _seen(
    camera: Camera, tags: tuple[Tag, ...], exact: FloatArray, rng: np.random.Generator
) -> list[Sighting]:
    """Return what one picture shows of tags whose corners lie exactly there."""
    edge = EDGE_SHARE * float(rng.normal())
    seen: list[Sighting] = []
    for tag, corners in zip(tags, exact, strict=True):
        if np.isfinite(corners).all() and camera.lens.shows(corners, _BORDER_PX).all():
            drawn = drawn_corners(corners, edge, rng)
            if drawn is not None:
                seen.append(Sighting(camera.name, tag.id, *drawn))
    return seen


def _told(lens: Lens, rng: np.random.Generator) -> Lens:
    """Return a lens as boards would tell it."""
    off = LENS_STD * rng.standard_normal(PARAMETERS)
    return Lens.of_parameters(lens.kind, lens.width_px, lens.height_px, lens.parameters + off)
