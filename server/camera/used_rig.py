"""The cameras that robots are found by, as plain numbers; this module loads no numba."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from autonomy.arrays import FloatArray

Document = Mapping[str, Any]
"""A JSON object."""


@dataclass(frozen=True, slots=True, eq=False)
class UsedRig:
    """Cameras as a calibration left them, with the water of now.

    ``server.camera.vision.rig_of`` makes the ``autonomy.vision.camera.Rig`` of it, in a worker.
    """

    calibration: int
    """Key of the calibration that it rests on; a fix cites it."""
    result: Document
    """What that found of all its cameras: see ``vision.rig_document``."""
    covariance: FloatArray
    """Joint covariance of all its cameras and of the level."""
    cameras: tuple[str, ...]
    """Those that are used, in the order of the calibration."""
    level_m: float
    """Down coordinate of the water's surface."""
    level_std_m: float = 0.0
    """Of what it changed by since the calibration."""
    ripple_slope_rad: float = 0.0
    """Root mean square slope of the surface, along each axis."""
    latency_std_s: Mapping[str, float] = field(default_factory=dict[str, float])
    """How well it is known when each camera's pictures were taken, where that was measured."""
