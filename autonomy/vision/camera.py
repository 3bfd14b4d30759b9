"""Cameras that hang over the tank or swim in it, and a rig of them with what is unsure of it."""

from dataclasses import dataclass, field, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.vision import sight_kernel as kernel
from autonomy.vision.constants import CAMERA_ERRORS
from autonomy.vision.lens import Lens
from autonomy.vision.refraction import (
    FRESH_WATER_INDEX,
    GREATEST_INDEX,
    LEAST_INDEX,
    FlatPort,
)
from autonomy.vision.rigid import Pose

INDEX_STD = 0.0005
"""How well the index of refraction of a water of known kind and temperature is known."""
_SMALLEST_SHARE = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """One camera: its lens, and where it is."""

    name: str
    lens: Lens
    pose: Pose
    """Takes camera axes (x right, y down in the picture, z forward) into the tank's NED."""
    edge_px: float = 0.0
    """How far a tag's corners seem to lie farther in, along both sides: a wrong gamma's error."""
    port: FlatPort | None = None
    """The window of a camera under water; none where it is above."""
    latency_std_s: float = 0.0
    """How well it is known when its pictures were taken."""
    packed: FloatArray = field(init=False, repr=False)
    """The same for the kernels (``sight_kernel``), shape ``(28,)``."""

    def __post_init__(self) -> None:
        packed = np.zeros(kernel.CAMERA_SIZE)
        packed[kernel.LENS : kernel.TURN] = self.lens.packed
        packed[kernel.TURN : kernel.EYE] = self.pose.rotation.ravel()
        packed[kernel.EYE : kernel.EDGE] = self.pose.position_m
        packed[kernel.EDGE] = self.edge_px
        if self.port is not None:
            packed[kernel.HAS_PORT] = 1.0
            packed[kernel.PORT :] = self.port.packed
        if not np.isfinite(np.delete(packed, kernel.FOLD)).all():
            raise ValueError(f"{self.name}: pose or edge_px is not finite")
        object.__setattr__(self, "packed", packed)

    def moved(self, errors: FloatArray) -> "Camera":
        """Return the camera after errors in the order of ``CAMERA_ERRORS`` were added."""
        lens = Lens.of_parameters(
            self.lens.kind,
            self.lens.width_px,
            self.lens.height_px,
            self.lens.parameters + errors[6:15],
        )
        pose = self.pose.moved(errors[:3], errors[3:6])
        return replace(self, lens=lens, pose=pose, edge_px=self.edge_px + float(errors[15]))


@dataclass(frozen=True, slots=True, eq=False)
class Rig:
    """The cameras of a site with the water's level, and their joint covariance.

    Raises:
        ValueError: If a name is there twice, a covariance has another shape or is none, or the
            index of refraction is none of water.
    """

    cameras: tuple[Camera, ...]
    level_m: float = 0.0
    """Down coordinate of the water's surface."""
    covariance: FloatArray | None = None
    """Of all cameras' errors one after the other (``CAMERA_ERRORS``) and the level's at the end,
    shape ``(16 n + 1, 16 n + 1)``; none where they are exact."""
    index: float = FRESH_WATER_INDEX
    index_std: float = INDEX_STD
    ripple_slope_rad: float = 0.0
    """Root mean square slope of the surface, along each axis."""
    packed: FloatArray = field(init=False, repr=False)
    """Cameras for the kernels, shape ``(n, 28)``."""
    root: FloatArray = field(init=False, repr=False)
    """``root @ root.T`` is the covariance; has as many columns as that has rank."""

    def __post_init__(self) -> None:
        names = [camera.name for camera in self.cameras]
        twice = {name for name in names if names.count(name) > 1}
        if twice:
            raise ValueError(f"cameras: {min(twice)} is there twice")
        if not LEAST_INDEX <= self.index <= GREATEST_INDEX:
            raise ValueError(f"index: {self.index} is not one of water")
        size = CAMERA_ERRORS * len(names) + 1
        root = np.zeros((size, 0))
        if self.covariance is not None:
            if self.covariance.shape != (size, size) or not np.isfinite(self.covariance).all():
                raise ValueError(f"covariance: is not of {size} finite numbers each way")
            root = _root(self.covariance)
        packed = np.array([camera.packed for camera in self.cameras])
        object.__setattr__(self, "packed", packed.reshape(-1, kernel.CAMERA_SIZE))
        object.__setattr__(self, "root", root)

    def number(self, name: str) -> int | None:
        """Return which camera has a name, if any."""
        names = [camera.name for camera in self.cameras]
        return names.index(name) if name in names else None

    def without(self, name: str) -> "Rig":
        """Return the rig that lacks a camera."""
        kept = [i for i, camera in enumerate(self.cameras) if camera.name != name]
        rows = [CAMERA_ERRORS * i + j for i in kept for j in range(CAMERA_ERRORS)]
        rows.append(CAMERA_ERRORS * len(self.cameras))
        whole = self.covariance
        covariance = None if whole is None else whole[np.ix_(rows, rows)]
        return replace(self, cameras=tuple(self.cameras[i] for i in kept), covariance=covariance)

    def at_new_level(self, level_m: float, change_std_m: float) -> "Rig":
        """Return the rig after the level changed by what the cameras themselves saw."""
        size = CAMERA_ERRORS * len(self.cameras) + 1
        covariance = np.zeros((size, size)) if self.covariance is None else self.covariance.copy()
        covariance[-1, -1] += change_std_m**2
        return replace(self, level_m=level_m, covariance=covariance)

    def at_level(self, level_m: float, std_m: float) -> "Rig":
        """Return the rig under another water level, whose error has nothing to do with the rest."""
        size = CAMERA_ERRORS * len(self.cameras) + 1
        covariance = np.zeros((size, size)) if self.covariance is None else self.covariance.copy()
        covariance[-1] = 0.0
        covariance[:, -1] = 0.0
        covariance[-1, -1] = std_m**2
        return replace(self, level_m=level_m, covariance=covariance)


def _root(covariance: FloatArray) -> FloatArray:
    """Return a factor of a covariance whose numbers may be of very different size."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(safe, safe))
    if float(values.min(initial=0.0)) < -1e-6 * len(scale):
        raise ValueError("covariance: is none, for it has a negative eigenvalue")
    keep = values > _SMALLEST_SHARE
    return scale[:, None] * vectors[:, keep] * np.sqrt(values[keep])
