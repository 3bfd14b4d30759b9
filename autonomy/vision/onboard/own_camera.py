"""A robot's own camera as a document tells it: lens, window, and how it sits on the robot.

Body axes are forward, starboard and down. A camera at roll, pitch and heading 0 looks forward with
the picture's up as the robot's up.

A lens that was measured in air sees under water through a flat port, whose window bends the light
(``refraction.FlatPort``). One that was fitted to boards under water has that bend in its own
numbers: it is taken as it is, and sees straight. A lens of the air without a port would see all
that is in the water a quarter too near, and is refused.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field, ValidationError

from autonomy.arrays import FloatArray
from autonomy.configuration import Configuration
from autonomy.vision.calibration.board import BoardView
from autonomy.vision.calibration.lens_fit import LensCalibration, calibrate_lens
from autonomy.vision.calibration.refusal import Refusal
from autonomy.vision.lens import PARAMETERS, Lens, LensKind
from autonomy.vision.refraction import (
    FRESH_WATER_INDEX,
    GREATEST_INDEX,
    LEAST_INDEX,
    FlatPort,
)
from autonomy.vision.rigid import Pose, skew

AIR_LENS_REFUSED = (
    "the lens was measured in air and has no port: under water all would look a quarter too near; "
    "tell the port, or fit the lens to boards under water"
)
STRAIGHT_SHARE = 0.005
"""By how much of the focal length a lens without port is unsure under water: no pinhole sees
through a window as that does, at all distances."""
_FORWARD = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Axes of a camera that looks forward, in body axes."""

Medium = Literal["air", "water"]
"""Where a lens was measured."""


class LensDocument(Configuration):
    """The lens, for pictures of one size."""

    kind: LensKind = "pinhole"
    width_px: int
    height_px: int
    focal_px: tuple[float, float]
    principal_px: tuple[float, float]
    distortion: tuple[float, ...] = ()
    """Coefficients in the order of ``lens.COEFFICIENTS``."""
    focal_std_share: float = Field(default=0.0005, ge=0.0, le=0.05)
    """How well the focal length is known, as a share of it."""
    principal_std_px: float = Field(default=0.5, ge=0.0, le=50.0)
    """How well the principal point is known, per axis."""
    measured_in: Medium


class PortDocument(Configuration):
    """The window before the lens."""

    distance_m: float = Field(default=0.010, ge=0.0, le=0.5)
    """From the lens's centre of projection to the inner face."""
    thickness_m: float = Field(default=0.005, ge=0.0, le=0.1)
    glass_index: float = Field(default=1.49, ge=1.0, le=2.0)


class MountDocument(Configuration):
    """Where the lens's centre of projection is on the robot, and how the camera is turned."""

    position_m: tuple[float, float, float]
    """In body axes."""
    roll_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    pitch_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    heading_deg: float = Field(default=0.0, ge=-360.0, le=360.0)
    position_std_m: float = Field(default=0.003, ge=0.0, le=1.0)
    """How well the place is known, per axis."""
    angle_std_deg: float = Field(default=1.0, ge=0.0, le=30.0)
    """How well the angles are known, per axis."""


class OwnCameraDocument(Configuration):
    """All of it, as its file on the robot has it."""

    lens: LensDocument
    port: PortDocument | None = None
    mount: MountDocument
    index: float = Field(default=FRESH_WATER_INDEX, ge=LEAST_INDEX, le=GREATEST_INDEX)
    """Index of refraction of the water."""


@dataclass(frozen=True, slots=True, eq=False)
class Mount:
    """How a camera sits on its robot."""

    pose: Pose
    """Takes body axes into camera axes."""
    covariance: FloatArray
    """Of its shift (m, camera axes) and its turn about body axes (rad), shape ``(6, 6)``."""

    @classmethod
    def of_angles(
        cls,
        position_m: Sequence[float],
        roll_rad: float = 0.0,
        pitch_rad: float = 0.0,
        heading_rad: float = 0.0,
        *,
        position_std_m: float = 0.003,
        angle_std_rad: float = math.radians(1.0),
    ) -> "Mount":
        """Return the mount of a camera that is at a place of the body, and turned so."""
        turned = Pose.of_angles(position_m, roll_rad, pitch_rad, heading_rad)
        in_body = Pose(turned.rotation @ _FORWARD, turned.position_m)
        variances = [position_std_m**2] * 3 + [angle_std_rad**2] * 3
        # the place in body axes is known; seen from the camera a turn moves the body's origin, too
        pose = in_body.inverse
        move = np.eye(6)
        move[:3, :3] = pose.rotation
        move[:3, 3:] = pose.rotation @ skew(in_body.position_m)
        return cls(pose, move @ np.diag(variances) @ move.T)

    @property
    def position_m(self) -> FloatArray:
        """Where the camera is in body axes, shape ``(3,)``."""
        return self.pose.inverse.position_m


@dataclass(frozen=True, slots=True, eq=False)
class OwnCamera:
    """A robot's own camera."""

    lens: Lens
    measured_in: Medium
    mount: Mount
    port: FlatPort | None = None
    lens_covariance: FloatArray | None = None
    """Of ``lens.parameters``, shape ``(9, 9)``; none where they are exact."""
    index: float = FRESH_WATER_INDEX

    @property
    def refusal(self) -> str:
        """Why it may not be used under water, in words; "" where it may."""
        if self.measured_in == "air" and self.port is None:
            return AIR_LENS_REFUSED
        if self.measured_in == "water" and self.port is not None:
            return (
                "the lens was fitted under water, so its numbers hold the port already: "
                "leave the port out, or measure the lens in air"
            )
        return ""


def own_camera_of(document: Mapping[str, object]) -> OwnCamera:
    """Read a robot's camera.

    Raises:
        ValueError: If something is missing or wrong; the message begins with its path.
    """
    try:
        told = OwnCameraDocument.model_validate(document)
    except ValidationError as refused:
        first = refused.errors(include_url=False)[0]
        path = ".".join(map(str, first["loc"]))
        raise ValueError(f"{path}: {first['msg']}") from None
    lens, mount, port = told.lens, told.mount, told.port
    stds = np.zeros(PARAMETERS)
    stds[:2] = lens.focal_std_share * np.array(lens.focal_px)
    stds[2:4] = lens.principal_std_px
    angles = np.radians([mount.roll_deg, mount.pitch_deg, mount.heading_deg]).tolist()
    return OwnCamera(
        Lens(
            lens.kind,
            lens.width_px,
            lens.height_px,
            lens.focal_px,
            lens.principal_px,
            lens.distortion,
        ),
        lens.measured_in,
        Mount.of_angles(
            mount.position_m,
            *angles,
            position_std_m=mount.position_std_m,
            angle_std_rad=math.radians(mount.angle_std_deg),
        ),
        None if port is None else FlatPort(port.distance_m, port.thickness_m, port.glass_index),
        np.diag(stds**2),
        told.index,
    )


def lens_under_water(
    width_px: int, height_px: int, views: Sequence[BoardView]
) -> LensCalibration | Refusal:
    """Fit a pinhole to views of the board under water: for a camera whose port nobody knows.

    Its covariance holds how far a pinhole is from a port (``STRAIGHT_SHARE``).

    Args:
        width_px: Of the pictures.
        height_px: Of the pictures.
        views: Of the board under water, at the distances at which tags will be seen.
    """
    found = calibrate_lens("pinhole", width_px, height_px, views)
    if isinstance(found, Refusal):
        return found
    focal = found.lens.parameters * (np.arange(PARAMETERS) < 2)
    model = STRAIGHT_SHARE**2 * np.outer(focal, focal)
    return LensCalibration(
        found.lens, found.covariance + model, found.rms_px, found.views, found.view_rms_px
    )
