"""Where a camera stands so that it sees the whole water, or the whole of a what-if run."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import viser

from autonomy.arrays import FloatArray
from webui.scene.projection import VIEW_WIDTH

FIELD_OF_VIEW_RAD = 0.7
"""Vertical angle of every camera of the scene."""
_DIRECTION = np.array([0.33, -0.81, 0.48])
"""From what is looked at towards the camera: south of it, above it and a little to the east."""
_MARGIN = 1.15
"""Room for labels around what is framed."""
_SMALLEST = 0.05 * VIEW_WIDTH
_NARROWEST = 0.5


@dataclass(frozen=True, slots=True)
class Frame:
    """A camera's place and what it looks at, in view units."""

    position: FloatArray
    look_at: FloatArray


WATER = Frame(
    np.array([0.57, -1.42, 0.82]) * VIEW_WIDTH,
    np.array([-0.04, -0.06, -0.22]) * VIEW_WIDTH,
)
"""The whole water of any site, which is as wide as the view."""


def frame_of(points: FloatArray, aspect: float) -> Frame:
    """Return the frame that shows all points.

    Args:
        points: In view units, shape ``(n, 3)``, at least one.
        aspect: Width of the canvas over its height.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    centre = (low + high) / 2
    radius = max(float(np.linalg.norm(high - low)) / 2, _SMALLEST)
    half_angle = math.atan(math.tan(FIELD_OF_VIEW_RAD / 2) * min(max(aspect, _NARROWEST), 1.0))
    distance = _MARGIN * radius / math.sin(half_angle)
    direction = _DIRECTION / np.linalg.norm(_DIRECTION)
    return Frame(centre + distance * direction, centre)


def begin(camera: viser.InitialCameraConfig, points: FloatArray | None) -> None:
    """Let cameras of later browsers begin so; see ``look``."""
    frame = WATER if points is None else frame_of(points, 1.0)
    camera.position = frame.position
    camera.look_at = frame.look_at
    camera.up = (0.0, 0.0, 1.0)
    camera.fov = FIELD_OF_VIEW_RAD


def look(clients: Iterable[viser.ClientHandle], points: FloatArray | None) -> None:
    """Let cameras see all points, shape ``(n, 3)`` in view units, or the water."""
    for client in clients:
        frame = WATER if points is None else frame_of(points, _aspect(client.camera))
        with client.atomic():
            client.camera.position = frame.position
            client.camera.look_at = frame.look_at
            client.camera.up_direction = (0.0, 0.0, 1.0)


def _aspect(camera: viser.CameraHandle) -> float:
    # A view that a page hides has no height.
    return camera.image_width / max(camera.image_height, 1)
