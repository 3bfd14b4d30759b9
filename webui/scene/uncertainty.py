"""How uncertain a plan expects to be: a hose that widens under water and narrows at a fix."""

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray, evenly_spread
from autonomy.estimation.position import STD_95
from autonomy.frames import ned_to_enu
from webui.scene.colour import UNCERTAINTY
from webui.scene.robot import ring_enu
from webui.scene.stage import Stage

_CORNERS = 20
"""Corners of each ring of the hose."""
_RINGS_MAX = 160
_OPACITY = 0.13
_RING_EVERY = 8
_RING_PX = 0.8
HOSE, RINGS = "plan/uncertainty", "plan/rings"


def draw_uncertainty(stage: Stage, points: FloatArray) -> None:
    """Draw the horizontal 95 % circles of a promised track and the hose that they span.

    Args:
        stage: Where to.
        points: Time s, north, east, down m, position standard deviation m; shape ``(n, 5)``.
    """
    kept = points[evenly_spread(len(points), _RINGS_MAX)]
    vertices, faces = hose(kept[:, 1:4], STD_95 * kept[:, 4])
    stage.mesh(HOSE, ned_to_enu(vertices), faces, UNCERTAINTY, _OPACITY)
    rings = [ring_enu(point[1:4], STD_95 * point[4]) for point in kept[::_RING_EVERY]]
    stage.lines(RINGS, np.concatenate(rings), UNCERTAINTY, _RING_PX)


def hose(centres_ned: FloatArray, radii_m: FloatArray) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Span a surface over horizontal circles.

    Args:
        centres_ned: Shape ``(n, 3)``, m.
        radii_m: Shape ``(n,)``, m.

    Returns:
        Vertices, shape ``(n * corners, 3)``, m, and triangles between them, shape ``(f, 3)``.
    """
    angle = np.linspace(0.0, 2 * np.pi, _CORNERS, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    vertices = centres_ned[:, None, :] + radii_m[:, None, None] * circle
    here = np.arange((len(centres_ned) - 1) * _CORNERS).reshape(-1, _CORNERS)
    beside = np.roll(here, -1, axis=1)
    near = np.stack([here, beside, here + _CORNERS], axis=-1)
    far = np.stack([beside, beside + _CORNERS, here + _CORNERS], axis=-1)
    return vertices.reshape(-1, 3), np.concatenate([near, far], axis=1).reshape(-1, 3)
